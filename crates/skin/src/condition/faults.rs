//! Which taxels are faulty and why, in calibration and at run time.

use super::config::ConditionConfig;
use taxel_hand::{Fault, Faults};

/// Samples without change before a taxel is called stuck, whatever the time says.
const STUCK_SAMPLES: u32 = 16;

/// A taxel's unsteadiness is counted in eighths of an event: each costs eight, each sample pays back one.
const UNSTEADY_EVENT: u32 = 8;
/// Twelve events more than were paid back make a taxel noisy.
const UNSTEADY_LIMIT: u32 = 12 * UNSTEADY_EVENT;
/// Three are forgiven.
const UNSTEADY_FORGIVEN: u32 = 3 * UNSTEADY_EVENT;
/// No taxel can owe more than this, so that it is forgiven within a foreseeable number of samples.
const UNSTEADY_MOST: u32 = 2 * UNSTEADY_LIMIT;

/// Whether a sample is what a silent chip reads: 0 or 65535 on every axis.
#[inline]
pub(super) fn is_dead_sample(raw: [u16; 3]) -> bool {
    raw.iter().all(|c| *c == 0 || *c == u16::MAX)
}

/// Limits of the robust rule, in the units it counts in.
#[derive(Debug, Clone, Copy)]
pub(super) struct HealthLimits {
    dead_samples: u32,
    recover_samples: u32,
    stuck_ns: u64,
    wrap_limit: f64,
    wraps_per_ns: f64,
    /// A step against the last one, both beyond this, is unsteady.
    pub(super) unsteady_counts: i32,
}

impl HealthLimits {
    pub(super) fn new(config: &ConditionConfig) -> Self {
        let wrap_limit = f64::from(config.wrap_limit);
        Self {
            dead_samples: config.dead_samples,
            recover_samples: config.recover_samples,
            stuck_ns: config.stuck_ms * 1_000_000,
            wrap_limit,
            wraps_per_ns: wrap_limit / (config.wrap_window_ms as f64 * 1e6),
            unsteady_counts: i32::MAX,
        }
    }
}

/// Since when a taxel has not changed by one count.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stillness {
    since_ns: u64,
    samples: u32,
}

impl Stillness {
    /// Before the first sample.
    pub(super) const UNKNOWN: Self = Self {
        since_ns: u64::MAX,
        samples: 0,
    };

    /// After a sample at `t_ns`.
    #[inline(always)]
    pub(super) fn after(self, changed: bool, t_ns: u64) -> Self {
        if changed || self.since_ns > t_ns {
            Self {
                since_ns: t_ns,
                samples: 0,
            }
        } else {
            Self {
                since_ns: self.since_ns,
                samples: self.samples.saturating_add(1),
            }
        }
    }

    /// Whether the last sample was a change.
    pub(super) fn is_over(self) -> bool {
        self.samples == 0
    }

    /// Whether that is too long at `t_ns`, a time after the last sample's.
    #[inline(always)]
    pub(super) fn is_stuck(self, t_ns: u64, limits: &HealthLimits) -> bool {
        self.samples >= STUCK_SAMPLES && t_ns - self.since_ns >= limits.stuck_ns
    }
}

/// One taxel's health under the robust rule.
#[derive(Debug, Default, Clone)]
pub(super) struct Health {
    faults: Faults,
    dead_run: u32,
    good_run: u32,
    unsteady: u32,
    noisy_at_rest: bool,
    wraps: f64,
}

impl Health {
    /// That of a taxel which was out of use for these reasons. Why it was noisy is not known: it stays so until it is
    /// calibrated anew.
    pub(super) fn known(faults: Faults, limits: &HealthLimits) -> Self {
        let mut health = Self {
            noisy_at_rest: faults.contains(Fault::Noisy),
            ..Self::default()
        };
        if faults.contains(Fault::Wrapping) {
            health.wraps = 2.0 * limits.wrap_limit;
        }
        for fault in [Fault::Dead, Fault::Stuck, Fault::Noisy, Fault::Wrapping] {
            if faults.contains(fault) {
                health.faults.insert(fault);
            }
        }
        health
    }

    /// The reasons that hold now.
    #[inline]
    pub(super) fn faults(&self) -> Faults {
        self.faults
    }

    /// Whether the taxel owes nothing for unsteadiness or wraps, so that an ordinary step changes nothing.
    #[inline]
    pub(super) fn is_square(&self) -> bool {
        self.unsteady == 0 && self.wraps == 0.0
    }

