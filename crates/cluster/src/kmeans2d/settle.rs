//! Lloyd's iterations and Hartigan's moves.

use super::steps::{LANES, lesser};
use super::{FAR, Kmeans2d};

/// Clusters as single points that may join them see them, side by side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joined {
    x: [f32; LANES],
    y: [f32; LANES],
    height: [f32; LANES],
    /// Weight; not a number for a cluster without points, which none joins, and where there is no cluster.
    mass: [f32; LANES],
    /// `m / (m + 1)`, the share of its squared distance that a point without a weight costs.
    share: [f32; LANES],
}

impl Joined {
    /// Steps for so many clusters.
    pub(super) fn steps(clusters: usize) -> Vec<Self> {
        let nowhere = [f32::NAN; LANES];
        let none = Self {
            x: nowhere,
            y: nowhere,
            height: nowhere,
            mass: nowhere,
            share: nowhere,
        };
        vec![none; clusters.div_ceil(LANES)]
    }
}

/// A swap that is settled goes on while falling so many times as far as in the last round would be enough.
const FALLS: f64 = 16.0;

impl Kmeans2d {
    /// Lloyd's iterations and Hartigan's moves until nothing changes, or as often as allowed.
    /// Afterwards labels, sums and distances belong to each other.
    pub(super) fn settle(&mut self) {
        self.settled = true;
        let few = self.few();
        for _ in 0..self.settings.iterations {
            let changed = self.assign();
            if changed > few {
                self.centre();
            } else if self.move_points() <= few {
                return;
            } else if self.settings.history > 0.0 {
                self.centre();
            }
        }
        self.settled = self.assign() <= few;
    }

