//! Swaps: those that are judged to pay, and in quiet frames those that may.

use super::swap::{Judge, MOST_FOUND, Swap};
use super::{Kmeans2d, Saved};

/// So many frames after a change, and then one in so many, are used to look further.
const FIRST_FRAMES: u32 = 4;
const QUIET_FRAMES: u32 = 4;
/// Points in the swaps that are tried in a quiet frame, in all: small frames try several swaps, at most so many.
const TRIED_POINTS: usize = 1000;
const MOST_TRIES: usize = 4;
/// In other frames so many swaps, the best by judgement, may be tried: judgement does not know how the clusters settle
/// afterwards. Of those that are judged to save too little two take their turn in a frame, and all do once a swap was made.
const TRIES: usize = 4;
/// With no more points for each cluster, all of these are tried in each frame.
const FEW: usize = 3;
/// What one of these has to save, in terms of what it is asked otherwise: it is tried because judgement may be wrong, and
/// actuators that slide along should not jump for the little more that it finds.
const DOUBT: f64 = 1.25;
/// Swaps in quiet frames are asked for this share of what others are: there are few of them, and
/// what they save lasts.
const QUIET_SHARE: f64 = 0.1;
/// So much of what else a jump must save is asked where points have heights: they are few for each cluster there, and one
/// cluster that is missing where it is needed costs many times the share.
const RAISED_SHARE: f64 = 0.25;
/// A cost within this of the least there can be is good enough.
const NEAR_LEAST: f64 = 1.06;
/// Frames without a swap after which half as much is asked of one.
const PATIENCE: f64 = 2.0;

/// What swaps have to save, for a share of the cost, or of the squared reach where that is more: with hardly more points than
/// clusters the cost is so little that every jump would save a share of it. The search borrows only part of the clusters.
macro_rules! judge {
    ($clusters:expr, $gain:expr) => {{
        let cost = $clusters.cost();
        let reach = $clusters.settings.reach * $clusters.settings.reach;
        Judge {
            gain: $gain * cost.max(reach),
            least: 0.002 * cost,
            times_if_doubtful: 1.0,
            reach,
            pinned: &$clusters.pinned,
            moved: &$clusters.moved,
            stands: $clusters.stands.places(),
        }
    }};
}

impl Kmeans2d {
    /// Makes the swaps that pay. Where none paid, it does not ask again before something has changed.
    pub(super) fn improve(&mut self) {
        let cost = self.cost();
        let few = 16 * self.changes < self.assignment.len();
        if let Some(before) = self.judged
            && few
            && (cost - before).abs() <= 0.5 * self.swap_gain() * before
        {
            return;
        }
        let most = self.settings.swaps;
        let mut made = 0;
        while made < most && self.swap(made > 0) {
            made += 1;
            (self.patience, self.turn) = (0, 0);
        }
        self.changes = 0;
        self.further = 0;
        self.judged = (made < most).then(|| self.cost());
    }

    /// Share of the cost that a swap is asked to save for each cluster that jumps by it.
    pub(super) fn swap_gain(&self) -> f64 {
        let gain = self.settings.swap_gain;
        if self.assignment.is_raised() && gain < 1.0 {
            RAISED_SHARE * gain
        } else {
            gain
        }
    }

    /// Share of the cost that a swap is asked to save in a quiet frame for each cluster that jumps by it: the
    /// less, the longer none was made, so that a bad arrangement does not last. Where points flicker, no frame is
    /// quiet.
    fn quiet_gain(&self) -> f64 {
        self.swap_gain() * QUIET_SHARE * PATIENCE / (PATIENCE + f64::from(self.patience))
    }

    /// Counts a frame whose points are those of the last, and says whether it is used to look further.
    pub(super) fn looks_further(&mut self) -> bool {
        if self.assignment.len() <= self.x.len() {
            return false;
        }
        let looks = self.looks_further_next();
        self.patience = self.patience.saturating_add(1);
        self.quiet = self.quiet.saturating_add(1);
        looks
    }

    /// Whether the next frame, if it has the points of this one, is used to look further.
    pub(super) fn looks_further_next(&self) -> bool {
        let quiet = self.quiet.saturating_add(1);
        quiet <= FIRST_FRAMES || quiet.is_multiple_of(QUIET_FRAMES)
    }

    /// Moves points by their new heights and tries more swaps. Says whether anything has changed.
    pub(super) fn rest(&mut self, heights: Option<&[f64]>) -> bool {
        self.pinned.copy_from_slice(&self.live);
        self.moved.fill(false);
        let moved = heights.is_some() && self.raise_again(heights);
        let swapped = self.settings.swap_gain < 1.0 && self.look_further();
        if swapped {
            self.splits.forget();
        }
        moved || swapped
    }

    /// Gives the same points other heights; says whether any moved for them.
    fn raise_again(&mut self, heights: Option<&[f64]>) -> bool {
        self.assignment.raise(heights);
        self.least = None;
        self.assignment.add_up(&mut self.sums);
        self.raise();
        // What was ranked was ranked by other heights.
        self.splits.forget();
        let mut moved = self.assign();
        if moved > 0 {
            self.centre();
        }
        moved += self.move_points();
        if moved > 0 {
            self.settle();
        }
        moved > 0
    }

