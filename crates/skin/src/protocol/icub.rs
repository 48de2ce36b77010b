//! The iCub's skin on MTB3 and MTB4 (protocols.md section 1): two frames per triangle, eight bits per pad.
//!
//! A pad's 8-bit value becomes z = 16 * value + 8, with x = y = 0. So it spans 8 to 4088, the size of a press on the other
//! skins, which is what the limits of the conditioning are made for; it is never 0 or 65535, which are the values of a
//! silent chip; and it never wraps. Pressing lowers it: the conditioning takes the magnitude of the difference.

use super::Protocol;
use crate::TaxelReading;

/// Triangles of a board.
pub(crate) const TRIANGLES: u8 = 16;
/// Pads of a triangle, thermal ones included.
pub(crate) const PADS: u8 = 12;
/// Pads in the first frame of a triangle.
const FIRST_PADS: usize = 7;
/// First byte of the first frame.
const FIRST: u8 = 0x40;
/// First byte of the second frame.
const SECOND: u8 = 0xC0;
/// So many no-acknowledge errors in a row make an MTB4 calibrate the triangle anew (protocols.md 1.8).
const RECALIBRATES_AFTER: u8 = 5;

/// Status of a reading: the triangle's chip did not acknowledge.
pub const ICUB_NO_ACK: u8 = 0x01;
/// Status of a reading: no chip is connected.
pub const ICUB_NOT_CONNECTED: u8 = 0x02;
/// Status of a reading: the pad is beyond the range of eight bits, and its value is clipped.
pub const ICUB_OUT_OF_RANGE: u8 = 0x20;

/// How an iCub board is configured before it is started: the table `icub` of a module in a layout file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IcubSetup {
    /// Time between two sweeps, ms, 1 to 209. Fifteen triangles and seven boards on a bus need more than 30.
    pub period_ms: u8,
    /// The value of a pad that is not pressed, 0 to 255.
    pub noload: u8,
    /// What is mounted and how it is compensated, 0 to 15: 0 temperature compensation, 1 palm or fingertip, 2 no
    /// compensation, 3 hand "ergo", 7 raw, 8 temperature compensation, second version.
    pub skin_type: u8,
    /// How far the chip's 16 bits are shifted right, 0 to 15.
    pub shift: u8,
    /// Offset of the chip's converter.
    pub cdc_offset: u16,
}

impl Default for IcubSetup {
    /// The values the official document uses.
    fn default() -> Self {
        Self {
            period_ms: 50,
            noload: 245,
            skin_type: 0,
            shift: 2,
            cdc_offset: 0x2200,
        }
    }
}

impl IcubSetup {
    /// What is wrong with it, if anything is.
    pub(crate) fn problem(&self) -> Option<String> {
        if !(1..=209).contains(&self.period_ms) {
            return Some(format!("icub.period_ms = {} is not 1 to 209", self.period_ms));
        }
        if self.skin_type > 15 {
            return Some(format!("icub.skin_type = {} is not 0 to 15", self.skin_type));
        }
        (self.shift > 15).then(|| format!("icub.shift = {} is not 0 to 15", self.shift))
    }

    /// Whether pad `k` (`triangle * 12 + pad`) measures temperature: pads 6 and 10 of a triangle, pad 11 on palms and
    /// fingertips (protocols.md 1.3).
    pub const fn is_thermal(&self, k: u8) -> bool {
        let pad = k % PADS;
        if self.skin_type == 1 {
            pad == 11
        } else {
            pad == 6 || pad == 10
        }
    }
}

/// Standard id of a triangle's frames.
pub(crate) const fn id(board: u8, triangle: u8) -> u16 {
    0x400 | (board as u16) << 4 | triangle as u16
}

/// One triangle: which taxels its pads are, and what it last said of itself.
#[derive(Debug, Clone)]
pub(crate) struct Triangle {
    /// Taxel of each pad; [`Triangle::NO_TAXEL`] where there is none in the layout.
    pub(crate) taxels: [u16; PADS as usize],
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

/// What a triangle's frame was.
pub(crate) enum Heard {
    Pads,
    /// ... and the board has just calibrated the triangle anew, so that its baseline holds no longer.
    Recalibrated,
    Malformed,
}

impl Triangle {
    pub(crate) const NO_TAXEL: u16 = u16::MAX;

