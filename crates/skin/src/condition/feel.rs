//! The way of a frame through conditioning: first the many ordinary samples, in loops without
//! rules, then the few others one by one.

use super::magnitude::{MagnitudeMode, distance_squared};
use super::motion::StepLimits;
use super::place::RepairLimits;
use super::taxel::{Rules, Sample};
use super::unchanging::{LastingContact, PAUSE_NS};
use super::{Conditioner, NEVER};
use crate::protocol::at_end;
use crate::reading::{TaxelReading, status_is_error};
use taxel_hand::{Fault, Faults, ForceFrame, Freshness, TactileFrame};

impl Conditioner {
    /// Takes every taxel of a frame through repair, faults, magnitude, contact and drift.
    pub(super) fn feel(&mut self, frame: &TactileFrame, out: &mut ForceFrame) {
        let rules = self.rules();
        self.take_ordinary(frame, &rules, out);
        for i in 0..self.unusual.len() {
            self.take_unusual(self.unusual[i], frame, &rules, out);
        }
        self.measure(&mut out.force);
        self.thresholds.judge(&out.force, &mut self.contact);
        self.follow_contacts(&out.force);
        if self.config.follow_drift {
            self.follow_drift(&out.force);
        }
        out.contact.copy_from_slice(&self.contact);
        out.faults.copy_from_slice(&self.faults);
        self.find_ends(frame, &mut out.saturated);
    }

    /// Marks the taxels in use that read an end of their range. Of most hands with three axes none has a count of 0 or
    /// 65535 at all, so that their boards' protocols are not asked.
    fn find_ends(&self, frame: &TactileFrame, saturated: &mut [bool]) {
        let counts = frame.counts.as_flattened().iter();
        if !counts.fold(false, |any, count| any | at_end(*count)) {
            saturated.fill(false);
            return;
        }
        for (n, saturated) in saturated.iter_mut().enumerate() {
            let reading = TaxelReading {
                taxel: n as u16,
                counts: frame.counts[n],
                status: frame.status[n],
            };
            *saturated = self.faults[n].is_empty() && self.protocols[n].is_saturated(&reading);
        }
    }

    /// By what this frame's samples are judged.
    fn rules(&self) -> Rules {
        Rules {
            robust: self.config.fault_rule.is_robust(),
            calibrating: self.calibration.is_running(),
            dead_samples: self.config.dead_samples,
            repair: self.repair_limits,
            scalar_repair: RepairLimits {
                unwrap: false,
                reject: false,
                ..self.repair_limits
            },
            health: self.health_limits,
        }
    }

    /// Takes in the samples that no rule can have anything to say about, and lists the other taxels
    /// as unusual. What is written as force is the squared distance from the baseline.
    fn take_ordinary(&mut self, frame: &TactileFrame, rules: &Rules, out: &mut ForceFrame) {
        let steps = StepLimits::new(&rules.repair, rules.health.unsteady_counts);
        self.motion.compare(&frame.counts, &steps);
        self.unusual.clear();
        // Slices of one length, so that no index below needs a check.
        let taxels = self.tracks.len();
        let (status, age_ns) = (&frame.status[..taxels], &frame.age_ns[..taxels]);
        let (freshness, baseline) = (&frame.freshness[..taxels], &self.baseline[..taxels]);
        let (faults, taxel) = (&mut self.faults[..taxels], &mut self.taxels[..taxels]);
        let (distance, repaired) = (&mut out.force[..taxels], &mut out.repaired[..taxels]);
        for (n, track) in self.tracks.iter_mut().enumerate() {
            let t_ns = frame.t_ns.saturating_sub(age_ns[n]);
            let next = self.motion.next(n);
            distance[n] = distance_squared(next.counts, baseline[n]);
            let usable = (freshness[n] == Freshness::Fresh) & !(rules.robust & status_is_error(status[n]));
            let clear = usable & self.motion.is_clear(n);
            if !(clear && track.follow(t_ns, next.has_moved(), distance[n], &rules.health)) {
                self.motion.stay(n);
                self.unusual.push(n);
                continue;
            }
            if track.owes {
                taxel[n].pay(track, next.step, self.motion.at(n).step, rules);
            }
            faults[n] = Faults::NONE;
            repaired[n] = next.is_beyond_border();
        }
        self.motion.go_on();
        self.counters.samples += (taxels - self.unusual.len()) as u64;
    }