    /// Tries more swaps, the next best by judgement: judgement does not know how the clusters settle afterwards.
    /// Says whether one was made.
    fn look_further(&mut self) -> bool {
        if !self.splits.is_ranked() {
            self.began = self.patience;
            let judge = judge!(self, self.quiet_gain());
            self.splits.rank(
                &self.assignment,
                &self.sums,
                [&self.x, &self.y, &self.height],
                &judge,
            );
        }
        let tries = (TRIED_POINTS / self.assignment.len()).clamp(1, MOST_TRIES);
        for _ in 0..tries {
            let judge = judge!(self, self.quiet_gain());
            let Some(swap) = self.splits.ranked(self.further, &self.sums, &judge) else {
                // All were tried. Once half as much is asked, those that saved too little may do.
                if self.patience >= 2 * self.began {
                    (self.further, self.began) = (0, self.patience);
                }
                return false;
            };
            self.further += 1;
            if self.make(&swap) {
                self.further = 0;
                self.patience = 0;
                return true;
            }
        }
        false
    }

    /// Dissolves one cluster and splits another if that saves enough; says whether it did. `again`, where that was worth
    /// it in this frame already.
    fn swap(&mut self, again: bool) -> bool {
        let (most, times_if_doubtful) = self.most_tried();
        let judge = Judge {
            times_if_doubtful,
            ..judge!(self, self.swap_gain())
        };
        let at = [&self.x[..], &self.y, &self.height];
        let (sure, found) = self.splits.find(&self.assignment, &self.sums, at, &judge, most);
        let mut doubtful = sure..found;
        if !again && self.assignment.len() > FEW * self.x.len() && sure < found {
            let first = sure + 2 * (self.turn % doubtful.len().div_ceil(2));
            doubtful = first..found.min(first + 2);
            self.turn += 1;
        }
        (0..sure).chain(doubtful).any(|rank| {
            let swap = self.splits.found(rank);
            self.make(&swap)
        })
    }

    /// How many swaps are tried before none is made, and how many times as much those have to save that are judged to save
    /// too little. Heights leave few points fewer ways; so where they have them, more are tried, unless the points can
    /// hardly be nearer to their centroids than they are. A cluster of n points that are `d` apart or more has a cost of at
    /// least `d^2 (n - 1) / 2`, and so all clusters together.
    fn most_tried(&self) -> (usize, f64) {
        let (points, clusters) = (self.assignment.len(), self.x.len());
        if !self.assignment.is_raised() || points > 2 * clusters {
            (TRIES, DOUBT)
        } else {
            let pitch = 0.5 * self.settings.reach;
            let least = 0.5 * pitch * pitch * (points - clusters) as f64;
            let most = match self.assignment.cost() > NEAR_LEAST * least {
                true => MOST_FOUND,
                false => 1,
            };
            (most, 1.0)
        }
    }

    /// What no clusters of the points can cost less than, a little less for rounding. 0 where it is not known: where
    /// points are weighted or have no heights, or a cluster has more than two, so that it would be far from the cost.
    fn least(&mut self) -> f64 {
        let assignment = &self.assignment;
        let pairs = !assignment.is_weighted() && self.sums.iter().all(|sums| sums.weight <= 2.0);
        if !pairs || !assignment.is_raised() {
            return 0.0;
        }
        let clusters = self.x.len();
        *self
            .least
            .get_or_insert_with(|| 0.999_9 * assignment.least_cost(clusters))
    }

    /// Makes a swap, and unmakes it unless it saves what it was asked to.
    fn make(&mut self, swap: &Swap) -> bool {
        let before = self.cost();
        let most = before - swap.asked;
        let least = self.least();
        if least > 0.0 && most <= least {
            return false;
        }
        let Saved { x, y, height, sums } = &mut self.saved;
        height.copy_from_slice(&self.height);
        x.copy_from_slice(&self.x);
        y.copy_from_slice(&self.y);
        sums.copy_from_slice(&self.sums);
        self.assignment.save();
        let settled = self.settled;
        let moved = std::mem::replace(&mut self.moved[swap.dissolved], true);
        let [kept, other] = swap.halves;
        self.put(swap.split, kept);
        self.put(swap.dissolved, other);
        if self.settle_below(most) {
            let after = self.cost();
            if after < before && after < most {
                return true;
            }
        }
        self.x.copy_from_slice(&self.saved.x);
        self.y.copy_from_slice(&self.saved.y);
        self.height.copy_from_slice(&self.saved.height);
        self.sums.copy_from_slice(&self.saved.sums);
        self.moved[swap.dissolved] = moved;
        self.assignment.restore();
        self.settled = settled;
        false
    }
}

#[cfg(test)]
mod tests {
    use crate::kmeans2d::tests::PLAIN;
    use crate::{Kmeans2d, Kmeans2dSettings, Plane};

    #[test]
    fn where_clusters_cost_little_a_jump_must_save_a_share_of_the_squared_reach() {
        // Two pairs and three clusters: one pair shares, and another is a jump away. First the left one is the more alike.
        let (x, y) = ([0.0, 1.0, 9.0, 10.0], [0.0; 4]);
        let goes_over = |differ: f64| {
            let settings = Kmeans2dSettings {
                swap_gain: 0.1,
                ..PLAIN
            };
            let mut solver = Kmeans2d::new(8, 3, settings);
            let mut follow = |keys: &[u16; 4], heights: [f64; 4]| {
                let found = solver.follow(Plane { x: &x, y: &y }, keys, None, Some(&heights));
                assert!((found.labels[0] == found.labels[1]) != (found.labels[2] == found.labels[3]));
                found.labels[2] == found.labels[3]
            };
            assert!(!follow(&[0, 1, 2, 3], [0.0, 0.0, 2.0, 0.0]));
            // Other keys, so that no frame is quiet.
            follow(&[4, 1, 2, 3], [0.0, differ, 0.0, 0.0])
        };
        // Half the square of the difference is saved. 0.1 is asked, a quarter of a tenth of the squared reach; of the cost,
        // that would be 0.015.
        assert!(!goes_over(0.4));
        assert!(goes_over(0.7));
    }
}
