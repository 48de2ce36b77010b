//! k-means in the plane that follows a moving scene: warm from the last frame, out of local optima when it pays, with
//! clusters that keep their identity.
//!
//! The optimum in the plane is out of reach in real time (the problem is NP-hard), and for a display it is not even wanted: an
//! actuator that jumps across the hand whenever another arrangement is a per mille better is felt as flicker. So each frame starts
//! from the centroids of the last one, and is improved by three moves, each of which lowers the cost:
//!
//! 1. Lloyd's iteration, with the last frame's centroids as an optional pull (evolutionary k-means, Chakrabarti et al. 2006).
//! 2. Single points that move to the second nearest cluster where that lowers the cost though they are nearer to their own
//!    (Hartigan's criterion, `n / (n - 1) * d1 > m / (m + 1) * d2`).
//! 3. A swap: the cluster that is missed least is dissolved and the one that gains most is split, if the gain is worth it. Only this
//!    move makes an actuator jump, and a threshold decides when it is allowed.
//!
//! Coordinates are single precision: pixels are exact, millimetres good to a micrometre. Every operation is elementwise or in index
//! order, so results are the same at every vector width.

mod assign;
mod identity;
mod swap;

use assign::Assignment;

use crate::Plane;
use swap::Splits;

/// What [`Kmeans2d`] may do in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kmeans2dSettings {
    /// History cost: a centroid is drawn towards its place in the last frame as if by this many times its own members. 0 follows
    /// the points alone.
    pub history: f64,
    /// Share of the cost that a swap must save to be made; 0 makes every swap that saves anything, infinity none.
    pub swap_gain: f64,
    /// Most swaps in a frame.
    pub swaps: u16,
    /// Most assignments of all points between two swaps.
    pub iterations: u16,
}

/// Clusters points in the plane frame by frame.
#[derive(Debug)]
pub struct Kmeans2d {
    settings: Kmeans2dSettings,
    assignment: Assignment,
    /// Where each cluster is, by id.
    x: Vec<f32>,
    y: Vec<f32>,
    /// Where each cluster was at the end of the last frame.
    last_x: Vec<f32>,
    last_y: Vec<f32>,
    /// Whether each id had points in the last frame.
    live: Vec<bool>,
    /// Whether each id was put elsewhere in this frame, so that where it was does not matter.
    moved: Vec<bool>,
    /// What the points of each id add up to.
    sums: Vec<Sums>,
    splits: Splits,
    saved_x: Vec<f32>,
    saved_y: Vec<f32>,
    identity: identity::Matching,
}

/// What a cluster adds up to.
#[derive(Debug, Default, Clone, Copy)]
struct Sums {
    x: f64,
    y: f64,
    weight: f64,
}

/// The clusters of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clusters<'a> {
    /// Id of the cluster of each point.
    pub labels: &'a [u16],
    /// First coordinate of each cluster's centroid, by id; of no meaning for a cluster without points.
    pub x: &'a [f32],
    /// Second coordinate of each cluster's centroid.
    pub y: &'a [f32],
    /// Whether each cluster has points.
    pub live: &'a [bool],
}

impl Kmeans2d {
    /// Memory for up to `points` points and exactly `clusters` clusters (fewer where there are fewer points).
    pub fn new(points: usize, clusters: usize, settings: Kmeans2dSettings) -> Self {
        Self {
            settings,
            assignment: Assignment::new(points),
            x: vec![0.0; clusters],
            y: vec![0.0; clusters],
            last_x: vec![0.0; clusters],
            last_y: vec![0.0; clusters],
            live: vec![false; clusters],
            moved: vec![false; clusters],
            sums: vec![Sums::default(); clusters],
            splits: Splits::new(clusters),
            saved_x: vec![0.0; clusters],
            saved_y: vec![0.0; clusters],
            identity: identity::Matching::new(clusters),
        }
    }

    /// Forgets the last frame.
    pub fn forget(&mut self) {
        self.live.fill(false);
    }

