//! What is said of boards.

use super::steadiness::Unsteady;
use crate::array;
use crate::kind::Kind;
use crate::names::modules_name;
use crate::problem::{Place, Problem, of_board};
use crate::view::{Look, Starting};
use taxel_can::SourceAddress;
use taxel_hand::shell_word;
use taxel_skin::{BoardState, Layout};

/// A bus on which nothing speaks. `starting` is `None` where no board of it is ever told to start.
pub(super) fn silent_bus(
    name: &str,
    bus: usize,
    source: &SourceAddress,
    starting: Option<Starting>,
) -> Problem {
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
pub(super) fn unrecorded_board(
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
pub(super) fn foreign_bus(look: &Look<'_>, bus: usize) -> Problem {
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

/// What is done about a board that is silent and can be told to start.
pub(super) fn what_is_done(starting: Starting) -> &'static str {
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

/// A board that is silent, or was never heard; `done` is what is done about it.
pub(super) fn silent_board(layout: &Layout, modules: Vec<usize>, state: BoardState, done: &str) -> Problem {
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
pub(super) fn unnamed_modules(layout: &Layout, modules: Vec<usize>, state: BoardState) -> Problem {
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

/// A board that falls silent again and again.
pub(super) fn unsteady_board(layout: &Layout, modules: Vec<usize>, how: Unsteady) -> Problem {
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
