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
    span: &Range<usize>,
    head: &Head,
    accepted: &Accepted,
) -> Result<(Wiring, Range<usize>), LayoutError> {
    let Some(protocol) = Protocol::from_name(module.protocol.get_ref()) else {
        let problem = LayoutProblem::UnknownProtocol {
            module: module.name.clone(),
            protocol: module.protocol.get_ref().clone(),
        };
        return source.refuse(&module.protocol.span(), problem);
    };
    let board = Board {
        source,
        module,
        span,
        protocol,
        head,
        accepted,
    };
    board.refuse_useless_keys()?;
    let wiring = Wiring {
        bus: 0,
        board: 0,
        protocol,
        icub: None,
        hub: None,
        array: None,
    };
    if !protocol.has_board() {
        return Ok((wiring, span.clone()));
    }
    let (bus, bus_span) = board.find_bus()?;
    let (address, address_span) = board.address()?;
    let wiring = Wiring {
        bus,
        board: address,
        hub: board.find_hub(bus)?,
        ..wiring
    };
    board.refuse_same(&wiring, &address_span)?;
    board.refuse_beside_hubs(&wiring, &bus_span)?;
    let wiring = Wiring {
        array: board.array_size()?,
        ..wiring
    };
    board.refuse_beside_array(&wiring, &bus_span)?;
    let icub = board.icub_setup()?;
    Ok((Wiring { icub, ..wiring }, address_span))
}

/// A module's keys, its place in the file, and what they are checked against.
struct Board<'a> {
    source: &'a Source<'a>,
    module: &'a FileModule,
    span: &'a Range<usize>,
    protocol: Protocol,
    head: &'a Head,
    accepted: &'a Accepted,
}

