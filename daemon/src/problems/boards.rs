//! What is wrong with the boards, and what their traffic shows.

use super::{Kind, Look, Place, Problem};
use std::collections::{HashMap, VecDeque};
use taxel_can::{BusState, LinkState};
use taxel_skin::{BoardState, BoardsMode, Finding, Layout};

/// A board that falls silent so often within so long is unsteady, until it was steady for a while.
const SILENCES: usize = 3;
const UNSTEADY_NS: u64 = 30_000_000_000;
const STEADY_NS: u64 = 10_000_000_000;

/// So many modules of a hub are named; further ones are counted.
const NAMED: usize = 3;

/// The modules that a problem of a hub is about.
pub(super) type OfHubs = HashMap<(Kind, Place), Vec<usize>>;

/// When each board fell silent of late.
#[derive(Debug, Default)]
pub(crate) struct Steadiness {
    boards: Vec<(bool, VecDeque<u64>)>,
}

impl Steadiness {
    /// Takes note whether a board is silent, and returns how often it fell silent, if that makes it unsteady.
    fn look(&mut self, module: usize, silent: bool, now_ns: u64) -> Option<usize> {
        if self.boards.len() <= module {
            self.boards.resize(module + 1, (false, VecDeque::new()));
        }
        let (was_silent, silences) = &mut self.boards[module];
        if silent && !*was_silent {
            silences.push_back(now_ns);
        }
        *was_silent = silent;
        while silences
            .front()
            .is_some_and(|t| now_ns.saturating_sub(*t) > UNSTEADY_NS)
        {
            silences.pop_front();
        }
        let last_ns = *silences.back()?;
        (silences.len() >= SILENCES && now_ns.saturating_sub(last_ns) <= STEADY_NS).then_some(silences.len())
    }
}

