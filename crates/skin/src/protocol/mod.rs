//! How boards speak on the bus, one file per protocol, and what is common to all of them.
//!
//! | protocol | frames | taxel numbers `k` | start sequence |
//! |---|---|---|---|
//! | `uskin-l1`, `uskin-l2` | one per taxel, three axes | `sda << 2 \| chip` | `SET_TXMODE` |
//! | `uskin-l3` | one per taxel, three axes | `sda << 4 \| taxel` | none: sends from power-up on |
//! | `icub-mtb3`, `icub-mtb4` | two per triangle, one axis of 8 bits | `triangle * 12 + pad` | configuration, then `SET_TXMODE` |
//! | `cyskin` | packets of one or more extended frames, one axis of 16 bits | sensor on the module, 1 to 11 | as configured |
//! | `cpm-finger` | four per sweep, one axis of 16 bits | channel | none known |

pub(crate) mod cpm_finger;
pub(crate) mod cyskin;
pub(crate) mod icub;
pub(crate) mod mtb;
pub(crate) mod uskin;

use taxel_can::{CanFrame, IdFilter};

/// How a board speaks on the bus (protocols.md 1, 2.3, 5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Protocol {
    /// uSkin on MTB3, firmware of 2017: id `0x700 + (board << 4) + (sda << 2) + chip`.
    UskinL1,
    /// uSkin on MTB3, since April 2018: id `(board << 8) + (sda << 4) + chip`, boards 0 to 7.
    UskinL2,
    /// XELA controllers with `ctr_ver = 3`: id bits 10 group, 9-8 SDA, 7-4 taxel, 3-0 controller.
    UskinL3,
    /// iCub skin on an MTB3: id `0x400 | board << 4 | triangle`, twice per triangle and sweep, boards 1 to 14.
    IcubMtb3,
    /// iCub skin on an MTB4: the frames of an MTB3, but a triangle that fails is calibrated anew by the board itself.
    IcubMtb4,
    /// One module of a CySkin hub: 29 bit ids, packets that several frames may carry. Much of it is not public and
    /// has to be configured ([`crate::CyskinSetup`]).
    Cyskin,
    /// The published finger with CySkin-type sensors: ids 0x405, 0x407, 0x409, 0x40B, four values each.
    CpmFinger,
    /// No board: the taxels come from an array in a file ([`crate::Layout::grid`]).
    Offline,
}

impl Protocol {
    /// The protocols that boards speak, in the order of their names.
    pub const BOARDS: [Protocol; 7] = [
        Protocol::UskinL1,
        Protocol::UskinL2,
        Protocol::UskinL3,
        Protocol::IcubMtb3,
        Protocol::IcubMtb4,
        Protocol::Cyskin,
        Protocol::CpmFinger,
    ];