    /// Takes in a sample by every rule there is, or notes that there is none.
    fn take_unusual(&mut self, n: usize, frame: &TactileFrame, rules: &Rules, out: &mut ForceFrame) {
        let (taxel, track) = (&mut self.taxels[n], &mut self.tracks[n]);
        let mut place = self.motion.at(n);
        track.accepted = false;
        let mut faults;
        if frame.freshness[n] == Freshness::Fresh {
            let sample = Sample {
                raw: frame.counts[n],
                t_ns: frame.t_ns.saturating_sub(frame.age_ns[n]),
                status_error: rules.robust && status_is_error(frame.status[n]),
            };
            if track.last_ns == NEVER || sample.t_ns > track.last_ns {
                self.counters.samples += 1;
                taxel.handle_sample(
                    &sample,
                    track,
                    &mut place,
                    &self.baseline[n],
                    rules,
                    &mut self.counters,
                );
                self.motion.set(n, place);
                if track.accepted && self.calibration.collects(taxel.has_baseline) {
                    self.calibration.collect(n, place.counts, sample.t_ns);
                }
            }
            faults = taxel.faults(rules.robust);
            if sample.status_error && !faults.contains(Fault::Dead) {
                faults.insert(Fault::Status);
            }
            if !taxel.has_baseline && !rules.calibrating && faults.is_empty() {
                faults.insert(Fault::Missing);
            }
            out.repaired[n] = taxel.repair.is_held() || place.is_beyond_border();
        } else {
            faults = taxel.faults(rules.robust);
            faults.insert(Fault::Missing);
            out.repaired[n] = false;
        }
        self.faults[n] = faults;
        out.force[n] = distance_squared(place.counts, self.baseline[n]);
    }

    /// Makes force of the squared distances; faulty taxels have none, and none has any while the
    /// baseline is being measured.
    fn measure(&self, force: &mut [f64]) {
        if self.calibration.is_running() {
            force.fill(0.0);
            return;
        }
        let mode = self.config.magnitude;
        match mode {
            MagnitudeMode::Vector => force.iter_mut().for_each(|f| *f = f.sqrt()),
            MagnitudeMode::VectorSquared => {}
            MagnitudeMode::Literal | MagnitudeMode::LiteralSquared => {
                let places = self.motion.counts().iter().zip(&self.baseline);
                for (force, (counts, baseline)) in force.iter_mut().zip(places) {
                    *force = mode.of(*counts, *baseline);
                }
            }
        }
        for n in &self.unusual {
            if !self.faults[*n].is_empty() {
                force[*n] = 0.0;
            }
        }
    }

    /// Notes which contacts change.
    fn follow_contacts(&mut self, force: &[f64]) {
        let squared = self.config.magnitude.is_squared();
        let counts = |force: f64| if squared { force.sqrt() } else { force };
        for (n, lasting) in self.lasting.iter_mut().enumerate() {
            if !(self.contact[n] | lasting.has_begun()) {
                continue;
            }
            let (force, times) = (counts(force[n]), self.tracks[n].times());
            if !self.faults[n].is_empty() {
                let is_missing = self.faults[n].iter().all(|fault| fault == Fault::Missing);
                let quiet_ns = self.frame_ns.saturating_sub(self.tracks[n].last_ns);
                if !(is_missing && quiet_ns < PAUSE_NS) {
                    *lasting = LastingContact::NONE;
                }
            } else if !lasting.has_begun() {
                *lasting = LastingContact::begin(force, times.0);
            } else if self.tracks[n].accepted {
                lasting.go_on(force, self.thresholds.both_of(n).map(counts), times);
            }
        }
    }

    /// Lets the baseline of untouched taxels follow slow drift.
    fn follow_drift(&mut self, force: &[f64]) {
        let calibrating = self.calibration.is_running();
        let places = self.motion.counts();
        for n in 0..places.len() {
            if self.contact[n] || calibrating || !self.faults[n].is_empty() {
                self.drift[n].disturb();
            } else if self.tracks[n].accepted {
                let (sample, times) = ((force[n], places[n]), self.tracks[n].times());
                let quiet_force = self.config.drift_quiet_share * self.thresholds.of(n);
                let limited = self.drift[n].follow(
                    &mut self.baseline[n],
                    sample,
                    times,
                    quiet_force,
                    &self.drift_limits,
                );
                self.counters.drift_limited += u64::from(limited);
            }
        }
    }
}
