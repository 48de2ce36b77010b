//! Which of a daemon's frames hold a reading that the one before did not.

/// Nanoseconds that an age in whole microseconds leaves open.
const ROUNDING_NS: u64 = 1_000;

/// When the newest reading of the frames so far was received, on the daemon's clock.
#[derive(Debug, Default)]
pub struct NewestReading(Option<u64>);

impl NewestReading {
    /// Whether a frame of this instant, with values of these ages (microseconds, `u32::MAX` where there is none), has a newer
    /// reading than all before. A daemon that ticks faster than its boards speak, or whose boards are silent, makes frames
    /// without one: they have the time of their tick, and the values of the frame before, which may be from before a mark.
    pub fn advances(&mut self, t_ns: u64, ages_us: impl Iterator<Item = u32>) -> bool {
        let Some(age_us) = ages_us.min().filter(|age_us| *age_us < u32::MAX) else {
            return false;
        };
        let read_ns = t_ns.saturating_sub(u64::from(age_us) * 1_000);
        let is_newer = self.0.is_none_or(|before_ns| read_ns > before_ns + ROUNDING_NS);
        if is_newer {
            self.0 = Some(read_ns);
        }
        is_newer
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_of_a_tick_for_which_nothing_came_has_no_newer_reading() {
        // Sweeps each 50 ms, of which the last reading comes at 42.0004 ms, and a tick each 33.3333 ms.
        let mut newest = NewestReading::default();
        let mut told = Vec::new();
        for tick in 2u64..10 {
            let tick_ns = tick * 33_333_300;
            let read_ns = (tick_ns - 42_000_400) / 50_000_000 * 50_000_000 + 42_000_400;
            let came = read_ns + 33_333_300 > tick_ns;
            let t_ns = if came { read_ns } else { tick_ns };
            let ages_us = [u32::MAX, ((t_ns - read_ns) / 1_000) as u32, 9_000_000];
            assert_eq!(newest.advances(t_ns, ages_us.into_iter()), came, "tick {tick}");
            told.push(came);
        }
        assert!(told.contains(&true) && told.contains(&false));
    }

    #[test]
    fn of_a_hand_that_is_silent_or_was_never_heard_no_frame_has_one() {
        let mut newest = NewestReading::default();
        assert!(!newest.advances(5_000_000, [u32::MAX; 2].into_iter()));
        assert!(newest.advances(6_000_000, [u32::MAX, 10].into_iter()));
        assert!(!newest.advances(900_000_000, [u32::MAX, 894_010].into_iter()));
        assert!(newest.advances(950_000_000, [0, 944_010].into_iter()));
    }
}
