//! What a taxel's force is: four readings of eq. (1).

use serde::{Deserialize, Serialize};

/// How counts `s` and baseline `s_0` become one magnitude.
///
/// The publication prints the squared norm, calls it magnitude, and subtracts two of them. On
/// counts with an offset that is blind to motion across the offset, so the default is the norm of
/// the difference.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MagnitudeMode {
    /// `||s - s_0||_2`, counts.
    #[default]
    Vector,
    /// `||s - s_0||_2^2`, counts squared.
    VectorSquared,
    /// `| ||s||_2 - ||s_0||_2 |`, counts: difference of scalars, without the printed square.
    Literal,
    /// `| ||s||_2^2 - ||s_0||_2^2 |`, counts squared: the publication to the letter. Exact when
    /// `s_0` is a frame, since both squares are integers below 2^53.
    LiteralSquared,
}

impl MagnitudeMode {
    /// Whether the result is in counts squared.
    pub fn is_squared(self) -> bool {
        matches!(self, Self::VectorSquared | Self::LiteralSquared)
    }

    /// The magnitude of `counts` above `baseline`, in the unit of the mode.
    #[inline]
    pub fn of(self, counts: [i32; 3], baseline: [f64; 3]) -> f64 {
        match self {
            Self::Vector => distance_squared(counts, baseline).sqrt(),
            Self::VectorSquared => distance_squared(counts, baseline),
            Self::Literal => (norm_squared(counts).sqrt() - baseline_norm_squared(baseline).sqrt()).abs(),
            Self::LiteralSquared => (norm_squared(counts) - baseline_norm_squared(baseline)).abs(),
        }
    }
}

/// `||s - s_0||_2^2`, counts squared.
#[inline]
pub(super) fn distance_squared(counts: [i32; 3], baseline: [f64; 3]) -> f64 {
    let [x, y, z] = counts;
    let (x, y, z) = (
        f64::from(x) - baseline[0],
        f64::from(y) - baseline[1],
        f64::from(z) - baseline[2],
    );
    x * x + y * y + z * z
}

#[inline]
fn norm_squared(counts: [i32; 3]) -> f64 {
    counts.iter().map(|c| i64::from(*c) * i64::from(*c)).sum::<i64>() as f64
}

#[inline]
fn baseline_norm_squared(baseline: [f64; 3]) -> f64 {
    baseline.iter().map(|b| b * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mode_on_a_triangle() {
        let (counts, baseline) = ([3, 4, 12], [0.0, 4.0, 0.0]);
        for (mode, expected) in [
            (MagnitudeMode::Vector, 153.0_f64.sqrt()),
            (MagnitudeMode::VectorSquared, 153.0),
            (MagnitudeMode::Literal, 9.0),
            (MagnitudeMode::LiteralSquared, 153.0),
        ] {
            assert_eq!(mode.of(counts, baseline), expected, "{mode:?}");
        }
    }

    #[test]
    fn literal_squared_is_exact_at_the_largest_counts() {
        let top = [65_535; 3];
        let base = [65_535.0, 65_535.0, 65_534.0];
        assert_eq!(MagnitudeMode::LiteralSquared.of(top, base), 131_069.0);
    }

    #[test]
    fn literal_is_blind_across_the_offset_and_vector_is_not() {
        let baseline = [30_000.0, 0.0, 40_000.0];
        let across = [30_000 + 400, 0, 40_000 - 300];
        assert!(MagnitudeMode::Literal.of(across, baseline) < 3.0);
        assert_eq!(MagnitudeMode::Vector.of(across, baseline), 500.0);
    }
}