impl Board<'_> {
    fn refuse<T>(&self, span: &Range<usize>, problem: impl Into<String>) -> Result<T, LayoutError> {
        let problem = LayoutProblem::Key {
            module: self.module.name.clone(),
            protocol: self.protocol,
            problem: problem.into(),
        };
        self.source.refuse(span, problem)
    }

    fn refuse_useless_keys(&self) -> Result<(), LayoutError> {
        let FileModule {
            bus,
            board,
            icub,
            hub,
            rows,
            columns,
            ..
        } = self.module;
        for (key, span) in [
            ("icub", icub.as_ref().map(Spanned::span)),
            ("hub", hub.as_ref().map(Spanned::span)),
            ("rows", rows.as_ref().map(Spanned::span)),
            ("columns", columns.as_ref().map(Spanned::span)),
        ] {
            if let Some(span) = span.filter(|_| !self.protocol.takes_key(key)) {
                return self.refuse(&span, format!("has no use for the key `{key}`"));
            }
        }
        let place = bus.as_ref().map(Spanned::span);
        match place.or(board.as_ref().map(Spanned::span)) {
            Some(span) if !self.protocol.has_board() => {
                self.refuse(&span, "has neither bus nor board; remove the key")
            }
            _ => Ok(()),
        }
    }

    fn find_bus(&self) -> Result<(u8, Range<usize>), LayoutError> {
        let Some(name) = &self.module.bus else {
            return self.refuse(self.span, "needs the key `bus`");
        };
        match self.head.buses.iter().position(|bus| bus == name.get_ref()) {
            Some(bus) => Ok((bus as u8, name.span())),
            None => {
                let problem = LayoutProblem::UnknownBus {
                    module: self.module.name.clone(),
                    bus: name.get_ref().clone(),
                    known: self.head.buses.join(", "),
                };
                self.source.refuse(&name.span(), problem)
            }
        }
    }

    fn address(&self) -> Result<(u8, Range<usize>), LayoutError> {
        let addresses = self.protocol.addresses();
        let (board, span) = match &self.module.board {
            Some(board) => (*board.get_ref(), board.span()),
            None if self.protocol.takes_key("board") => {
                return self.refuse(self.span, "needs the key `board`");
            }
            None => (addresses.start.into(), self.span.clone()),
        };
        if board < addresses.start.into() || board >= addresses.end.into() {
            let problem = LayoutProblem::BoardOutOfRange {
                module: self.module.name.clone(),
                board,
                protocol: self.protocol,
            };
            return self.source.refuse(&span, problem);
        }
        Ok((board as u8, span))
    }

    /// The hub of a CySkin module, which must be on the module's bus.
    fn find_hub(&self, bus: u8) -> Result<Option<u8>, LayoutError> {
        if !self.protocol.takes_key("hub") {
            return Ok(None);
        }
        let Some(setup) = &self.head.cyskin else {
            return self.source.refuse(self.span, LayoutProblem::Cyskin(no_table()));
        };
        let known = || {
            let names: Vec<&str> = setup.hubs.iter().map(|hub| hub.name.as_str()).collect();
            names.join(", ")
        };
        let Some(hub) = &self.module.hub else {
            return self.refuse(self.span, format!("needs the key `hub`, one of {}", known()));
        };
        let name = hub.get_ref();
        let problem = match setup.hubs.iter().position(|h| h.name == *name) {
            None => format!("names hub {name:?}, but the hubs are {}", known()),
            Some(index) if setup.hubs[index].bus != bus => {
                let bus = &self.head.buses[setup.hubs[index].bus as usize];
                format!("names hub {name:?}, which is on bus {bus:?}")
            }
            Some(index) => return Ok(Some(index as u8)),
        };
        self.refuse(&hub.span(), problem)
    }

    fn refuse_same(&self, wiring: &Wiring, span: &Range<usize>) -> Result<(), LayoutError> {
        let same = |m: &Wiring| {
            (m.bus, m.board, m.hub) == (wiring.bus, wiring.board, wiring.hub)
                && m.protocol.has_addresses_of(self.protocol)
        };
        let Some(other) = self.accepted.wiring.iter().position(same) else {
            return Ok(());
        };
        let problem = LayoutProblem::SameBoard {
            module: self.module.name.clone(),
            bus: self.head.buses[wiring.bus as usize].clone(),
            board: wiring.board,
            other: self.accepted.modules[other].name.clone(),
            other_line: self.source.line(&self.accepted.spans[other]),
        };
        self.source.refuse(span, problem)
    }

    /// A middle frame of a hub's packet would be a command to an MTB, and its other ids are those of data.
    fn refuse_beside_hubs(&self, wiring: &Wiring, span: &Range<usize>) -> Result<(), LayoutError> {
        let hubs = self.head.cyskin.as_ref();
        if hubs.is_none_or(|setup| setup.ids != HubIds::Standard) {
            return Ok(());
        }
        let why = "hubs with standard ids use those of other boards and of commands to them; give hubs a bus of their own";
        self.refuse_beside(wiring, |m| m.hub.is_some() != wiring.hub.is_some(), span, why)
    }

    fn refuse_beside_array(&self, wiring: &Wiring, span: &Range<usize>) -> Result<(), LayoutError> {
        let why = "a pressure array has a socket of its own; give it a bus of its own";
        self.refuse_beside(wiring, |m| m.array.is_some() || wiring.array.is_some(), span, why)
    }

    /// Refuses a bus that such a board is on already.
    fn refuse_beside(
        &self,
        wiring: &Wiring,
        such: impl Fn(&Wiring) -> bool,
        span: &Range<usize>,
        why: &str,
    ) -> Result<(), LayoutError> {
        let mut before = self.accepted.wiring.iter();
        match before.position(|m| m.protocol.has_board() && m.bus == wiring.bus && such(m)) {
            None => Ok(()),
            Some(other) => self.refuse(
                span,
                format!(
                    "cannot share bus {:?} with module {:?} (line {}): {why}",
                    self.head.buses[wiring.bus as usize],
                    self.accepted.modules[other].name,
                    self.source.line(&self.accepted.spans[other])
                ),
            ),
        }
    }

    /// Rows and columns of a pressure array.
    fn array_size(&self) -> Result<Option<[u16; 2]>, LayoutError> {
        if !self.protocol.takes_key("rows") {
            return Ok(None);
        }
        let most = self.protocol.taxel_numbers();
        let side = |name: &str, value: &Option<Spanned<i64>>| match value {
            None => self.refuse(self.span, format!("needs the key `{name}`")),
            Some(value) => match u16::try_from(*value.get_ref()) {
                Ok(side) if (1..=most).contains(&side) => Ok(side),
                _ => self.refuse(
                    &value.span(),
                    format!("has 1 to {most} {name}, not {}", value.get_ref()),
                ),
            },
        };
        let rows = side("rows", &self.module.rows)?;
        let columns = side("columns", &self.module.columns)?;
        match u32::from(rows) * u32::from(columns) {
            taxels if taxels <= most.into() => Ok(Some([rows, columns])),
            taxels => self.refuse(
                self.span,
                format!("has {taxels} taxels in {rows} rows of {columns}; an array has {most} at most"),
            ),
        }
    }

    fn icub_setup(&self) -> Result<Option<IcubSetup>, LayoutError> {
        let Some(setup) = &self.module.icub else {
            return Ok(self.protocol.takes_key("icub").then(IcubSetup::default));
        };
        match setup.get_ref().0.problem() {
            Some(problem) => self.refuse(&setup.span(), problem),
            None => Ok(Some(setup.get_ref().0)),
        }
    }
}