    /// The same, given up (`false`, with labels and centroids left in between) when the cost does
    /// not fall fast enough to get below `most`.
    pub(super) fn settle_below(&mut self, most: f64) -> bool {
        self.settled = true;
        let few = self.few();
        let mut before = f64::INFINITY;
        for _ in 0..self.settings.iterations {
            let changed = self.assign();
            let cost = self.cost();
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
        self.settled = self.assign() <= few;
        true
    }

    /// Assigns every point to its nearest centroid; returns how many labels changed.
    pub(super) fn assign(&mut self) -> usize {
        let centroids = [&self.x[..], &self.y, &self.height];
        self.assignment.assign(centroids, &mut self.sums)
    }

    /// Sum of squared distances of the points from their centroids, heights included.
    pub(super) fn cost(&self) -> f64 {
        self.assignment.cost()
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
        self.raise();
    }

    /// Takes every cluster to the mean height of its points.
    pub(super) fn raise(&mut self) {
        for (height, sums) in self.height.iter_mut().zip(&self.sums) {
            if sums.weight > 0.0 {
                *height = (sums.height / sums.weight) as f32;
            }
        }
    }

    /// Moves single points where that lowers the cost; returns how many moved.
    pub(super) fn move_points(&mut self) -> usize {
        let mut moved = 0;
        let heaviest = self.assignment.greatest_weight();
        for id in 0..self.sums.len() {
            self.show(id, heaviest);
        }
        self.ask(heaviest);
        for n in 0..self.assignment.len() {
            let from = usize::from(self.assignment.labels()[n]);
            let (near, next) = self.assignment.distances(n);
            let height = self.assignment.height(n);
            if near * self.asks[from] <= next {
                continue;
            }
            let (x, y, weight) = self.assignment.point(n);
            let heavy = self.sums[from].weight;
            let left = heavy - weight;
            if left <= 0.0 {
                continue;
            }
            let Some(to) = self.cheapest([x as f32, y as f32, height], weight as f32, from) else {
                continue;
            };
            let (dx, dy) = (x - f64::from(self.x[to]), y - f64::from(self.y[to]));
            let dz = f64::from(height - self.height[to]);
            let joined = self.sums[to].weight;
            let costs = (dx * dx + dy * dy + dz * dz) * joined / (joined + weight);
            if costs < f64::from(near) * heavy / left * 0.999_999 {
                for (id, weight) in [(from, -weight), (to, weight)] {
                    let sums = &mut self.sums[id];
                    sums.add(x as f32, y as f32, height, weight);
                    self.height[id] = (sums.height / sums.weight) as f32;
                    self.x[id] = (sums.x / sums.weight) as f32;
                    self.y[id] = (sums.y / sums.weight) as f32;
                    self.show(id, heaviest);
                }
                self.assignment.relabel(n, to);
                self.ask(heaviest);
                moved += 1;
            }
        }
        moved
    }

    /// Shows a cluster to single points as it has become; none of them weighs more than `heaviest`.
    fn show(&mut self, id: usize, heaviest: f64) {
        let weight = self.sums[id].weight;
        let left = weight - heaviest;
        self.saves[id] = if left > 0.0 {
            weight / left
        } else if self.assignment.is_weighted() {
            f64::INFINITY
        } else {
            0.0
        };
        let mass = if weight > 0.0 { weight as f32 } else { f32::NAN };
        let (joined, lane) = (&mut self.joined[id / LANES], id % LANES);
        joined.x[lane] = self.x[id];
        joined.y[lane] = self.y[id];
        joined.height[lane] = self.height[id];
        joined.mass[lane] = mass;
        joined.share[lane] = mass / (mass + 1.0);
    }

    /// The cluster that a point joins at the least cost, `m / (m + w)` of its squared distance, other than its own;
    /// ties, within what [`Assignment::assign`] takes for one, to the lowest id. `None` where there is no other.
    fn cheapest(&self, [x, y, height]: [f32; 3], weight: f32, own: usize) -> Option<usize> {
        let (ids, own) = (self.assignment.id_bits(), own as u32);
        let weighted = self.assignment.is_weighted();
        let mut least = [f32::MAX; LANES];
        for (joined, first) in self.joined.iter().zip((0u32..).step_by(LANES)) {
            let mut share = joined.share;
            if weighted {
                share = joined.mass.map(|mass| mass / (mass + weight));
            }
            for lane in 0..LANES {
                let id = first + lane as u32;
                let (dx, dy, dz) = (
                    x - joined.x[lane],
                    y - joined.y[lane],
                    height - joined.height[lane],
                );
                // With all bits set it is not a number, and never the lesser.
                let is_own = u32::from(id == own).wrapping_neg();
                let share = f32::from_bits(share[lane].to_bits() | is_own);
                let cost = (dx * dx + dy * dy + dz * dz) * share;
                least[lane] = lesser(f32::from_bits(cost.to_bits() & !ids | id), least[lane]);
            }
        }
        for half in [4, 2, 1] {
            for lane in 0..half {
                least[lane] = lesser(least[lane + half], least[lane]);
            }
        }
        (least[0] < f32::MAX).then_some((least[0].to_bits() & ids) as usize)
    }

    /// How many times nearer than the second nearest centroid a point of each cluster must be for
    /// it to be sure to stay: leaving saves `n / (n - 1)` of the one distance, and costs `m / (m +
    /// 1)` of the other, least for the lightest cluster.
    fn ask(&mut self, heaviest: f64) {
        let mut lightest = f64::INFINITY;
        for sums in &self.sums {
            let weight = if sums.weight > 0.0 {
                sums.weight
            } else {
                f64::INFINITY
            };
            lightest = if weight < lightest { weight } else { lightest };
        }
        for (ask, saves) in self.asks.iter_mut().zip(&self.saves) {
            *ask = (saves * (lightest + heaviest) / lightest) as f32 * 1.000_01;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::kmeans2d::tests::PLAIN;
    use crate::{Kmeans2d, Plane};

    /// A row of points a unit apart, of which the first has a height, in two clusters: how many are in that of the first.
    fn beside_the_first(height: f64) -> usize {
        let (x, y) = ([0.0, 1.0, 2.0, 3.0, 4.0], [0.0; 5]);
        let heights = [height, 0.0, 0.0, 0.0, 0.0];
        let mut solver = Kmeans2d::new(5, 2, PLAIN);
        let found = solver.follow(Plane { x: &x, y: &y }, &[0, 1, 2, 3, 4], None, Some(&heights));
        found.labels.iter().filter(|id| **id == found.labels[0]).count()
    }

    #[test]
    fn a_point_goes_to_the_centroid_that_is_nearest_heights_included() {
        // Two and three cost 2.5 and half the squared height; one and four cost 5.
        assert_eq!(beside_the_first(0.0), 2);
        assert_eq!(beside_the_first(3.0), 1);
    }
}
