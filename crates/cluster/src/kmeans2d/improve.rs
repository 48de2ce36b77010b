//! Swaps: those that are judged to pay, and in quiet frames those that may.

use super::swap::{Judge, Swap};
use super::{Kmeans2d, Saved};

/// One frame in so many of those in which nothing changes is used to look further.
const QUIET_FRAMES: u32 = 4;
/// Swaps in quiet frames are asked for this share of what others are: there are few of them, and
/// what they save lasts.
const QUIET_SHARE: f64 = 0.25;

impl Kmeans2d {
    /// Makes the swaps that pay. Where none paid, it does not ask again before something has changed.
    pub(super) fn improve(&mut self) {
        let cost = self.assignment.cost();
        let few = 16 * self.changes < self.assignment.len();
        if let Some(before) = self.judged
            && few
            && (cost - before).abs() <= 0.5 * self.settings.swap_gain * before
        {
            return;
        }
        let mut left = self.settings.swaps;
        while left > 0 && self.swap() {
            left -= 1;
        }
        self.changes = 0;
        self.further = 0;
        self.judged = (left > 0).then(|| self.assignment.cost());
    }

    /// In a frame in which nothing has changed, tries one more swap, the next best by judgement:
    /// judgement does not know how the clusters settle afterwards. Says whether it was made.
    pub(super) fn look_further(&mut self) -> bool {
        let may_jump = self.settings.swap_gain < 1.0 && self.assignment.len() > self.x.len();
        if !may_jump {
            return false;
        }
        self.quiet = self.quiet.wrapping_add(1);
        if !self.quiet.is_multiple_of(QUIET_FRAMES) {
            return false;
        }
        self.pinned.copy_from_slice(&self.live);
        self.moved.fill(false);
        let mut judge = judge(
            &self.settings,
            self.assignment.cost(),
            &self.pinned,
            &self.moved,
            self.stands.places(),
        );
        judge.gain *= QUIET_SHARE;
        if !self.splits.is_ranked() {
            self.splits
                .rank(&self.assignment, &self.sums, &self.x, &self.y, &judge);
            return false;
        }
        let swap = self.splits.ranked(self.further, &self.sums, &judge);
        self.further += usize::from(swap.is_some());
        let made = swap.is_some_and(|swap| self.make(&swap));
        if made {
            self.further = 0;
        }
        made
    }

    /// Dissolves one cluster and splits another if that saves enough; says whether it did.
    fn swap(&mut self) -> bool {
        let judge = judge(
            &self.settings,
            self.assignment.cost(),
            &self.pinned,
            &self.moved,
            self.stands.places(),
        );
        let best = self
            .splits
            .best(&self.assignment, &self.sums, &self.x, &self.y, &judge);
        best.is_some_and(|swap| self.make(&swap))
    }

    /// Makes a swap, and unmakes it unless it saves what it was asked to.
    fn make(&mut self, swap: &Swap) -> bool {
        let before = self.assignment.cost();
        let Saved { x, y, sums } = &mut self.saved;
        x.copy_from_slice(&self.x);
        y.copy_from_slice(&self.y);
        sums.copy_from_slice(&self.sums);
        self.assignment.save();
        let settled = self.settled;
        let moved = std::mem::replace(&mut self.moved[swap.dissolved], true);
        let [kept, other] = swap.halves;
        (self.x[swap.split], self.y[swap.split]) = kept;
        (self.x[swap.dissolved], self.y[swap.dissolved]) = other;
        let most = before - swap.asked;
        if self.settle_below(most) {
            let after = self.assignment.cost();
            if after < before && after < most {
                return true;
            }
        }
        self.x.copy_from_slice(&self.saved.x);
        self.y.copy_from_slice(&self.saved.y);
        self.sums.copy_from_slice(&self.saved.sums);
        self.moved[swap.dissolved] = moved;
        self.assignment.restore();
        self.settled = settled;
        false
    }
}

/// What swaps have to save.
fn judge<'a>(
    settings: &super::Kmeans2dSettings,
    cost: f64,
    pinned: &'a [bool],
    moved: &'a [bool],
    stands: &'a [[f32; 2]],
) -> Judge<'a> {
    Judge {
        gain: settings.swap_gain * cost,
        least: 0.002 * cost,
        reach: settings.reach * settings.reach,
        pinned,
        moved,
        stands,
    }
}
