//! Which taxel sits where: on which bus and board, at which pixel of the tactile image, where on the hand.

use crate::layout_error::LayoutError;
use crate::protocol::Protocol;
use crate::protocol::cyskin::CyskinSetup;
use crate::protocol::icub::IcubSetup;
use std::path::Path;

/// Most modules in a layout.
pub const MAX_MODULES: usize = 1000;
/// Most taxels in a layout: their numbers fit in 16 bits with one left over for "none".
pub const MAX_TAXELS: usize = 65_535;
/// Most pixels in a tactile image: a strip 65,535 pixels long and 16 high just fits.
pub const MAX_PIXELS: usize = 1 << 20;

const NO_TAXEL: u16 = u16::MAX;

const BUILTIN: [(&str, &str); 8] = [
    (
        "allegro-uskin-15",
        include_str!("../layouts/allegro-uskin-15.toml"),
    ),
    ("allegro-xela-18", include_str!("../layouts/allegro-xela-18.toml")),
    ("cpm-finger", include_str!("../layouts/cpm-finger.toml")),
    ("cyskin-triangle", include_str!("../layouts/cyskin-triangle.toml")),
    ("icub-forearm", include_str!("../layouts/icub-forearm.toml")),
    ("schunk-sdh", include_str!("../layouts/schunk-sdh.toml")),
    ("uskin-fingertip", include_str!("../layouts/uskin-fingertip.toml")),
    ("uskin-module", include_str!("../layouts/uskin-module.toml")),
];

/// A hand: its buses, its modules, and every taxel's place. Made from a layout file, or built in.
///
/// Taxels are numbered `0..N` in the order of `modules`, and within a module by the board's own number `k`.
/// One module is one board, so a module's index also numbers its board.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Name of the hand, such as `allegro-uskin-15`.
    pub name: String,
    /// Width of the tactile image, pixels.
    pub width: u16,
    /// Height of the tactile image, pixels.
    pub height: u16,
    /// Names of the buses, in order; a module names its bus by index into this list.
    pub buses: Vec<String>,
    /// The modules, in the order of the file.
    pub modules: Vec<Module>,
    /// The taxels, indexed by taxel number.
    pub taxels: Vec<Taxel>,
    /// How the CySkin hubs of this hand speak; `None` where no module is of protocol `cyskin`.
    pub cyskin: Option<CyskinSetup>,
    /// Taxel of each pixel, row by row; `NO_TAXEL` where there is none.
    pixels: Vec<u16>,
}

/// One board's patch of taxels.
#[derive(Debug, Clone, PartialEq)]
pub struct Module {
    /// Name for people, such as `index tip`.
    pub name: String,
    /// Part of the hand it belongs to, such as `index`; actuators of different parts are not neighbours.
    pub part: String,
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
    /// Number of its first taxel in the layout.
    pub first_taxel: u16,
    /// How many taxels it has.
    pub taxels: u16,
}

/// One taxel's place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taxel {
    /// Index of its module in [`Layout::modules`].
    pub module: u16,
    /// The board's own number for it, as [`Protocol::frame_id`] takes it: `sda << 2 | chip` in L1 and L2,
    /// `sda << 4 | taxel` in L3, `triangle * 12 + pad` for the iCub, the sensor's number for CySkin, the channel for
    /// `cpm-finger`; for an offline array its place in the module, and 0 in a [`Layout::grid`].
    pub k: u8,
    /// Column in the tactile image, from the left.
    pub x: u16,
    /// Row in the tactile image, from the top.
    pub y: u16,
    /// Place on the hand, millimetres, where known.
    pub position_mm: Option<[f32; 3]>,
}