    /// Its name in layout files.
    pub const fn name(self) -> &'static str {
        match self {
            Protocol::UskinL1 => "uskin-l1",
            Protocol::UskinL2 => "uskin-l2",
            Protocol::UskinL3 => "uskin-l3",
            Protocol::IcubMtb3 => "icub-mtb3",
            Protocol::IcubMtb4 => "icub-mtb4",
            Protocol::Cyskin => "cyskin",
            Protocol::CpmFinger => "cpm-finger",
            Protocol::Offline => "offline",
        }
    }

    /// The protocol of this name, `offline` included.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::BOARDS
            .into_iter()
            .chain([Protocol::Offline])
            .find(|p| p.name() == name)
    }

    /// How many board addresses there are, `first_address()..addresses()`.
    ///
    /// MTBs have four address bits, of which 15 is the broadcast. L3's address is `group << 4 | controller`, that of
    /// `cyskin` the module's number on its hub.
    pub const fn addresses(self) -> u8 {
        match self {
            Protocol::UskinL1 | Protocol::IcubMtb3 | Protocol::IcubMtb4 => 15,
            Protocol::UskinL2 => 8,
            Protocol::UskinL3 => 32,
            Protocol::Cyskin => cyskin::MODULES,
            Protocol::CpmFinger | Protocol::Offline => 1,
        }
    }

    /// The lowest board address: 1 for the iCub, where 0 is the host, and 0 otherwise.
    pub const fn first_address(self) -> u8 {
        self.is_icub() as u8
    }

    /// How many taxel numbers a board has, `k = 0..taxel_numbers()`.
    ///
    /// In L1 and L2 `k = sda << 2 | chip`. In L3 `k = sda << 4 | taxel`; the manual's module uses taxels 0 to 5 of
    /// each SDA line, so the numbers of a 4x6 module have gaps. iCub: `k = triangle * 12 + pad`, where some pads are
    /// no taxels; CySkin: `k = sensor`, where 0 is the temperature ([`crate::Decoder::auxiliary`] has those).
    pub const fn taxel_numbers(self) -> u8 {
        match self {
            Protocol::UskinL1 | Protocol::UskinL2 | Protocol::CpmFinger => 16,
            Protocol::UskinL3 => 64,
            Protocol::IcubMtb3 | Protocol::IcubMtb4 => icub::TRIANGLES * icub::PADS,
            Protocol::Cyskin => cyskin::SENSORS,
            Protocol::Offline => u8::MAX,
        }
    }

    /// Standard id of the frames that carry taxel `k` of a board and nothing else; `None` if the protocol has no such
    /// board or taxel, or puts several taxels into a frame.
    pub const fn can_id(self, board: u8, k: u8) -> Option<u16> {
        uskin::can_id(self, board, k)
    }

    /// Standard id of the frames that carry taxel `k` of a board, alone or with others; `None` if there is no such
    /// board or taxel, and for `cyskin`, which has extended ids.
    pub const fn frame_id(self, board: u8, k: u8) -> Option<u16> {
        if board < self.first_address() || board >= self.addresses() || k >= self.taxel_numbers() {
            return None;
        }
        match self {
            Protocol::UskinL1 | Protocol::UskinL2 | Protocol::UskinL3 => uskin::can_id(self, board, k),
            Protocol::IcubMtb3 | Protocol::IcubMtb4 => Some(icub::id(board, k / icub::PADS)),
            Protocol::CpmFinger => Some(cpm_finger::id(k)),
            Protocol::Cyskin | Protocol::Offline => None,
        }
    }

    /// The board and taxel number `(board, k)` a standard id means; `None` if no taxel has frames of its own with
    /// this id. It undoes [`Protocol::can_id`].
    pub const fn taxel_of(self, id: u16) -> Option<(u8, u8)> {
        uskin::taxel_of(self, id)
    }

    /// A filter that passes the taxel frames of one board: exact for L1, L2 and the iCub; for L3 it passes every
    /// taxel number, used or not, and for `cpm-finger` every id from 0x400 to 0x40F. `None` if the protocol has no such
    /// board, and for `cyskin`, whose ids are the hub's.
    pub const fn filter(self, board: u8) -> Option<IdFilter> {
        let mask = match self {
            Protocol::UskinL1 | Protocol::IcubMtb3 | Protocol::IcubMtb4 | Protocol::CpmFinger => 0x7F0,
            Protocol::UskinL2 => 0x7CC,
            Protocol::UskinL3 => 0x40F,
            Protocol::Cyskin | Protocol::Offline => return None,
        };
        match self.frame_id(board, 0) {
            Some(id) => Some(IdFilter::standard(id & mask, mask)),
            None => None,
        }
    }

    /// Whether boards of this protocol are an MTB of the iCub's family, which is started and stopped by `SET_TXMODE`.
    /// XELA controllers (L3) send from power-up on and no command is known (protocols.md 2.4).
    pub const fn takes_commands(self) -> bool {
        matches!(self, Protocol::UskinL1 | Protocol::UskinL2) || self.is_icub()
    }

    /// Whether it is the iCub's skin.
    pub const fn is_icub(self) -> bool {
        matches!(self, Protocol::IcubMtb3 | Protocol::IcubMtb4)
    }

    /// Whether its taxels measure one axis only: their value is z, and x and y are 0. Their counts do not wrap.
    pub const fn is_scalar(self) -> bool {
        matches!(
            self,
            Protocol::IcubMtb3 | Protocol::IcubMtb4 | Protocol::Cyskin | Protocol::CpmFinger
        )
    }

    /// Whether its steps are so coarse (8 bits) that a healthy taxel at rest keeps one value for seconds.
    pub const fn is_coarse(self) -> bool {
        self.is_icub()
    }

    /// Whether two protocols number their boards in one list, so that equal addresses mean the same board.
    pub const fn has_addresses_of(self, other: Self) -> bool {
        const fn list(protocol: Protocol) -> u8 {
            match protocol {
                Protocol::UskinL1 | Protocol::UskinL2 | Protocol::IcubMtb3 | Protocol::IcubMtb4 => 0,
                Protocol::UskinL3 => 1,
                Protocol::Cyskin => 2,
                Protocol::CpmFinger => 3,
                Protocol::Offline => 4,
            }
        }
        list(self) == list(other)
    }

    /// The frame that carries one taxel's value, as the board would send it: status, then x, y, z with the most
    /// significant byte first, then `sda + 1` (protocols.md 2.2). `None` if there is no such board or taxel, or the
    /// protocol puts several taxels into a frame.
    pub fn frame(self, board: u8, k: u8, counts: [u16; 3], status: u8) -> Option<CanFrame> {
        uskin::frame(self, board, k, counts, status)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_the_name_of_one_protocol() {
        for protocol in Protocol::BOARDS.into_iter().chain([Protocol::Offline]) {
            assert_eq!(Protocol::from_name(protocol.name()), Some(protocol));
        }
        assert_eq!(Protocol::from_name("icub"), None);
    }

    #[test]
    fn a_filter_passes_every_frame_of_its_board() {
        for protocol in Protocol::BOARDS {
            for board in 0..=u8::MAX {
                for k in 0..=u8::MAX {
                    let Some(id) = protocol.frame_id(board, k) else {
                        continue;
                    };
                    let frame = CanFrame::standard(id, &[]).expect("11 bits");
                    let filter = protocol.filter(board).expect("it has such a board");
                    assert!(filter.passes(&frame), "{protocol:?} board {board} k {k}");
                }
            }
        }
    }
}
