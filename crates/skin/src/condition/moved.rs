//! A hand that begins to move within the calibration window, or comes to rest, rests as in the quieter half of it.
//!
//! What a clean touch changes is an outlier, or a level that is left out. Movement that begins slowly is neither: the
//! samples widen the spread that they are judged by, and are noise in the end. Noise that begins goes as far, but changes
//! from sample to sample as it does over time.

use super::Conditioner;

/// What moved while a hand was calibrated, or was touched, so that it is in doubt where it rests. What is left out as a short
/// touch is none of it.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Movement {
    /// Nothing.
    #[default]
    None,
    /// So many taxels, no more than half of those that can be used. One that was still in half of the window rests as there.
    Taxels(u32),
    /// Nothing, but most taxels were so noisy that they were out of use: the contact threshold is of that noise.
    Noise,
    /// Most of the hand in one half of the window: all of it rests as in the other.
    InOneHalf,
    /// Most of the hand in both: the contact threshold is of the movement.
    InBothHalves,
}

/// A taxel that moves in a half of the window goes more than this many times as far from its mean as in the other.
const MOVED_PEAKS: f64 = 2.0;
/// ... which is not taken to be less than this, counts: 2.5 times it are the least threshold.
const LEAST_PEAK_COUNTS: u32 = 4;

impl Conditioner {
    /// Finds what moved in the window. Where most taxels moved in one half of it, takes the rest of all from the other; where
    /// a few did, only where these are.
    pub(super) fn judge_movement(&mut self) {
        let taxels = self.baseline.len();
        let keeps_still = self.keeps_still();
        let used = |n: &usize| self.is_usable(*n) && (keeps_still || !self.calibration.idle[*n].constant);
        let used = || (0..taxels).filter(used);
        let are_most = |count: usize| 2 * count > used().count();
        let moved = (0..2).find(|half| are_most(used().filter(|n| self.moves(*n, *half)).count()));
        let wander = |n: &usize| {
            let idle = &self.calibration.idle[*n];
            match moved.zip(idle.halves) {
                Some((moved, halves)) => halves[1 - moved].wanders,
                None => idle.wanders,
            }
        };
        let wandering = used().filter(wander).count();
        // What begins at the end are outliers, and the hand rests without them.
        let ending = used().filter(|n| self.calibration.idle[*n].ends_slow).count();
        let movement = match moved {
            _ if are_most(wandering) => Movement::InBothHalves,
            Some(_) => Movement::InOneHalf,
            None if are_most(ending) => Movement::InOneHalf,
            None if wandering > 0 => Movement::Taxels(wandering as u32),
            None => Movement::None,
        };
        self.calibration.report.moved = movement;
        self.calibration.rests_in_half = moved.is_some();
        match (moved, movement) {
            (Some(moved), _) => self.rest_in_the_other_half(moved),
            (None, Movement::Taxels(_)) => self.few_rest_in_the_quieter_half(),
            _ => {}
        }
    }

    /// Whether a taxel has a baseline, and nothing stands against it.
    fn is_usable(&self, n: usize) -> bool {
        self.taxels[n].has_baseline && self.taxels[n].standing.is_empty()
    }

    /// Whether most taxels keep one value, as those of a skin without noise do at rest. In a hand with noise a taxel that does is
    /// dead, and there are few.
    pub(super) fn keeps_still(&self) -> bool {
        let usable = || (0..self.baseline.len()).filter(|n| self.is_usable(*n));
        2 * usable().filter(|n| self.calibration.idle[*n].constant).count() > usable().count()
    }

    /// All taxels rest as in the half in which the hand did not move.
    fn rest_in_the_other_half(&mut self, moved: usize) {
        for n in 0..self.baseline.len() {
            let halves = self.calibration.idle[n].halves;
            if let Some(halves) = halves.filter(|_| self.taxels[n].has_baseline) {
                self.touched[n] |= self.moves(n, moved);
                let still = halves[1 - moved];
                self.take_baseline(n, still.rest.baseline);
                self.calibration.idle[n].rest = still.rest;
                let noise_peak = &mut self.calibration.idle[n].noise_peak;
                *noise_peak = noise_peak.min(still.noise_peak);
            }
        }
    }

    /// A taxel that wanders, but in one half of the window only, rests where it does in the other. What counts of it for the
    /// threshold stays that of the whole window: with that of the half, a few taxels that vibrate would be in contact.
    fn few_rest_in_the_quieter_half(&mut self) {
        for n in 0..self.baseline.len() {
            let idle = &self.calibration.idle[n];
            let moved = (0..2).find(|half| idle.wanders && self.moves(n, *half));
            let still = moved.zip(idle.halves).map(|(moved, halves)| halves[1 - moved]);
            if let Some(still) = still.filter(|still| self.taxels[n].has_baseline && !still.wanders) {
                self.take_baseline(n, still.rest.baseline);
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
