//! A hand that moves, or is touched on most of its taxels, in a part of the calibration window rests as in its quietest half.
//!
//! What a clean touch changes is an outlier, or a level that is left out. Movement that begins slowly is neither: the
//! samples widen the spread that they are judged by, and are noise in the end.

use super::Conditioner;
use super::baseline::{Half, robust_spread};

/// A taxel that goes further from its rest than this many times the largest idle magnitude of the quietest half has moved.
const MOVED_PEAKS: f64 = 2.5;
/// ... which is not taken to be less than this, counts: 2.5 times it are the least threshold.
const LEAST_PEAK_COUNTS: u32 = 4;

impl Conditioner {
    /// Takes the rest of all taxels from the half in which the hand is quietest, if at least every second one moves
    /// outside of it.
    pub(super) fn rest_in_the_quietest_half(&mut self) {
        let quietest = (0..3).filter_map(|half| Some((half, self.median(half, |half, _| half.rest.peak)?)));
        let Some((half, _)) = quietest.min_by(|a, b| a.1.total_cmp(&b.1)) else {
            return;
        };
        let strongest = self.median(half, |half, _| half.strongest);
        let least = self.median(half, |half, step| half.rest.peak.max(step));
        let times = self.in_unit_of_force(MOVED_PEAKS);
        if strongest <= least.map(|peak| times * peak) {
            return;
        }
        self.calibration.report.moved = true;
        for n in 0..self.baseline.len() {
            if let Some(quiet) = self.calibration.idle[n].halves[half].filter(|_| self.taxels[n].has_baseline)
            {
                self.touched[n] |= quiet.strongest > times * quiet.rest.peak.max(self.least_peak(n));
                self.take_baseline(n, quiet.rest.baseline);
                self.calibration.idle[n].rest = quiet.rest;
            }
        }
    }

    /// The median over the taxels in use of what half a window says, and the least idle magnitude; `None` where no taxel
    /// has enough samples.
    fn median(&mut self, half: usize, of: impl Fn(&Half, f64) -> f64) -> Option<f64> {
        let mut values = std::mem::take(&mut self.calibration.scratch);
        values.clear();
        let used = (0..self.baseline.len())
            .filter(|n| self.taxels[*n].has_baseline && self.taxels[*n].standing.is_empty());
        values.extend(used.filter_map(|n| {
            let half = self.calibration.idle[n].halves[half].as_ref()?;
            Some(of(half, self.least_peak(n)))
        }));
        let median = (!values.is_empty()).then(|| robust_spread(&mut values).0);
        self.calibration.scratch = values;
        median
    }

    /// The largest idle magnitude that is taken for one at rest in any case: that of a step.
    fn least_peak(&self, n: usize) -> f64 {
        self.in_unit_of_force(self.calibration.idle[n].step.max(LEAST_PEAK_COUNTS).into())
    }
}
