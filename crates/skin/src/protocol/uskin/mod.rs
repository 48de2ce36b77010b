//! uSkin and XELA (docs/protocols.md, "uSkin"): one frame per taxel. L1 and L2 are MTBs, L3 is a XELA
//! controller, which sends from power-up on.

pub(crate) mod decode;
mod ids;
pub(crate) mod recognise;
mod start;

use super::board_protocol::{BoardProtocol, Mtb, Order, Properties};
use super::commands::Sequences;
use super::icub::setup::IcubSetup;
use super::id_table::IdTable;
use super::mtb::BoardKind;
use super::wired_board::WiredBoard;
use ids::IdLayout;
use taxel_can::CanFrame;

pub(crate) struct Uskin {
    ids: IdLayout,
    properties: Properties,
    nominal_hz: f64,
}

/// uSkin firmware was made for the MTB3.
const MTB: Option<Mtb> = Some(Mtb {
    kinds: &[BoardKind::Mtb3],
    configured: false,
});
/// The firmware's timer.
const MTB_HZ: f64 = 100.0;
/// The manual of 2023.
const XELA_HZ: f64 = 83.0;

pub(crate) const L1: Uskin = Uskin {
    ids: IdLayout::L1,
    properties: Properties {
        name: "uskin-l1",
        addresses: 0..15,
        mtb: MTB,
        ..Properties::USUAL
    },
    nominal_hz: MTB_HZ,
};

pub(crate) const L2: Uskin = Uskin {
    ids: IdLayout::L2,
    properties: Properties {
        name: "uskin-l2",
        addresses: 0..8,
        taxel_numbers: 24,
        mtb: MTB,
        ..Properties::USUAL
    },
    nominal_hz: MTB_HZ,
};

pub(crate) const L3: Uskin = Uskin {
    ids: IdLayout::L3,
    properties: Properties {
        name: "uskin-l3",
        addresses: 0..32,
        taxel_numbers: 64,
        // Controllers are numbered apart from MTBs.
        board_word: "controller",
        ..Properties::USUAL
    },
    nominal_hz: XELA_HZ,
};

impl BoardProtocol for Uskin {
    fn properties(&self) -> &Properties {
        &self.properties
    }

    fn frame_id(&self, board: u8, k: u16) -> Option<u16> {
        Some(self.ids.id(board, k as u8))
    }

    fn taxel_of(&self, id: u16) -> Option<(u8, u16)> {
        self.ids.taxel_of(id).map(|(board, k)| (board, k.into()))
    }

    fn board_mask(&self) -> Option<u16> {
        Some(self.ids.board_mask())
    }

    fn frame(&self, board: u8, k: u16, counts: [u16; 3], status: u8) -> Option<CanFrame> {
        decode::frame(self.ids, board, k as u8, counts, status)
    }

    fn enter(&self, table: &mut IdTable, board: &WiredBoard<'_>) {
        // L3 does not use the status byte.
        let status_mask = if self.ids == IdLayout::L3 { 0 } else { 0xFF };
        for (k, taxel) in board.taxels() {
            table.enter_taxel(self.ids.id(board.address, k), board.module, taxel, status_mask);
        }
    }

    fn sequences(&self, board: &WiredBoard<'_>) -> Option<Sequences> {
        self.properties.mtb.map(|_| start::sequences(board.address))
    }

    fn nominal_hz(&self, _icub: Option<&IcubSetup>) -> Option<f64> {
        Some(self.nominal_hz)
    }

    /// The 4x4 phalange as the Waseda group draws it: row = sda, column = [0, 2, 1, 3][chip]
    /// (docs/protocols.md, "uSkin drawing order"). What a XELA controller has is not known without being
    /// told.
    fn default_order(&self) -> Option<Order> {
        self.properties.mtb.map(|_| phalange(4))
    }

