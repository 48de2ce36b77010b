//! Boards whose frames come and cannot be read: of another protocol than the layout says, of another firmware, or damaged.

use crate::kind::Kind;
use crate::names::{is_of_board, modules_name};
use crate::problem::{Place, Problem, of_board, place_of_board};
use crate::view::Look;
use taxel_hand::shell_word;

/// How many of a board are worth a sentence, within the time looked at, and as which share (one in so many) of these and its
/// readings. It is over where they are less than half as many.
const FRAMES: u64 = 3;
const SHARE: u64 = 5;
/// Where so many of a hundred are malformed, it is not that some are damaged.
const NEARLY_ALL: u64 = 80;

/// What came of a board, or of a bus, within the time looked at.
#[derive(Debug, Default)]
struct Came {
    modules: Vec<usize>,
    malformed: u64,
    /// These and its readings.
    all: u64,
    /// Sweeps that the board had the time for, as far as it was ever read. Each takes a frame at least.
    sweeps: u64,
}

impl Came {
    fn of_board(look: &Look<'_>, modules: Vec<usize>) -> Self {
        let mut came = Self::default();
        for module in &modules {
            let (now, before) = (&look.view.boards[*module], &look.boards_before[*module]);
            came.malformed += now.malformed.saturating_sub(before.malformed);
            came.all += now.frames().saturating_sub(before.frames());
            let sweeps = now.period_ns.map_or(0.0, |ns| 1e9 * look.seconds / ns as f64);
            came.sweeps = came.sweeps.max(sweeps as u64);
        }
        Self { modules, ..came }
    }

    /// Whether so many are malformed that it is told. A few frames of somebody else in the place of a board that has died
    /// are no board that cannot be read, though nothing else comes.
    fn is_unread(&self, was_so: bool) -> bool {
        let least = self.all.div_ceil(SHARE).max(self.sweeps / 2);
        match was_so {
            true => self.malformed >= least.div_ceil(2).max(1),
            false => self.malformed >= least.max(FRAMES),
        }
    }
}

pub(crate) fn judge(look: &Look<'_>, had: impl Fn(Place) -> bool, found: &mut Vec<Problem>) {
    let layout = look.setup.layout;
    for bus in 0..layout.buses.len() {
        let here = || (0..layout.modules.len()).filter(|m| usize::from(layout.wiring[*m].bus) == bus);
        let of_board = |first| here().filter(move |m| is_of_board(layout, first, *m));
        let firsts = here().filter(|m| of_board(*m).next() == Some(*m));
        let boards = firsts.map(|first| Came::of_board(look, of_board(first).collect()));
        let mut heard: Vec<Came> = boards.filter(|came| came.all > 0).collect();
        let had_bus = had(Place::Bus(bus));
        let is_told = |came: &Came| came.is_unread(had_bus || had(place_of_board(layout, came.modules[0])));
        // Each board of a bad bus is above and below the limit by chance.
        let is_bus =
            heard.len() > 1 && heard.iter().any(is_told) && heard.iter().all(|came| came.is_unread(true));
        if is_bus {
            let mut of_bus = Came::default();
            for board in heard {
                of_bus.malformed += board.malformed;
                of_bus.all += board.all;
                of_bus.modules.extend(board.modules);
            }
            found.push(malformed_bus(look, bus, of_bus));
        } else {
            heard.retain(is_told);
            found.extend(heard.into_iter().map(|came| malformed_board(look, came)));
        }
    }
}

/// Whether it is told that frames of the board of a module cannot be read: then it is not silent.
pub(crate) fn is_told(found: &[Problem], module: usize) -> bool {
    (found.iter()).any(|p| p.kind == Kind::BoardMalformed && p.modules.contains(&module))
}

fn malformed_board(look: &Look<'_>, came: Came) -> Problem {
    let layout = look.setup.layout;
    let name = modules_name(layout, &came.modules);
    let name = name.trim_end_matches(',');
    let (found, advice) = words(look, &came);
    of_board(
        layout,
        Kind::BoardMalformed,
        came.modules,
        format!("{name}: {found}"),
        advice,
        format!("{name}: its frames can be read"),
    )
}

/// Of every board that speaks on a bus frames cannot be read: that is one fault.
fn malformed_bus(look: &Look<'_>, bus: usize, came: Came) -> Problem {
    let name = &look.setup.layout.buses[bus];
    let (found, advice) = words(look, &came);
    Problem {
        modules: came.modules,
        ..Problem::new(
            Kind::BoardMalformed,
            Place::Bus(bus),
            format!("{name}: {found}, and so it is of every board"),
            advice,
            format!("{name}: frames of its boards can be read"),
        )
    }
}

/// What is found, and what to do.
fn words(look: &Look<'_>, came: &Came) -> (String, String) {
    let wiring = &look.setup.layout.wiring[came.modules[0]];
    let protocol = wiring.protocol.name();
    let share = 100 * came.malformed / came.all.max(1);
    let (which, advice) = match share >= NEARLY_ALL {
        true => (
            String::new(),
            format!(
                "check `protocol` in the layout (`taxel doctor --scan {}` recognises boards), the firmware, and that nobody \
                 else sends with these ids",
                shell_word(&look.setup.sources[usize::from(wiring.bus)])
            ),
        ),
        false => (
            format!(", {share} % of what comes,"),
            "the rest can be read: check that nobody else sends with these ids, then cable, termination and bit rate".into(),
        ),
    };
    let rate = came.malformed as f64 / look.seconds;
    (
        format!(
            "{rate:.0} frames a second{which} have its ids and are none of {protocol}, by their length or content"
        ),
        advice,
    )
}
