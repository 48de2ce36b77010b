//! Names of columns and arrays that say that what is called so is time.

use crate::table::TimeUnit;

/// What a name of times says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ClockName {
    /// Their unit; none where the name has none.
    pub(crate) unit: Option<TimeUnit>,
    /// Whether it says no more than that, so that it is the time of a frame rather than that of something in it.
    pub(crate) is_plain: bool,
}

impl ClockName {
    /// None where a name says nothing of times. Case does not matter. A unit stands behind it (`time_ms`, `Time [ms]`), or
    /// is the name (`secs`). `%time` is what `rostopic echo -p` calls nanoseconds, `__time` what PlotJuggler calls seconds; of
    /// a field in a message, such as `/hand/header/stamp`, the last part tells.
    pub(crate) fn of(name: &str) -> Option<Self> {
        let lower = name.to_lowercase();
        if lower == "%time" {
            return Some(Self {
                unit: Some(TimeUnit::Ns),
                is_plain: true,
            });
        }
        let (name, in_brackets) = without_brackets(&lower);
        let name = last_part(name).trim_start_matches(['_', '%']);
        let words: Vec<&str> = name
            .split(['_', ' ', '-'])
            .filter(|word| !word.is_empty())
            .collect();
        let (words, unit) = match (in_brackets.and_then(unit), &words[..]) {
            (None, [before @ .., last]) if !before.is_empty() => match unit(last) {
                Some(unit) => (before, Some(unit)),
                None => (&words[..], None),
            },
            (unit, words) => (words, unit),
        };
        match words {
            ["t"] if !lower.contains(['.', '/']) => Some(Self { unit, is_plain: true }),
            ["time" | "timestamp" | "elapsed" | "stamp"] | ["time", "stamp"] => {
                Some(Self { unit, is_plain: true })
            }
            [.., "time" | "timestamp" | "stamp"] => Some(Self {
                unit,
                is_plain: false,
            }),
            [word] if word.len() > 2 && unit.is_none() => {
                let unit = Some(self::unit(word)?);
                Some(Self { unit, is_plain: true })
            }
            _ => None,
        }
    }
}

/// The names of two columns that are one time: whole seconds, and the nanoseconds beyond, as ROS has them.
pub(crate) fn in_two_columns<'a>(names: &[&'a str]) -> Option<[&'a str; 2]> {
    let called = |ends: [&str; 4]| {
        let is_so = |name: &&&str| ends.contains(&last_part(&name.to_ascii_lowercase()));
        names.iter().find(is_so).copied()
    };
    let seconds = called(["sec", "secs", "seconds", "stamp_sec"])?;
    Some([seconds, called(["nsec", "nsecs", "nanosec", "stamp_nanosec"])?])
}

/// What is behind the last dot or stroke of a field's name.
pub(crate) fn last_part(name: &str) -> &str {
    name.rsplit(['.', '/']).next().unwrap_or(name)
}

/// A name without the brackets at its end, and what is in them.
fn without_brackets(name: &str) -> (&str, Option<&str>) {
    let cut = name
        .strip_suffix([')', ']'])
        .and_then(|name| name.rsplit_once(['(', '[']));
    cut.map_or((name, None), |(name, inside)| {
        (name.trim_end(), Some(inside.trim()))
    })
}

fn unit(word: &str) -> Option<TimeUnit> {
    match word {
        "s" | "sec" | "secs" | "second" | "seconds" => Some(TimeUnit::S),
        "ms" | "msec" | "msecs" | "millis" | "milliseconds" => Some(TimeUnit::Ms),
        "us" | "\u{b5}s" | "\u{3bc}s" | "usec" | "usecs" | "micros" | "microseconds" => Some(TimeUnit::Us),
        "ns" | "nsec" | "nsecs" | "nanosec" | "nanos" | "nanoseconds" => Some(TimeUnit::Ns),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_times_say_their_unit_or_none() {
        let (s, ms, us, ns) = (TimeUnit::S, TimeUnit::Ms, TimeUnit::Us, TimeUnit::Ns);
        let plain = [
            ("t", None),
            ("T_ms", Some(ms)),
            ("time", None),
            ("TIMESTAMP", None),
            ("elapsed", None),
            ("time_ns", Some(ns)),
            ("timestamp_us", Some(us)),
            ("Time [s]", Some(s)),
            ("Time(ms)", Some(ms)),
            ("time [\u{b5}s]", Some(us)),
            ("__time", None),
            ("%time", Some(ns)),
            ("seconds", Some(s)),
            ("field.header.stamp", None),
            ("/hand/header/stamp", None),
        ];
        for (name, unit) in plain {
            let expected = ClockName { unit, is_plain: true };
            assert_eq!(ClockName::of(name), Some(expected), "{name}");
        }
        for (name, unit) in [
            ("host_time", None),
            ("recv_timestamp_ns", Some(ns)),
            ("ROS time (s)", Some(s)),
        ] {
            let expected = ClockName {
                unit,
                is_plain: false,
            };
            assert_eq!(ClockName::of(name), Some(expected), "{name}");
        }
        let others = [
            "tip",
            "t1",
            "a.t",
            "s",
            "ms",
            "timer",
            "Force 0 (N)",
            "/hand/data[5]",
            "J0",
            "sx",
            "0B5X",
            "",
        ];
        for name in others {
            assert_eq!(ClockName::of(name), None, "{name}");
        }
    }
}
