//! Unwraps counts modulo 2^16 and holds back single-sample glitches, taxel by taxel.
//!
//! A sample is taken as the value nearest to the last one modulo 2^16. A jump that motion does not
//! explain (one axis alone, or very large) is held back for one sample and taken only if the next
//! sample confirms it; the delay is never more than that one sample. A jump of more than a quarter
//! turn is ambiguous: the pair of samples then decides, by the smaller sum of the squared step and
//! the squared distance from the baseline. Should the choice have been wrong, or a frame have been
//! lost around a wrap, the taxel comes to rest a multiple of 65536 from its baseline, and is pulled
//! back there.

use super::place::{Place, RepairLimits};

const TURN: i32 = 1 << 16;
/// From here on the direction of a step modulo 2^16 is in doubt.
const AMBIGUOUS_COUNTS: i32 = TURN / 4;
/// Further turns than this are no motion any magnet makes (two are seen in recorded presses).
const MAX_TURNS: i32 = 4;
/// A wrap in a step below this is noise around the border, no sign of trouble.
const COARSE_WRAP_COUNTS: i32 = 512;
/// How near the baseline, modulo 2^16, a taxel at rest must be on every axis to be pulled back.
const REST_TOLERANCE_COUNTS: i32 = 1_024;
/// Largest step of a taxel at rest.
const REST_STEP_COUNTS: i32 = 200;
/// How many samples at rest it takes.
const REST_SAMPLES: u8 = 5;

/// What a new sample turned out to be: a set of events.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Verdict(u8);

impl Verdict {
    /// The counts moved to this sample; otherwise it is held back.
    pub(super) const ACCEPTED: Self = Self(1);
    /// An axis crossed the border of 2^16.
    pub(super) const WRAPPED: Self = Self(1 << 1);
    /// ... in a step that noise does not explain.
    pub(super) const COARSE_WRAP: Self = Self(1 << 2);
    /// An ambiguous step was taken the long way round, since that leads back towards the baseline.
    pub(super) const LONG_WAY: Self = Self(1 << 3);
    /// The sample held back before this one was a glitch.
    pub(super) const GLITCH: Self = Self(1 << 4);
    /// The taxel was pulled back to its baseline by a multiple of 65536.
    pub(super) const RECOVERED: Self = Self(1 << 5);
    /// The counts ran away beyond any motion and were anchored anew.
    pub(super) const RAN_AWAY: Self = Self(1 << 6);

    /// Whether the event happened.
    #[inline]
    pub(super) fn contains(self, event: Self) -> bool {
        self.0 & event.0 != 0
    }

    /// Whether anything but an ordinary sample came.
    #[inline]
    pub(super) fn is_eventful(self) -> bool {
        self != Self::ACCEPTED
    }

    fn insert(&mut self, event: Self, happened: bool) {
        self.0 |= if happened { event.0 } else { 0 };
    }
}

/// What is pending about one taxel's samples.
#[derive(Debug, Default, Clone)]
pub(super) struct RepairState {
    /// The last sample that was held back.
    pending: [u16; 3],
    /// Axes on which it was suspect, as bits; zero while nothing is held.
    suspect: u8,
    rest: u8,
    known: bool,
    /// The last sample was not used, or not yet.
    held: bool,
    /// No sample was accepted since the pending one.
    waiting: bool,
}

impl RepairState {
    /// Whether the last sample was held back or not used, so that the counts are older.
    #[inline]
    pub(super) fn is_held(&self) -> bool {
        self.held
    }

    /// Whether nothing is pending, so that a sample is taken as it is where
    /// [`Motion::is_clear`](super::motion::Motion::is_clear).
    pub(super) fn is_settled(&self) -> bool {
        self.known && !self.held && self.suspect == 0 && self.rest == 0
    }

    /// The last sample that was a measurement, whether the counts moved to it or not.
    pub(super) fn newest(&self, place: &Place) -> [u16; 3] {
        if self.waiting {
            self.pending
        } else {
            place.counts.map(|c| c as u16)
        }
    }

    /// The last sample is no measurement: the counts stay.
    pub(super) fn hold(&mut self) {
        (self.suspect, self.rest, self.held) = (0, 0, true);
    }

    /// Forgets everything; the next sample is taken as it is.
    pub(super) fn reset(&mut self) {
        *self = Self::default();
    }

    /// Takes a sample as it is, on the turn nearest to the baseline where there is one: after a gap
    /// too long to unwrap.
    pub(super) fn anchor(
        &mut self,
        place: &mut Place,
        raw: [u16; 3],
        baseline: Option<&[f64; 3]>,
        limits: &RepairLimits,
    ) -> Verdict {
        let counts = raw.map(i32::from);
        place.counts = match baseline {
            Some(b) if limits.unwrap => std::array::from_fn(|a| nearest(counts[a], b[a].round() as i32)),
            _ => counts,
        };
        place.step = [0; 3];
        *self = Self {
            known: true,
            pending: self.pending,
            ..Self::default()
        };
        Verdict::ACCEPTED
    }

