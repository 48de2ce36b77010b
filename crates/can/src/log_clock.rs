//! The time of a recording, made of stamps from a clock that may be set while it is recorded.

/// A stamp so far before the newest is no frame that another overtook: the clock was set back.
const SET_BACK_NS: u64 = 1_000_000_000;
/// A stamp so far behind the newest is no pause: the clock was set forward, as that of a computer
/// without a battery is when it first hears of the time.
const SET_FORWARD_NS: u64 = 24 * 3600 * 1_000_000_000;

/// Turns the stamps of a recording into time since its first frame.
///
/// candump stamps with the wall clock, and logs are put together from several. Where the stamps go
/// back by more than a second, or forward by more than a day, the frame is due together with the
/// newest before it, and time goes on from there. Smaller steps are left as they are:
/// [`LogClock::since_first_ns`] may go back by up to a second.
///
/// Give it every frame of the file, whatever is done with it, so that all that read one file have
/// the same time.
#[derive(Debug, Default, Clone)]
pub struct LogClock {
    newest: Option<Newest>,
}

#[derive(Debug, Clone, Copy)]
struct Newest {
    stamp_ns: u64,
    since_first_ns: u64,
}

impl LogClock {
    /// Time from the first frame to the frame of this stamp, nanoseconds; 0 for one just before the first.
    pub fn since_first_ns(&mut self, stamp_ns: u64) -> u64 {
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
        if forward_ns <= SET_FORWARD_NS {
            newest.since_first_ns = newest.since_first_ns.saturating_add(forward_ns);
        }
        newest.since_first_ns
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
        for (what, stamp_ns, since_first_ns) in [
            ("the first", boot, 0),
            ("a frame", boot + 2, 2),
            ("one that was overtaken", boot + 1, 1),
            ("one from before the first", boot - 5, 0),
            ("a pause", boot + 3600 * S, 3600 * S),
            ("set forward", now, 3600 * S),
            ("a frame", now + 7, 3600 * S + 7),
            ("set back", now - 2 * S, 3600 * S + 7),
            ("a frame", now - 2 * S + 3, 3600 * S + 10),
            ("set back to nothing", 0, 3600 * S + 10),
            ("a frame", 4, 3600 * S + 14),
            ("set to the end of time", u64::MAX, 3600 * S + 14),
            ("a second before", u64::MAX - S, 3599 * S + 14),
        ] {
            assert_eq!(clock.since_first_ns(stamp_ns), since_first_ns, "{what}");
        }
    }
}
