//! A hand that begins to move within the calibration window, or comes to rest, rests as in the quieter half of it.
//!
//! What a clean touch changes is an outlier, or a level that is left out. Movement that begins slowly is neither: the
//! samples widen the spread that they are judged by, and are noise in the end. Noise that begins goes as far, but changes
//! from sample to sample as it does over time.

use super::Conditioner;

/// A taxel that moves in a half of the window goes more than this many times as far from its mean as in the other.
const MOVED_PEAKS: f64 = 2.0;
/// ... which is not taken to be less than this, counts: 2.5 times it are the least threshold.
const LEAST_PEAK_COUNTS: u32 = 4;

impl Conditioner {
    /// Where most taxels move in one half of the window, takes the rest of all from the other.
    pub(super) fn rest_in_the_quieter_half(&mut self) {
        let taxels = self.baseline.len();
        let used = |n: &usize| self.taxels[*n].has_baseline && self.taxels[*n].standing.is_empty();
        let used = || (0..taxels).filter(used);
        let most_move = |half: &usize| 2 * used().filter(|n| self.moves(*n, *half)).count() > used().count();
        let Some(moved) = (0..2).find(most_move) else {
            return;
        };
        self.calibration.report.moved = true;
        for n in 0..taxels {
            let halves = self.calibration.idle[n].halves;
            if let Some(halves) = halves.filter(|_| self.taxels[n].has_baseline) {
                self.touched[n] |= self.moves(n, moved);
                let still = halves[1 - moved].rest;
                self.take_baseline(n, still.baseline);
                self.calibration.idle[n].rest = still;
            }
        }
    }

    /// Whether a taxel moves in this half of the window, and not in the other.
    fn moves(&self, n: usize, half: usize) -> bool {
        let idle = &self.calibration.idle[n];
        idle.halves.is_some_and(|halves| {
            let (moved, still) = (halves[half], halves[1 - half]);
            let least = self.in_unit_of_force(idle.step.max(LEAST_PEAK_COUNTS).into());
            moved.is_slow && moved.rest.peak > self.in_unit_of_force(MOVED_PEAKS) * still.rest.peak.max(least)
        })
    }
}
