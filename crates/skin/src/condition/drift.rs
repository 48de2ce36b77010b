//! Slow drift of the baseline, followed only while a taxel is untouched.

/// Start of the quiet time of a taxel that is not quiet.
const DISTURBED: u64 = u64::MAX;

/// How far and how fast the baseline follows.
#[derive(Debug, Clone, Copy)]
pub(super) struct DriftLimits {
    /// One over the time constant, per nanosecond.
    per_time_constant: f64,
    /// One over the waiting time, per nanosecond.
    per_wait: f64,
    wait_ns: u64,
    limit_counts: f64,
}

impl DriftLimits {
    pub(super) fn new(time_constant_ms: u64, wait_ms: u64, limit_counts: f64) -> Self {
        Self {
            per_time_constant: 1e-6 / time_constant_ms as f64,
            per_wait: 1e-6 / wait_ms.max(1) as f64,
            wait_ns: wait_ms * super::MS,
            limit_counts,
        }
    }
}

/// One taxel's time without touch, and where its baseline was calibrated.
#[derive(Debug, Clone)]
pub(super) struct DriftState {
    calibrated: [f64; 3],
    quiet_since_ns: u64,
    /// Force, smoothed over the waiting time: noise comes near the threshold now and then, its mean does not.
    level: f64,
    at_limit: bool,
}

impl Default for DriftState {
    fn default() -> Self {
        Self {
            calibrated: [0.0; 3],
            quiet_since_ns: DISTURBED,
            level: 0.0,
            at_limit: false,
        }
    }
}

impl DriftState {
    /// Starts from a calibrated baseline.
    pub(super) fn calibrated(&mut self, baseline: [f64; 3]) {
        *self = Self {
            calibrated: baseline,
            ..Self::default()
        };
    }

    /// Whether drift has reached the limit, so that the baseline follows no further.
    pub(super) fn is_at_limit(&self) -> bool {
        self.at_limit
    }

    /// The taxel was touched, faulty or not heard: the wait begins anew.
    #[inline]
    pub(super) fn disturb(&mut self) {
        self.quiet_since_ns = DISTURBED;
    }

    /// A sample of `force` without contact, `dt_ns` after the last. Where the smoothed force has
    /// stayed below `quiet_force` and there was no contact for long enough, `baseline` moves
    /// towards `counts` by `dt_ns / time_constant`. Returns whether the limit was reached just now.
    #[inline(always)]
    pub(super) fn follow(
        &mut self,
        baseline: &mut [f64; 3],
        sample: (f64, [i32; 3]),
        (t_ns, dt_ns): (u64, u64),
        quiet_force: f64,
        limits: &DriftLimits,
    ) -> bool {
        let (force, counts) = sample;
        let dt = dt_ns.cast_signed() as f64;
        if self.quiet_since_ns == DISTURBED {
            (self.quiet_since_ns, self.level) = (t_ns, force);
        } else {
            self.level += (force - self.level) * (dt * limits.per_wait).min(1.0);
        }
        if self.level >= quiet_force || t_ns - self.quiet_since_ns < limits.wait_ns {
            return false;
        }
        let share = (dt * limits.per_time_constant).min(1.0);
        let mut at_limit = false;
        for a in 0..3 {
            let wanted = baseline[a] + (f64::from(counts[a]) - baseline[a]) * share;
            let drifted = wanted - self.calibrated[a];
            let allowed = drifted.clamp(-limits.limit_counts, limits.limit_counts);
            at_limit |= allowed != drifted;
            baseline[a] = if allowed == drifted {
                wanted
            } else {
                self.calibrated[a] + allowed
            };
        }
        let newly = at_limit && !self.at_limit;
        self.at_limit = at_limit;
        newly
    }
}
