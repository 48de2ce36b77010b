//! Settings outside their ranges, refused in one way.

use std::ops::RangeInclusive;

/// A setting outside its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{table}{key} = {value} is outside {min} to {max}{}{unit}", if unit.is_empty() { "" } else { " " })]
pub struct RangeError {
    /// Where the key is, as a message begins: `sweep: `, `joints.`.
    pub table: &'static str,
    /// The key.
    pub key: String,
    /// The value given.
    pub value: f64,
    /// Smallest allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
    /// Unit of all three; empty where the key's name says it.
    pub unit: &'static str,
}

/// Refuses a value outside its range, and what is not a number.
pub fn check_range(
    table: &'static str,
    key: impl Into<String>,
    value: impl Into<f64>,
    range: RangeInclusive<f64>,
    unit: &'static str,
) -> Result<(), RangeError> {
    let value = value.into();
    if range.contains(&value) {
        return Ok(());
    }
    Err(RangeError {
        table,
        key: key.into(),
        value,
        min: *range.start(),
        max: *range.end(),
        unit,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_belong_to_a_range_and_not_a_number_to_none() {
        let check = |value: f64| check_range("tick.", "rate_hz", value, 1.0..=1000.0, "Hz");
        for good in [1.0, 30.0, 1000.0] {
            check(good).unwrap();
        }
        for (bad, text) in [
            (0.5, "tick.rate_hz = 0.5 is outside 1 to 1000 Hz"),
            (f64::NAN, "tick.rate_hz = NaN is outside 1 to 1000 Hz"),
        ] {
            assert_eq!(check(bad).unwrap_err().to_string(), text);
        }
        let share = check_range("profile: ", "history", 101, 0.0..=100.0, "");
        assert_eq!(
            share.unwrap_err().to_string(),
            "profile: history = 101 is outside 0 to 100"
        );
    }
}