    /// Samples in a row that read dead.
    pub(super) fn dead_run(&self) -> u32 {
        self.dead_run
    }

    /// A new calibration: noise and stuck are judged anew, wraps forgotten; a dead taxel stays dead
    /// until it speaks.
    pub(super) fn recalibrate(&mut self) {
        let dead = self.faults.contains(Fault::Dead);
        self.faults = Faults::NONE;
        if dead {
            self.faults.insert(Fault::Dead);
        }
        (self.unsteady, self.noisy_at_rest, self.wraps) = (0, false, 0.0);
    }

    /// A sample that reads dead.
    pub(super) fn handle_dead_sample(&mut self, limits: &HealthLimits) {
        self.good_run = 0;
        self.dead_run = self.dead_run.saturating_add(1);
        if self.dead_run >= limits.dead_samples {
            self.faults.insert(Fault::Dead);
        }
    }

    /// A sample that cannot be used for another reason.
    pub(super) fn handle_no_sample(&mut self) {
        self.good_run = 0;
    }

    /// A good sample. A taxel is no longer stuck once it moves; one that was dead and has a baseline lives again after
    /// enough of them.
    pub(super) fn handle_sample(
        &mut self,
        moving: bool,
        stuck: bool,
        has_baseline: bool,
        limits: &HealthLimits,
    ) {
        self.dead_run = 0;
        self.good_run = self.good_run.saturating_add(1);
        if self.good_run >= limits.recover_samples && has_baseline {
            self.faults.remove(Fault::Dead);
        }
        if moving {
            self.faults.remove(Fault::Stuck);
        }
        if stuck {
            self.faults.insert(Fault::Stuck);
        }
    }

    /// An accepted step after the one before, over `dt_ns`.
    pub(super) fn moved(&mut self, step: [i32; 3], before: [i32; 3], dt_ns: u64, limits: &HealthLimits) {
        let reversed = |step: i32, before: i32| {
            (step < 0) != (before < 0) && step.abs().min(before.abs()) > limits.unsteady_counts
        };
        if (0..3).any(|a| reversed(step[a], before[a])) {
            self.add_unsteady(UNSTEADY_EVENT);
        } else if self.unsteady > 0 {
            self.unsteady -= 1;
            if self.unsteady <= UNSTEADY_FORGIVEN && !self.noisy_at_rest {
                self.faults.remove(Fault::Noisy);
            }
        }
        if self.wraps > 0.0 {
            self.wraps = (self.wraps - dt_ns as f64 * limits.wraps_per_ns).max(0.0);
            if self.wraps <= limits.wrap_limit / 2.0 {
                self.faults.remove(Fault::Wrapping);
            }
        }
    }

    /// A glitch was rejected.
    pub(super) fn glitched(&mut self) {
        self.add_unsteady(2 * UNSTEADY_EVENT);
    }

    fn add_unsteady(&mut self, amount: u32) {
        self.unsteady = (self.unsteady + amount).min(UNSTEADY_MOST);
        if self.unsteady > UNSTEADY_LIMIT {
            self.faults.insert(Fault::Noisy);
        }
    }

    /// `weight` wraps that noise around the border does not explain.
    pub(super) fn wrapped(&mut self, weight: f64, limits: &HealthLimits) {
        self.wraps = (self.wraps + weight).min(2.0 * limits.wrap_limit);
        if self.wraps > limits.wrap_limit {
            self.faults.insert(Fault::Wrapping);
        }
    }

    /// Counts that ran away beyond any motion.
    pub(super) fn ran_away(&mut self, limits: &HealthLimits) {
        self.wrapped(1.25 * limits.wrap_limit, limits);
    }

    /// The calibration's judgement on noise.
    pub(super) fn judge_noise(&mut self, noisy: bool) {
        self.noisy_at_rest = noisy;
        if noisy {
            self.faults.insert(Fault::Noisy);
        } else if self.unsteady <= UNSTEADY_LIMIT {
            self.faults.remove(Fault::Noisy);
        }
    }

    /// The calibration found no change by one count.
    pub(super) fn judge_stuck(&mut self) {
        self.faults.insert(Fault::Stuck);
    }

    /// The taxel has a baseline of its own at last.
    pub(super) fn baseline_found(&mut self) {
        self.faults.remove(Fault::Dead);
    }
}

