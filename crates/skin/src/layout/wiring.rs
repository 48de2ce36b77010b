//! A hand's geometry, and how its boards are wired.

use super::error::LayoutError;
use crate::protocol::cyskin::setup::CyskinSetup;
use crate::protocol::icub::setup::IcubSetup;
use crate::protocol::{Protocol, WiredBoard};
use taxel_hand::{Geometry, Module};

/// A hand: its [`Geometry`], which it is to all who do not ask for wires, and the wiring of its
/// boards. Made from a layout file, or built in.
///
/// One module is one board, so a module's index also numbers its board.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Modules and taxels.
    pub geometry: Geometry,
    /// Names of the buses, in order; a module's wiring names its bus by index into this list.
    pub buses: Vec<String>,
    /// How each module's board is wired, in the order of [`Geometry::modules`].
    pub wiring: Vec<Wiring>,
    /// The board's own number for each taxel, in the order of [`Geometry::taxels`], as
    /// [`Protocol::frame_id`] takes it: `sda << 2 | chip` in L1 and L2 (from 16 on for chips 4 and 5),
    /// `sda << 4 | taxel` in L3, `triangle * 12 + pad` for the iCub, the sensor's number for CySkin, the
    /// channel for `cpm-finger`; for a pressure array its place, row by row; for an offline array, as a
    /// [`Layout::grid`] is, its place in the module.
    pub k: Vec<u16>,
    /// How the CySkin hubs of this hand speak; `None` where no module is of protocol `cyskin`.
    pub cyskin: Option<CyskinSetup>,
}

/// Where one module's board is, and how it speaks.
#[derive(Debug, Clone, PartialEq)]
pub struct Wiring {
    /// Index of its bus in [`Layout::buses`].
    pub bus: u8,
    /// Address of its board on that bus; of a CySkin module its number on its hub.
    pub board: u8,
    /// How its board speaks.
    pub protocol: Protocol,
    /// How its board is configured before it is started; `Some` exactly for the protocols
    /// `icub-mtb3` and `icub-mtb4`.
    pub icub: Option<IcubSetup>,
    /// Index of its hub in [`CyskinSetup::hubs`]; `Some` exactly for the protocol `cyskin`.
    pub hub: Option<u8>,
    /// Rows and columns of the frames that it sends; `Some` exactly for the protocol `pressure-array`.
    pub array: Option<[u16; 2]>,
}

impl std::ops::Deref for Layout {
    type Target = Geometry;

    fn deref(&self) -> &Geometry {
        &self.geometry
    }
}

impl Layout {
    /// A layout for an array without boards: [`Geometry::grid`], whose taxels are one pseudo module.
    pub fn grid(width: u16, height: u16) -> Result<Self, LayoutError> {
        Self::grid_of_cells(width, height, |_| true)
    }

    /// The same of an array in which only some cells are taxels ([`Geometry::grid_of_cells`]).
    pub fn grid_of_cells(
        width: u16,
        height: u16,
        is_taxel: impl Fn(usize) -> bool,
    ) -> Result<Self, LayoutError> {
        let geometry = Geometry::grid_of_cells(width, height, is_taxel);
        let geometry = geometry.map_err(|_| LayoutError::GridSize { width, height })?;
        Ok(Self {
            k: (0..geometry.len()).map(|k| k as u16).collect(),
            wiring: vec![Wiring {
                bus: 0,
                board: 0,
                protocol: Protocol::OFFLINE,
                icub: None,
                hub: None,
                array: None,
            }],
            geometry,
            buses: Vec::new(),
            cyskin: None,
        })
    }

    /// Each module's board: the module's index, its taxels, and its wiring.
    pub fn boards(&self) -> impl Iterator<Item = (u16, &Module, &Wiring)> {
        (0u16..)
            .zip(&self.modules)
            .zip(&self.wiring)
            .map(|((index, module), wiring)| (index, module, wiring))
    }

    /// The modules that have no board, whose taxels are columns of an array in a file alone.
    pub fn without_board(&self) -> impl Iterator<Item = &Module> {
        let of_file = self
            .boards()
            .filter(|(_, _, wiring)| !wiring.protocol.has_board());
        of_file.map(|(_, module, _)| module)
    }

    /// How the board of the module that a taxel belongs to is wired. `taxel` is below [`Geometry::len`].
    pub fn wiring_of(&self, taxel: usize) -> &Wiring {
        &self.wiring[usize::from(self.taxels[taxel].module)]
    }

