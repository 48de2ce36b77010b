//! The wall clock of a recording.

use taxel_can::both_clocks_ns;

/// By how much a clock was set at least that is taken for set, nanoseconds: less is the time between reading two clocks.
const SET_NS: u64 = 100_000_000;

/// From `CLOCK_MONOTONIC` to the wall clock, by what both showed when the recording began.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wall {
    /// Less than nothing where the wall clock stands before the machine's start.
    minus_monotonic_ns: i64,
}

impl Wall {
    pub(super) fn now() -> Self {
        let (realtime_ns, monotonic_ns) = both_clocks_ns();
        Self::between(realtime_ns, monotonic_ns)
    }

    fn between(realtime_ns: u64, monotonic_ns: u64) -> Self {
        Self {
            minus_monotonic_ns: realtime_ns.wrapping_sub(monotonic_ns) as i64,
        }
    }

    pub(super) fn at(self, t_ns: u64) -> u64 {
        t_ns.saturating_add_signed(self.minus_monotonic_ns)
    }

    /// How far the clock was set since then, where it was set since it was `known_ns` off; nanoseconds.
    pub(super) fn moved_ns(self, known_ns: i64) -> Option<i64> {
        let (realtime_ns, monotonic_ns) = both_clocks_ns();
        let moved_ns = realtime_ns.wrapping_sub(self.at(monotonic_ns)) as i64;
        (moved_ns.abs_diff(known_ns) > SET_NS).then_some(moved_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_was_set_is_told_once_by_how_far() {
        const DAY_NS: i64 = 86_400_000_000_000;
        let now = Wall::now();
        for day_ns in [DAY_NS, -DAY_NS] {
            // As one that began when the clock stood so.
            let wall = Wall {
                minus_monotonic_ns: now.minus_monotonic_ns - day_ns,
            };
            let moved_ns = std::iter::repeat_with(|| wall.moved_ns(0)).find_map(|moved| moved);
            assert!(moved_ns.unwrap().abs_diff(day_ns) < DAY_NS as u64 / 24);
            assert_eq!(wall.moved_ns(moved_ns.unwrap()), None);
        }
    }

    #[test]
    fn a_wall_clock_before_the_start_of_the_machine_is_the_wall_clock() {
        let wall = Wall::between(100_000_000_000, 20_000_000_000_000);
        assert_eq!(wall.at(20_005_000_000_000), 105_000_000_000);
    }
}
