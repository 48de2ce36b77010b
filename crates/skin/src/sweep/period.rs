//! How often a board sends its taxels, measured from what it sends.

/// Assumed until something was measured: uSkin's 100 Hz (docs/protocols.md, "Bus timing").
pub(crate) const START_NS: u64 = 10_000_000;
const SHORTEST_NS: u64 = 1_000_000;
const LONGEST_NS: u64 = 10_000_000_000;

/// Running median of the times between two readings of the same taxel, over all taxels of one board.
///
/// Each interval moves the estimate a small step, whose size does not depend on the interval. All
/// intervals of a sweep together move it by 1/4 of itself at first and by 1/64 after sixteen
/// sweeps; those that are off by more than half, as repetitions and what follows a lost frame are,
/// by an eighth of that. Only if two sweeps' worth of intervals agree that it is far off, and at
/// the start, it goes by halves until it meets one, and begins with large steps again.
#[derive(Debug, Clone)]
pub(crate) struct Period {
    estimate_ns: u64,
    /// Intervals taken since it met one.
    taken: u32,
    measured: bool,
    /// Whether it goes by halves.
    seeking: bool,
    /// Intervals far above the estimate minus those far below; near ones pull it to zero by two.
    far: i32,
    far_limit: i32,
    /// Binary logarithm of the board's number of taxels, rounded up.
    taxels_log2: u32,
}

impl Period {
    /// For a board of this many taxels.
    pub(crate) fn new(taxels: usize) -> Self {
        let taxels = taxels.max(1) as u32;
        Self {
            estimate_ns: START_NS,
            taken: 0,
            measured: false,
            seeking: true,
            far: 0,
            far_limit: 2 * taxels as i32,
            taxels_log2: taxels.next_power_of_two().trailing_zeros(),
        }
    }

    /// Takes the time between two successive readings of one taxel. Constant time. Less than half
    /// of the shortest period is a repetition and nothing else.
    pub(crate) fn measure(&mut self, interval_ns: u64) {
        if interval_ns < SHORTEST_NS / 2 {
            return;
        }
        let estimate = self.estimate_ns;
        let longer = interval_ns > estimate;
        let near = interval_ns.abs_diff(estimate) <= estimate / 2;
        if near {
            self.far -= self.far.clamp(-2, 2);
        } else {
            self.far += if longer { 1 } else { -1 };
            self.seeking |= self.far.abs() > self.far_limit;
        }
        let sweeps_log2 = ((self.taken >> self.taxels_log2) + 1).ilog2();
        let shift = 2 + sweeps_log2.min(4) + self.taxels_log2;
        self.taken = self.taken.saturating_add(1);
        let step = match (self.seeking, near) {
            (true, _) => estimate / 2,
            (false, true) => estimate >> shift,
            (false, false) => estimate >> (shift + 3),
        };
        let moved = if longer {
            (estimate + step).min(interval_ns)
        } else {
            (estimate - step).max(interval_ns)
        };
        if self.seeking && moved == interval_ns {
            self.seeking = false;
            self.far = 0;
            self.taken = 0;
        }
        self.estimate_ns = moved.clamp(SHORTEST_NS, LONGEST_NS);
        self.measured = true;
    }

    /// The estimate, nanoseconds, 1 ms to 10 s.
    pub(crate) fn ns(&self) -> u64 {
        self.estimate_ns
    }

    /// The estimate, if it is one: `None` before the first interval.
    pub(crate) fn measured_ns(&self) -> Option<u64> {
        self.measured.then_some(self.estimate_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const TAXELS: u64 = 16;

    /// Takes `sweeps` sweeps of the same interval.
    fn run(period: &mut Period, sweeps: u64, interval_ns: u64) -> u64 {
        for _ in 0..sweeps * TAXELS {
            period.measure(interval_ns);
        }
        period.ns()
    }

    fn off_by(value: u64, truth: u64) -> f64 {
        value.abs_diff(truth) as f64 / truth as f64
    }

    #[test]
    fn one_sweep_is_enough_at_the_start() {
        for ms in [1, 2, 8, 10, 12, 20, 33, 100, 1000, 5000] {
            let mut period = Period::new(TAXELS as usize);
            assert_eq!(run(&mut period, 1, ms * MS), ms * MS);
        }
    }

    #[test]
    fn a_change_of_the_period_is_followed() {
        for from in [1, 10, 20, 33, 100, 10_000] {
            for to in [1, 10, 20, 33, 100, 10_000] {
                let mut period = Period::new(TAXELS as usize);
                run(&mut period, 10, from * MS);
                let after = run(&mut period, 50, to * MS);
                assert!(off_by(after, to * MS) < 0.01, "{from} to {to} ms: {after}");
            }
        }
    }

    #[test]
    fn doubled_and_lost_frames_move_it_by_less_than_a_tenth() {
        let mut period = Period::new(TAXELS as usize);
        run(&mut period, 20, 20 * MS);
        for i in 0..10_000u64 {
            match i % 10 {
                0 | 3 => period.measure(40 * MS),
                5 => period.measure(30_000),
                // Held back: the time before it is longer, the time after it shorter.
                7 => [39, 1].into_iter().for_each(|ms| period.measure(ms * MS)),
                _ => period.measure(20 * MS),
            }
            assert!(off_by(period.ns(), 20 * MS) < 0.1, "{}", period.ns());
        }
        // A whole sweep lost, and one that came twice.
        run(&mut period, 1, 40 * MS);
        run(&mut period, 1, MS);
        assert!(off_by(period.ns(), 20 * MS) < 0.1, "{}", period.ns());
    }

    #[test]
    fn it_stays_between_its_limits() {
        let mut period = Period::new(TAXELS as usize);
        assert_eq!(run(&mut period, 10, SHORTEST_NS / 2), SHORTEST_NS);
        assert_eq!(run(&mut period, 10, u64::MAX), LONGEST_NS);
        assert_eq!(run(&mut period, 10, 7 * MS), 7 * MS);
    }
}
