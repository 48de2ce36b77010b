//! The published finger with CySkin-type sensors (docs/protocols.md, "CPM finger"): four standard frames of
//! four values, no command.

pub(crate) mod decode;
pub(crate) mod recognise;

use super::board_protocol::{BoardProtocol, Measures, Order, Properties};
use super::id_table::{IdTable, KindDecoder};
use super::wired_board::WiredBoard;
use decode::{Finger, IDS, PROXIMITY_ID, id};
use taxel_can::IdFilter;

pub(crate) struct CpmFinger;

impl BoardProtocol for CpmFinger {
    fn properties(&self) -> &Properties {
        const CPM_FINGER: Properties = Properties {
            name: "cpm-finger",
            measures: Measures {
                axes: 1,
                bits: 16,
                rests_at_zero: false,
            },
            ..Properties::USUAL
        };
        &CPM_FINGER
    }

    fn frame_id(&self, _board: u8, k: u16) -> Option<u16> {
        Some(id(k as u8))
    }

    fn board_of(&self, id: u16) -> Option<u8> {
        IDS.contains(&id).then_some(0)
    }

    fn board_mask(&self) -> Option<u16> {
        Some(0x7F0)
    }

    fn frames_per_sweep(&self, _k: &[u16]) -> usize {
        IDS.len() + 1
    }

    fn enter(&self, table: &mut IdTable, board: &WiredBoard<'_>) {
        let ids = IDS.into_iter().chain([PROXIMITY_ID]);
        table.let_through(IdFilter::standard(PROXIMITY_ID, 0x7FF));
        table.enter_decoder(ids, board.module, KindDecoder::CpmFinger(Finger::new(board)));
    }

    fn proposed_order(&self, taxels: &[u8]) -> Order {
        let cell = |k: u8| taxels.contains(&k).then_some(k).map_or(-1, i16::from);
        (0..4)
            .map(|row| (0..4).map(|column| cell(4 * row + column)).collect())
            .collect()
    }
}
