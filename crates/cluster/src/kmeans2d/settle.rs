//! Lloyd's iterations and Hartigan's moves.

use super::{FAR, Kmeans2d, Sums};

/// Clusters side by side in one step.
const LANES: usize = 8;

/// Weight of a cluster for single points that may join it; not a number for one without points, which none joins.
fn mass(sums: &Sums) -> f32 {
    if sums.weight > 0.0 {
        sums.weight as f32
    } else {
        f32::NAN
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
        self.settled = self.assignment.assign(&self.x, &self.y, &mut self.sums) <= few;
        true
    }

    /// Sum of squared distances of the points from their centroids, and of squared differences from the mean heights.
    pub(super) fn cost(&self) -> f64 {
        let flat = self.assignment.cost();
        if !self.assignment.is_raised() {
            return flat;
        }
        let live = self.sums.iter().filter(|sums| sums.weight > 0.0);
        let means: f64 = live.map(|sums| sums.height * sums.height / sums.weight).sum();
        flat + (self.assignment.squared_heights() - means)
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

    /// Moves single points where that lowers the cost, to which the squared differences of heights are added here;
    /// returns how many moved.
    pub(super) fn move_points(&mut self) -> usize {
        let mut moved = 0;
        self.ask();
        for (held, sums) in self.mass.iter_mut().zip(&self.sums) {
            *held = mass(sums);
        }
        for n in 0..self.assignment.len() {
            let from = usize::from(self.assignment.labels()[n]);
            let (near, next) = self.assignment.distances(n);
            let height = self.assignment.height(n);
            let below = height - self.height[from];
            let near = near + below * below;
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
                    self.mass[id] = mass(sums);
                }
                self.assignment.relabel(n, to);
                self.ask();
                moved += 1;
            }
        }
        moved
    }

    /// The cluster that a point joins at the least cost, `m / (m + w)` of its squared distance, other than its own;
    /// ties, within what [`Assignment::assign`] takes for one, to the lowest id. `None` where there is no other.
    fn cheapest(&mut self, point: [f32; 3], weight: f32, own: usize) -> Option<usize> {
        let ids = self.assignment.id_bits();
        let held = std::mem::replace(&mut self.mass[own], f32::NAN);
        let mut least = [f32::MAX; LANES];
        let cost = |x: f32, y: f32, height: f32, mass: f32, id: u32| {
            let (dx, dy, dz) = (point[0] - x, point[1] - y, point[2] - height);
            let cost = (dx * dx + dy * dy + dz * dz) * (mass / (mass + weight));
            f32::from_bits(cost.to_bits() & !ids | id)
        };
        let ([x, y, height], mass) = ([&self.x, &self.y, &self.height], &self.mass);
        let whole = x.len() / LANES * LANES;
        for first in (0..whole).step_by(LANES) {
            let of = |values: &Vec<f32>| -> [f32; LANES] { std::array::from_fn(|lane| values[first + lane]) };
            let (x, y, height, mass) = (of(x), of(y), of(height), of(mass));
            for lane in 0..LANES {
                let cost = cost(x[lane], y[lane], height[lane], mass[lane], (first + lane) as u32);
                least[lane] = if cost < least[lane] { cost } else { least[lane] };
            }
        }
        let mut best = least
            .iter()
            .copied()
            .fold(f32::MAX, |a, b| if b < a { b } else { a });
        for id in whole..x.len() {
            let cost = cost(x[id], y[id], height[id], mass[id], id as u32);
            best = if cost < best { cost } else { best };
        }
        self.mass[own] = held;
        (best < f32::MAX).then_some((best.to_bits() & ids) as usize)
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
