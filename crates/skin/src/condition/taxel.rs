//! One taxel's state, and the path through it of a sample that calls for a closer look.

use super::NEVER;
use super::faults::{Health, HealthLimits, Stillness, is_dead_sample};
use super::place::{Place, RepairLimits};
use super::repair::{RepairState, Verdict};
use super::report::ConditionCounters;
use taxel_hand::Faults;

/// After a silence this long, and of more than four intervals, counts are anchored to the baseline
/// instead of unwrapped.
const GAP_NS: u64 = 500_000_000;
/// Nearer to its baseline than this, counts squared, a taxel cannot be at rest on a wrong turn.
const NEARLY_A_TURN_SQUARED: f64 = 64_000.0 * 64_000.0;

/// What every sample of a taxel is compared with: little, since each frame goes through all of it.
#[derive(Debug, Clone)]
pub(super) struct Track {
    /// Time of its newest sample, or [`NEVER`].
    pub(super) last_ns: u64,
    /// Time between its last two samples.
    interval_ns: u64,
    stillness: Stillness,
    /// Nothing is pending about the taxel or held against it.
    settled: bool,
    /// It is still paying for unsteadiness or wraps.
    pub(super) owes: bool,
    /// The counts moved to the newest sample, and that came with this frame.
    pub(super) accepted: bool,
    /// Keeping one value for long is no fault.
    pub(super) may_rest: bool,
}

/// The rest of what is known of one taxel, apart from its place, baseline and drift.
#[derive(Debug, Clone)]
pub(super) struct Taxel {
    pub(super) repair: RepairState,
    pub(super) health: Health,
    /// Reasons that stay until the next calibration: masked, and the publication's rule.
    pub(super) standing: Faults,
    pub(super) has_baseline: bool,
    /// Measures one axis, whose counts neither wrap nor are lost byte by byte: they are taken as they come.
    pub(super) scalar: bool,
    /// It has eight bits only.
    pub(super) coarse: bool,
    /// 0 is no sign that it is dead.
    pub(super) rests_at_zero: bool,
}

/// A new sample of a taxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub(super) raw: [u16; 3],
    pub(super) t_ns: u64,
    /// The board's status byte reports an error.
    pub(super) status_error: bool,
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

impl Track {
    /// A taxel that was never heard.
    pub(super) fn new() -> Self {
        Self {
            last_ns: NEVER,
            interval_ns: 0,
            stillness: Stillness::UNKNOWN,
            settled: false,
            owes: false,
            accepted: false,
            may_rest: false,
        }
    }

    /// Takes a sample of time `t_ns` whose step is clear, at this squared `distance` from the
    /// baseline, if no rule can have anything to say about it. Otherwise nothing has changed, and
    /// [`Taxel::handle_sample`] has to look.
    #[inline(always)]
    pub(super) fn follow(&mut self, t_ns: u64, moved: bool, distance: f64, limits: &HealthLimits) -> bool {
        let dt_ns = t_ns.wrapping_sub(self.last_ns);
        // Of the same time, or older, wraps to beyond any gap.
        let in_time = dt_ns.wrapping_sub(1) < GAP_NS - 1;
        let stillness = self.stillness.after(moved, t_ns);
        let stuck = stillness.is_stuck(t_ns, limits) & !self.may_rest;
        let ordinary = self.settled & in_time & !stuck & (distance < NEARLY_A_TURN_SQUARED);
        if ordinary {
            (self.last_ns, self.interval_ns) = (t_ns, dt_ns);
            (self.stillness, self.accepted) = (stillness, true);
        }
        ordinary
    }

    /// Time of the newest sample, and since the one before.
    #[inline(always)]
    pub(super) fn times(&self) -> (u64, u64) {
        (self.last_ns, self.interval_ns)
    }

    /// A new calibration begins.
    pub(super) fn start_anew(&mut self) {
        (self.stillness, self.settled) = (Stillness::UNKNOWN, false);
    }

