//! Pressure arrays (docs/protocols.md, "Pressure arrays"): whole frames that a program sends, cut into CAN frames of four
//! taxels by their source.

pub(crate) mod decode;

use super::board_protocol::{BoardProtocol, Measures, Properties};
use super::id_table::{IdTable, KindDecoder};
use super::wired_board::WiredBoard;
use crate::reading::TaxelReading;
use decode::{Array, PER_FRAME};
use taxel_can::MAX_ARRAY_TAXELS;

pub(crate) struct PressureArray;

impl BoardProtocol for PressureArray {
    fn properties(&self) -> &Properties {
        const PRESSURE_ARRAY: Properties = Properties {
            name: "pressure-array",
            taxel_numbers: MAX_ARRAY_TAXELS,
            // Counts are steps of pressure: an untouched taxel keeps 0 for hours.
            measures: Measures {
                axes: 1,
                bits: 8,
                rests_at_zero: true,
            },
            keys: &["bus", "rows", "columns"],
            settles: false,
            bit_rate: None,
            board_word: "array",
            ..Properties::USUAL
        };
        &PRESSURE_ARRAY
    }

    fn frame_id(&self, _board: u8, k: u16) -> Option<u16> {
        Some(1 + k / PER_FRAME)
    }

    fn board_of(&self, id: u16) -> Option<u8> {
        (id > 0).then_some(0)
    }

    /// Everything: an array is alone where its frames come from.
    fn board_mask(&self) -> Option<u16> {
        Some(0)
    }

    fn frames_per_sweep(&self, k: &[u16]) -> usize {
        1 + k.len().div_ceil(PER_FRAME.into())
    }

    fn enter(&self, table: &mut IdTable, board: &WiredBoard<'_>) {
        let ids = 0..self.frames_per_sweep(board.k) as u16;
        table.enter_decoder(ids, board.module, KindDecoder::PressureArray(Array::new(board)));
    }

    /// Nothing is known of the sensor's range; that a taxel reads 0 says that nothing presses it.
    fn is_saturated(&self, reading: &TaxelReading) -> bool {
        reading.counts[2] == u16::MAX
    }
}