impl Layout {
    /// Checks the text of a layout file. `file_name` is only for messages.
    pub fn parse(text: &str, file_name: &str) -> Result<Self, LayoutError> {
        crate::layout_file::parse(text, file_name)
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

    /// A layout for an array without boards: one taxel per pixel, numbered row by row, in one pseudo module.
    ///
    /// Refuses empty arrays and those of more than [`MAX_TAXELS`] taxels.
    pub fn grid(width: u16, height: u16) -> Result<Self, LayoutError> {
        let count = width as usize * height as usize;
        if count == 0 || count > MAX_TAXELS {
            return Err(LayoutError::GridSize { width, height });
        }
        let module = Module {
            name: "grid".into(),
            part: "grid".into(),
            bus: 0,
            board: 0,
            protocol: Protocol::Offline,
            icub: None,
            hub: None,
            first_taxel: 0,
            taxels: count as u16,
        };
        let taxels = (0..count)
            .map(|i| Taxel {
                module: 0,
                k: 0,
                x: (i % width as usize) as u16,
                y: (i / width as usize) as u16,
                position_mm: None,
            })
            .collect();
        Ok(Self::assemble(
            format!("grid:{height}x{width}"),
            [width, height],
            Vec::new(),
            vec![module],
            taxels,
            None,
        ))
    }

    /// Puts checked parts together; every taxel lies in the image, no two on one pixel.
    pub(crate) fn assemble(
        name: String,
        [width, height]: [u16; 2],
        buses: Vec<String>,
        modules: Vec<Module>,
        taxels: Vec<Taxel>,
        cyskin: Option<CyskinSetup>,
    ) -> Self {
        let mut pixels = vec![NO_TAXEL; width as usize * height as usize];
        for (i, taxel) in taxels.iter().enumerate() {
            pixels[taxel.y as usize * width as usize + taxel.x as usize] = i as u16;
        }
        Self {
            name,
            width,
            height,
            buses,
            modules,
            taxels,
            cyskin,
            pixels,
        }
    }

    /// Number of taxels, `N`.
    pub fn len(&self) -> usize {
        self.taxels.len()
    }

    /// Whether there is no taxel; never so for a layout that parsed.
    pub fn is_empty(&self) -> bool {
        self.taxels.is_empty()
    }

    /// The taxel at this pixel; `None` where the image is padding, and outside it.
    pub fn taxel_at(&self, x: u16, y: u16) -> Option<usize> {
        if x >= self.width {
            return None;
        }
        let taxel = *self.pixels.get(y as usize * self.width as usize + x as usize)?;
        (taxel != NO_TAXEL).then_some(taxel as usize)
    }

    /// The module a taxel belongs to. `taxel` is below [`Layout::len`].
    pub fn module_of(&self, taxel: usize) -> &Module {
        &self.modules[self.taxels[taxel].module as usize]
    }

    /// Standard id of the frames that carry this taxel and nothing else on its module's bus; `None` for an offline
    /// array, and for boards that send several taxels in a frame.
    pub fn can_id(&self, taxel: usize) -> Option<u16> {
        let module = self.module_of(taxel);
        module.protocol.can_id(module.board, self.taxels[taxel].k)
    }

    /// The first module whose board has this address on this bus. L3 controllers are numbered apart from MTB boards,
    /// hence the protocol; CySkin modules are numbered by hub, so that there may be others.
    pub fn board(&self, bus: u8, board: u8, protocol: Protocol) -> Option<usize> {
        self.modules
            .iter()
            .position(|m| m.bus == bus && m.board == board && m.protocol.has_addresses_of(protocol))
    }

    /// Frames that one sweep of every board puts on this bus. At 1 Mbit/s a bus carries 7,400 to 9,000 frames/s
    /// (protocols.md 2.5), which bounds the sweep rate. For CySkin it is an estimate: which modules a hub puts into
    /// one packet is not public.
    pub fn frames_per_sweep(&self, bus: u8) -> usize {
        let modules = self.modules.iter().filter(|m| m.bus == bus);
        modules
            .map(|m| match m.protocol {
                Protocol::Offline => 0,
                Protocol::UskinL1 | Protocol::UskinL2 | Protocol::UskinL3 => m.taxels as usize,
                Protocol::IcubMtb3 | Protocol::IcubMtb4 => 2 * self.triangles(m).count_ones() as usize,
                Protocol::CpmFinger => 5,
                Protocol::Cyskin => (m.taxels as usize * 2 + 7).div_ceil(7),
            })
            .sum()
    }

    /// The triangles of an iCub board that have taxels in the layout, a bit each.
    pub fn triangles(&self, module: &Module) -> u16 {
        let first = module.first_taxel as usize;
        let taxels = &self.taxels[first..first + module.taxels as usize];
        taxels.iter().fold(0, |set, taxel| {
            set | 1 << ((taxel.k / crate::protocol::icub::PADS) & 15)
        })
    }
}