    /// Clusters the points of the next frame.
    ///
    /// With no more points than clusters each point is a cluster of its own, with the id of the cluster that was within 2 units of it
    /// before, the nearest pairs first; other points get ids that were not in use, lowest first. With more points, ids that had no
    /// points start at the points farthest from all others.
    /// `weights`, where given, must be positive.
    ///
    /// # Panics
    ///
    /// If the lengths do not match.
    pub fn follow(&mut self, points: Plane<'_>, weights: Option<&[f64]>) -> Clusters<'_> {
        assert_eq!(points.x.len(), points.y.len(), "as many x as y");
        assert!(
            weights.is_none_or(|w| w.len() == points.len()),
            "one weight per point"
        );
        self.assignment.place(points, weights);
        if points.len() <= self.x.len() {
            self.identity
                .match_points(&self.assignment, &mut self.x, &mut self.y, &mut self.live);
            self.identity.label(&mut self.assignment);
        } else {
            self.follow_many();
        }
        self.last_x.copy_from_slice(&self.x);
        self.last_y.copy_from_slice(&self.y);
        Clusters {
            labels: self.assignment.labels(),
            x: &self.x,
            y: &self.y,
            live: &self.live,
        }
    }

    fn follow_many(&mut self) {
        self.moved.fill(false);
        self.seed();
        self.settle();
        if self.find_live() {
            self.seed();
            self.settle();
        }
        let mut swaps = self.settings.swaps;
        while swaps > 0 && self.swap(self.settings.swap_gain) {
            swaps -= 1;
        }
        self.find_live();
    }

    /// Finds out which ids have points; says whether some have none.
    fn find_live(&mut self) -> bool {
        let mut some_empty = false;
        for (live, sums) in self.live.iter_mut().zip(&self.sums) {
            *live = sums.weight > 0.0;
            some_empty |= !*live;
        }
        some_empty
    }

    /// Gives the ids that were not in use a place: each the point farthest from those placed so far.
    fn seed(&mut self) {
        let mut open = self.live.iter().filter(|live| !**live).count();
        if open == 0 {
            return;
        }
        self.assignment.distances_to(&self.x, &self.y, &self.live);
        for id in 0..self.x.len() {
            if open == 0 {
                break;
            }
            if !self.live[id] {
                let (x, y) = self.assignment.farthest();
                (self.x[id], self.y[id]) = (x, y);
                self.live[id] = true;
                self.moved[id] = true;
                self.assignment.approach(x, y);
                open -= 1;
            }
        }
    }

    /// Lloyd's iterations and Hartigan's moves until nothing changes, or as often as allowed.
    fn settle(&mut self) {
        for _ in 0..self.settings.iterations {
            let changed = self.assignment.assign(&self.x, &self.y);
            if !changed {
                if !self.move_points() {
                    return;
                }
                self.centre();
                continue;
            }
            self.add_up();
            self.centre();
        }
        self.assignment.assign(&self.x, &self.y);
        self.add_up();
    }

    fn add_up(&mut self) {
        self.sums.fill(Sums::default());
        for n in 0..self.assignment.len() {
            let (x, y, weight) = self.assignment.point(n);
            let sums = &mut self.sums[usize::from(self.assignment.labels()[n])];
            sums.x += weight * x;
            sums.y += weight * y;
            sums.weight += weight;
        }
    }

    /// Moves every centroid to the mean of its points, drawn towards where it was.
    fn centre(&mut self) {
        for (id, sums) in self.sums.iter().enumerate() {
            if sums.weight > 0.0 {
                let history = if self.moved[id] {
                    0.0
                } else {
                    self.settings.history
                };
                let pull = history * sums.weight;
                let weight = sums.weight + pull;
                self.x[id] = ((sums.x + pull * f64::from(self.last_x[id])) / weight) as f32;
                self.y[id] = ((sums.y + pull * f64::from(self.last_y[id])) / weight) as f32;
            }
        }
    }

    /// Moves single points where that lowers the cost; says whether any moved.
    fn move_points(&mut self) -> bool {
        let mut moved = false;
        // A cluster asks `m / (m + 1)` of its distance, so the lightest asks least.
        let lightest = self
            .sums
            .iter()
            .map(|sums| sums.weight)
            .fold(f64::INFINITY, f64::min);
        for n in 0..self.assignment.len() {
            let from = usize::from(self.assignment.labels()[n]);
            let (x, y, weight) = self.assignment.point(n);
            let left = self.sums[from].weight - weight;
            let (near, next) = self.assignment.distances(n);
            let lightest = lightest / (lightest + weight);
            if left <= 0.0 || near * self.sums[from].weight <= next * left * lightest {
                continue;
            }
            let mut to = (from, near * self.sums[from].weight / left);
            for (id, sums) in self.sums.iter().enumerate() {
                if id != from {
                    let (dx, dy) = (x - f64::from(self.x[id]), y - f64::from(self.y[id]));
                    let cost = (dx * dx + dy * dy) * sums.weight / (sums.weight + weight);
                    if cost < to.1 * 0.999_999 {
                        to = (id, cost);
                    }
                }
            }
            if to.0 != from {
                for (id, sign) in [(from, -1.0), (to.0, 1.0)] {
                    let sums = &mut self.sums[id];
                    sums.x += sign * weight * x;
                    sums.y += sign * weight * y;
                    sums.weight += sign * weight;
                    self.x[id] = (sums.x / sums.weight) as f32;
                    self.y[id] = (sums.y / sums.weight) as f32;
                }
                self.assignment.relabel(n, to.0);
                moved = true;
            }
        }
        moved
    }

    /// Dissolves one cluster and splits another if that saves more than `gain` of the cost; says whether it did.
    fn swap(&mut self, gain: f64) -> bool {
        let before = self.assignment.cost();
        let Some(swap) = self.splits.best(&self.assignment, &self.sums, &self.x, &self.y) else {
            return false;
        };
        if swap.saving <= gain * before || swap.saving <= 0.0 {
            return false;
        }
        self.saved_x.copy_from_slice(&self.x);
        self.saved_y.copy_from_slice(&self.y);
        let moved = std::mem::replace(&mut self.moved[swap.dissolved], true);
        let split = (self.last_x[swap.split], self.last_y[swap.split]);
        let [kept, other] = swap.halves_from(split);
        (self.x[swap.split], self.y[swap.split]) = kept;
        (self.x[swap.dissolved], self.y[swap.dissolved]) = other;
        self.settle();
        let after = self.assignment.cost();
        if after < before * (1.0 - gain) && after < before {
            return true;
        }
        self.x.copy_from_slice(&self.saved_x);
        self.y.copy_from_slice(&self.saved_y);
        self.moved[swap.dissolved] = moved;
        self.assignment.assign(&self.x, &self.y);
        self.add_up();
        false
    }
}

#[cfg(test)]
mod tests;
