//! Boards that fall silent again and again, each by itself.

use super::is_lost;
use crate::array;
use crate::problem::Problem;
use crate::view::Look;
use std::collections::VecDeque;
use taxel_skin::{BoardState, BoardStatus, Finding, Layout};

/// A board that falls silent this many times within this long is unsteady, until it was steady for a while.
const SILENCES: usize = 3;
const UNSTEADY_NS: u64 = 30_000_000_000;
const STEADY_NS: u64 = 10_000_000_000;

/// Boards that fall silent within this long do so together.
const TOGETHER_NS: u64 = 250_000_000;

/// When each board fell silent of late. The boards count that themselves: a silence may be over before the next look.
#[derive(Debug, Default)]
pub(crate) struct Steadiness {
    boards: Vec<Board>,
}

#[derive(Debug, Default, Clone)]
struct Board {
    /// Silences that it has counted.
    counted: u64,
    /// When it fell silent last, and whether that is still to be judged.
    last: Option<(u64, bool)>,
    /// When it fell silent by itself, and whether some others did just then.
    silences: VecDeque<(u64, bool)>,
}

/// How often a board has fallen silent of late.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unsteady {
    pub(super) times: usize,
    /// Whether others fell silent with it once.
    pub(super) with_others: bool,
}

impl Steadiness {
    /// Takes note of what the boards have counted, and judges it.
    pub(super) fn handle(&mut self, look: &Look<'_>, found: &[Problem]) {
        let (layout, view) = (look.setup.layout, look.view);
        self.boards.resize(layout.modules.len(), Board::default());
        // What a daemon that was stopped has not heard says nothing of boards.
        let was_held_up =
            look.awake_ns > 0 && view.now_ns.saturating_sub(look.awake_ns) < look.setup.silence_ns;
        for (module, wiring) in layout.wiring.iter().enumerate() {
            let bus = usize::from(wiring.bus);
            let excused = was_held_up
                || !view.boards_due
                || view.buses.get(bus).is_none_or(is_lost)
                || array::is_late(found, bus)
                || is_doubled(view.findings, module);
            self.note(module, view.boards[module].silences, excused, view.now_ns);
        }
        self.judge(layout, view.boards, view.now_ns);
    }

    /// Takes note of what a board has counted. Nobody is to be blamed for a silence that is `excused`.
    fn note(&mut self, module: usize, counted: u64, excused: bool, now_ns: u64) {
        let board = &mut self.boards[module];
        let fell_silent = std::mem::replace(&mut board.counted, counted) < counted;
        // The one before is judged first, however soon the next comes.
        if fell_silent && !matches!(board.last, Some((_, true))) {
            board.last = Some((now_ns, !excused));
        }
    }

    /// Judges the silences that are old enough to know which others there were: what most boards of a bus or of the hand do
    /// together, of those that can tell, is the doing of what they share, or of the machine that holds the daemon up.
    fn judge(&mut self, layout: &Layout, boards: &[BoardStatus], now_ns: u64) {
        for module in 0..self.boards.len() {
            let Some((fell_ns, true)) = self.boards[module].last else {
                continue;
            };
            if now_ns.saturating_sub(fell_ns) < TOGETHER_NS {
                continue;
            }
            let is_near = |other: &usize| {
                (self.boards[*other].last).is_some_and(|(t, _)| t.abs_diff(fell_ns) <= TOGETHER_NS)
            };
            let can_tell = |other: &usize| is_near(other) || would_notice(&boards[*other], &boards[module]);
            let bus = layout.wiring[module].bus;
            let [of_bus, of_hand] = [Some(bus), None].map(|only| {
                let on = |other: &usize| only.is_none_or(|bus| layout.wiring[*other].bus == bus);
                let asked: Vec<usize> = (0..boards.len()).filter(on).filter(can_tell).collect();
                let fallen = asked.iter().copied().filter(is_near);
                (
                    count_boards(layout, fallen),
                    count_boards(layout, asked.iter().copied()),
                )
            });
            let is_most = |(fallen, asked): (usize, usize)| 2 * fallen > asked.max(2);
            let by_itself = !is_most(of_bus) && !is_most(of_hand);
            let with_others = of_hand.0 > 1;
            let board = &mut self.boards[module];
            board.last = Some((fell_ns, false));
            if by_itself {
                board.silences.push_back((fell_ns, with_others));
            }
        }
    }

    /// How often a board has fallen silent by itself of late, if that makes it unsteady.
    pub(super) fn unsteady(&mut self, module: usize, now_ns: u64) -> Option<Unsteady> {
        let silences = &mut self.boards[module].silences;
        while silences
            .front()
            .is_some_and(|(t, _)| now_ns.saturating_sub(*t) > UNSTEADY_NS)
        {
            silences.pop_front();
        }
        let (last_ns, _) = *silences.back()?;
        let unsteady = Unsteady {
            times: silences.len(),
            with_others: silences.iter().any(|(_, with_others)| *with_others),
        };
        (unsteady.times >= SILENCES && now_ns.saturating_sub(last_ns) <= STEADY_NS).then_some(unsteady)
    }
}

/// Whether a board would have fallen silent, too, in a silence of another: a slow one does not miss a sweep in what is three
/// periods of a fast one, and one that does not speak misses none.
fn would_notice(board: &BoardStatus, silent: &BoardStatus) -> bool {
    let [period_ns, silent_period_ns] = [board, silent].map(|board| board.period_ns.unwrap_or(0));
    let speaks = matches!(board.state, BoardState::Settling | BoardState::Streaming);
    // Periods are as measured.
    let as_fast = 4 * period_ns <= 5 * silent_period_ns;
    speaks && (as_fast || 4 * period_ns <= silent.silence_ns)
}

/// How many boards these modules are of.
fn count_boards(layout: &Layout, modules: impl Iterator<Item = usize>) -> usize {
    let mut boards: Vec<_> = modules.map(|m| layout.wiring[m].hub.ok_or(m)).collect();
    boards.sort_unstable();
    boards.dedup();
    boards.len()
}

/// Whether two boards send as one, each of which makes gaps for the other.
fn is_doubled(findings: &[Finding], module: usize) -> bool {
    let is_it = |finding: &Finding| matches!(finding, Finding::TwoBoards { module: doubled, .. } if usize::from(*doubled) == module);
    findings.iter().any(is_it)
}
