//! The last step of a frame with many points for each cluster: points between two clusters go to the one whose heights
//! are like theirs.
//!
//! With so many points, heights in the search would leave no frame quiet, and what a cluster's points differ by is
//! decided by few of them. So the search knows nothing of this step, and finds the next frame's clusters from its own.

use super::assign::Assignment;

/// Share of the squared distances by which they may grow for the sake of heights, where points are those of the last frame.
pub(super) const GIVEN_AT_REST: f64 = 0.02;
/// The same where they have changed: the search may be far from its end.
pub(super) const GIVEN_IN_CHANGE: f64 = 0.01;
/// How often all points are asked.
const ROUNDS: usize = 2;

/// The clusters that are shown, where they are not those of the search.
#[derive(Debug)]
pub(super) struct Traded {
    labels: Vec<u16>,
    sides: Vec<Side>,
}

/// A cluster as its points see it, with what they add up to.
#[derive(Debug, Default, Clone, Copy)]
struct Side {
    points: f64,
    sum: [f64; 3],
    mean: [f64; 3],
    /// `n / (n - 1)`, what a squared distance counts for a point that leaves.
    left: f64,
    /// `n / (n + 1)`, for one that joins.
    joined: f64,
}

impl Side {
    fn add(&mut self, [x, y, height]: [f64; 3], points: f64) {
        self.points += points;
        self.sum[0] += points * x;
        self.sum[1] += points * y;
        self.sum[2] += points * height;
    }

    fn measure(&mut self) {
        self.mean = self.sum.map(|sum| sum / self.points);
        self.left = self.points / (self.points - 1.0);
        self.joined = self.points / (self.points + 1.0);
    }

    /// Squared distance from the mean place.
    #[inline]
    fn far(&self, [x, y, _]: [f64; 3]) -> f64 {
        let (dx, dy) = (x - self.mean[0], y - self.mean[1]);
        dx * dx + dy * dy
    }

    /// Squared difference from the mean height.
    #[inline]
    fn unlike(&self, [.., height]: [f64; 3]) -> f64 {
        let dz = height - self.mean[2];
        dz * dz
    }
}

impl Traded {
    pub(super) fn new(points: usize, clusters: usize) -> Self {
        Self {
            labels: Vec::with_capacity(points),
            sides: vec![Side::default(); clusters],
        }
    }

    /// Shows what the search found.
    pub(super) fn forget(&mut self) {
        self.labels.clear();
    }

    /// The clusters to show: the search's own, but for points that were traded.
    pub(super) fn labels<'a>(&'a self, points: &'a Assignment) -> &'a [u16] {
        if self.labels.is_empty() {
            points.labels()
        } else {
            &self.labels
        }
    }

    /// Moves points to the cluster with the second nearest centroid where the squared differences of heights fall by a
    /// greater share than the squared distances grow; in all by `given`, a share of them, at most. Points that stand for
    /// a cluster stay.
    pub(super) fn trade(
        &mut self,
        points: &Assignment,
        heights: &[f64],
        members: &[Option<u32>],
        given: f64,
    ) {
        self.labels.clear();
        self.labels.extend_from_slice(points.labels());
        let [far, unlike] = self.measure(points, heights);
        let mut left = given * far;
        for _ in 0..ROUNDS {
            let mut moved = false;
            for (n, label) in self.labels.iter_mut().enumerate() {
                let (from, to) = (usize::from(*label), points.second(n));
                if from == to || members[from] == Some(n as u32) || self.sides[to].points == 0.0 {
                    continue;
                }
                let at = point(points, heights, n);
                let (own, other) = (&self.sides[from], &self.sides[to]);
                let more = other.far(at) * other.joined - own.far(at) * own.left;
                let got = own.unlike(at) * own.left - other.unlike(at) * other.joined;
                // One branch, which is hardly ever taken, rather than three.
                if (more <= left) & (got > 0.0) & (more * unlike < got * far) {
                    left -= more;
                    for (id, points) in [(from, -1.0), (to, 1.0)] {
                        self.sides[id].add(at, points);
                        self.sides[id].measure();
                    }
                    *label = to as u16;
                    moved = true;
                }
            }
            if !moved {
                break;
            }
        }
    }

    /// Adds up the clusters. Returns all squared distances from the means, and all squared differences of heights.
    fn measure(&mut self, points: &Assignment, heights: &[f64]) -> [f64; 2] {
        self.sides.fill(Side::default());
        for (n, label) in self.labels.iter().enumerate() {
            self.sides[usize::from(*label)].add(point(points, heights, n), 1.0);
        }
        for side in &mut self.sides {
            side.measure();
        }
        let mut costs = [0.0; 2];
        for (n, label) in self.labels.iter().enumerate() {
            let (side, at) = (&self.sides[usize::from(*label)], point(points, heights, n));
            costs[0] += side.far(at);
            costs[1] += side.unlike(at);
        }
        costs
    }
}

fn point(points: &Assignment, heights: &[f64], n: usize) -> [f64; 3] {
    let [x, y] = points.place_of(n);
    [f64::from(x), f64::from(y), heights[n]]
}