    /// Takes the next sample. `baseline` where it is known.
    pub(super) fn push(
        &mut self,
        place: &mut Place,
        raw: [u16; 3],
        baseline: Option<&[f64; 3]>,
        limits: &RepairLimits,
    ) -> Verdict {
        if !self.known {
            return self.anchor(place, raw, None, limits);
        }
        let step: [i32; 3] = std::array::from_fn(|a| step_to(raw[a], place.counts[a], limits));
        let mut verdict = Verdict::default();
        if self.suspect != 0 {
            let step = if self.confirms(raw, step, limits) {
                self.resolve(place, raw, step, baseline, limits, &mut verdict)
            } else {
                verdict.insert(Verdict::GLITCH, true);
                step
            };
            self.suspect = 0;
            self.accept(place, step, &mut verdict);
        } else {
            let suspect = if limits.reject {
                suspicion(step, place.step, limits)
            } else {
                0
            };
            if suspect != 0 {
                (self.suspect, self.pending) = (suspect, raw);
                (self.held, self.waiting) = (true, true);
                return verdict;
            }
            self.accept(place, step, &mut verdict);
        }
        if limits.unwrap {
            if let Some(baseline) = baseline {
                self.come_to_rest(place, baseline, &mut verdict);
            }
            if place.counts.iter().any(|c| (c >> 16).abs() > MAX_TURNS) {
                self.anchor(place, raw, baseline, limits);
                verdict.insert(Verdict::RAN_AWAY, true);
            }
        }
        verdict
    }

    /// Whether `raw` is nearer to the held sample than to the last good one, on every suspect axis.
    fn confirms(&self, raw: [u16; 3], step: [i32; 3], limits: &RepairLimits) -> bool {
        (0..3).filter(|a| self.suspect & (1 << a) != 0).all(|a| {
            let from_held = if limits.unwrap {
                i32::from(raw[a].wrapping_sub(self.pending[a]).cast_signed())
            } else {
                i32::from(raw[a]) - i32::from(self.pending[a])
            };
            from_held.abs() < step[a].abs()
        })
    }

    /// The step from the last good sample over the held one to `raw`, where the direction of the
    /// first may be in doubt.
    fn resolve(
        &self,
        place: &Place,
        raw: [u16; 3],
        step: [i32; 3],
        baseline: Option<&[f64; 3]>,
        limits: &RepairLimits,
        verdict: &mut Verdict,
    ) -> [i32; 3] {
        if !limits.unwrap {
            return step;
        }
        std::array::from_fn(|a| {
            let near = step_to(self.pending[a], place.counts[a], limits);
            let onward = i32::from(raw[a].wrapping_sub(self.pending[a]).cast_signed());
            let far = near - TURN * if near < 0 { -1 } else { 1 };
            if near.abs() < AMBIGUOUS_COUNTS {
                return near + onward;
            }
            let rest = baseline.map_or(f64::from(place.counts[a]), |b| b[a]);
            let cost = |held: i32| {
                let offset = f64::from(place.counts[a] + held + onward) - rest;
                f64::from(held).powi(2) + offset * offset
            };
            if cost(far) < cost(near) {
                verdict.insert(Verdict::LONG_WAY, true);
                far + onward
            } else {
                near + onward
            }
        })
    }

    fn accept(&mut self, place: &mut Place, step: [i32; 3], verdict: &mut Verdict) {
        verdict.insert(Verdict::ACCEPTED, true);
        (self.held, self.waiting) = (false, false);
        for (count, step) in place.counts.iter_mut().zip(step) {
            let before = *count >> 16;
            *count += step;
            let wrapped = *count >> 16 != before;
            verdict.insert(Verdict::WRAPPED, wrapped);
            verdict.insert(Verdict::COARSE_WRAP, wrapped && step.abs() > COARSE_WRAP_COUNTS);
        }
        place.step = step;
    }

    /// Pulls a resting taxel back when it lies a multiple of 65536 from its baseline.
    fn come_to_rest(&mut self, place: &mut Place, baseline: &[f64; 3], verdict: &mut Verdict) {
        let offset: [i32; 3] = std::array::from_fn(|a| place.counts[a] - baseline[a] as i32);
        if offset.iter().all(|o| o.abs() < TURN / 2) {
            self.rest = 0;
            return;
        }
        let rests = (0..3).all(|a| {
            let residue = (offset[a] as u16).cast_signed();
            i32::from(residue).abs() < REST_TOLERANCE_COUNTS && place.step[a].abs() < REST_STEP_COUNTS
        });
        self.rest = if rests { self.rest + 1 } else { 0 };
        if self.rest >= REST_SAMPLES {
            for (count, base) in place.counts.iter_mut().zip(baseline) {
                *count = nearest(*count, base.round() as i32);
            }
            self.rest = 0;
            verdict.insert(Verdict::RECOVERED, true);
        }
    }
}

/// Step from accepted counts to `raw` on one axis.
fn step_to(raw: u16, counts: i32, limits: &RepairLimits) -> i32 {
    if limits.unwrap {
        i32::from(raw.wrapping_sub(counts as u16).cast_signed())
    } else {
        i32::from(raw) - counts
    }
}

/// The axes whose step motion does not explain. What counts is the part of the step that neither
/// standing still nor going on as `before` predicts; it must stand out from the other axes and from
/// the axis's own last step.
fn suspicion(step: [i32; 3], before: [i32; 3], limits: &RepairLimits) -> u8 {
    let odd: [i32; 3] = std::array::from_fn(|a| step[a].abs().min((step[a] - before[a]).abs()));
    let mut suspect = 0;
    for a in 0..3 {
        let others = odd[(a + 1) % 3].max(odd[(a + 2) % 3]);
        let usual = others.max(before[a].abs());
        let alone = odd[a] > limits.glitch_counts && odd[a] > 4 * usual;
        if alone || odd[a] > limits.jump_counts {
            suspect |= 1 << a;
        }
    }
    suspect
}

/// The value that equals `count` modulo 2^16 and is nearest to `to`.
fn nearest(count: i32, to: i32) -> i32 {
    to + i32::from((count.wrapping_sub(to) as u16).cast_signed())
}
