//! Lloyd's iterations and Hartigan's moves.

use super::{FAR, Kmeans2d};

/// A swap that is settled goes on while falling so many times as far as in the last round would be enough.
const FALLS: f64 = 16.0;

impl Kmeans2d {
    /// Lloyd's iterations and Hartigan's moves until nothing changes, or as often as allowed.
    /// Afterwards labels, sums and distances belong to each other.
    pub(super) fn settle(&mut self) {
        self.settled = true;
        let few = self.few();
        for _ in 0..self.settings.iterations {
            let changed = self.assignment.assign(&self.x, &self.y, &mut self.sums);
            if changed > few {
                self.centre();
            } else if self.move_points() <= few {
                return;
            } else if self.settings.history > 0.0 {
                self.centre();
            }
        }
        self.settled = self.assignment.assign(&self.x, &self.y, &mut self.sums) <= few;
    }

    /// The same, given up (`false`, with labels and centroids left in between) when the cost does
    /// not fall fast enough to get below `most`.
    pub(super) fn settle_below(&mut self, most: f64) -> bool {
        self.settled = true;
        let few = self.few();
        let mut before = f64::INFINITY;
        for _ in 0..self.settings.iterations {
            let changed = self.assignment.assign(&self.x, &self.y, &mut self.sums);
            let cost = self.assignment.cost();
            if cost - FALLS * (before - cost) >= most {
                return false;
            }
            before = cost;
            if changed > few {
                self.centre();
            } else if self.move_points() <= few {
                return true;
            } else if self.settings.history > 0.0 {
                self.centre();
            }
        }
        self.settled = self.assignment.assign(&self.x, &self.y, &mut self.sums) <= few;
        true
    }

    /// How many labels may change, or points move, without a reason to go on: none of fewer than
    /// 1,024 points, and one for each 1,024 of more, which is too few to be felt. With more points
    /// the last ones take ever more rounds.
    fn few(&self) -> usize {
        self.assignment.len() / 1024
    }

    /// Moves every centroid to the mean of its points, drawn towards where it was.
    pub(super) fn centre(&mut self) {
        for (id, sums) in self.sums.iter().enumerate() {
            if sums.weight > 0.0 {
                let history = if self.moved[id] || self.last_x[id] == FAR {
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

    /// Moves single points where that lowers the cost; returns how many moved.
    fn move_points(&mut self) -> usize {
        let mut moved = 0;
        self.ask();
        for n in 0..self.assignment.len() {
            let from = usize::from(self.assignment.labels()[n]);
            let (near, next) = self.assignment.distances(n);
            if near * self.asks[from] <= next {
                continue;
            }
            let (x, y, weight) = self.assignment.point(n);
            let heavy = self.sums[from].weight;
            let left = heavy - weight;
            if left <= 0.0 {
                continue;
            }
            let mut to = (from, f64::from(near) * heavy / left * 0.999_999);
            for (id, sums) in self.sums.iter().enumerate() {
                let (dx, dy) = (x - f64::from(self.x[id]), y - f64::from(self.y[id]));
                let (cost, share) = ((dx * dx + dy * dy) * sums.weight, sums.weight + weight);
                // A division for those only that are nearer than any before.
                if cost < to.1 * share && id != from && sums.weight > 0.0 {
                    to = (id, cost / share * 0.999_999);
                }
            }
            if to.0 != from {
                for (id, weight) in [(from, -weight), (to.0, weight)] {
                    let sums = &mut self.sums[id];
                    sums.add(x as f32, y as f32, weight);
                    self.x[id] = (sums.x / sums.weight) as f32;
                    self.y[id] = (sums.y / sums.weight) as f32;
                }
                self.assignment.relabel(n, to.0);
                self.ask();
                moved += 1;
            }
        }
        moved
    }

    /// How many times nearer than the second nearest centroid a point of each cluster must be for
    /// it to be sure to stay: leaving saves `n / (n - 1)` of the one distance, and costs `m / (m +
    /// 1)` of the other, least for the lightest cluster.
    fn ask(&mut self) {
        let lightest = (self.sums.iter().map(|sums| sums.weight))
            .filter(|weight| *weight > 0.0)
            .fold(f64::INFINITY, f64::min);
        let heaviest = self.assignment.greatest_weight();
        for (ask, sums) in self.asks.iter_mut().zip(&self.sums) {
            let left = sums.weight - heaviest;
            *ask = if left > 0.0 {
                (sums.weight / left * (lightest + heaviest) / lightest) as f32 * 1.000_01
            } else if self.assignment.is_weighted() {
                f32::INFINITY
            } else {
                0.0
            };
        }
    }
}
