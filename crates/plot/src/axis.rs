//! Axes: what they say, what they span, where their ticks are.

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
    at: Vec<f64>,
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

    /// Ticks at these values alone, such as the sizes that were measured, in place of round ones.
    pub fn ticks(mut self, at: impl IntoIterator<Item = f64>) -> Self {
        self.at = at.into_iter().collect();
        self
    }

    /// Where ticks are on this scale, about `count` of them, and what they say.
    pub(crate) fn marked(&self, scale: &Scale, count: usize) -> Vec<(f64, String)> {
        let within = |value: &f64| (scale.low..=scale.high).contains(value);
        let ticks = if self.at.is_empty() {
            scale.ticks(count)
        } else {
            self.at.iter().copied().filter(within).collect()
        };
        let texts = tick_texts(&ticks);
        ticks.into_iter().zip(texts).collect()
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

    /// Round values, about `count` of them; three or more where that does not crowd them.
    fn ticks(&self, count: usize) -> Vec<f64> {
        let range: Range<f64> = self.low..self.high;
        let count = count.max(2);
        let on_axis = |ticks: Vec<f64>| {
            let within =
                |value: &f64| (range.start..=range.end).contains(value) && (!self.log || *value > 0.0);
            ticks.into_iter().filter(within).collect::<Vec<f64>>()
        };
        let linear =
            |count: usize| on_axis(RangedCoordf64::from(range.clone()).key_points(BoldPoints(count)));
        let decades = self.log.then(|| on_axis(self.log_ticks(count)));
        // A part of a decade has round values of its own.
        let tries = decades.into_iter().chain((count..count + 3).map(linear));
        let mut best = Vec::new();
        for ticks in tries {
            if best.len() < 3 && ticks.len() > best.len() {
                best = ticks;
            }
        }
        best
    }

    /// 1, 2 and 5 of each decade up to two decades, then every decade, or as many as there is room for.
    fn log_ticks(&self, count: usize) -> Vec<f64> {
        let decades = (self.high / self.low).log10();
        let (steps, apart) = match decades {
            ..2.0 => (&[1.0, 2.0, 5.0][..], 1),
            _ => (&[1.0][..], (decades / count as f64).ceil() as i32),
        };
        let powers = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let powers = powers.filter(|power| power.rem_euclid(apart) == 0);
        powers
            .flat_map(|power| steps.iter().map(move |step| step * 10f64.powi(power)))
            .collect()
    }
}

/// A value as short as it can be said where it stands alone.
pub(crate) fn tick_text(value: f64) -> String {
    text(value, 0)
}

/// What stands beside ticks: in so many digits that each says where it is.
fn tick_texts(ticks: &[f64]) -> Vec<String> {
    let step = ticks.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let step = step.fold(f64::INFINITY, f64::min);
    // What is left of a rounding error around zero.
    let clean = |value: f64| if value.abs() < 1e-6 * step { 0.0 } else { value };
    let ticks: Vec<f64> = match ticks {
        [_] => ticks.to_vec(),
        _ => ticks.iter().copied().map(clean).collect(),
    };
    let told = |digits: usize| -> Vec<String> { ticks.iter().map(|tick| text(*tick, digits)).collect() };
    let is_exact = |texts: &Vec<String>| {
        texts.iter().zip(&ticks).all(|(text, tick)| {
            let off = text
                .parse::<f64>()
                .map_or(f64::INFINITY, |told| (told - tick).abs());
            off <= 0.01 * step
        })
    };
    (0..14).map(told).find(is_exact).unwrap_or_else(|| told(0))
}

/// A value with as many digits more than usual.
fn text(value: f64, digits: usize) -> String {
    let shortest = |text: &str| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text.to_owned(),
    };
    let size = value.abs();
    if value != 0.0 && !(1e-3..1e6).contains(&size) {
        let text = format!("{value:.0$e}", 1 + digits);
        let (mantissa, power) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{power}", shortest(mantissa));
    }
    match shortest(&format!("{value:.0$}", 4 + digits)) {
        zero if zero == "-0" => "0".into(),
        text => text,
    }
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

    #[test]
    fn a_log_axis_has_round_ticks_however_much_it_spans() {
        for (low, high, wanted) in [
            (38.0, 640.0, &[50.0, 100.0, 200.0, 500.0][..]),
            (90.0, 4_000.0, &[100.0, 200.0, 500.0, 1_000.0, 2_000.0]),
            (250.0, 480.0, &[300.0, 400.0]),
            (8.0, 17_000.0, &[10.0, 100.0, 1_000.0, 10_000.0]),
            (0.5, 2e8, &[1.0, 100.0, 10_000.0, 1e6, 1e8]),
        ] {
            let ticks = Axis::new("")
                .log()
                .range(low, high)
                .scale([].into_iter())
                .ticks(5);
            assert!(
                wanted
                    .iter()
                    .all(|tick| ticks.iter().any(|t| (t - tick).abs() < 1e-9 * tick)),
                "{ticks:?}"
            );
            assert!((3..=8).contains(&ticks.len()), "{low} to {high}: {ticks:?}");
        }
    }

    #[test]
    fn a_low_chart_has_three_ticks_or_more() {
        for high in [4_700.0, 87_000.0, 1.04, 255.0, 99.0, 0.031] {
            let ticks = Axis::new("").range(0.0, high).scale([].into_iter()).ticks(3);
            assert!((3..=6).contains(&ticks.len()), "{high}: {ticks:?}");
        }
    }

    #[test]
    fn every_tick_says_where_it_is_in_few_digits() {
        for (ticks, wanted) in [
            (&[1e6, 1.02e6, 1.04e6][..], &["1e6", "1.02e6", "1.04e6"][..]),
            (&[1e6, 1.25e6, 1.5e6], &["1e6", "1.25e6", "1.5e6"]),
            (&[0.0, 50_000.0, 100_000.0], &["0", "50000", "100000"]),
            (&[1.00001, 1.00002], &["1.00001", "1.00002"]),
            (&[-0.1, -1e-17, 0.1], &["-0.1", "0", "0.1"]),
            (&[0.1, 0.2, 0.30000000000000004], &["0.1", "0.2", "0.3"]),
            (&[1e-4], &["1e-4"]),
        ] {
            assert_eq!(tick_texts(ticks), wanted);
        }
    }

    #[test]
    fn ticks_of_ones_own_stand_where_they_are_said_to() {
        let axis = Axis::new("").log().ticks([2.0, 4.0, 8.0, 999.0]);
        let marked = axis.marked(&axis.scale([2.0, 8.0].into_iter()), 5);
        let texts: Vec<&str> = marked.iter().map(|(_, text)| text.as_str()).collect();
        assert_eq!(texts, ["2", "4", "8"]);
    }
}