pub(super) fn judge(look: &Look<'_>, steadiness: &mut Steadiness, found: &mut Vec<Problem>) -> OfHubs {
    let mut of_hubs = OfHubs::new();
    let layout = &look.config.layout;
    for finding in &look.now.findings {
        found.push(of_finding(look, finding));
    }
    let displaced = |module: usize| {
        look.now.findings.iter().any(|finding| match finding {
            Finding::OnOtherBus { module: m, .. } => is_of_board(layout, usize::from(*m), module),
            Finding::BusesSwapped { buses, .. } => buses.contains(&layout.wiring[module].bus),
            _ => false,
        })
    };
    for (index, bus) in look.now.buses.iter().enumerate() {
        let boards = || (0..layout.modules.len()).filter(|m| usize::from(layout.wiring[*m].bus) == index);
        if bus.link != LinkState::Up || bus.source.bus_state == BusState::BusOff {
            // Told of the bus; that its boards are silent says nothing of them.
            continue;
        }
        let state = |m: usize| look.now.boards[m].state;
        // Between the first sweeps of a board that has just come up its state says silent, too.
        let long = |m: usize| {
            let last_ns = look.now.boards[m].last_ns;
            let silence_ns = (look.config.boards.silence_ms * 1e6) as u64;
            last_ns.is_none_or(|last| look.now.now_ns.saturating_sub(last) >= silence_ns)
        };
        let quiet = |m: usize| match state(m) {
            BoardState::Silent => long(m),
            BoardState::NeverSeen => look.boards_due,
            BoardState::Settling | BoardState::Streaming => false,
        };
        let all = boards().count() > 1 && boards().all(quiet);
        if all {
            found.push(silent_bus(look, index));
        }
        let (mut silent, mut unsteady) = (Vec::new(), Vec::new());
        for module in boards() {
            let fell_silent = look.boards_due && !all && state(module) == BoardState::Silent;
            if let Some(times) = steadiness.look(module, fell_silent, look.now.now_ns) {
                unsteady.push((module, times));
            }
            if !all && quiet(module) && !displaced(module) {
                silent.push((module, state(module)));
            }
        }
        let mut say = |problem: Problem, modules: Vec<usize>| {
            if let Place::Hub(_) = problem.place {
                of_hubs.insert((problem.kind, problem.place), modules);
            }
            found.push(problem);
        };
        for (modules, times) in by_board(layout, &unsteady, |_, _| true) {
            say(unsteady_board(layout, &modules, times), modules);
        }
        for (modules, state) in by_board(layout, &silent, |a, b| a == b) {
            say(silent_board(look, &modules, state), modules);
        }
    }
    of_hubs
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

/// Whether two modules are on one board: on one hub, or the same.
fn is_of_board(layout: &Layout, module: usize, other: usize) -> bool {
    let hub = |module: usize| layout.wiring[module].hub;
    module == other || (hub(module).is_some() && hub(module) == hub(other))
}

/// `index tip (can0 board 3)`; `palm (can0 hub left, board 3)`.
fn named(layout: &Layout, module: usize) -> String {
    let (name, wiring) = (&layout.modules[module].name, &layout.wiring[module]);
    let hub = hub_of(layout, module).map_or_else(String::new, |hub| format!("hub {hub}, "));
    let bus = &layout.buses[usize::from(wiring.bus)];
    format!("{name} ({bus} {hub}board {})", wiring.board)
}

/// What is plugged into a bus with a module: its hub, or its board.
fn plugged(layout: &Layout, module: usize) -> String {
    match hub_of(layout, module) {
        Some(hub) => format!(
            "hub {hub} ({})",
            layout.buses[usize::from(layout.wiring[module].bus)]
        ),
        None => named(layout, module),
    }
}

fn hub_of(layout: &Layout, module: usize) -> Option<&str> {
    let hub = layout.wiring[module].hub?;
    Some(&layout.cyskin.as_ref()?.hubs.get(usize::from(hub))?.name)
}

fn what_is_done(look: &Look<'_>) -> &'static str {
    match look.config.boards.mode {
        BoardsMode::Passive => {
            "Nothing is sent to boards in passive mode: whoever controls them has to start them"
        }
        _ => "It is told to start again and again",
    }
}

fn silent_bus(look: &Look<'_>, bus: usize) -> Problem {
    let name = &look.config.layout.buses[bus];
    let finished = what_is_done(look).replace("It is", "They are");
    Problem {
        kind: "bus-silent",
        place: Place::Bus(bus),
        severe: true,
        sentence: format!(
            "{name}: no board speaks; check the hand's power, the cable and the bit rate. {finished}"
        ),
        over: format!("{name}: boards speak again"),
    }
}

/// Whose problem it is if it is of these modules of one board.
fn place(layout: &Layout, modules: &[usize]) -> Place {
    let module = modules[0];
    layout.wiring[module]
        .hub
        .map_or(Place::Module(module), Place::Hub)
}

/// `index tip (can0 board 3)`; `hub left (can0) with all its modules (palm, heel, wrist and 4 more)`; `a part of hub left (can0), 2 of
/// its 7 modules (palm, heel),`.
fn named_all(layout: &Layout, modules: &[usize]) -> String {
    let hub = layout.wiring[modules[0]].hub;
    if hub.is_none() || modules.len() == 1 {
        return named(layout, modules[0]);
    }
    let names: Vec<&str> = (modules.iter().take(NAMED))
        .map(|m| layout.modules[*m].name.as_str())
        .collect();
    let list = match modules.len().saturating_sub(NAMED) {
        0 => names.join(", "),
        more => format!("{} and {more} more", names.join(", ")),
    };
    let hub_name = plugged(layout, modules[0]);
    if layout.wiring.iter().filter(|m| m.hub == hub).count() == modules.len() {
        format!("{hub_name} with all its modules ({list})")
    } else {
        let (some, all) = (
            modules.len(),
            layout.wiring.iter().filter(|m| m.hub == hub).count(),
        );
        format!("a part of {hub_name}, {some} of its {all} modules ({list}),")
    }
}

fn silent_board(look: &Look<'_>, modules: &[usize], state: BoardState) -> Problem {
    let layout = &look.config.layout;
    let name = named_all(layout, modules);
    let done = what_is_done(look);
    let (kind, sentence) = match state {
        BoardState::NeverSeen => (
            "board-unheard",
            format!(
                "{name} was not heard since the start; check its power, its cable and its address switches, which the layout has to match. {done}"
            ),
        ),
        _ => (
            "board-silent",
            format!("{name} is silent; check its power and cable. {done}, and the rest goes on"),
        ),
    };
    Problem {
        kind,
        place: place(layout, modules),
        severe: false,
        sentence,
        over: format!("{} speaks", name.trim_end_matches(',')),
    }
}

fn unsteady_board(layout: &Layout, modules: &[usize], times: usize) -> Problem {
    let name = named_all(layout, modules);
    Problem {
        kind: "board-unsteady",
        place: place(layout, modules),
        severe: false,
        sentence: format!(
            "{name} fell silent {times} times within half a minute: a loose plug, or a supply that sags so that it reboots"
        ),
        over: format!("{} is steady again", name.trim_end_matches(',')),
    }
}

fn of_finding(look: &Look<'_>, finding: &Finding) -> Problem {
    let layout = &look.config.layout;
    let bus_name = |bus: u8| &layout.buses[usize::from(bus)];
    match *finding {
        Finding::IdBabbles {
            bus,
            id,
            extended,
            module,
            rate_hz,
            share,
        } => {
            let name = bus_name(bus);
            let id_name = if extended {
                format!("{id:08X}")
            } else {
                format!("{id:03X}")
            };
            let loud = format!(
                "{rate_hz:.0} frames/s, at least {:.0} % of a bus of 1 Mbit/s",
                100.0 * share
            );
            let who = match module {
                Some(m) => format!(
                    "id {id_name} of {} babbles: {loud}. Its board, or another node that uses its id, is defective: unplug it",
                    named(layout, usize::from(m))
                ),
                None => format!(
                    "id {id_name}, which is nobody's in the layout, babbles: {loud}. Find the node that sends it (unplug one after the other) and stop it"
                ),
            };
            Problem {
                kind: "babbling",
                place: Place::Stranger(bus.into(), id | u32::from(extended) << 31),
                severe: false,
                sentence: format!("{name}: {who}. Ids above it may starve; the rest goes on"),
                over: format!("{name}: id {id_name} no longer babbles"),
            }
        }
        Finding::BoardBabbles {
            module,
            rate_hz,
            share,
            sweeps_hz: [sweeps, usual],
        } => {
            let name = named(layout, module.into());
            Problem {
                kind: "board-babbling",
                place: Place::Module(module.into()),
                severe: false,
                sentence: format!(
                    "{name} sends {sweeps:.0} sweeps/s where others send {usual:.0}: {rate_hz:.0} frames/s, at least {:.0} % of a bus of 1 Mbit/s. Restart or unplug it; ids above its own may starve",
                    100.0 * share
                ),
                over: format!("{name} no longer babbles"),
            }
        }
        Finding::TwoBoards {
            module,
            sweeps_hz: [sweeps, usual],
        } => {
            let index = usize::from(module);
            let m = &layout.wiring[index];
            let quiet: Vec<String> = (0..layout.modules.len())
                .filter(|i| {
                    let other = &layout.wiring[*i];
                    let state = look.now.boards[*i].state;
                    (other.bus, other.protocol) == (m.bus, m.protocol)
                        && matches!(state, BoardState::Silent | BoardState::NeverSeen)
                })
                .map(|i| named(layout, i))
                .collect();
            let hint = match quiet.as_slice() {
                [] => "Set the address switches of one of them to another address".to_string(),
                [one] => format!("{one} is silent and probably the other one: correct its address switches"),
                several => format!(
                    "One of {} is probably the other: correct its address switches",
                    several.join(", ")
                ),
            };
            let name = format!("board {} of {}", m.board, bus_name(m.bus));
            Problem {
                kind: "two-boards-one-address",
                place: Place::Module(index),
                severe: true,
                sentence: format!(
                    "two boards answer as {name} ({}): its values alternate, {sweeps:.0} sweeps/s where others send {usual:.0}. {hint}",
                    layout.modules[index].name
                ),
                over: format!("one board alone answers as {name}"),
            }
        }
        Finding::OnOtherBus { module, bus } => {
            let index = usize::from(module);
            let (name, other) = (plugged(layout, index), bus_name(bus));
            Problem {
                kind: "board-on-other-bus",
                place: Place::Module(index),
                severe: true,
                sentence: format!(
                    "{name} is silent, and a board of its address speaks on {other}: wire it to {}, or write `bus = \"{other}\"` into the layout",
                    bus_name(layout.wiring[index].bus)
                ),
                over: format!("no board of the address of {name} speaks on {other} any more"),
            }
        }
        Finding::BusesSwapped {
            buses,
            module,
            boards,
        } => {
            let [a, b] = buses.map(bus_name);
            let index = usize::from(module);
            let sources = buses.map(|bus| look.config.sources[usize::from(bus)].to_string());
            let other = if layout.wiring[index].bus == buses[0] {
                b
            } else {
                a
            };
            let evidence = match boards {
                1 => format!(
                    "{} speaks on {other}, which has no such board in the layout. It may also be that only this board is on the wrong bus",
                    plugged(layout, index)
                ),
                n => format!("{n} boards that only one of them has speak on the other"),
            };
            Problem {
                kind: "buses-swapped",
                place: Place::Stranger(buses[0].into(), 0x4000_0000 | u32::from(buses[1])),
                severe: true,
                sentence: format!(
                    "{a} and {b} look swapped: {evidence}. Swap the two cables, or the two lines `source = \"{}\"` and `source = \"{}\"` of the configuration",
                    sources[0], sources[1]
                ),
                over: format!("{a} and {b} no longer look swapped"),
            }
        }
        Finding::NotInLayout {
            bus,
            protocol,
            address,
        } => {
            let name = bus_name(bus);
            let number = protocol.address_text(address);
            Problem {
                kind: "board-not-in-layout",
                place: Place::Stranger(
                    bus.into(),
                    0x2000_0000 | (protocol.index() as u32) << 26 | address,
                ),
                severe: false,
                sentence: format!(
                    "{name}: a board answers as address {number} ({}), which the layout does not have there: correct its address switches, or add it to the layout",
                    protocol.name()
                ),
                over: format!("{name}: no board answers as address {number} any more"),
            }
        }
    }
}
