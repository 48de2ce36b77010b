//! Whether the values of a board alternate between those of two boards.
//!
//! Two boards with one address send each taxel's id in turn. Their taxels rest at levels thousands
//! of counts apart (docs/protocols.md, "uSkin values"), so a value is far from the one before it
//! and close to the one before that. No touch does that: a finger that presses moves a value on,
//! and noise moves it as far from the one as from the other.

use crate::reading::TaxelReading;

/// A step this many times as large as the one over two readings is a swing.
const TIMES: u16 = 4;
/// Steps smaller than this are noise: of magnetic taxels, and of the coarse ones of 8 bits.
const LEAST_COUNTS: u16 = 64;
const LEAST_COARSE_COUNTS: u16 = 4;

/// The last two values of one taxel.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Alternation {
    before: [[u16; 3]; 2],
    seen: u8,
}

impl Alternation {
    /// Takes the next value, and returns by how much it swung away from the last and back to the one before, counts; 0 where
    /// it did not.
    #[inline]
    pub(crate) fn swing(&mut self, reading: &TaxelReading, coarse: bool) -> u16 {
        let least = if coarse { LEAST_COARSE_COUNTS } else { LEAST_COUNTS };
        let [last, one_before] = self.before;
        let known = self.seen == 2;
        self.before = [reading.counts, last];
        self.seen = (self.seen + 1).min(2);
        let step = distance(reading.counts, last);
        match known && step >= least && step / TIMES >= distance(reading.counts, one_before) {
            true => step,
            false => 0,
        }
    }
}

/// The largest difference of an axis; counts wrap.
#[inline]
fn distance(a: [u16; 3], b: [u16; 3]) -> u16 {
    let axis = |i: usize| a[i].wrapping_sub(b[i]).cast_signed().unsigned_abs();
    axis(0).max(axis(1)).max(axis(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swings(values: impl IntoIterator<Item = u16>) -> usize {
        let mut alternation = Alternation::default();
        let reading = |z| TaxelReading {
            taxel: 0,
            counts: [0x8000, 0x8000, z],
            status: 0,
        };
        values
            .into_iter()
            .filter(|z| alternation.swing(&reading(*z), false) > 0)
            .count()
    }

    #[test]
    fn two_boards_swing_with_every_reading_and_one_board_never() {
        let noise = |i: u16| i * 7 % 11;
        assert_eq!(swings((0..100).map(|i| 13_000 + i % 2 * 900 + noise(i))), 98);
        assert_eq!(swings((0..100).map(|i| 13_000 + noise(i))), 0, "rest");
        assert_eq!(swings((0..100).map(|i| 13_000 + i * 100)), 0, "pressing");
        // Counts wrap, and two boards may rest on either side.
        assert_eq!(
            swings((0..100u16).map(|i| if i.is_multiple_of(2) { 60_000 } else { 100 })),
            98
        );
    }
}
