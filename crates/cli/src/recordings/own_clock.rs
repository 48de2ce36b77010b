//! Times on a recording's own clock, which may begin at 0 or in 1970.

use std::ops::RangeInclusive;

/// What a clock may show, seconds: up to the year 2096 of those that begin in 1970.
pub(crate) const CLOCK_S: RangeInclusive<f64> = 0.0..=4e9;

/// Nanoseconds by which a first frame may come later than it is said to be there: sweeps are timed by their ends.
pub(crate) const LATE_NS: u64 = 100_000_000;

/// The instant that so many seconds name, nanoseconds. Of times since 1970, doubles keep a quarter of a microsecond: it is the
/// earliest that the same number of seconds may stand for in the recording.
pub(crate) fn instant_ns(seconds: f64) -> u64 {
    let next_ns = ((seconds.next_up() - seconds) * 1e9).round() as u64;
    ((seconds * 1e9).round() as u64).saturating_sub(next_ns)
}
