//! A hand that begins to move within the calibration window, or comes to rest, rests as in the quieter half of it.
//!
//! What a clean touch changes is an outlier, or a level that is left out. Movement that begins slowly is neither: the
//! samples widen the spread that they are judged by, and are noise in the end.

use super::Conditioner;
use super::baseline::{Half, TaxelIdle, robust_spread};

/// A hand moves whose largest idle magnitude is more than this many times that of the quieter half.
const MOVED_PEAKS: f64 = 2.0;
/// ... which is not taken to be less than this, counts: 2.5 times it are the least threshold.
const LEAST_PEAK_COUNTS: u32 = 4;
/// A half of which more is left out is no rest, however quiet what is left: it may be the lesser part that is at rest.
const LEFT_OUT: f64 = 0.1;

/// How little the hand rests in a half.
#[derive(Debug, Clone, Copy)]
struct Unrest {
    half: usize,
    is_left_out: bool,
    peak: f64,
}

impl Conditioner {
    /// Takes the rest of all taxels from the half in which the hand is quieter, if it moves in the other. Where both are as
    /// quiet, one of them may be under a touch, and nobody knows which.
    pub(super) fn rest_in_the_quieter_half(&mut self) {
        let [Some(first), Some(last)] = [self.unrest(0), self.unrest(1)] else {
            return;
        };
        let is_first = match first.is_left_out == last.is_left_out {
            true => first.peak <= last.peak,
            false => last.is_left_out,
        };
        let (Unrest { half, .. }, other) = if is_first { (first, last) } else { (last, first) };
        let moved = self.median(half, |_, idle, _| idle.rest.peak);
        let quiet = self.median(half, |half, _, least| half.rest.peak.max(least));
        let (Some(moved), Some(quiet)) = (moved, quiet) else {
            return;
        };
        let times = self.in_unit_of_force(MOVED_PEAKS);
        let is_quiet = !other.is_left_out && other.peak <= times * quiet;
        if moved <= times * quiet || is_quiet {
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

    fn unrest(&mut self, half: usize) -> Option<Unrest> {
        Some(Unrest {
            half,
            is_left_out: self.median(half, |half, _, _| half.left_out)? > LEFT_OUT,
            peak: self.median(half, |half, _, _| half.rest.peak)?,
        })
    }

    /// The median over the taxels in use of what half a window says, the window, and the least idle magnitude; `None`
    /// where no taxel has enough samples.
    fn median(&mut self, half: usize, of: impl Fn(&Half, &TaxelIdle, f64) -> f64) -> Option<f64> {
        let mut values = std::mem::take(&mut self.calibration.scratch);
        values.clear();
        let used = (0..self.baseline.len())
            .filter(|n| self.taxels[*n].has_baseline && self.taxels[*n].standing.is_empty());
        values.extend(used.filter_map(|n| {
            let idle = &self.calibration.idle[n];
            Some(of(idle.halves[half].as_ref()?, idle, self.least_peak(n)))
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
