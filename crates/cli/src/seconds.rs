//! Times as people write and read them.

use std::ops::RangeInclusive;
use std::time::Duration;

/// Reads an option's number of seconds within `range`, such as `4`, `0.5` or `30s`.
pub(crate) fn seconds(
    range: RangeInclusive<f64>,
) -> impl Fn(&str) -> Result<Duration, String> + Clone + Send + Sync {
    move |text| {
        let number = text.strip_suffix('s').unwrap_or(text).trim().parse::<f64>();
        let seconds = number.ok().filter(|seconds| range.contains(seconds));
        let (least, most) = range.clone().into_inner();
        seconds
            .map(Duration::from_secs_f64)
            .ok_or_else(|| format!("give seconds from {least} to {most}, such as 30 or 0.5"))
    }
}

/// A time in the two units that fit, of which the smaller is cut.
pub(crate) fn duration_text(seconds: f64) -> String {
    let whole = seconds as u64;
    let (days, hours, minutes) = (whole / 86_400, whole / 3600 % 24, whole / 60 % 60);
    match (days, hours, minutes) {
        (0, 0, 0) => format!("{whole} s"),
        (0, 0, minutes) => format!("{minutes} min {} s", whole % 60),
        (0, hours, minutes) => format!("{hours} h {minutes} min"),
        (days, hours, _) => format!("{days} d {hours} h"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_read_as_people_write_them() {
        let read = seconds(0.001..=3600.0);
        assert_eq!(read("30s"), Ok(Duration::from_secs(30)));
        assert_eq!(read("0.5"), Ok(Duration::from_millis(500)));
        assert_eq!(read("3600 s"), Ok(Duration::from_secs(3600)));
        for text in ["", "0", "-3", "3601", "1e300", "inf", "nan", "1h"] {
            let said = read(text).unwrap_err();
            assert_eq!(
                said, "give seconds from 0.001 to 3600, such as 30 or 0.5",
                "{text}"
            );
        }
    }

    #[test]
    fn a_time_is_told_in_two_units() {
        for (seconds, told) in [
            (0.4, "0 s"),
            (59.9, "59 s"),
            (90.0, "1 min 30 s"),
            (11_520.0, "3 h 12 min"),
            (100_000.0, "1 d 3 h"),
        ] {
            assert_eq!(duration_text(seconds), told);
        }
    }
}