    fn proposed_order(&self, taxels: &[u8]) -> Order {
        let mut order = match self.ids {
            IdLayout::L1 | IdLayout::L2 => match self.ids.expected(taxels).len() {
                24 => (0..4)
                    .map(|sda| {
                        [
                            4 * sda,
                            4 * sda + 1,
                            4 * sda + 2,
                            4 * sda + 3,
                            16 + 2 * sda,
                            17 + 2 * sda,
                        ]
                        .to_vec()
                    })
                    .collect(),
                expected => phalange((expected / 4) as i16),
            },
            IdLayout::L3 => {
                let lines = 0..=taxels.iter().map(|k| k >> 4).max().unwrap_or(0);
                let per_line = taxels.iter().map(|k| k & 15).max().unwrap_or(0);
                lines
                    .map(|sda| (0..=per_line).map(|taxel| i16::from(sda << 4 | taxel)).collect())
                    .collect()
            }
        };
        for cell in order.iter_mut().flatten() {
            if !u8::try_from(*cell).is_ok_and(|k| taxels.contains(&k)) {
                *cell = -1;
            }
        }
        order
    }
}

/// The first lines of a phalange.
fn phalange(lines: i16) -> Order {
    (0..lines)
        .map(|sda| [0, 2, 1, 3].map(|chip| sda << 2 | chip).to_vec())
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::protocol::Protocol;
    use taxel_can::CanFrame;

    #[test]
    fn ids_are_those_of_the_published_layouts() {
        let cases = [
            // XELA XR1944: board 1, 0x710 to 0x71F.
            (Protocol::USKIN_L1, 1, 0, Some(0x710)),
            (Protocol::USKIN_L1, 1, 15, Some(0x71F)),
            // L1: sda 1, chip 2.
            (Protocol::USKIN_L1, 5, 0b01_10, Some(0x756)),
            // L2: board 2 sends 0x200 to 0x233.
            (Protocol::USKIN_L2, 2, 0, Some(0x200)),
            (Protocol::USKIN_L2, 2, 15, Some(0x233)),
            (Protocol::USKIN_L2, 7, 0b10_01, Some(0x721)),
            (Protocol::USKIN_L2, 8, 0, None),
            // L3: controller 1, SDA 0 taxel 5 and SDA 3 taxel 5.
            (Protocol::USKIN_L3, 1, 0x05, Some(0x051)),
            (Protocol::USKIN_L3, 1, 0x10, Some(0x101)),
            (Protocol::USKIN_L3, 1, 0x35, Some(0x351)),
            (Protocol::USKIN_L3, 0x11, 0x00, Some(0x401)),
            (Protocol::USKIN_L1, 15, 0, None),
            // A XELA 4x6 module: chips 4 and 5 of each line.
            (Protocol::USKIN_L2, 1, 16, Some(0x104)),
            (Protocol::USKIN_L2, 1, 17, Some(0x105)),
            (Protocol::USKIN_L2, 1, 22, Some(0x134)),
            (Protocol::USKIN_L2, 1, 23, Some(0x135)),
            (Protocol::USKIN_L2, 0, 24, None),
            (Protocol::USKIN_L1, 0, 16, None),
            (Protocol::USKIN_L3, 32, 0, None),
        ];
        for (protocol, board, k, id) in cases {
            assert_eq!(protocol.can_id(board, k), id, "{protocol:?} board {board} k {k}");
        }
    }

    #[test]
    fn every_id_of_every_board_means_its_taxel_and_passes_its_filter() {
        for protocol in [Protocol::USKIN_L1, Protocol::USKIN_L2, Protocol::USKIN_L3] {
            let mut ids = 0;
            for id in 0..0x800 {
                let Some((board, k)) = protocol.taxel_of(id) else {
                    continue;
                };
                ids += 1;
                assert_eq!(protocol.can_id(board, k), Some(id), "{protocol:?} {id:#x}");
                for b in protocol.addresses() {
                    let passes = protocol
                        .filter(b)
                        .unwrap()
                        .passes(&CanFrame::standard(id, &[]).unwrap());
                    assert_eq!(passes, b == board, "{protocol:?} {id:#x} board {b}");
                }
            }
            assert_eq!(
                ids,
                protocol.addresses().len() * protocol.taxel_numbers() as usize
            );
            assert_eq!(protocol.taxel_of(0x800), None);
        }
    }
}
