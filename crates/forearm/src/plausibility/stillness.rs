//! Potentiometers that stand still although their finger moves: stuck, where noise hides that from a look at single samples.

use serde::{Deserialize, Serialize};

/// Parts of a squeeze, as many samples in each.
const PARTS: usize = 6;
/// A column whose means over these parts differ by no more than this stands still, degrees: less than a count of a
/// potentiometer's converter (0.33), however it comes and goes.
const STILL_DEG: f64 = 0.25;
/// Sound ones that stand still are this much further away from those of the training at most, degrees: as far as those of
/// one place are from each other. With places left out of the training 1 is enough; with less than 6, sound squeezes of
/// the public data are taken for stuck ones.
const BEYOND_DEG: f64 = 6.0;

/// Where a potentiometer stood still in squeezes of the training. A sound one may: hardly bent, it moves by less than a
/// count. Elsewhere, one that stands still is stuck.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Stillness {
    /// Smallest and largest mean but one, degrees: one odd squeeze is to hide no stuck ones. None where it always moved.
    levels_deg: Option<[f64; 2]>,
}

impl Stillness {
    /// Of the same potentiometer in all squeezes of the training.
    pub(crate) fn of<C: AsRef<[f64]>>(columns: impl Iterator<Item = C>) -> Self {
        let mut levels: Vec<f64> = columns
            .filter_map(|column| level_of_still(column.as_ref()))
            .collect();
        levels.sort_by(f64::total_cmp);
        let odd = usize::from(levels.len() > 2);
        let of_end = |n: usize| levels.get(n).copied();
        let most = levels.len().checked_sub(1 + odd).and_then(of_end);
        Self {
            levels_deg: of_end(odd).zip(most).map(|(least, most)| [least, most]),
        }
    }

    /// Whether the potentiometer is stuck in a squeeze that is over.
    pub(crate) fn is_stuck(self, column: &[f64]) -> bool {
        let is_known = |level: f64| {
            self.levels_deg
                .is_some_and(|[low, high]| (low - BEYOND_DEG..=high + BEYOND_DEG).contains(&level))
        };
        level_of_still(column).is_some_and(|level| !is_known(level))
    }

    /// Whether one that was read is one.
    pub(crate) fn is_whole(self) -> bool {
        self.levels_deg.is_none_or(|[low, high]| low <= high)
    }
}

/// The mean of a column that stands still.
fn level_of_still(column: &[f64]) -> Option<f64> {
    let part = |n: usize| &column[n * column.len() / PARTS..(n + 1) * column.len() / PARTS];
    let mut means = [0.0; PARTS];
    for (n, mean) in means.iter_mut().enumerate() {
        let known = || part(n).iter().filter(|value| value.is_finite());
        *mean = match known().count() {
            0 => return None,
            count => known().sum::<f64>() / count as f64,
        };
    }
    let least = means.iter().copied().fold(f64::INFINITY, f64::min);
    let most = means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (most - least <= STILL_DEG).then(|| means.iter().sum::<f64>() / PARTS as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moves by `by` and back, with a count of noise in every tenth sample.
    fn column(level: f64, by: f64) -> Vec<f64> {
        let at = |row: usize| level + by * (1.0 - (row as f64 - 47.0).abs() / 47.0);
        let noise = |row: usize| if (row * 7).is_multiple_of(10) { 0.33 } else { 0.0 };
        (0..95).map(|row| at(row) + noise(row)).collect()
    }

    #[test]
    fn a_potentiometer_that_stands_where_no_sound_one_stood_is_stuck() {
        let columns = [column(40.0, 0.0), column(43.0, 0.0), column(55.0, 3.0)];
        let stillness = Stillness::of(columns.into_iter());
        for (level, by, is_stuck) in [
            (41.0, 0.0, false),
            (48.0, 0.0, false),
            (55.0, 0.0, true),
            (30.0, 0.0, true),
            (30.0, 1.0, false),
        ] {
            assert_eq!(stillness.is_stuck(&column(level, by)), is_stuck, "{level} {by}");
        }
        // One that always moved is never believed when it does not.
        let moving = Stillness::of([column(40.0, 2.0)].into_iter());
        assert!(moving.is_stuck(&column(40.0, 0.0)) && !moving.is_stuck(&[f64::NAN; 95]));
        assert!(!moving.is_stuck(&[40.0; 3]), "too short to tell");
    }
}
