//! What is wrong with the boards: those that are silent, or fall silent again and again.

use crate::array;
use crate::kind::Kind;
use crate::malformed;
use crate::names::{is_of_board, modules_name};
use crate::problem::{Place, Problem, of_board};
use crate::traffic::{hub_speaks, speaks_on};
use crate::view::{BusView, Look, Starting};
use std::collections::VecDeque;
use taxel_can::{BusState, LinkState, SourceAddress};
use taxel_hand::shell_word;
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
struct Unsteady {
    times: usize,
    /// Whether others fell silent with it once.
    with_others: bool,
}

impl Steadiness {
    /// Takes note of what the boards have counted, and judges it.
    fn handle(&mut self, look: &Look<'_>, found: &[Problem]) {
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
    fn unsteady(&mut self, module: usize, now_ns: u64) -> Option<Unsteady> {
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

/// Whether nothing can be heard on a bus.
fn is_lost(bus: &BusView) -> bool {
    bus.link != LinkState::Up || bus.counters.bus_state == BusState::BusOff
}

pub(crate) fn judge(look: &Look<'_>, steadiness: &mut Steadiness, found: &mut Vec<Problem>) {
    let (layout, view) = (look.setup.layout, look.view);
    steadiness.handle(look, found);
    for (index, bus) in view.buses.iter().enumerate() {
        if is_lost(bus) {
            // Told of the bus; that its boards are silent says nothing of them.
            continue;
        }
        let is_here = |m: &usize| {
            let wiring = &layout.wiring[*m];
            wiring.protocol.has_board() && usize::from(wiring.bus) == index
        };
        let boards = || (0..layout.modules.len()).filter(is_here);
        let here: Vec<usize> = boards().collect();
        if here.is_empty() {
            continue;
        }
        let is_late = array::is_late(found, index);
        let malformed: Vec<usize> = (here.iter().copied())
            .filter(|m| malformed::is_told(found, *m))
            .collect();
        let state = |m: usize| view.boards[m].state;
        // Between the first sweeps of a board that has just come up its state says silent, too.
        let long = |m: usize| {
            let last_ns = view.boards[m].last_ns;
            let silence_ns = match layout.wiring[m].array {
                Some(_) => array::SILENCE_NS.max(look.setup.silence_ns),
                None => look.setup.silence_ns,
            };
            last_ns.is_none_or(|last| view.now_ns.saturating_sub(last.max(look.awake_ns)) >= silence_ns)
        };
        let quiet = |m: usize| match state(m) {
            _ if malformed.contains(&m) => false,
            BoardState::Silent => long(m) && !is_late,
            BoardState::NeverSeen => view.boards_due,
            BoardState::Settling | BoardState::Streaming => false,
        };
        let is_foreign = bus.unknown > 0 && boards().all(|m| state(m) == BoardState::NeverSeen);
        let hub_speaks = |m: usize| hub_speaks(layout, view.findings, m);
        let all = (boards().count() > 1 || is_foreign) && boards().all(|m| quiet(m) && !hub_speaks(m));
        if all {
            found.push(match is_foreign {
                true => foreign_bus(look, index),
                false => {
                    let starting = here.iter().any(|m| layout.is_started(*m)).then_some(bus.starting);
                    silent_bus(&layout.buses[index], index, &look.setup.sources[index], starting)
                }
            });
        }
        let (mut silent, mut unsteady) = (Vec::new(), Vec::new());
        for module in boards() {
            if let Some(how) = steadiness.unsteady(module, view.now_ns) {
                unsteady.push((module, how));
            }
            if !all && quiet(module) && speaks_on(layout, view.findings, module).is_none() {
                silent.push((module, state(module)));
            }
        }
        for (modules, how) in by_board(layout, &unsteady, |_, _| true) {
            found.push(unsteady_board(layout, modules, how));
        }
        // A hub is told to start where nothing comes of it.
        let hub_sends = |module: usize| {
            let of_hub = |m: &usize| is_of_board(layout, module, *m);
            boards()
                .filter(of_hub)
                .any(|m| matches!(state(m), BoardState::Settling | BoardState::Streaming))
        };
        for (modules, state) in by_board(layout, &silent, |a, b| a == b) {
            let done = match modules[0] {
                module if hub_sends(module) => "Nothing is sent to a hub that sends values of others",
                module if layout.is_started(module) => what_is_done(bus.starting),
                _ => "Nothing is sent to it: such a board sends from power-up on",
            };
            found.push(match layout.wiring[modules[0]].array {
                Some(_) => array::silent(&look.setup.sources[index], layout, modules[0], state),
                None if hub_speaks(modules[0]) => unnamed_modules(layout, modules, state),
                None => match &look.setup.sources[index] {
                    recording @ SourceAddress::Log { .. } => {
                        unrecorded_board(layout, modules, state, recording)
                    }
                    _ => silent_board(layout, modules, state, done),
                },
            });
        }
    }
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

/// The modules of one hub, of which the same is said, together: each list with what was noted of its first.
fn by_board<T: Copy>(
    layout: &Layout,
    modules: &[(usize, T)],
    same: impl Fn(&T, &T) -> bool,
) -> Vec<(Vec<usize>, T)> {
    let mut boards: Vec<(Vec<usize>, T)> = Vec::new();
    for (module, of) in modules {
        let board = (boards.iter_mut())
            .find(|(board, other)| is_of_board(layout, board[0], *module) && same(other, of));
        match board {
            Some((board, _)) => board.push(*module),
            None => boards.push((vec![*module], *of)),
        }
    }
    boards
}

/// `starting` is `None` where no board of the bus is ever told to start.
fn silent_bus(name: &str, bus: usize, source: &SourceAddress, starting: Option<Starting>) -> Problem {
    let done = match starting {
        Some(Starting::Repeated) => "They are told to start again and again",
        Some(starting) => what_is_done(starting),
        None => "Nothing is sent to such boards: they send from power-up on",
    };
    let advice = match source {
        SourceAddress::Log { .. } => {
            format!("compare buses and board numbers in the layout with what is in {source}")
        }
        _ => format!("check the hand's power, the cable and the bit rate. {done}"),
    };
    Problem::new(
        Kind::BusSilent,
        Place::Bus(bus),
        format!("{name}: no board speaks"),
        advice,
        format!("{name}: boards speak again"),
    )
}

/// A board of which a recording has nothing, or nothing any more.
fn unrecorded_board(
    layout: &Layout,
    modules: Vec<usize>,
    state: BoardState,
    recording: &SourceAddress,
) -> Problem {
    let name = modules_name(layout, &modules);
    let over = format!("{} speaks", name.trim_end_matches(','));
    let (kind, found, advice) = match state {
        BoardState::NeverSeen => (
            Kind::BoardUnheard,
            format!("{name} is not in {recording}"),
            "compare its bus and its number in the layout with the recording. The rest goes on",
        ),
        _ => (
            Kind::BoardSilent,
            format!("{name} is silent in {recording}"),
            "It was so when this was recorded, and the rest goes on",
        ),
    };
    of_board(layout, kind, modules, found, advice.into(), over)
}

/// A bus on which others speak and none of its boards ever did: probably it is the layout that is wrong.
fn foreign_bus(look: &Look<'_>, bus: usize) -> Problem {
    let (layout, unknown) = (look.setup.layout, look.view.buses[bus].unknown);
    // Boards that are told to start fall silent where whoever tells them ends.
    let start = match look.view.buses[bus].starting {
        Starting::Repeated => " --start",
        Starting::ByOthers | Starting::NotAllowed => "",
    };
    let (name, source) = (&layout.buses[bus], shell_word(&look.setup.sources[bus]));
    Problem::new(
        Kind::BusSilent,
        Place::Bus(bus),
        format!(
            "{name}: no board of layout {} speaks, and {unknown} frames have ids of nobody in it",
            layout.name
        ),
        format!(
            "`taxel doctor --scan{start} {source}` says which boards these are, and writes their layout. If they are not the \
             hand's, check its power and cable"
        ),
        format!("{name}: boards of layout {} speak", layout.name),
    )
}

fn what_is_done(starting: Starting) -> &'static str {
    match starting {
        Starting::Repeated => "It is told to start again and again",
        Starting::ByOthers => {
            "Nothing is sent to boards in passive mode: whoever controls them has to start them"
        }
        Starting::NotAllowed => {
            "Nothing was sent on this bus (a recording, --listen-only, or others speak there): its boards may wait for a start command"
        }
    }
}

fn silent_board(layout: &Layout, modules: Vec<usize>, state: BoardState, done: &str) -> Problem {
    let name = modules_name(layout, &modules);
    let over = format!("{} speaks", name.trim_end_matches(','));
    match state {
        BoardState::NeverSeen => of_board(
            layout,
            Kind::BoardUnheard,
            modules,
            format!("{name} was not heard since the start"),
            format!(
                "check its power, its cable and its address switches, which the layout has to match. {done}"
            ),
            over,
        ),
        _ => of_board(
            layout,
            Kind::BoardSilent,
            modules,
            format!("{name} is silent"),
            format!("check its power and cable. {done}, and the rest goes on"),
            over,
        ),
    }
}

/// Modules of which nothing comes, though their hub sends values of others.
fn unnamed_modules(layout: &Layout, modules: Vec<usize>, state: BoardState) -> Problem {
    let name = modules_name(layout, &modules);
    let kind = match state {
        BoardState::NeverSeen => Kind::BoardUnheard,
        _ => Kind::BoardSilent,
    };
    of_board(
        layout,
        kind,
        modules,
        format!("{name} sends no values, and its hub sends those of modules that the layout does not have on it"),
        "compare `board` in the layout with the numbers on the hub; if they are right, check the module's cable".into(),
        format!("{} speaks", name.trim_end_matches(',')),
    )
}

fn unsteady_board(layout: &Layout, modules: Vec<usize>, how: Unsteady) -> Problem {
    let Unsteady { times, with_others } = how;
    let name = modules_name(layout, &modules);
    let over = format!("{} is steady again", name.trim_end_matches(','));
    let busy = match with_others {
        true => ". Others fell silent at the same moment: a busy machine, or what they share",
        false => "",
    };
    let found = format!(
        "{name} fell silent {times} times within half a minute: a loose plug, or a supply that sags so that it \
         reboots{busy}"
    );
    let (found, advice) = match layout.wiring[modules[0]].array {
        Some(_) => array::unsteady(&name, times),
        None => (found, String::new()),
    };
    of_board(layout, Kind::BoardUnsteady, modules, found, advice, over)
}