/// The publication's rule on frame 0: an axis beyond the mean of all present taxels by `sigmas`
/// population standard deviations.
///
/// `present` says which taxels have a value; only they count towards `N`. Sums are exact integers.
/// Writes whether each taxel is faulty; one that is not present is left `false`.
pub(super) fn paper_rule(
    frame: &[[u16; 3]],
    present: &[bool],
    sigmas: f64,
    two_sided: bool,
    faulty: &mut [bool],
) {
    faulty.fill(false);
    let n = present.iter().filter(|p| **p).count() as i128;
    if n == 0 {
        return;
    }
    for axis in 0..3 {
        let (mut sum, mut squares) = (0i128, 0i128);
        for (counts, _) in frame.iter().zip(present).filter(|(_, p)| **p) {
            let c = i128::from(counts[axis]);
            sum += c;
            squares += c * c;
        }
        let mean = sum as f64 / n as f64;
        let deviation = ((n * squares - sum * sum) as f64).sqrt() / n as f64;
        for (taxel, counts) in frame.iter().enumerate().filter(|(t, _)| present[*t]) {
            let above = f64::from(counts[axis]) - mean;
            faulty[taxel] |= if two_sided { above.abs() } else { above } > sigmas * deviation;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits() -> HealthLimits {
        HealthLimits {
            unsteady_counts: 450,
            ..HealthLimits::new(&ConditionConfig::robust())
        }
    }

    #[test]
    fn only_a_sample_at_the_rails_on_every_axis_is_dead() {
        for (raw, dead) in [
            ([0, 0, 0], true),
            ([65_535, 65_535, 65_535], true),
            ([0, 65_535, 0], true),
            ([0, 0, 1], false),
            ([65_535, 65_534, 65_535], false),
        ] {
            assert_eq!(is_dead_sample(raw), dead, "{raw:?}");
        }
    }

    #[test]
    fn paper_rule_is_one_sided_as_worded_and_excludes_the_absent() {
        // x of the present: 0, 0, 0, 10: mean 2.5, population sd 4.33; 10 is beyond, 0 is not below
        // by one sd.
        let frame = [[0, 5, 5], [0, 5, 5], [0, 5, 5], [10, 5, 5], [65_535; 3]];
        let present = [true, true, true, true, false];
        let mut faulty = [true; 5];
        paper_rule(&frame, &present, 1.0, false, &mut faulty);
        assert_eq!(faulty, [false, false, false, true, false]);

        // 0, 10, 10, 10: the low one is beyond only two-sided.
        let frame = [[0, 5, 5], [10, 5, 5], [10, 5, 5], [10, 5, 5], [65_535; 3]];
        paper_rule(&frame, &present, 1.0, false, &mut faulty);
        assert_eq!(faulty, [false; 5]);
        paper_rule(&frame, &present, 1.0, true, &mut faulty);
        assert_eq!(faulty, [true, false, false, false, false]);
    }

    #[test]
    fn paper_rule_flags_nothing_among_equals() {
        let mut faulty = [true; 3];
        paper_rule(&[[65_535; 3]; 3], &[true; 3], 1.0, true, &mut faulty);
        assert_eq!(faulty, [false; 3]);
    }

    #[test]
    fn a_taxel_is_noisy_after_many_reversals_and_forgiven_after_quiet() {
        let mut health = Health::default();
        let limits = limits();
        for i in 0..20 {
            let sign = if i % 2 == 0 { 1 } else { -1 };
            health.moved([sign * 500, 0, 0], [-sign * 500, 0, 0], 1_000_000, &limits);
        }
        assert!(health.faults().contains(Fault::Noisy));
        for _ in 0..200 {
            health.moved([3, 0, 0], [-3, 0, 0], 1_000_000, &limits);
        }
        assert!(health.faults().is_empty());
    }

    #[test]
    fn wraps_beyond_the_limit_within_the_window_are_a_fault_and_run_off() {
        let mut health = Health::default();
        let limits = limits();
        for _ in 0..41 {
            health.wrapped(1.0, &limits);
            health.moved([0; 3], [0; 3], 1_000_000, &limits);
        }
        assert!(health.faults().contains(Fault::Wrapping));
        health.moved([0; 3], [0; 3], 6_000_000_000, &limits);
        assert!(health.faults().is_empty());
    }
}
