//! The one clock of the pipeline, and the way from the kernel's receive stamps to it.

use nix::time::{ClockId, clock_gettime};

/// `CLOCK_MONOTONIC` in nanoseconds: the scale of [`crate::Received::t_ns`] for every live source.
pub fn monotonic_ns() -> u64 {
    read(ClockId::CLOCK_MONOTONIC)
}

pub(crate) fn realtime_ns() -> u64 {
    read(ClockId::CLOCK_REALTIME)
}

/// `CLOCK_REALTIME` and `CLOCK_MONOTONIC` at one instant, nanoseconds. A reading that was interrupted half way would put them
/// apart, so it is the tightest of three.
pub fn both_clocks_ns() -> (u64, u64) {
    let (mut tightest, mut both) = (u64::MAX, (0, 0));
    for _ in 0..3 {
        let before = monotonic_ns();
        let realtime = realtime_ns();
        let width = monotonic_ns().saturating_sub(before);
        if width < tightest {
            (tightest, both) = (width, (realtime, before + width / 2));
        }
        if width < 1_000 {
            break;
        }
    }
    both
}

/// Both clocks are always there on Linux, so a failure cannot happen; 0 is what it would read as.
fn read(clock: ClockId) -> u64 {
    clock_gettime(clock).map_or(0, |t| {
        (t.tv_sec() as u64)
            .wrapping_mul(1_000_000_000)
            .wrapping_add(t.tv_nsec() as u64)
    })
}

/// Turns the kernel's receive stamps, which are wall clock time, into `CLOCK_MONOTONIC`.
///
/// The kernel stamps a socket's frames with `CLOCK_REALTIME`, which an operator or NTP may set at
/// any time. The offset between the clocks is therefore sampled again and again, and what it gives
/// is held between two times that are known without the wall clock: a frame read now arrived no
/// later than now, and no earlier than the last time its queue was found empty. So a step of the
/// wall clock, however large, shifts no frame by more than the time between two readings of the
/// socket, and times never run backwards.
#[derive(Debug, Clone)]
pub(crate) struct StampConverter {
    realtime_minus_monotonic_ns: i128,
    floor_ns: u64,
}

impl StampConverter {
    /// A converter for a queue that is empty at `monotonic_ns`, when the wall clock shows `realtime_ns`.
    pub(crate) fn new(realtime_ns: u64, monotonic_ns: u64) -> Self {
        Self {
            realtime_minus_monotonic_ns: i128::from(realtime_ns) - i128::from(monotonic_ns),
            floor_ns: monotonic_ns,
        }
    }

    /// Takes both clocks, read together, as the new offset between them.
    pub(crate) fn set_offset(&mut self, realtime_ns: u64, monotonic_ns: u64) {
        self.realtime_minus_monotonic_ns = i128::from(realtime_ns) - i128::from(monotonic_ns);
    }

    /// Says that the queue was empty at `monotonic_ns`: whatever it holds later arrived after that.
    pub(crate) fn queue_was_empty(&mut self, monotonic_ns: u64) {
        self.floor_ns = self.floor_ns.max(monotonic_ns);
    }

    /// The receive time of the next frame of the queue, read at `now_ns`; without a stamp it is `now_ns`.
    pub(crate) fn convert(&mut self, stamp_realtime_ns: Option<u64>, now_ns: u64) -> u64 {
        let ceiling = now_ns.max(self.floor_ns);
        let t_ns = match stamp_realtime_ns {
            None => ceiling,
            Some(stamp) => {
                let t = i128::from(stamp) - self.realtime_minus_monotonic_ns;
                u64::try_from(t.max(0))
                    .unwrap_or(u64::MAX)
                    .clamp(self.floor_ns, ceiling)
            }
        };
        self.floor_ns = t_ns;
        t_ns
    }

    /// Samples the machine's clocks.
    pub(crate) fn sample(&mut self) {
        let (realtime_ns, monotonic_ns) = both_clocks_ns();
        self.set_offset(realtime_ns, monotonic_ns);
    }

    /// A converter for a queue that is empty now.
    pub(crate) fn starting_now() -> Self {
        let (realtime_ns, monotonic_ns) = both_clocks_ns();
        Self::new(realtime_ns, monotonic_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const S: u64 = 1_000_000_000;
    const WALL: u64 = 1_700_000_000 * S;

    /// Started at 100 s of the monotonic clock.
    fn converter() -> StampConverter {
        StampConverter::new(WALL, 100 * S)
    }

    #[test]
    fn a_stamp_keeps_its_distance_to_now() {
        let mut c = converter();
        assert_eq!(c.convert(Some(WALL + 3 * S), 104 * S), 103 * S);
        assert_eq!(c.convert(Some(WALL + 3 * S + 7), 104 * S), 103 * S + 7);
    }

    #[test]
    fn without_a_stamp_the_time_of_reading_counts() {
        assert_eq!(converter().convert(None, 104 * S), 104 * S);
    }

    #[test]
    fn a_wall_clock_set_forward_puts_no_frame_into_the_future() {
        let mut c = converter();
        c.queue_was_empty(103 * S);
        assert_eq!(c.convert(Some(WALL + 3600 * S), 104 * S), 104 * S);
    }

    #[test]
    fn a_wall_clock_set_back_puts_no_frame_before_the_last_empty_queue() {
        let mut c = converter();
        c.queue_was_empty(103 * S);
        assert_eq!(c.convert(Some(WALL - 3600 * S), 104 * S), 103 * S);
        assert_eq!(c.convert(Some(0), 104 * S), 103 * S);
    }

    #[test]
    fn after_the_next_sample_a_step_is_forgotten() {
        let mut c = converter();
        c.set_offset(WALL + 3600 * S, 105 * S);
        c.queue_was_empty(105 * S);
        assert_eq!(c.convert(Some(WALL + 3600 * S + S), 107 * S), 106 * S);
    }

    #[test]
    fn the_machines_clocks_are_sampled_together() {
        let mut c = StampConverter::new(0, 0);
        c.sample();
        let before = monotonic_ns();
        let t = c.convert(Some(realtime_ns()), u64::MAX);
        let error = t.abs_diff(before);
        assert!(error < S, "{error} ns away from the clock it stands for");
    }

    proptest! {
        #[test]
        fn times_never_run_backwards_nor_ahead(
            steps in proptest::collection::vec((any::<u64>(), any::<u64>(), 0u64..S, any::<bool>()), 0..50)
        ) {
            let mut c = converter();
            let (mut now, mut last) = (100 * S, 0);
            for (stamp, wall, passed, resample) in steps {
                now += passed;
                if resample {
                    c.set_offset(wall, now);
                }
                let t = c.convert(Some(stamp), now);
                prop_assert!(t >= last && t <= now);
                last = t;
            }
        }
    }
}
