//! What the traffic itself shows: babbling nodes, two boards with one address, boards and buses in
//! the wrong place.

use crate::kind::Kind;
use crate::names::{board_name, is_of_board, plug_name};
use crate::problem::{Place, Problem};
use crate::view::Look;
use taxel_can::id_text;
use taxel_skin::{BoardState, Finding, Layout};

/// The bus (index) on which the board of a module was found to speak instead of its own; `None`
/// where it was not.
pub fn speaks_on(layout: &Layout, findings: &[Finding], module: usize) -> Option<u8> {
    let own = layout.wiring[module].bus;
    findings.iter().find_map(|finding| match *finding {
        Finding::OnOtherBus { module: m, bus } if is_of_board(layout, usize::from(m), module) => Some(bus),
        Finding::BusesSwapped { buses: [a, b], .. } if own == a || own == b => {
            Some(if own == a { b } else { a })
        }
        _ => None,
    })
}

pub(crate) fn judge(look: &Look<'_>, found: &mut Vec<Problem>) {
    found.extend((look.view.findings.iter()).filter_map(|finding| of_finding(look, finding)));
}

fn of_finding(look: &Look<'_>, finding: &Finding) -> Option<Problem> {
    let layout = look.setup.layout;
    Some(match *finding {
        Finding::IdBabbles {
            bus,
            id,
            extended,
            module,
            rate_hz,
            share,
        } => babbling(layout, bus, (id, extended), module, rate_hz, share),
        Finding::BoardBabbles {
            module,
            rate_hz,
            share,
            sweeps_hz: [sweeps, usual],
        } => {
            let name = board_name(layout, module.into());
            Problem::new(
                Kind::BoardBabbling,
                Place::Module(module.into()),
                format!(
                    "{name} sends {sweeps:.0} sweeps/s where others send {usual:.0}: {rate_hz:.0} frames/s, at least {:.0} % of a bus of 1 Mbit/s",
                    100.0 * share
                ),
                "Restart or unplug it; ids above its own may starve",
                format!("{name} no longer babbles"),
            )
        }
        Finding::TwoBoards { module, sweeps_hz } => two_boards(look, module.into(), sweeps_hz),
        Finding::OnOtherBus { module, bus } => {
            let index = usize::from(module);
            let (name, other) = (plug_name(layout, index), bus_name(layout, bus));
            Problem::new(
                Kind::BoardOnOtherBus,
                Place::Module(index),
                format!("{name} is silent, and a board of its address speaks on {other}"),
                format!(
                    "wire it to {}, or write `bus = \"{other}\"` into the layout",
                    bus_name(layout, layout.wiring[index].bus)
                ),
                format!("no board of the address of {name} speaks on {other} any more"),
            )
        }
        Finding::BusesSwapped {
            buses,
            module,
            boards,
        } => swapped(look, buses, module.into(), boards),
        Finding::NotInLayout {
            bus,
            protocol,
            address,
        } => {
            let name = bus_name(layout, bus);
            let number = protocol.address_text(address);
            Problem::new(
                Kind::BoardNotInLayout,
                Place::Stranger(
                    bus.into(),
                    0x2000_0000 | (protocol.index() as u32) << 26 | address,
                ),
                format!(
                    "{name}: a board answers as address {number} ({}), which the layout does not have there",
                    protocol.name()
                ),
                "correct its address switches, or add it to the layout",
                format!("{name}: no board answers as address {number} any more"),
            )
        }
        Finding::ModulesNotInLayout { hub, number, modules } => {
            return strange_modules(layout, hub, number, modules);
        }
    })
}

/// Whether the hub of a module was found to send values of modules that the layout does not have on it.
pub(crate) fn hub_speaks(layout: &Layout, findings: &[Finding], module: usize) -> bool {
    let own = layout.wiring[module].hub;
    findings
        .iter()
        .any(|finding| matches!(*finding, Finding::ModulesNotInLayout { hub, .. } if own == Some(hub)))
}

