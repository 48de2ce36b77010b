//! A module's board: its protocol, and where on which bus it is.

use super::error::{LayoutError, LayoutProblem};
use super::source::{Accepted, FileModule, Head, Source};
use super::wiring::Wiring;
use crate::protocol::Protocol;
use crate::protocol::cyskin::file::no_table;
use crate::protocol::cyskin::setup::HubIds;
use crate::protocol::icub::setup::IcubSetup;
use std::ops::Range;
use toml::Spanned;

/// Checks the keys `protocol`, `bus`, `board`, `icub`, `hub`, `rows` and `columns` of a module, and returns the wiring
/// of its board, which no module before it has, with the place of its address in the file.
pub(crate) fn accept_board(
    source: &Source<'_>,
    module: &FileModule,
    module_span: &Range<usize>,
    head: &Head,
    accepted: &Accepted,
) -> Result<(Wiring, Range<usize>), LayoutError> {
    let name = || module.name.clone();
    let Some(protocol) = Protocol::from_name(module.protocol.get_ref()) else {
        let problem = LayoutProblem::UnknownProtocol {
            module: name(),
            protocol: module.protocol.get_ref().clone(),
        };
        return source.refuse(&module.protocol.span(), problem);
    };
    let refuse = |span: &Range<usize>, problem: &str| {
        let problem = LayoutProblem::Key {
            module: name(),
            protocol,
            problem: problem.into(),
        };
        source.refuse(span, problem)
    };
    let bus_span = module.bus.as_ref().map(Spanned::span);
    let board_span = module.board.as_ref().map(Spanned::span);
    for (key, span) in [
        ("icub", module.icub.as_ref().map(Spanned::span)),
        ("hub", module.hub.as_ref().map(Spanned::span)),
        ("rows", module.rows.as_ref().map(Spanned::span)),
        ("columns", module.columns.as_ref().map(Spanned::span)),
    ] {
        if let Some(span) = span.filter(|_| !protocol.takes_key(key)) {
            return refuse(&span, &format!("has no use for the key `{key}`"));
        }
    }
    if !protocol.has_board() {
        return match bus_span.or(board_span) {
            Some(span) => refuse(&span, "has neither bus nor board; remove the key"),
            None => {
                let wiring = Wiring {
                    bus: 0,
                    board: 0,
                    protocol,
                    icub: None,
                    hub: None,
                    array: None,
                };
                Ok((wiring, module_span.clone()))
            }
        };
    }

    let Some(bus_name) = &module.bus else {
        return refuse(module_span, "needs the key `bus`");
    };
    let Some(bus) = head.buses.iter().position(|b| b == bus_name.get_ref()) else {
        let problem = LayoutProblem::UnknownBus {
            module: name(),
            bus: bus_name.get_ref().clone(),
            known: head.buses.join(", "),
        };
        return source.refuse(&bus_name.span(), problem);
    };
    let addresses = protocol.addresses();
    let (board, board_span) = match &module.board {
        Some(board) => (*board.get_ref(), board.span()),
        None if protocol.takes_key("board") => return refuse(module_span, "needs the key `board`"),
        None => (addresses.start.into(), module_span.clone()),
    };
    if board < addresses.start.into() || board >= addresses.end.into() {
        let problem = LayoutProblem::BoardOutOfRange {
            module: name(),
            board,
            protocol,
        };
        return source.refuse(&board_span, problem);
    }
    let (bus, board) = (bus as u8, board as u8);
    let hub = if protocol.takes_key("hub") {
        Some(find_hub(source, module, module_span, (bus, protocol), head)?)
    } else {
        None
    };
    let same = |m: &Wiring| {
        m.bus == bus && m.board == board && m.hub == hub && m.protocol.has_addresses_of(protocol)
    };
    if let Some(other) = accepted.wiring.iter().position(same) {
        let problem = LayoutProblem::SameBoard {
            module: name(),
            bus: head.buses[bus as usize].clone(),
            board,
            other: accepted.modules[other].name.clone(),
            other_line: source.line(&accepted.spans[other]),
        };
        return source.refuse(&board_span, problem);
    }
    // A middle frame of a hub's packet would be a command to an MTB, and its other ids are those of data.
    let hubs_use_standard_ids = head
        .cyskin
        .as_ref()
        .is_some_and(|setup| setup.ids == HubIds::Standard);
    let other_kind =
        |m: &Wiring| m.protocol.has_board() && m.bus == bus && (m.hub.is_some() != hub.is_some());
    if let Some(other) = accepted
        .wiring
        .iter()
        .position(other_kind)
        .filter(|_| hubs_use_standard_ids)
    {
        let problem = format!(
            "cannot share bus {:?} with module {:?} (line {}): hubs with standard ids use those of other boards and of commands to them; give hubs a bus of their own",
            head.buses[bus as usize],
            accepted.modules[other].name,
            source.line(&accepted.spans[other])
        );
        return refuse(&bus_name.span(), &problem);
    }
    let array = match protocol.takes_key("rows") {
        true => Some(array_size(source, module, module_span, protocol)?),
        false => None,
    };
    let not_alone =
        |m: &Wiring| m.protocol.has_board() && m.bus == bus && (array.is_some() || m.array.is_some());
    if let Some(other) = accepted.wiring.iter().position(not_alone) {
        let problem = format!(
            "cannot share bus {:?} with module {:?} (line {}): a pressure array has a socket of its own; give it a bus of its own",
            head.buses[bus as usize],
            accepted.modules[other].name,
            source.line(&accepted.spans[other])
        );
        return refuse(&bus_name.span(), &problem);
    }
    let icub = match &module.icub {
        Some(setup) => {
            if let Some(problem) = setup.get_ref().0.problem() {
                return refuse(&setup.span(), &problem);
            }
            Some(setup.get_ref().0)
        }
        None => protocol.takes_key("icub").then(IcubSetup::default),
    };
    let wiring = Wiring {
        bus,
        board,
        protocol,
        icub,
        hub,
        array,
    };
    Ok((wiring, board_span))
}