    /// The time base started again: sample times mean nothing any more.
    pub(super) fn restart_clock(&mut self) {
        (self.last_ns, self.interval_ns) = (NEVER, 0);
        (self.stillness, self.settled) = (Stillness::UNKNOWN, false);
    }
}

impl Taxel {
    pub(super) fn new(standing: Faults) -> Self {
        Self {
            repair: RepairState::default(),
            health: Health::default(),
            standing,
            has_baseline: false,
            scalar: false,
            coarse: false,
            rests_at_zero: false,
        }
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

    /// Whether an ordinary sample, one that [`Track::follow`] takes, needs no rule but what it owes.
    fn is_settled(&self) -> bool {
        self.has_baseline && self.faults(true).is_empty() && self.repair.is_settled()
    }

    /// A sample that [`Track::follow`] took pays for what is owed.
    #[cold]
    pub(super) fn pay(&mut self, track: &mut Track, step: [i32; 3], before: [i32; 3], rules: &Rules) {
        self.health.moved(step, before, track.interval_ns, &rules.health);
        track.owes = !self.health.is_square();
    }

    /// Takes a new sample of any kind by every rule. `track` then says whether the counts moved to it.
    pub(super) fn handle_sample(
        &mut self,
        sample: &Sample,
        track: &mut Track,
        place: &mut Place,
        baseline: &[f64; 3],
        rules: &Rules,
        counters: &mut ConditionCounters,
    ) {
        track.accepted = self.judge(sample, track, place, baseline, rules, counters);
        track.settled = !rules.calibrating && self.is_settled() && place.is_within_reach();
        track.owes = !self.health.is_square();
    }

    fn judge(
        &mut self,
        sample: &Sample,
        track: &mut Track,
        place: &mut Place,
        baseline: &[f64; 3],
        rules: &Rules,
        counters: &mut ConditionCounters,
    ) -> bool {
        let Sample { raw, t_ns, .. } = *sample;
        let first = track.last_ns == NEVER;
        let dt_ns = if first { 0 } else { t_ns - track.last_ns };
        track.last_ns = t_ns;
        let was_dead = self.health.dead_run() >= rules.dead_samples;
        let is_dead = is_dead_sample(raw) && !(self.rests_at_zero && raw == [0; 3]);
        if sample.status_error {
            counters.status_errors += 1;
            // The status of a chip that does not answer is as dead as its counts. One axis alone does not tell.
            if is_dead && !self.scalar {
                counters.dead_samples += 1;
                self.health.handle_dead_sample(&rules.health);
            } else {
                self.health.handle_no_sample();
            }
            self.repair.hold();
            return false;
        }
        if is_dead && (rules.robust || (rules.repair.reject && !was_dead)) {
            counters.dead_samples += 1;
            self.health.handle_dead_sample(&rules.health);
            self.repair.hold();
            return false;
        }
        track.stillness = track.stillness.after(raw != self.repair.newest(place), t_ns);
        // The first sample is no change: what was known before may be that it is stuck.
        let moving = !first && track.stillness.is_over();
        let stuck = !track.may_rest && track.stillness.is_stuck(t_ns, &rules.health);
        self.health
            .handle_sample(moving, stuck, self.has_baseline, &rules.health);

        let gap = dt_ns >= GAP_NS && dt_ns > 4 * track.interval_ns.max(1);
        if !first {
            track.interval_ns = dt_ns;
        }
        let baseline = (self.has_baseline && !rules.calibrating).then_some(baseline);
        let before = place.step;
        let limits = if self.scalar {
            &rules.scalar_repair
        } else {
            &rules.repair
        };
        let verdict = if first || was_dead || gap {
            self.repair.anchor(place, raw, baseline, limits)
        } else {
            self.repair.push(place, raw, baseline, limits)
        };
        if verdict.is_eventful() {
            self.note(verdict, rules, counters);
        }
        let accepted = verdict.contains(Verdict::ACCEPTED);
        if accepted {
            self.health.moved(place.step, before, dt_ns, &rules.health);
        }
        accepted
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