fn strange_modules(layout: &Layout, hub: u8, number: u8, modules: u16) -> Option<Problem> {
    let known = layout.cyskin.as_ref()?.hubs.get(usize::from(hub))?;
    let name = format!("{}: hub {}", bus_name(layout, known.bus), known.name);
    let more = match modules {
        0 | 1 => String::new(),
        modules => format!(" and {} more", modules - 1),
    };
    Some(Problem::new(
        Kind::BoardNotInLayout,
        Place::Stranger(known.bus.into(), 0x4000_0000 | u32::from(hub)),
        format!("{name} sends values of module {number}{more}, which the layout does not have on it"),
        "compare `board` of its modules with their numbers on the hub, or add what is missing to the layout",
        format!("{name} sends values of no other modules than the layout's any more"),
    ))
}

fn bus_name(layout: &Layout, bus: u8) -> &str {
    &layout.buses[usize::from(bus)]
}

fn babbling(
    layout: &Layout,
    bus: u8,
    (id, extended): (u32, bool),
    module: Option<u16>,
    rate_hz: f64,
    share: f64,
) -> Problem {
    let name = bus_name(layout, bus);
    let id = id | u32::from(extended) << 31;
    let place = Place::Stranger(bus.into(), id);
    let id = id_text(id);
    let (whose, advice) = match module {
        Some(m) => (
            format!(" of {}", board_name(layout, m.into())),
            "Its board, or another node that uses its id, is defective: unplug it",
        ),
        None => (
            ", which is nobody's in the layout,".into(),
            "Find the node that sends it (unplug one after the other) and stop it",
        ),
    };
    Problem::new(
        Kind::Babbling,
        place,
        format!(
            "{name}: id {id}{whose} babbles: {rate_hz:.0} frames/s, at least {:.0} % of a bus of 1 Mbit/s",
            100.0 * share
        ),
        format!("{advice}. Ids above it may starve; the rest goes on"),
        format!("{name}: id {id} no longer babbles"),
    )
}

fn two_boards(look: &Look<'_>, module: usize, [sweeps, usual]: [f64; 2]) -> Problem {
    let layout = look.setup.layout;
    let m = &layout.wiring[module];
    let quiet: Vec<String> = (0..layout.modules.len())
        .filter(|i| {
            let other = &layout.wiring[*i];
            let state = look.view.boards[*i].state;
            (other.bus, other.protocol) == (m.bus, m.protocol)
                && matches!(state, BoardState::Silent | BoardState::NeverSeen)
        })
        .map(|i| board_name(layout, i))
        .collect();
    let advice = match quiet.as_slice() {
        [] => "Set the address switches of one of them to another address".to_string(),
        [one] => format!("{one} is silent and probably the other one: correct its address switches"),
        several => format!(
            "One of {} is probably the other: correct its address switches",
            several.join(", ")
        ),
    };
    let name = format!("board {} of {}", m.board, bus_name(layout, m.bus));
    let one = match sweeps > usual {
        true => format!(" where one board sends {usual:.0}"),
        false => String::new(),
    };
    Problem::new(
        Kind::TwoBoards,
        Place::Module(module),
        format!(
            "two boards answer as {name} ({}): its values alternate, {sweeps:.0} sweeps/s{one}",
            layout.modules[module].name
        ),
        advice,
        format!("one board alone answers as {name}"),
    )
}

fn swapped(look: &Look<'_>, buses: [u8; 2], module: usize, boards: u16) -> Problem {
    let layout = look.setup.layout;
    let [a, b] = buses.map(|bus| bus_name(layout, bus));
    let sources = buses.map(|bus| look.setup.sources[usize::from(bus)].to_string());
    let other = if layout.wiring[module].bus == buses[0] {
        b
    } else {
        a
    };
    let evidence = match boards {
        1 => format!(
            "{} speaks on {other}, which has no such board in the layout. It may also be that only this board is on the wrong bus",
            plug_name(layout, module)
        ),
        n => format!("{n} boards that only one of them has speak on the other"),
    };
    Problem::new(
        Kind::BusesSwapped,
        Place::Stranger(buses[0].into(), 0x4000_0000 | u32::from(buses[1])),
        format!("{a} and {b} look swapped: {evidence}"),
        format!(
            "Swap the two cables, or the two lines `source = \"{}\"` and `source = \"{}\"` of the configuration",
            sources[0], sources[1]
        ),
        format!("{a} and {b} no longer look swapped"),
    )
}
