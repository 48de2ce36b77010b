//! A calibration that was done before, and goes on.

use super::Conditioner;
use super::faults::Health;
use taxel_hand::{Fault, Faults};

/// What conditioning knew of a hand at an instant, as a recorded frame has it. Each list has an entry per taxel.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// The contact threshold, in the unit of force.
    pub threshold: f64,
    /// Baseline x, y, z, counts; not a number where it had none.
    pub baseline: Vec<[f32; 3]>,
    /// Whether it was in contact.
    pub contact: Vec<bool>,
    /// Why it was not used.
    pub faults: Vec<Faults>,
}

impl Conditioner {
    /// Whether this hand's calibration has ended with the same threshold and baselines, to the digits of `known`.
    pub fn has_measured(&self, known: &Calibrated) -> bool {
        let baselines = self.baseline.iter().zip(&self.taxels);
        let measured = baselines.map(|(baseline, taxel)| match taxel.has_baseline {
            true => baseline.map(|counts| counts as f32),
            false => [f32::NAN; 3],
        });
        !self.is_calibrating()
            && self.threshold() as f32 == known.threshold as f32
            && self.taxels() == known.baseline.len()
            && measured
                .zip(&known.baseline)
                .all(|(measured, known)| measured == *known || measured[0].is_nan() && known[0].is_nan())
    }

    /// Goes on from what was known before, instead of calibrating on the first frames. Taxels that had no baseline find
    /// their own when they speak. Where taxels have thresholds of their own, each begins with the hand's. Baselines may
    /// drift from here as far as from where they were calibrated. Nothing changes where it is of another number of taxels.
    pub fn go_on_from(&mut self, known: &Calibrated) {
        let taxels = self.taxels();
        let lengths = [known.baseline.len(), known.contact.len(), known.faults.len()];
        if lengths != [taxels; 3] {
            return;
        }
        self.rezero();
        self.thresholds.set_theta(known.threshold);
        // A hand most of whose taxels never changed is one whose counts rest.
        let stuck = known.faults.iter().filter(|faults| faults.contains(Fault::Stuck));
        let is_quiet = 2 * stuck.count() > taxels;
        let mut late = 0;
        for (n, baseline) in known.baseline.iter().enumerate() {
            self.thresholds.set_taxel(n, known.threshold);
            let faults = known.faults[n];
            self.taxels[n].health = Health::known(faults, &self.health_limits);
            if faults.contains(Fault::PaperRule) {
                self.taxels[n].standing.insert(Fault::PaperRule);
            }
            self.tracks[n].may_rest = is_quiet || self.taxels[n].coarse;
            self.taxels[n].has_baseline = false;
            if baseline.iter().all(|counts| counts.is_finite()) {
                self.take_baseline(n, baseline.map(f64::from));
                self.judge_zero(n);
            } else {
                late += 1;
            }
        }
        self.contact.copy_from_slice(&known.contact);
        self.calibration.skip(late);
    }
}