/// Rows and columns of a pressure array.
fn array_size(
    source: &Source<'_>,
    module: &FileModule,
    module_span: &Range<usize>,
    protocol: Protocol,
) -> Result<[u16; 2], LayoutError> {
    let most = protocol.taxel_numbers();
    let key = |problem: String| LayoutProblem::Key {
        module: module.name.clone(),
        protocol,
        problem,
    };
    let side = |name: &str, value: &Option<Spanned<i64>>| match value {
        None => source.refuse(module_span, key(format!("needs the key `{name}`"))),
        Some(value) => match u16::try_from(*value.get_ref()) {
            Ok(side) if (1..=most).contains(&side) => Ok(side),
            _ => {
                let problem = format!("has 1 to {most} {name}, not {}", value.get_ref());
                source.refuse(&value.span(), key(problem))
            }
        },
    };
    let [rows, columns] = [side("rows", &module.rows)?, side("columns", &module.columns)?];
    match u32::from(rows) * u32::from(columns) {
        taxels if taxels <= most.into() => Ok([rows, columns]),
        taxels => {
            let problem =
                format!("has {taxels} taxels in {rows} rows of {columns}; an array has {most} at most");
            source.refuse(module_span, key(problem))
        }
    }
}

/// The hub of a CySkin module, which must be on the module's bus.
fn find_hub(
    source: &Source<'_>,
    module: &FileModule,
    module_span: &Range<usize>,
    (bus, protocol): (u8, Protocol),
    head: &Head,
) -> Result<u8, LayoutError> {
    let Some(setup) = &head.cyskin else {
        return source.refuse(module_span, LayoutProblem::Cyskin(no_table()));
    };
    let known = || {
        let names: Vec<&str> = setup.hubs.iter().map(|hub| hub.name.as_str()).collect();
        names.join(", ")
    };
    let (span, problem) = match &module.hub {
        None => (
            module_span.clone(),
            format!("needs the key `hub`, one of {}", known()),
        ),
        Some(hub) => match setup.hubs.iter().position(|h| h.name == *hub.get_ref()) {
            None => (
                hub.span(),
                format!("names hub {:?}, but the hubs are {}", hub.get_ref(), known()),
            ),
            Some(index) if setup.hubs[index].bus != bus => (
                hub.span(),
                format!(
                    "names hub {:?}, which is on bus {:?}",
                    hub.get_ref(),
                    head.buses[setup.hubs[index].bus as usize]
                ),
            ),
            Some(index) => return Ok(index as u8),
        },
    };
    let problem = LayoutProblem::Key {
        module: module.name.clone(),
        protocol,
        problem,
    };
    source.refuse(&span, problem)
}
