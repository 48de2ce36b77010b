//! A hand as the layout file describes it: its geometry, and how its boards are wired.

mod board;
mod error;
mod file;
mod pose;
mod tile;

pub use error::{LayoutError, LayoutProblem};

use crate::protocol::Protocol;
use crate::protocol::cyskin::CyskinSetup;
use crate::protocol::icub::IcubSetup;
use std::path::Path;
use taxel_hand::{Geometry, Module};

const BUILTIN: [(&str, &str); 8] = [
    (
        "allegro-uskin-15",
        include_str!("../../layouts/allegro-uskin-15.toml"),
    ),
    (
        "allegro-xela-18",
        include_str!("../../layouts/allegro-xela-18.toml"),
    ),
    ("cpm-finger", include_str!("../../layouts/cpm-finger.toml")),
    (
        "cyskin-triangle",
        include_str!("../../layouts/cyskin-triangle.toml"),
    ),
    ("icub-forearm", include_str!("../../layouts/icub-forearm.toml")),
    ("schunk-sdh", include_str!("../../layouts/schunk-sdh.toml")),
    (
        "uskin-fingertip",
        include_str!("../../layouts/uskin-fingertip.toml"),
    ),
    ("uskin-module", include_str!("../../layouts/uskin-module.toml")),
];

/// A hand: its [`Geometry`], which it is to all who do not ask for wires, and the wiring of its boards. Made from a
/// layout file, or built in.
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
    /// The board's own number for each taxel, in the order of [`Geometry::taxels`], as [`Protocol::frame_id`] takes it:
    /// `sda << 2 | chip` in L1 and L2, `sda << 4 | taxel` in L3, `triangle * 12 + pad` for the iCub, the sensor's number
    /// for CySkin, the channel for `cpm-finger`; for an offline array its place in the module, and 0 in a
    /// [`Layout::grid`].
    pub k: Vec<u8>,
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
    /// How its board is configured before it is started; `Some` exactly for the protocols `icub-mtb3` and `icub-mtb4`.
    pub icub: Option<IcubSetup>,
    /// Index of its hub in [`CyskinSetup::hubs`]; `Some` exactly for the protocol `cyskin`.
    pub hub: Option<u8>,
}

impl std::ops::Deref for Layout {
    type Target = Geometry;

    fn deref(&self) -> &Geometry {
        &self.geometry
    }
}

impl Layout {
    /// Checks the text of a layout file. `file_name` is only for messages.
    pub fn parse(text: &str, file_name: &str) -> Result<Self, LayoutError> {
        file::parse(text, file_name)
    }

    /// Reads and checks a layout file.
    pub fn load(path: &Path) -> Result<Self, LayoutError> {
        let text = std::fs::read_to_string(path).map_err(|source| LayoutError::Read {
            path: path.display().to_string(),
            source,
        })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// The hand built in under this name; `None` where there is none ([`Layout::builtin_names`]).
    pub fn builtin(name: &str) -> Option<Self> {
        let (_, text) = BUILTIN.iter().find(|(n, _)| *n == name)?;
        Self::parse(text, &format!("{name}.toml")).ok()
    }

    /// The names [`Layout::builtin`] knows; the first is the default hand.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// The file a built-in hand is made from, to start a layout of one's own.
    pub fn builtin_text(name: &str) -> Option<&'static str> {
        BUILTIN.iter().find(|(n, _)| *n == name).map(|(_, text)| *text)
    }

    /// The layout that a user names: a built-in hand, `grid:HxW`, or the path of a layout file, tried in this order.
    pub fn resolve(name_or_path: &str) -> Result<Self, LayoutError> {
        if let Some(layout) = Self::builtin(name_or_path) {
            return Ok(layout);
        }
        if let Some(size) = name_or_path.strip_prefix("grid:") {
            let bad = || LayoutError::BadGrid(name_or_path.to_string());
            let (height, width) = size.split_once('x').ok_or_else(bad)?;
            return Self::grid(
                width.parse().map_err(|_| bad())?,
                height.parse().map_err(|_| bad())?,
            );
        }
        let path = Path::new(name_or_path);
        if !path.exists() {
            return Err(LayoutError::Unknown {
                name: name_or_path.to_string(),
                builtin: Self::builtin_names().collect::<Vec<_>>().join(", "),
            });
        }
        Self::load(path)
    }

    /// A layout for an array without boards: [`Geometry::grid`], whose taxels are one pseudo module.
    pub fn grid(width: u16, height: u16) -> Result<Self, LayoutError> {
        let geometry = Geometry::grid(width, height).map_err(|_| LayoutError::GridSize { width, height })?;
        Ok(Self {
            k: vec![0; geometry.len()],
            wiring: vec![Wiring {
                bus: 0,
                board: 0,
                protocol: Protocol::Offline,
                icub: None,
                hub: None,
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

    /// How the board of the module that a taxel belongs to is wired. `taxel` is below [`Geometry::len`].
    pub fn wiring_of(&self, taxel: usize) -> &Wiring {
        &self.wiring[usize::from(self.taxels[taxel].module)]
    }

    /// The boards' own numbers for the taxels of a module.
    pub fn k_of(&self, module: &Module) -> &[u8] {
        &self.k[module.taxel_range()]
    }

    /// Standard id of the frames that carry this taxel and nothing else on its module's bus; `None` for an offline
    /// array, and for boards that send several taxels in a frame.
    pub fn can_id(&self, taxel: usize) -> Option<u16> {
        let wiring = self.wiring_of(taxel);
        wiring.protocol.can_id(wiring.board, self.k[taxel])
    }

    /// The first module whose board has this address on this bus. L3 controllers are numbered apart from MTB boards,
    /// hence the protocol; CySkin modules are numbered by hub, so that there may be others.
    pub fn board(&self, bus: u8, board: u8, protocol: Protocol) -> Option<usize> {
        self.wiring
            .iter()
            .position(|m| m.bus == bus && m.board == board && m.protocol.has_addresses_of(protocol))
    }

    /// Frames that one sweep of every board puts on this bus. At 1 Mbit/s a bus carries 7,400 to 9,000 frames/s
    /// (protocols.md 2.5), which bounds the sweep rate. For CySkin it is an estimate: which modules a hub puts into
    /// one packet is not public.
    pub fn frames_per_sweep(&self, bus: u8) -> usize {
        self.boards()
            .filter(|(_, _, wiring)| wiring.bus == bus)
            .map(|(_, module, wiring)| match wiring.protocol {
                Protocol::Offline => 0,
                Protocol::UskinL1 | Protocol::UskinL2 | Protocol::UskinL3 => module.taxels as usize,
                Protocol::IcubMtb3 | Protocol::IcubMtb4 => 2 * self.triangles(module).count_ones() as usize,
                Protocol::CpmFinger => 5,
                Protocol::Cyskin => (module.taxels as usize * 2 + 7).div_ceil(7),
            })
            .sum()
    }

    /// The triangles of an iCub board that have taxels in the layout, a bit each.
    pub fn triangles(&self, module: &Module) -> u16 {
        self.k_of(module)
            .iter()
            .fold(0, |set, k| set | 1 << ((k / crate::protocol::icub::PADS) & 15))
    }
}
