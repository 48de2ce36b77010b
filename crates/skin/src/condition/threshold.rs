//! The contact threshold that a calibration settles on, eq. (2).

use super::Conditioner;
use super::config::ThresholdSource;
use super::moved::Movement;
use super::spread::robust_spread;
use taxel_hand::Fault;

/// As much more than on one axis is a step on all three.
const AXES: f64 = 1.75;
/// Least threshold of a hand with taxels of eight bits: two steps of 16 counts, as the iCub's own
/// skinManager has it (docs/protocols.md, "iCub conditioning").
const COARSE_LEAST_COUNTS: f64 = 32.0;
/// Where more than one of so many taxels is noisier in a part of the window, noise has begun, or ended; by chance it is one of
/// thirty, and in such noise one of two at least where it matters.
const NOISIER_ONE_OF: usize = 4;

impl Conditioner {
    /// Noise that begins within the window counts by how far it goes there.
    pub(super) fn take_noise_of_parts(&mut self) {
        let idle = &mut self.calibration.idle;
        let used = |n: &usize| self.taxels[*n].has_baseline && !idle[*n].constant;
        let used = || (0..self.taxels.len()).filter(used);
        let noisier = used().filter(|n| idle[*n].noise_peak > 0.0).count();
        if NOISIER_ONE_OF * noisier > used().count() {
            for idle in idle {
                idle.rest.peak = idle.rest.peak.max(idle.noise_peak);
            }
        }
    }

    /// `theta` of eq. (2): the largest idle magnitude among taxels that are neither faulty nor
    /// touched, nor far beyond the rest, times the margin. Where most are noisy when the window ends, these count, too: by the
    /// noise limit that the window has set they may be back in use soon, and would be in contact.
    pub(super) fn hand_threshold(&mut self) -> f64 {
        let window = self.config.threshold == ThresholdSource::Window;
        let mut peaks = std::mem::take(&mut self.calibration.scratch);
        peaks.clear();
        let idle = &self.calibration.idle;
        let rests = |n: &usize, or_noisy: bool| {
            let mut faults = self.settled_faults(*n);
            if or_noisy {
                faults.remove(Fault::Noisy);
            }
            self.taxels[*n].has_baseline && !idle[*n].constant && faults.is_empty()
        };
        let count = |or_noisy| (0..self.baseline.len()).filter(|n| rests(n, or_noisy)).count();
        let are_noisy = 2 * count(false) < count(true);
        // What wanders on a skin that keeps still is a touch, and not how the skin rests.
        let keeps_still = self.keeps_still();
        let healthy = |n: &usize| rests(n, are_noisy) && !(window && keeps_still && idle[*n].wanders);
        let peak = |n: usize| idle[n].rest.peak;
        let all = (0..self.baseline.len()).filter(healthy);
        let rests_in_half = self.calibration.rests_in_half;
        if window && !rests_in_half && all.clone().any(|n| !self.touched[n]) {
            peaks.extend(all.filter(|n| !self.touched[*n]).map(peak));
        } else {
            peaks.extend(all.map(peak));
        }
        let largest = peaks.iter().copied().fold(0.0, f64::max);
        let theta = if window {
            let (median, sigma) = robust_spread(&mut peaks);
            // One step up and down is no stray, be those that show it ever so few.
            let step = (0..self.baseline.len())
                .filter(healthy)
                .map(|n| idle[n].step)
                .fold(1, u32::max);
            let strays = median + self.config.noise_sigmas * sigma.max(median / 4.0);
            largest.min(strays.max(self.in_unit_of_force(AXES * f64::from(step))))
        } else {
            largest
        };
        self.calibration.scratch = peaks;
        if window && are_noisy {
            let moved = &mut self.calibration.report.moved;
            *moved = Movement::Noise.max(*moved);
        }
        self.own_threshold(theta)
    }

    pub(super) fn own_threshold(&self, peak: f64) -> f64 {
        let least = match self.config.threshold_min_counts {
            // A value on the edge between two steps flickers without being touched.
            least if least > 0.0 && self.coarse => least.max(COARSE_LEAST_COUNTS),
            least => least,
        };
        (peak * self.config.threshold_margin).max(self.in_unit_of_force(least))
    }

    /// A magnitude in counts, squared where forces are.
    pub(super) fn in_unit_of_force(&self, counts: f64) -> f64 {
        match self.config.magnitude.is_squared() {
            true => counts * counts,
            false => counts,
        }
    }
}