    /// The boards' own numbers for the taxels of a module.
    pub fn k_of(&self, module: &Module) -> &[u16] {
        &self.k[module.taxel_range()]
    }

    /// Standard id of the frames that carry this taxel and nothing else on its module's bus; `None`
    /// for an offline array, and for boards that send several taxels in a frame.
    pub fn can_id(&self, taxel: usize) -> Option<u16> {
        let wiring = self.wiring_of(taxel);
        wiring.protocol.can_id(wiring.board, self.k[taxel])
    }

    /// The first module whose board has this address on this bus. L3 controllers are numbered apart
    /// from MTB boards, hence the protocol; CySkin modules are numbered by hub, so that there may
    /// be others.
    pub fn board(&self, bus: u8, board: u8, protocol: Protocol) -> Option<usize> {
        self.wiring
            .iter()
            .position(|m| m.bus == bus && m.board == board && m.protocol.has_addresses_of(protocol))
    }

    /// Frames that one sweep of every board puts on this bus. At 1 Mbit/s a bus carries 7,400 to
    /// 9,000 frames/s (docs/protocols.md, "Bus timing"), which bounds the sweep rate. For CySkin it
    /// is an estimate: which modules a hub puts into one packet is not public.
    pub fn frames_per_sweep(&self, bus: u8) -> usize {
        self.frames_hz(bus, |_| 1.0) as usize
    }

    /// Frames per second on this bus if its boards send as many sweeps per second as `sweeps_hz` says of each.
    pub fn frames_hz(&self, bus: u8, sweeps_hz: impl Fn(&Wiring) -> f64) -> f64 {
        let frames = |module, wiring: &Wiring| wiring.protocol.0.frames_per_sweep(self.k_of(module)) as f64;
        self.boards()
            .filter(|(_, _, wiring)| wiring.bus == bus)
            .map(|(_, module, wiring)| frames(module, wiring) * sweeps_hz(wiring))
            .sum()
    }

    /// Rows and columns of the pressure array on a bus (index), if there is one; it is alone there.
    pub fn array_on(&self, bus: usize) -> Option<[u16; 2]> {
        let of_bus = self.wiring.iter().filter(|wiring| usize::from(wiring.bus) == bus);
        of_bus.filter_map(|wiring| wiring.array).next()
    }

    /// Whether the board of a module (index) is told to start; others send from power-up on.
    pub fn is_started(&self, module: usize) -> bool {
        let wiring = &self.wiring[module];
        wiring
            .protocol
            .0
            .sequences(&self.wired_board(module as u16))
            .is_some()
    }

    /// The board of a module, as its protocol sees it.
    pub(crate) fn wired_board(&self, module: u16) -> WiredBoard<'_> {
        let (of_module, wiring) = (
            &self.modules[usize::from(module)],
            &self.wiring[usize::from(module)],
        );
        let setup = self.cyskin.as_ref().zip(wiring.hub);
        WiredBoard {
            module,
            address: wiring.board,
            icub: wiring.icub.as_ref(),
            hub: setup.and_then(|(setup, hub)| Some((setup, setup.hubs.get(usize::from(hub))?))),
            array: wiring.array,
            first_taxel: of_module.first_taxel,
            k: self.k_of(of_module),
        }
    }

    /// Whether a bus has a board of the address of this one, or a hub of the address of its hub.
    pub(crate) fn has_address_of(&self, board: &Wiring, bus: u8) -> bool {
        if let (Some(setup), Some(hub)) = (&self.cyskin, board.hub) {
            let address = setup.hubs[usize::from(hub)].address;
            return setup
                .hubs
                .iter()
                .any(|hub| (hub.bus, hub.address) == (bus, address));
        }
        self.board(bus, board.board, board.protocol).is_some()
    }
}

impl Wiring {
    /// Sweeps per second of the board when it runs by itself, by what is public of it; `None` where
    /// nothing is.
    pub fn nominal_hz(&self) -> Option<f64> {
        self.protocol.0.nominal_hz(self.icub.as_ref())
    }

    /// Whether the board can be started for every sweep.
    pub fn can_be_triggered(&self) -> bool {
        self.protocol.mtb().is_some_and(|mtb| !mtb.configured)
    }

    /// Whether anything can be sent to the board or its hub, by what is known of it.
    pub fn takes_commands(&self) -> bool {
        self.protocol.mtb().is_some() || self.hub.is_some()
    }
}
