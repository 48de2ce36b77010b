//! Boards whose frames come and cannot be read: of another protocol than the layout says, or of another firmware.

use crate::kind::Kind;
use crate::names::{is_of_board, modules_name};
use crate::problem::{Place, Problem, of_board, place_of_board};
use crate::view::Look;

/// How many of a board are worth a sentence, within the time looked at, and as which share (one in so many) of these and its
/// readings. It is over where they are less than half as many.
const FRAMES: u64 = 3;
const SHARE: u64 = 5;

pub(crate) fn judge(look: &Look<'_>, had: impl Fn(Place) -> bool, found: &mut Vec<Problem>) {
    let layout = look.setup.layout;
    for bus in 0..layout.buses.len() {
        let here = || (0..layout.modules.len()).filter(|m| usize::from(layout.wiring[*m].bus) == bus);
        let mut malformed: Vec<(Vec<usize>, u64)> = Vec::new();
        for first in here() {
            let modules: Vec<usize> = here().filter(|m| is_of_board(layout, first, *m)).collect();
            if modules[0] == first {
                let frames = unread(look, &modules, &had);
                malformed.extend(frames.map(|frames| (modules, frames)));
            }
        }
        let modules = malformed.iter().map(|(modules, _)| modules.len()).sum::<usize>();
        if malformed.len() > 1 && modules == here().count() {
            let frames = malformed.iter().map(|(_, frames)| frames).sum();
            found.push(malformed_bus(look, bus, here().collect(), frames));
        } else {
            let problems = malformed.into_iter();
            found.extend(problems.map(|(modules, frames)| malformed_board(look, modules, frames)));
        }
    }
}

/// Whether it is told that frames of the board of a module cannot be read: then it is not silent.
pub(crate) fn is_told(found: &[Problem], module: usize) -> bool {
    (found.iter()).any(|p| p.kind == Kind::BoardMalformed && p.modules.contains(&module))
}

/// Frames of the board of these modules within the time looked at that could not be read, where they are enough to tell.
fn unread(look: &Look<'_>, modules: &[usize], had: impl Fn(Place) -> bool) -> Option<u64> {
    let layout = look.setup.layout;
    let (mut malformed, mut all) = (0, 0);
    for module in modules {
        let (now, before) = (&look.view.boards[*module], &look.boards_before[*module]);
        malformed += now.malformed.saturating_sub(before.malformed);
        all += now.frames().saturating_sub(before.frames());
    }
    let bus = Place::Bus(layout.wiring[modules[0]].bus.into());
    let least = match had(place_of_board(layout, modules[0])) || had(bus) {
        true => all.div_ceil(2 * SHARE).max(1),
        false => FRAMES.max(all.div_ceil(SHARE)),
    };
    (malformed >= least).then_some(malformed)
}

fn malformed_board(look: &Look<'_>, modules: Vec<usize>, frames: u64) -> Problem {
    let layout = look.setup.layout;
    let name = modules_name(layout, &modules);
    let name = name.trim_end_matches(',');
    let (found, advice) = words(look, modules[0], frames);
    of_board(
        layout,
        Kind::BoardMalformed,
        modules,
        format!("{name}: {found}"),
        advice,
        format!("{name}: its frames can be read"),
    )
}

/// No frame of any board of a bus can be read, or few: that is one fault.
fn malformed_bus(look: &Look<'_>, bus: usize, modules: Vec<usize>, frames: u64) -> Problem {
    let name = &look.setup.layout.buses[bus];
    let (found, advice) = words(look, modules[0], frames);
    Problem {
        modules,
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
fn words(look: &Look<'_>, module: usize, frames: u64) -> (String, String) {
    let wiring = &look.setup.layout.wiring[module];
    let protocol = wiring.protocol.name();
    (
        format!(
            "{:.0} frames a second have its ids and are none of {protocol}, by their length or content",
            frames as f64 / look.seconds
        ),
        format!(
            "check `protocol` in the layout (`taxel doctor --scan {}` recognises boards), the firmware, and that nobody \
             else sends with these ids",
            look.setup.sources[usize::from(wiring.bus)]
        ),
    )
}
