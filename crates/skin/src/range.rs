//! Settings outside their ranges, refused in one way.

/// A setting outside its range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{table}: {field} = {value} is outside {min} to {max}")]
pub struct RangeError {
    /// The table of the configuration.
    pub table: &'static str,
    /// The key.
    pub field: &'static str,
    /// The value given.
    pub value: f64,
    /// Smallest allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
}

/// Checks `(field, value, min, max)` one after the other; NaN is outside every range.
pub(crate) fn check_ranges(
    table: &'static str,
    ranges: &[(&'static str, f64, f64, f64)],
) -> Result<(), RangeError> {
    for &(field, value, min, max) in ranges {
        if !(value >= min && value <= max) {
            return Err(RangeError {
                table,
                field,
                value,
                min,
                max,
            });
        }
    }
    Ok(())
}

/// Milliseconds as nanoseconds.
pub(crate) fn nanoseconds(ms: f64) -> u64 {
    (ms * 1e6).round() as u64
}
