//! Times in a table: their columns where no name says so, and their cells.

use super::columns::cell;
use crate::table::TimeUnit;
use csv::ByteRecord;

/// Lines that show whether a column without a name is time.
pub(super) const LINES: usize = 100;

/// Whether these cells rise as times do, and not as numbers of frames: one is no whole number, or the first is far from 0.
pub(super) fn is_clock<'a>(cells: impl Iterator<Item = &'a ByteRecord>) -> bool {
    let number = |record: &ByteRecord| {
        let first = record
            .get(0)
            .and_then(|bytes| cell(bytes).ok()?.parse::<f64>().ok());
        first.filter(|number| number.is_finite())
    };
    let Some(times) = cells.map(number).collect::<Option<Vec<f64>>>() else {
        return false;
    };
    let is_no_number_of_a_frame =
        times.iter().any(|time| time.fract() != 0.0) || unit_since_1970(&times).is_some();
    is_no_number_of_a_frame && rises(&times)
}

/// The unit in which these would be times of these years, one after another.
pub(super) fn unit_since_1970(times: &[f64]) -> Option<TimeUnit> {
    let units = [TimeUnit::S, TimeUnit::Ms, TimeUnit::Us, TimeUnit::Ns];
    let is_in = |unit: &TimeUnit| {
        let second = 10f64.powi(9 - unit.decimals());
        times
            .iter()
            .all(|time| (1e9 * second..2e9 * second).contains(time))
    };
    units.into_iter().find(is_in).filter(|_| rises(times))
}

fn rises(times: &[f64]) -> bool {
    times.windows(2).all(|pair| pair[0] <= pair[1]) && times.first() < times.last()
}

/// The unit in which a clock of these years is at a number beyond its seconds.
pub(super) fn unit_beyond_seconds(number: f64) -> &'static str {
    match number {
        ..1e14 => "ms",
        ..1e17 => "us",
        _ => "ns",
    }
}

/// The time of a cell that holds this number. Nanoseconds since 1970 are more than a number of 53 bits can hold, in
/// whatever unit they are written: its digits are taken as they stand there, and rounded below a nanosecond.
pub(super) fn time_ns(bytes: &[u8], number: f64, unit: TimeUnit) -> Option<u64> {
    let exact = cell(bytes).ok().and_then(|text| exact_ns(text, unit));
    exact.or_else(|| {
        let time_ns = (number * 10f64.powi(unit.decimals())).round();
        (0.0..1.8e19).contains(&time_ns).then_some(time_ns as u64)
    })
}

/// The nanoseconds of a number as it is written; none where it has a sign, no digits, or more of them than fit.
fn exact_ns(text: &str, unit: TimeUnit) -> Option<u64> {
    let (number, exponent) = match text.split_once(['e', 'E']) {
        Some((number, exponent)) => (number, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
    let digits: u128 = format!("{whole}{fraction}").parse().ok()?;
    let decimals = i32::try_from(fraction.len()).ok()?;
    let scale = exponent.checked_add(unit.decimals())?.checked_sub(decimals)?;
    let power = 10u128.checked_pow(scale.unsigned_abs())?;
    let time_ns = match scale < 0 {
        true => digits.checked_add(power / 2)? / power,
        false => digits.checked_mul(power)?,
    };
    time_ns.try_into().ok()
}
