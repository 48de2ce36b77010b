//! What the traffic itself shows: babbling nodes, two boards with one address, boards and buses in the wrong place.

use super::{AREA, HandFacts, object};
use crate::doctor::finding::Check;
use taxel_skin::{Finding, Layout};

/// What is to be said of findings. Boards beyond the layout are told with the ids they send.
pub(super) fn check(layout: &Layout, facts: &HandFacts) -> Vec<Check> {
    let bus_name = |bus: u8| layout.buses[usize::from(bus)].as_str();
    let board = |module: u16| object(layout, module.into());
    facts
        .findings
        .iter()
        .filter_map(|finding| match *finding {
            Finding::IdBabbles {
                bus,
                id,
                extended,
                module,
                rate_hz,
                share,
            } => {
                let id = if extended { format!("{id:08X}") } else { format!("{id:03X}") };
                let whose = match module {
                    Some(module) => format!("of {}", board(module)),
                    None => "of a node that is not of the hand".into(),
                };
                let found = format!("id {id} {whose} comes {rate_hz:.0} times a second, at least {:.0} % of the bus", share * 100.0);
                let check = Check::error(AREA, "babbling", bus_name(bus), found);
                Some(check.advise("unplug the nodes one after the other until it stops: ids behind it starve"))
            }
            Finding::BoardBabbles {
                module,
                share,
                sweeps_hz: [its, usual],
                ..
            } => {
                let found = format!(
                    "sends {its:.0} sweeps/s where its like send {usual:.0}, at least {:.0} % of the bus",
                    share * 100.0
                );
                Some(Check::error(AREA, "babbling", board(module), found).advise("switch its power off and on"))
            }
            Finding::TwoBoards {
                module,
                sweeps_hz: [its, usual],
            } => {
                let found = format!(
                    "two boards answer to this address: {its:.0} sweeps/s instead of {usual:.0}, alternating between two values"
                );
                let check = Check::error(AREA, "address", board(module), found).wanted("one board per address");
                Some(check.advise("take one of them off the bus and give it an address of its own (SET_BOARD_ADX, 0x32)"))
            }
            Finding::OnOtherBus { module, bus } => {
                let found = format!("speaks on {}", bus_name(bus));
                let own = bus_name(layout.wiring[usize::from(module)].bus);
                let check = Check::error(AREA, "wrong bus", board(module), found).wanted(own);
                Some(check.advise("plug it into its own bus, or write the other one into the layout file"))
            }
            Finding::BusesSwapped {
                buses: [a, b],
                boards,
                ..
            } => {
                let (a, b) = (bus_name(a), bus_name(b));
                let found = format!("the boards of {a} speak on {b} and those of {b} on {a} ({boards} tell)");
                let check = Check::error(AREA, "swapped", format!("{a} and {b}"), found);
                Some(check.advise("swap the plugs of the two adapters, or the sources of the two [[bus]] tables"))
            }
            Finding::NotInLayout { .. } => None,
        })
        .collect()
}

/// The bus on which a board (module index) was found to speak instead of its own.
pub(super) fn elsewhere(layout: &Layout, facts: &HandFacts, module: usize) -> Option<u8> {
    let own = layout.wiring[module].bus;
    facts.findings.iter().find_map(|finding| match *finding {
        Finding::OnOtherBus { module: m, bus } if is_of_board(layout, usize::from(m), module) => Some(bus),
        Finding::BusesSwapped { buses: [a, b], .. } if own == a || own == b => {
            Some(if own == a { b } else { a })
        }
        _ => None,
    })
}

/// Whether two modules are on one board: on one hub, or the same.
fn is_of_board(layout: &Layout, module: usize, other: usize) -> bool {
    let hub = |module: usize| layout.wiring[module].hub;
    module == other || (hub(module).is_some() && hub(module) == hub(other))
}

/// Whether it is known whose board speaks on a bus under an address that the bus does not have.
pub(super) fn is_displaced(layout: &Layout, facts: &HandFacts, bus: u8, address: u8) -> bool {
    layout
        .wiring
        .iter()
        .enumerate()
        .any(|(index, wiring)| wiring.board == address && elsewhere(layout, facts, index) == Some(bus))
}
