//! The frames that a message of a pressure array is cut into.

use crate::protocol::board_decoder::{BoardDecoder, BoardFrame};
use crate::protocol::wired_board::WiredBoard;
use crate::reading::{Readings, TaxelReading};
use taxel_can::ArrayHead;

/// Taxels in a frame.
pub(super) const PER_FRAME: u16 = 4;

/// One array: its taxels, and whether the message at work is of its size.
#[derive(Debug, Clone)]
pub(crate) struct Array {
    first_taxel: u16,
    taxels: u16,
    size: [u16; 2],
    fits: bool,
}

impl Array {
    pub(super) fn new(board: &WiredBoard<'_>) -> Self {
        Self {
            first_taxel: board.first_taxel,
            taxels: board.k.len() as u16,
            size: board.array.unwrap_or_default(),
            fits: true,
        }
    }
}

impl BoardDecoder for Array {
    #[inline]
    fn decode(&mut self, id: u16, data: &[u8], readings: &mut Readings) -> BoardFrame {
        let Some(place) = id.checked_sub(1) else {
            let head = ArrayHead::of_frame(data);
            self.fits = head.is_some_and(|head| [head.rows, head.columns] == self.size);
            return match self.fits {
                true => BoardFrame::Readings,
                false => BoardFrame::Malformed,
            };
        };
        let first = place * PER_FRAME;
        let taxels = PER_FRAME.min(self.taxels.saturating_sub(first));
        if !self.fits || taxels == 0 || data.len() != 2 * usize::from(taxels) {
            return BoardFrame::Malformed;
        }
        for (k, count) in (first..).zip(data.chunks_exact(2)) {
            readings.push(TaxelReading {
                taxel: self.first_taxel + k,
                counts: [0, 0, u16::from_le_bytes([count[0], count[1]])],
                status: 0,
            });
        }
        BoardFrame::Readings
    }

    fn auxiliary(&self, _channel: u8) -> Option<u16> {
        None
    }
}
