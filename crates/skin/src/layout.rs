//! Which taxel sits where: on which bus and board, at which pixel of the tactile image, where on the hand.

/// A hand: its buses, its modules, and every taxel's place. Made from a layout file, or built in.
///
/// Taxels are numbered `0..N` in the order of `modules`, and within a module by the board's own number `k`.
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
    /// Address of its board on that bus.
    pub board: u8,
    /// How its board speaks.
    pub protocol: Protocol,
    /// Number of its first taxel in the layout.
    pub first_taxel: u16,
    /// How many taxels it has.
    pub taxels: u16,
}

/// How a board speaks on the bus (protocols.md 2.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Protocol {
    /// uSkin on MTB3, firmware of 2017: id `0x700 + (board << 4) + (sda << 2) + chip`.
    UskinL1,
    /// uSkin on MTB3, since April 2018: id `(board << 8) + (sda << 4) + chip`, boards 0 to 7.
    UskinL2,
    /// XELA controllers with `ctr_ver = 3`: id bits 10 group, 9-8 SDA, 7-4 taxel, 3-0 controller.
    UskinL3,
}

/// One taxel's place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taxel {
    /// Index of its module in [`Layout::modules`].
    pub module: u16,
    /// The board's own number for it; for uSkin `k = sda << 2 | chip`.
    pub k: u8,
    /// Column in the tactile image, from the left.
    pub x: u16,
    /// Row in the tactile image, from the top.
    pub y: u16,
    /// Place on the hand, millimetres, where known.
    pub position_mm: Option<[f32; 3]>,
}
