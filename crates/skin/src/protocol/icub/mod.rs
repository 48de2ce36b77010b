//! The iCub's skin on MTB3 and MTB4 (docs/protocols.md, "iCub skin"): two frames per triangle, configured
//! before it is started.

pub(crate) mod decode;
pub(crate) mod recognise;
pub(crate) mod setup;
pub(crate) mod start;

use super::board_protocol::{BoardProtocol, Measures, Mtb, Order, Properties};
use super::commands::Sequences;
use super::id_table::{IdTable, KindDecoder};
use super::mtb::{BoardKind, answer_filter};
use super::wired_board::WiredBoard;
use crate::reading::TaxelReading;
use decode::{ICUB_OUT_OF_RANGE, TRIANGLES, Triangle};
use setup::{IcubSetup, PADS};
use std::collections::BTreeSet;

pub(crate) struct Icub {
    properties: Properties,
    /// Whether the board calibrates a triangle anew by itself that fails.
    recalibrates: bool,
}

const USUAL: Properties = Properties {
    // 0 is the host.
    addresses: 1..15,
    taxel_numbers: (TRIANGLES * PADS) as u16,
    measures: Measures {
        axes: 1,
        bits: 8,
        rests_at_zero: false,
    },
    keys: &["bus", "board", "icub"],
    // It is calibrated for half a second before it speaks.
    settles: false,
    ..Properties::USUAL
};

pub(crate) const MTB3: Icub = Icub {
    properties: Properties {
        name: "icub-mtb3",
        mtb: Some(Mtb {
            kinds: &[BoardKind::Mtb3],
            configured: true,
        }),
        ..USUAL
    },
    recalibrates: false,
};

pub(crate) const MTB4: Icub = Icub {
    properties: Properties {
        name: "icub-mtb4",
        mtb: Some(Mtb {
            kinds: &[BoardKind::Mtb4, BoardKind::Mtb4w, BoardKind::Mtb4c],
            configured: true,
        }),
        ..USUAL
    },
    recalibrates: true,
};

impl BoardProtocol for Icub {
    fn properties(&self) -> &Properties {
        &self.properties
    }

    fn frame_id(&self, board: u8, k: u16) -> Option<u16> {
        Some(id(board, k as u8 / PADS))
    }

    fn board_of(&self, id: u16) -> Option<u8> {
        (id >> 8 == 4).then_some((id >> 4 & 15) as u8)
    }

    fn board_mask(&self) -> Option<u16> {
        Some(0x7F0)
    }

    fn frames_per_sweep(&self, k: &[u16]) -> usize {
        2 * triangles(k).count_ones() as usize
    }

    fn enter(&self, table: &mut IdTable, board: &WiredBoard<'_>) {
        let has = triangles(board.k);
        table.let_through(answer_filter(board.address));
        for number in (0..TRIANGLES).filter(|triangle| has >> triangle & 1 == 1) {
            let (id, triangle) = (
                id(board.address, number),
                Triangle::new(board, number, self.recalibrates),
            );
            table.enter_decoder([id], board.module, KindDecoder::Icub(triangle));
            // Boards set up by obsolete commands send under class 3 (docs/protocols.md, "iCub frames").
            table.enter_alias(id - 0x100, id);
        }
    }

    fn sequences(&self, board: &WiredBoard<'_>) -> Option<Sequences> {
        let setup = board.icub?;
        Some(start::sequences(board.address, setup, triangles(board.k)))
    }

    fn nominal_hz(&self, icub: Option<&IcubSetup>) -> Option<f64> {
        icub.map(|setup| 1000.0 / f64::from(setup.period_ms))
    }

    fn is_temperature(&self, k: u16, icub: Option<&IcubSetup>) -> bool {
        icub.is_some_and(|setup| setup.is_thermal(k as u8))
    }

    fn may_be_temperature(&self, k: u16, icub: Option<&IcubSetup>) -> bool {
        icub.is_some_and(|setup| setup.may_be_thermal(k as u8))
    }

    fn is_saturated(&self, reading: &TaxelReading) -> bool {
        reading.status & ICUB_OUT_OF_RANGE != 0
    }

    /// The triangles side by side, each as the iCub's own viewer draws it; pads 6 and 10 are thermal.
    fn proposed_order(&self, taxels: &[u8]) -> Order {
        const TRIANGLE: [[i16; 7]; 4] = [
            [-1, -1, -1, 9, -1, -1, -1],
            [-1, -1, 8, -1, 11, -1, -1],
            [-1, 7, -1, 3, -1, 0, -1],
            [5, -1, 4, -1, 2, -1, 1],
        ];
        let triangles: BTreeSet<u8> = taxels.iter().map(|k| k / PADS).collect();
        let cell = |triangle: u8, pad: i16| {
            let k = u8::try_from(pad).map(|pad| triangle * PADS + pad);
            k.ok().filter(|k| taxels.contains(k)).map_or(-1, i16::from)
        };
        let row = |pads: [i16; 7]| {
            let of_triangle = |triangle: &u8| pads.map(|pad| cell(*triangle, pad));
            triangles.iter().flat_map(of_triangle).collect()
        };
        TRIANGLE.into_iter().map(row).collect()
    }
}

/// Standard id of a triangle's frames.
const fn id(board: u8, triangle: u8) -> u16 {
    0x400 | (board as u16) << 4 | triangle as u16
}

/// The triangles that have taxels among `k`, a bit each.
fn triangles(k: &[u16]) -> u16 {
    k.iter().fold(0, |set, k| set | 1 << ((k / u16::from(PADS)) & 15))
}
