//! Quantiles of measurements.

use serde::Serialize;

/// The value that a share `q` (0 to 1) of the values does not exceed: the nearest rank, so always
/// one of the values; 0 if there are none. Sorts.
///
/// ```
/// let mut times = [3.0, 1.0, 2.0, 10.0];
/// assert_eq!(taxel_eval::quantile(&mut times, 0.5), 2.0);
/// assert_eq!(taxel_eval::quantile(&mut times, 0.99), 10.0);
/// ```
pub fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let rank = (q * values.len() as f64).ceil() as usize;
    values.get(rank.max(1) - 1).copied().unwrap_or(0.0)
}

/// The quantiles that reports give of times, in their unit.
#[derive(Debug, Default, Clone, Copy, PartialEq, Serialize)]
pub struct Quantiles {
    /// Median.
    pub p50: f64,
    /// 99 in 100 are no longer.
    pub p99: f64,
    /// 999 in 1000 are no longer.
    pub p999: f64,
    /// The longest.
    pub max: f64,
}

impl Quantiles {
    /// Of these values. Sorts.
    pub fn of(values: &mut [f64]) -> Self {
        let mut at = |q| quantile(values, q);
        Self {
            p50: at(0.5),
            p99: at(0.99),
            p999: at(0.999),
            max: at(1.0),
        }
    }
}

/// Mean; 0 of nothing.
pub(crate) fn mean(values: &[f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_is_the_nearest_rank() {
        let mut values: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        for (q, want) in [
            (0.0, 1.0),
            (0.5, 50.0),
            (0.95, 95.0),
            (0.99, 99.0),
            (0.999, 100.0),
            (1.0, 100.0),
        ] {
            assert_eq!(quantile(&mut values, q), want, "{q}");
        }
        assert_eq!(quantile(&mut [], 0.5), 0.0);
        assert_eq!(quantile(&mut [4.0], 0.001), 4.0);
    }
}
