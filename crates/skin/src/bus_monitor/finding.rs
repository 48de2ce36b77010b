//! What can be found in the traffic of a bus.

use crate::protocol::Protocol;

/// Something that is wrong on a bus. Rates and shares are of the newest window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finding {
    /// One identifier takes so much of a bus that those behind it starve: a node babbles.
    IdBabbles {
        /// Index of the bus in [`crate::Layout::buses`].
        bus: u8,
        /// The identifier.
        id: u32,
        /// Whether it has 29 bits.
        extended: bool,
        /// Module (index) whose board the identifier belongs to; `None` for a node that is not of the hand.
        module: Option<u16>,
        /// Frames per second.
        rate_hz: f64,
        /// Share of a bus of 1 Mbit/s, 0 to 1, stuff bits not counted.
        share: f64,
    },
    /// A board sends its sweeps far more often than its like, and fills the bus.
    BoardBabbles {
        /// Its module (index).
        module: u16,
        /// Frames per second.
        rate_hz: f64,
        /// Share of a bus of 1 Mbit/s, 0 to 1, stuff bits not counted.
        share: f64,
        /// Sweeps per second of the board, and of its like.
        sweeps_hz: [f64; 2],
    },
    /// Two boards answer under one address: its taxels alternate between two values, and come twice as often as they
    /// should, or have alternated for long.
    TwoBoards {
        /// The module (index) whose address it is.
        module: u16,
        /// Sweeps per second under that address, and what one board sends; the same again where nobody knows.
        sweeps_hz: [f64; 2],
    },
    /// A board speaks on another bus than the layout says, and not on its own.
    OnOtherBus {
        /// Its module (index).
        module: u16,
        /// The bus (index) it speaks on.
        bus: u8,
    },
    /// Every board that tells two buses apart speaks on the other one of them.
    BusesSwapped {
        /// The buses (indices), the lower first.
        buses: [u8; 2],
        /// Of the boards that are on the other bus, the first one's module (index).
        module: u16,
        /// How many such boards there are. One may as well be a single board on the wrong bus.
        boards: u16,
    },
    /// A board speaks under an address that the layout does not have on this bus, nor on another
    /// one that lacks it.
    NotInLayout {
        /// The bus (index).
        bus: u8,
        /// The protocol it speaks.
        protocol: Protocol,
        /// Its address.
        address: u32,
    },
    /// A CySkin hub of the layout sends values of modules that the layout does not have on it.
    ModulesNotInLayout {
        /// The hub (index in the layout's [`crate::CyskinSetup::hubs`]).
        hub: u8,
        /// Of these modules, the lowest number on the hub.
        number: u8,
        /// How many such modules there are.
        modules: u16,
    },
}

/// How much a bus carried in the newest window.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct BusLoad {
    /// Data and remote frames per second.
    pub frames_hz: f64,
    /// Share of a bus of 1 Mbit/s, without stuff bits.
    pub share: f64,
    /// The same with as many stuff bits as there can be; what it really was lies between the two
    /// (docs/protocols.md, "Bus timing").
    pub share_most: f64,
}
