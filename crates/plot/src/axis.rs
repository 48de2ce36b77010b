//! Axes: what they say, what they span, where their ticks are.

use plotters::coord::combinators::{IntoLogRange, LogCoord};
use plotters::coord::ranged1d::{BoldPoints, Ranged};
use plotters::coord::types::RangedCoordf64;
use std::ops::Range;

/// One axis of a chart. Without a range of its own it spans the data.
#[derive(Debug, Clone, Default)]
pub struct Axis {
    pub(crate) label: String,
    pub(crate) names: Vec<String>,
    log: bool,
    range: Option<(f64, f64)>,
    from_zero: bool,
}

impl Axis {
    /// An axis of numbers; its label says the quantity and the unit.
    pub fn new(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..Self::default()
        }
    }

    /// An axis of names: the first is at 0, the next at 1, and so on. For bars and boxes, on x.
    pub fn of_names<S: Into<String>>(label: impl Into<String>, names: impl IntoIterator<Item = S>) -> Self {
        let names = names.into_iter().map(Into::into).collect();
        Self {
            names,
            ..Self::new(label)
        }
    }

    /// Logarithmic. What is not above zero is left out of the picture; the numbers keep it.
    pub fn log(mut self) -> Self {
        self.log = true;
        self
    }

    /// Spans `low` to `high`, whatever the data; what lies outside is drawn at the edge.
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    /// Begins at zero, or below it where data do.
    pub fn from_zero(mut self) -> Self {
        self.from_zero = true;
        self
    }

    /// The scale for these values.
    pub(crate) fn scale(&self, values: impl Iterator<Item = f64>) -> Scale {
        let usable = values.filter(|v| v.is_finite() && (!self.log || *v > 0.0));
        let (low, high) = usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
        let (low, high) = match self.range {
            Some(range) => range,
            None if !self.names.is_empty() => (-0.5, self.names.len() as f64 - 0.5),
            None if low > high && self.log => (1.0, 10.0),
            None if low > high => (0.0, 1.0),
            None => self.padded(low, high),
        };
        Scale {
            log: self.log,
            low,
            high,
        }
    }

    fn padded(&self, low: f64, high: f64) -> (f64, f64) {
        if self.log {
            let margin = ((high / low).ln() * 0.04).exp().max(1.05);
            return (low / margin, high * margin);
        }
        let width = if high > low {
            high - low
        } else {
            high.abs().max(1.0)
        };
        let margin = 0.04 * width;
        let low = if self.from_zero && low >= 0.0 {
            0.0
        } else {
            low - margin
        };
        (low, high + margin)
    }
}

/// From values to the share of the axis, 0 to 1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    log: bool,
    low: f64,
    high: f64,
}

impl Scale {
    /// Where a value is on the axis, 0 to 1; none for what has no place on it.
    pub(crate) fn place(&self, value: f64) -> Option<f64> {
        if !value.is_finite() || (self.log && value <= 0.0) {
            return None;
        }
        let share = if self.log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        share.is_finite().then(|| share.clamp(0.0, 1.0))
    }

    /// Round values, about `count` of them.
    pub(crate) fn ticks(&self, count: usize) -> Vec<f64> {
        let range: Range<f64> = self.low..self.high;
        let hint = BoldPoints(count.max(2));
        let ticks = if self.log {
            let decades = (self.high / self.low).log10();
            let coord: LogCoord<f64> = range.clone().log_scale().into();
            let all: Vec<f64> = coord.key_points(hint);
            // Plotters marks whole decades; two of them make no axis.
            if decades < 1.5 { one_two_five(&range) } else { all }
        } else {
            RangedCoordf64::from(range.clone()).key_points(hint)
        };
        ticks
            .into_iter()
            .filter(|v| (range.start..=range.end).contains(v))
            .collect()
    }
}

fn one_two_five(range: &Range<f64>) -> Vec<f64> {
    let first = range.start.log10().floor() as i32;
    let last = range.end.log10().ceil() as i32;
    let decades = (first..=last).map(|power| 10f64.powi(power));
    decades.flat_map(|d| [d, 2.0 * d, 5.0 * d]).collect()
}

/// A value as short as it can be said beside a tick.
pub(crate) fn tick_text(value: f64) -> String {
    let size = value.abs();
    if value != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{value:.1e}").replace(".0e", "e");
    }
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    // What is left of a rounding error around zero.
    if text == "-0" || text.is_empty() {
        "0"
    } else {
        text
    }
    .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_said_as_short_as_they_can_be() {
        for (value, text) in [
            (0.0, "0"),
            (-1e-17, "-1e-17"),
            (0.25, "0.25"),
            (10.0, "10"),
            (20_000.0, "20000"),
            (1e6, "1e6"),
            (2.5e-4, "2.5e-4"),
            (-3.0, "-3"),
        ] {
            assert_eq!(tick_text(value), text);
        }
    }

    #[test]
    fn what_has_no_place_on_an_axis_gets_none() {
        let log = Axis::new("")
            .log()
            .scale([1.0, -3.0, f64::NAN, 100.0].into_iter());
        assert_eq!(
            (log.place(0.0), log.place(-1.0), log.place(f64::NAN)),
            (None, None, None)
        );
        assert!((log.place(10.0).unwrap() - 0.5).abs() < 1e-9);
        let linear = Axis::new("").range(0.0, 10.0).scale([].into_iter());
        assert_eq!((linear.place(20.0), linear.place(-1.0)), (Some(1.0), Some(0.0)));
    }

    #[test]
    fn an_axis_has_ticks_whatever_its_data() {
        for values in [&[][..], &[5.0], &[0.0, 0.0], &[1e-9, 2e-9], &[1.0, 1e12]] {
            for axis in [Axis::new(""), Axis::new("").log(), Axis::new("").from_zero()] {
                let ticks = axis.scale(values.iter().copied()).ticks(5);
                assert!((1..=16).contains(&ticks.len()), "{axis:?} {values:?}: {ticks:?}");
            }
        }
    }
}