    pub(crate) fn new(protocol: Protocol) -> Self {
        Self {
            taxels: [Self::NO_TAXEL; PADS as usize],
            values: [0; PADS as usize],
            heard: 0,
            out_of_range: 0,
            errors: 0,
            no_ack_run: 0,
            recalibrates: matches!(protocol, Protocol::IcubMtb4),
        }
    }

    /// Takes a frame of this triangle and gives its taxels' readings to `push`.
    ///
    /// The board says at the end of the second frame what is wrong, so the pads of the first frame carry what was
    /// said last: an MTB3 may send the second frame first, and waiting would make whole values late.
    #[inline]
    pub(crate) fn hear(&mut self, data: &[u8], push: impl FnMut(TaxelReading)) -> Heard {
        match *data {
            [FIRST, ref pads @ ..] if pads.len() == FIRST_PADS => {
                self.take(0, pads, push);
                Heard::Pads
            }
            [SECOND, p7, p8, p9, p10, p11, high, low] => {
                let word = u16::from(high) << 8 | u16::from(low);
                self.out_of_range = word >> 4;
                self.errors = low & 0x0F;
                let recalibrated = self.count_no_ack();
                self.take(FIRST_PADS, &[p7, p8, p9, p10, p11], push);
                if recalibrated {
                    Heard::Recalibrated
                } else {
                    Heard::Pads
                }
            }
            // Old firmware sends no status (protocols.md 1.3).
            [SECOND, p7, p8, p9, p10, p11] => {
                (self.out_of_range, self.errors) = (0, 0);
                self.take(FIRST_PADS, &[p7, p8, p9, p10, p11], push);
                Heard::Pads
            }
            _ => Heard::Malformed,
        }
    }

    /// Newest raw value of a pad.
    pub(crate) fn value(&self, pad: u8) -> Option<u8> {
        (self.heard >> pad & 1 == 1).then(|| self.values[pad as usize])
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
    fn take(&mut self, from: usize, pads: &[u8], mut push: impl FnMut(TaxelReading)) {
        for (pad, &value) in (from..).zip(pads) {
            self.values[pad] = value;
            self.heard |= 1 << pad;
            let taxel = self.taxels[pad];
            if taxel != Self::NO_TAXEL {
                push(TaxelReading {
                    taxel,
                    counts: [0, 0, u16::from(value) << 4 | 8],
                    status: self.status(pad, value),
                });
            }
        }
    }

    /// The status byte of a reading: the board's error bits, [`ICUB_OUT_OF_RANGE`], and [`crate::STATUS_ERROR`]
    /// where the value must not be used.
    ///
    /// A pad that is pressed harder than eight bits can say reads 0 and is out of range (the firmware calls it
    /// "pressure too high"). That is the strongest touch there is and no fault. Out of range on the other side is
    /// drift or damage.
    #[inline]
    fn status(&self, pad: usize, value: u8) -> u8 {
        let beyond = self.out_of_range >> pad & 1 == 1;
        let unusable = self.errors != 0 || (beyond && value >= 128);
        self.errors
            | if beyond { ICUB_OUT_OF_RANGE } else { 0 }
            | if unusable { crate::STATUS_ERROR } else { 0 }
    }
}

/// The two frames' data of a triangle with these pads, out-of-range mask (a bit per pad) and error bits, as the
/// board sends them (protocols.md 1.3): for simulators and tests.
pub fn icub_triangle_data(pads: [u8; 12], out_of_range: u16, errors: u8) -> [[u8; 8]; 2] {
    let [p0, p1, p2, p3, p4, p5, p6, p7, p8, p9, p10, p11] = pads;
    let high = (out_of_range >> 4) as u8;
    let low = (out_of_range << 4) as u8 | errors & 0x0F;
    [
        [FIRST, p0, p1, p2, p3, p4, p5, p6],
        [SECOND, p7, p8, p9, p10, p11, high, low],
    ]
}
