//! The iCub's skin on MTB3 and MTB4 (docs/protocols.md, "iCub skin"): two frames per triangle, eight bits per
//! pad.
//!
//! A pad's 8-bit value becomes z = 16 * value + 8, with x = y = 0. So it spans 8 to 4088, the size
//! of a press on the other skins, which is what the limits of the conditioning are made for; it is
//! never 0 or 65535, which are the values of a silent chip; and it never wraps. Pressing lowers it:
//! the conditioning takes the magnitude of the difference.

use super::setup::PADS;
use crate::protocol::board_decoder::{BoardDecoder, BoardFrame, NOBODY};
use crate::protocol::wired_board::WiredBoard;
use crate::reading::{Readings, STATUS_ERROR, TaxelReading};

/// Triangles of a board.
pub(super) const TRIANGLES: u8 = 16;
/// Pads in the first frame of a triangle.
const FIRST_PADS: usize = 7;
/// First byte of the first frame.
const FIRST: u8 = 0x40;
/// First byte of the second frame.
const SECOND: u8 = 0xC0;
/// This many no-acknowledge errors in a row make an MTB4 calibrate the triangle anew (docs/protocols.md,
/// "MTB4").
const RECALIBRATES_AFTER: u8 = 5;

/// Status of a reading: the triangle's chip did not acknowledge.
pub const ICUB_NO_ACK: u8 = 0x01;
/// Status of a reading: no chip is connected.
pub const ICUB_NOT_CONNECTED: u8 = 0x02;
/// Status of a reading: the pad is beyond the range of eight bits, and its value is clipped.
pub const ICUB_OUT_OF_RANGE: u8 = 0x20;

/// Which half of a triangle a frame's data could be, 0 or 1; `None` for neither.
pub(crate) fn half_of(data: &[u8]) -> Option<usize> {
    match *data {
        [FIRST, ..] if data.len() == 8 => Some(0),
        [SECOND, ..] if matches!(data.len(), 6 | 8) => Some(1),
        _ => None,
    }
}

/// One triangle: which taxels its pads are, and what it last said of itself.
#[derive(Debug, Clone)]
pub(crate) struct Triangle {
    number: u8,
    /// Taxel of each pad; [`NOBODY`] where there is none in the layout.
    taxels: [u16; PADS as usize],
    /// Newest value of each pad, thermal ones included.
    values: [u8; PADS as usize],
    /// Pads heard, a bit each.
    heard: u16,
    /// Newest out-of-range mask, a bit per pad.
    out_of_range: u16,
    /// Newest error bits.
    errors: u8,
    no_ack_run: u8,
    recalibrates: bool,
}

impl BoardDecoder for Triangle {
    /// The board says at the end of the second frame what is wrong, so the pads of the first frame
    /// carry what was said last: an MTB3 may send the second frame first, and waiting would make
    /// whole values late.
    #[inline]
    fn decode(&mut self, _id: u16, data: &[u8], readings: &mut Readings) -> BoardFrame {
        match *data {
            [FIRST, ref pads @ ..] if pads.len() == FIRST_PADS => {
                self.take(0, pads, readings);
                BoardFrame::Readings
            }
            [SECOND, p7, p8, p9, p10, p11, high, low] => {
                let word = u16::from(high) << 8 | u16::from(low);
                self.out_of_range = word >> 4;
                self.errors = low & 0x0F;
                let recalibrated = self.count_no_ack();
                self.take(FIRST_PADS, &[p7, p8, p9, p10, p11], readings);
                if recalibrated {
                    BoardFrame::Recalibrated
                } else {
                    BoardFrame::Readings
                }
            }
            // Old firmware sends no status (docs/protocols.md, "iCub frames").
            [SECOND, p7, p8, p9, p10, p11] => {
                (self.out_of_range, self.errors) = (0, 0);
                self.take(FIRST_PADS, &[p7, p8, p9, p10, p11], readings);
                BoardFrame::Readings
            }
            _ => BoardFrame::Malformed,
        }
    }

    /// Pads by `triangle * 12 + pad`, thermal ones included.
    fn auxiliary(&self, channel: u8) -> Option<u16> {
        let (triangle, pad) = (channel / PADS, usize::from(channel % PADS));
        let heard = triangle == self.number && self.heard >> pad & 1 == 1;
        heard.then(|| self.values[pad].into())
    }
}

impl Triangle {
    /// Triangle `number` of a board. `recalibrates`: the board calibrates a triangle anew by itself
    /// that fails, as an MTB4 does.
    pub(super) fn new(board: &WiredBoard<'_>, number: u8, recalibrates: bool) -> Self {
        let mut taxels = [NOBODY; PADS as usize];
        for (k, taxel) in board.taxels().filter(|(k, _)| k / PADS == number) {
            taxels[usize::from(k % PADS)] = taxel;
        }
        Self {
            number,
            taxels,
            values: [0; PADS as usize],
            heard: 0,
            out_of_range: 0,
            errors: 0,
            no_ack_run: 0,
            recalibrates,
        }
    }

    fn count_no_ack(&mut self) -> bool {
        if self.errors & ICUB_NO_ACK == 0 {
            self.no_ack_run = 0;
            return false;
        }
        self.no_ack_run = self.no_ack_run.saturating_add(1);
        self.recalibrates && self.no_ack_run == RECALIBRATES_AFTER
    }

    #[inline]
    fn take(&mut self, from: usize, pads: &[u8], readings: &mut Readings) {
        for (pad, &value) in (from..).zip(pads) {
            self.values[pad] = value;
            self.heard |= 1 << pad;
            let taxel = self.taxels[pad];
            if taxel != NOBODY {
                readings.push(TaxelReading {
                    taxel,
                    counts: [0, 0, u16::from(value) << 4 | 8],
                    status: self.status(pad, value),
                });
            }
        }
    }

    /// The status byte of a reading: the board's error bits, [`ICUB_OUT_OF_RANGE`], and [`STATUS_ERROR`]
    /// where the value must not be used.
    ///
    /// A pad that is pressed harder than eight bits can say reads 0 and is out of range (the
    /// firmware calls it "pressure too high"). That is the strongest touch there is and no fault.
    /// Out of range on the other side is drift or damage.
    #[inline]
    fn status(&self, pad: usize, value: u8) -> u8 {
        let beyond = self.out_of_range >> pad & 1 == 1;
        let unusable = self.errors != 0 || (beyond && value >= 128);
        self.errors | if beyond { ICUB_OUT_OF_RANGE } else { 0 } | if unusable { STATUS_ERROR } else { 0 }
    }
}

/// The two frames' data of a triangle with these pads, out-of-range mask (a bit per pad) and error
/// bits, as the board sends them (docs/protocols.md, "iCub frames"): for simulators and tests.
pub fn icub_triangle_data(pads: [u8; 12], out_of_range: u16, errors: u8) -> [[u8; 8]; 2] {
    let [p0, p1, p2, p3, p4, p5, p6, p7, p8, p9, p10, p11] = pads;
    let high = (out_of_range >> 4) as u8;
    let low = (out_of_range << 4) as u8 | errors & 0x0F;
    [
        [FIRST, p0, p1, p2, p3, p4, p5, p6],
        [SECOND, p7, p8, p9, p10, p11, high, low],
    ]
}
