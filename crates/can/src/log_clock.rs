//! The time of a recording, made of stamps from a clock that may be set while it is recorded.

use std::fmt;

/// A stamp so far before the newest is no frame that another overtook: the clock was set back.
const SET_BACK_NS: u64 = 1_000_000_000;
/// The longest pause of a recording that is played, nanoseconds. Behind a longer one is a clock that was set forward,
/// as that of a computer without a battery is when it first hears of the time, a damaged time, or a hand that was off.
pub const LONGEST_PAUSE_NS: u64 = 60 * 1_000_000_000;

/// Turns the stamps of a recording into time since its first frame.
///
/// candump stamps with the wall clock, and logs are put together from several. Where the stamps go
/// back by more than a second, or forward by more than [`LONGEST_PAUSE_NS`], the frame is due together
/// with the newest before it, and time goes on from there; both are counted in [`ClockJumps`]. Smaller
/// steps are left as they are: [`LogClock::since_first_ns`] may go back by up to a second.
///
/// Give it every frame of the file, whatever is done with it, so that all that read one file have
/// the same time.
#[derive(Debug, Default, Clone)]
pub struct LogClock {
    newest: Option<Newest>,
    jumps: ClockJumps,
}

#[derive(Debug, Clone, Copy)]
struct Newest {
    stamp_ns: u64,
    since_first_ns: u64,
}

/// Where the time of a recording was not taken as it stands there.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct ClockJumps {
    /// How often it went forward by more than [`LONGEST_PAUSE_NS`].
    pub forward: u64,
    /// Time left out there in all, nanoseconds.
    pub skipped_ns: u64,
    /// How often it went back by more than a second.
    pub back: u64,
    /// Line of the first frame behind a jump, from 1; 0 where there was none.
    pub first_line: u64,
}

impl ClockJumps {
    /// How many there were.
    pub fn count(&self) -> u64 {
        self.forward.saturating_add(self.back)
    }

    /// Notes that the frame at `line` came so much after the one before it, and is played as if it came at once.
    pub fn skip(&mut self, line: u64, ns: u64) {
        self.forward += 1;
        self.skipped_ns = self.skipped_ns.saturating_add(ns);
        self.note(line);
    }

    fn note(&mut self, line: u64) {
        if self.first_line == 0 {
            self.first_line = line;
        }
    }
}

impl fmt::Display for ClockJumps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times = |count: u64| match count {
            1 => "once".to_owned(),
            count => format!("{count} times"),
        };
        f.write_str("its time jumps")?;
        if self.forward > 0 {
            let (skipped_s, limit_s) = (self.skipped_ns as f64 / 1e9, LONGEST_PAUSE_NS / 1_000_000_000);
            let forward = times(self.forward);
            write!(
                f,
                " forward by more than {limit_s} s {forward} ({skipped_s:.1} s left out)"
            )?;
        }
        if self.back > 0 {
            let and = if self.forward > 0 { " and" } else { "" };
            write!(f, "{and} back by more than 1 s {}", times(self.back))?;
        }
        write!(f, ", first at line {}", self.first_line)
    }
}

impl LogClock {
    /// Time from the first frame to the frame of this stamp, which stands at `line` (from 1), nanoseconds; 0 for one
    /// just before the first.
    #[inline]
    pub fn since_first_ns(&mut self, stamp_ns: u64, line: u64) -> u64 {
        let Some(newest) = &mut self.newest else {
            self.newest = Some(Newest {
                stamp_ns,
                since_first_ns: 0,
            });
            return 0;
        };
        let back_ns = newest.stamp_ns.saturating_sub(stamp_ns);
        if (1..=SET_BACK_NS).contains(&back_ns) {
            return newest.since_first_ns.saturating_sub(back_ns);
        }
        let forward_ns = stamp_ns.saturating_sub(newest.stamp_ns);
        newest.stamp_ns = stamp_ns;
        if forward_ns > LONGEST_PAUSE_NS {
            self.jumps.skip(line, forward_ns);
        } else if back_ns > 0 {
            self.jumps.back += 1;
            self.jumps.note(line);
        } else {
            newest.since_first_ns = newest.since_first_ns.saturating_add(forward_ns);
        }
        newest.since_first_ns
    }

    /// Where time was not taken as it stands.
    pub fn jumps(&self) -> ClockJumps {
        self.jumps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_on_where_the_clock_was_set() {
        const S: u64 = 1_000_000_000;
        let boot = 10 * S;
        let now = 1_795_000_000 * S;
        let mut clock = LogClock::default();
        for (line, (what, stamp_ns, since_first_ns)) in [
            ("the first", boot, 0),
            ("a frame", boot + 2, 2),
            ("one that was overtaken", boot + 1, 1),
            ("one from before the first", boot - 5, 0),
            ("a pause", boot + 60 * S, 60 * S),
            ("set forward", now, 60 * S),
            ("a frame", now + 7, 60 * S + 7),
            ("set back", now - 2 * S, 60 * S + 7),
            ("a frame", now - 2 * S + 3, 60 * S + 10),
            ("set back to nothing", 0, 60 * S + 10),
            ("a frame", 4, 60 * S + 14),
            ("set to the end of time", u64::MAX, 60 * S + 14),
            ("a second before", u64::MAX - S, 59 * S + 14),
        ]
        .into_iter()
        .enumerate()
        {
            assert_eq!(
                clock.since_first_ns(stamp_ns, line as u64 + 1),
                since_first_ns,
                "{what}"
            );
        }
        let jumps = clock.jumps();
        assert_eq!((jumps.forward, jumps.back, jumps.first_line), (2, 2, 6));
    }

    #[test]
    fn what_is_left_out_is_told_with_its_time_and_line() {
        let mut clock = LogClock::default();
        // One flipped byte: 6459 s for 0.006459 s.
        for (line, stamp_ns) in [(1, 0), (2, 6_459_000_000_000), (3, 7_000_000), (4, 8_000_000)] {
            clock.since_first_ns(stamp_ns, line);
        }
        assert_eq!(
            clock.jumps().to_string(),
            "its time jumps forward by more than 60 s once (6459.0 s left out) and back by more than 1 s once, first \
             at line 2"
        );
        assert_eq!(clock.since_first_ns(9_000_000, 5), 2_000_000);
    }
}
