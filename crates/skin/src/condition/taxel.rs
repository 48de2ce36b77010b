//! One taxel's state, side by side in memory, and the path every sample takes through it.

use super::NEVER;
use super::drift::DriftState;
use super::faults::{Health, HealthLimits, is_dead_sample};
use super::repair::{RepairLimits, RepairState, Verdict};
use super::report::ConditionCounters;
use crate::frame::Faults;

/// After a silence this long, and of more than four intervals, counts are anchored to the baseline instead of unwrapped.
const GAP_NS: u64 = 500_000_000;

/// What is known of one taxel, apart from its baseline.
#[derive(Debug, Clone)]
pub(super) struct Taxel {
    /// Time of its newest sample, or [`NEVER`].
    pub(super) last_ns: u64,
    /// Time between its last two samples.
    interval_ns: u64,
    pub(super) repair: RepairState,
    pub(super) health: Health,
    pub(super) drift: DriftState,
    /// Reasons that stay until the next calibration: masked, and the publication's rule.
    pub(super) standing: Faults,
    pub(super) has_baseline: bool,
    pub(super) contact: bool,
    /// Measures one axis, whose counts neither wrap nor are lost byte by byte: they are taken as they come.
    pub(super) scalar: bool,
    /// Its steps are so coarse that keeping one value for long is no fault.
    pub(super) coarse: bool,
}

/// What a sample is judged by; the same for all taxels of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules {
    pub(super) robust: bool,
    pub(super) calibrating: bool,
    pub(super) dead_samples: u32,
    pub(super) repair: RepairLimits,
    /// The repair of a scalar taxel: none.
    pub(super) scalar_repair: RepairLimits,
    pub(super) health: HealthLimits,
}

impl Taxel {
    pub(super) fn new(standing: Faults) -> Self {
        Self {
            last_ns: NEVER,
            interval_ns: 0,
            repair: RepairState::default(),
            health: Health::default(),
            drift: DriftState::default(),
            standing,
            has_baseline: false,
            contact: false,
            scalar: false,
            coarse: false,
        }
    }

    /// The time base started again: sample times mean nothing any more.
    pub(super) fn restart_clock(&mut self) {
        (self.last_ns, self.interval_ns) = (NEVER, 0);
        self.health.restart_clock();
        self.drift.disturb();
    }

    /// The reasons that hold now, apart from those of the frame.
    #[inline]
    pub(super) fn faults(&self, robust: bool) -> Faults {
        if robust {
            self.standing.union(self.health.faults())
        } else {
            self.standing
        }
    }

    /// Takes a new sample of time `t_ns`. Returns the time since the last one, whether the counts moved to it,
    /// and the repaired counts.
    #[inline(always)]
    pub(super) fn hear(
        &mut self,
        raw: [u16; 3],
        t_ns: u64,
        status_error: bool,
        baseline: &[f64; 3],
        rules: &Rules,
        counters: &mut ConditionCounters,
    ) -> (u64, bool, [i32; 3]) {
        let first = self.last_ns == NEVER;
        let dt_ns = if first { 0 } else { t_ns - self.last_ns };
        self.last_ns = t_ns;
        if status_error {
            counters.status_errors += 1;
            self.health.hear_nothing();
            self.repair.hold();
            return (dt_ns, false, self.repair.counts());
        }
        let was_dead = self.health.dead_run() >= rules.dead_samples;
        if is_dead_sample(raw) && (rules.robust || (rules.repair.reject && !was_dead)) {
            counters.dead_samples += 1;
            self.health.hear_dead(&rules.health);
            self.repair.hold();
            return (dt_ns, false, self.repair.counts());
        }
        self.health
            .hear(raw, t_ns, self.has_baseline, self.coarse, &rules.health);

        let gap = dt_ns >= GAP_NS && dt_ns > 4 * self.interval_ns.max(1);
        if !first {
            self.interval_ns = dt_ns;
        }
        let baseline = (self.has_baseline && !rules.calibrating).then_some(baseline);
        let before = self.repair.step();
        let limits = if self.scalar {
            &rules.scalar_repair
        } else {
            &rules.repair
        };
        let (verdict, counts, step) = if first || was_dead || gap {
            (
                self.repair.anchor(raw, baseline, limits),
                self.repair.counts(),
                [0; 3],
            )
        } else {
            self.repair.push(raw, baseline, limits)
        };
        if verdict.is_eventful() {
            self.note(verdict, rules, counters);
        }
        let accepted = verdict.contains(Verdict::ACCEPTED);
        if accepted {
            self.health.moved(step, before, dt_ns, &rules.health);
        }
        (dt_ns, accepted, counts)
    }

    /// Counts what a sample brought besides its value.
    #[cold]
    fn note(&mut self, verdict: Verdict, rules: &Rules, counters: &mut ConditionCounters) {
        let count = |counter: &mut u64, event: Verdict| *counter += u64::from(verdict.contains(event));
        count(&mut counters.wraps, Verdict::WRAPPED);
        count(&mut counters.long_ways, Verdict::LONG_WAY);
        count(&mut counters.glitches, Verdict::GLITCH);
        count(&mut counters.recoveries, Verdict::RECOVERED);
        count(&mut counters.runaways, Verdict::RAN_AWAY);
        counters.held += u64::from(!verdict.contains(Verdict::ACCEPTED));
        if verdict.contains(Verdict::GLITCH) {
            self.health.glitched();
        }
        if verdict.contains(Verdict::COARSE_WRAP) || verdict.contains(Verdict::RECOVERED) {
            self.health.wrapped(1.0, &rules.health);
        }
        if verdict.contains(Verdict::RAN_AWAY) {
            self.health.ran_away(&rules.health);
        }
    }
}
