//! What boards send: the values of taxels.

use std::ops::Deref;

/// Status bit of a reading that must not be used. It is the MLX90393's error bit; the decoders of
/// other boards set it where theirs say that something is wrong.
pub const STATUS_ERROR: u8 = 0x10;

/// Whether a status byte says that the value beside it must not be used: error bit set, or no answer.
pub(crate) const fn status_is_error(status: u8) -> bool {
    status & STATUS_ERROR != 0
}

/// One taxel's value, as a board sent it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaxelReading {
    /// Index of the taxel in the layout, `0..N`.
    pub taxel: u16,
    /// Raw counts of x, y, z; 0 to 65535, on an arbitrary offset.
    pub counts: [u16; 3],
    /// The status byte the board sent with the value (for uSkin the MLX90393's, docs/protocols.md,
    /// "MLX90393 status").
    pub status: u8,
}

/// Most readings that one frame of any board carries: those of a CySkin packet of 255 data bytes,
/// which come with its last frame.
pub const MAX_READINGS: usize = 128;

/// The readings of one frame: a small array without a heap.
#[derive(Debug, Clone, Copy)]
pub struct Readings {
    len: u8,
    items: [TaxelReading; MAX_READINGS],
}

impl Readings {
    /// No readings.
    pub const fn new() -> Self {
        const NONE: TaxelReading = TaxelReading {
            taxel: 0,
            counts: [0; 3],
            status: 0,
        };
        Self {
            len: 0,
            items: [NONE; MAX_READINGS],
        }
    }

    #[inline]
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    #[inline]
    pub(crate) fn set_one(&mut self, reading: TaxelReading) {
        self.items[0] = reading;
        self.len = 1;
    }

    #[inline]
    pub(crate) fn push(&mut self, reading: TaxelReading) {
        if let Some(place) = self.items.get_mut(self.len as usize) {
            *place = reading;
            self.len += 1;
        }
    }
}

impl Default for Readings {
    fn default() -> Self {
        Self::new()
    }
}

impl Deref for Readings {
    type Target = [TaxelReading];

    #[inline]
    fn deref(&self) -> &[TaxelReading] {
        &self.items[..self.len as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_bit_and_the_missing_answer_are_errors() {
        for (status, error) in [
            (0x82, false),
            (0x83, false),
            (0x00, false),
            (0x93, true),
            // The I2C bus, left to its pull-ups.
            (0xFF, true),
        ] {
            assert_eq!(status_is_error(status), error, "{status:#04x}");
        }
    }
}
