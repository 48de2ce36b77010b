//! Settings outside their ranges, refused in one way.

use taxel_hand::{RangeError, check_range};

/// Checks `(key, value, min, max)` of a table one after the other; `table` is how a message begins.
pub(crate) fn check_ranges(
    table: &'static str,
    ranges: &[(&'static str, f64, f64, f64)],
) -> Result<(), RangeError> {
    ranges
        .iter()
        .try_for_each(|&(key, value, min, max)| check_range(table, key, value, min..=max, ""))
}

/// Milliseconds as nanoseconds.
pub(crate) fn nanoseconds(ms: f64) -> u64 {
    (ms * 1e6).round() as u64
}
