//! How boards speak on the bus (docs/protocols.md): a folder per kind, and the list of them.
//!
//! A new protocol is a folder with an implementation of `BoardProtocol`, a constant and a line in
//! the list. Nothing else in this crate asks which protocol it has before it.

pub(crate) mod board_decoder;
pub(crate) mod board_protocol;
pub(crate) mod commands;
pub(crate) mod cpm_finger;
pub(crate) mod cyskin;
pub(crate) mod icub;
pub(crate) mod id_table;
pub(crate) mod mtb;
mod offline;
pub(crate) mod pressure_array;
pub(crate) mod recognised;
pub(crate) mod uskin;
mod wired_board;

pub use board_protocol::{Measures, Mtb, Protocol};
pub(crate) use board_protocol::{Order, at_end};
pub(crate) use wired_board::WiredBoard;

use recognised::Recognise;

impl Protocol {
    /// uSkin on MTB3, firmware of 2017: id `0x700 + (board << 4) + (sda << 2) + chip`.
    pub const USKIN_L1: Self = Self(&uskin::L1);
    /// uSkin on MTB3, since April 2018, and XELA 4x6 modules with such ids: id
    /// `(board << 8) + (sda << 4) + chip`, boards 0 to 7.
    pub const USKIN_L2: Self = Self(&uskin::L2);
    /// XELA controllers with `ctr_ver = 3`: id bits 10 group, 9-8 SDA, 7-4 taxel, 3-0 controller.
    pub const USKIN_L3: Self = Self(&uskin::L3);
    /// iCub skin on an MTB3: id `0x400 | board << 4 | triangle`, twice per triangle and sweep,
    /// boards 1 to 14.
    pub const ICUB_MTB3: Self = Self(&icub::MTB3);
    /// iCub skin on an MTB4: the frames of an MTB3, but a triangle that fails is calibrated anew by
    /// the board itself.
    pub const ICUB_MTB4: Self = Self(&icub::MTB4);
    /// One module of a CySkin hub: packets that several frames may carry, as Genoa's own CAN library
    /// drives hubs or as the layout has it ([`crate::CyskinSetup`]).
    pub const CYSKIN: Self = Self(&cyskin::Cyskin);
    /// The published finger with CySkin-type sensors: ids 0x405, 0x407, 0x409, 0x40B, four values each.
    pub const CPM_FINGER: Self = Self(&cpm_finger::CpmFinger);
    /// An array of pressure sensors whose frames a program sends over a Unix socket: no CAN at all, but the source cuts
    /// each into CAN frames (docs/protocols.md, "Pressure arrays").
    pub const PRESSURE_ARRAY: Self = Self(&pressure_array::PressureArray);
    /// No board: the taxels come from an array in a file ([`crate::Layout::grid`]).
    pub const OFFLINE: Self = Self(&offline::Offline);
}

/// Every protocol, in the order in which messages name them.
const LIST: &[Protocol] = &[
    Protocol::USKIN_L1,
    Protocol::USKIN_L2,
    Protocol::USKIN_L3,
    Protocol::ICUB_MTB3,
    Protocol::ICUB_MTB4,
    Protocol::CYSKIN,
    Protocol::CPM_FINGER,
    Protocol::PRESSURE_ARRAY,
    Protocol::OFFLINE,
];

/// What finds boards with standard ids in the traffic of an unknown bus, in the order in which they
/// are asked: each takes out what it knows for certain before the next one guesses. CySkin's
/// packets have extended ids and are apart.
pub(crate) const RECOGNISERS: &[Recognise] = &[
    icub::recognise::take_boards,
    uskin::recognise::take_boards,
    cpm_finger::recognise::take_boards,
];

impl Protocol {
    /// The protocols that boards speak, in the order in which messages name them.
    pub fn boards() -> impl Iterator<Item = Self> {
        LIST.iter().copied().filter(|protocol| protocol.has_board())
    }

    /// The protocol of this name, `offline` included.
    pub fn from_name(name: &str) -> Option<Self> {
        LIST.iter().copied().find(|protocol| protocol.name() == name)
    }

    /// Its place in the list, for tables by protocol.
    pub fn index(self) -> usize {
        LIST.iter()
            .position(|protocol| *protocol == self)
            .unwrap_or(LIST.len())
    }

    /// The names of all protocols, `offline` included, for messages.
    pub(crate) fn names() -> String {
        let names: Vec<&str> = LIST.iter().map(|protocol| protocol.name()).collect();
        names.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_can::CanFrame;

    #[test]
    fn every_name_is_the_name_of_one_protocol() {
        for protocol in Protocol::boards().chain([Protocol::OFFLINE]) {
            assert_eq!(Protocol::from_name(protocol.name()), Some(protocol));
            let same = LIST.iter().filter(|other| **other == protocol);
            assert_eq!(same.count(), 1, "{protocol:?}");
        }
        assert_eq!(Protocol::from_name("icub"), None);
    }

    #[test]
    fn a_filter_passes_every_frame_of_its_board() {
        for protocol in Protocol::boards() {
            for board in 0..=u8::MAX {
                for k in 0..=u16::from(u8::MAX) {
                    let Some(id) = protocol.frame_id(board, k) else {
                        continue;
                    };
                    let frame = CanFrame::standard(id, &[]).expect("11 bits");
                    let filter = protocol.filter(board).expect("it has such a board");
                    assert!(filter.passes(&frame), "{protocol:?} board {board} k {k}");
                    assert_eq!(protocol.board_of(id), Some(board), "{protocol:?} {id:#x}");
                }
            }
        }
    }
}
