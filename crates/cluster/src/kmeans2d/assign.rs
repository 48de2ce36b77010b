//! Points, their nearest centroid and the distances to the two nearest.

use crate::Plane;

/// Points side by side in one step.
const LANES: usize = 8;

/// The points of a frame and the cluster each belongs to.
#[derive(Debug)]
pub(super) struct Assignment {
    n: usize,
    x: Vec<[f32; LANES]>,
    y: Vec<[f32; LANES]>,
    weight: Vec<f32>,
    /// Squared distance to the nearest centroid; 0 for the points that fill up the last step.
    near: Vec<[f32; LANES]>,
    /// Squared distance to the second nearest.
    next: Vec<[f32; LANES]>,
    label: Vec<u16>,
}

impl Assignment {
    pub(super) fn new(points: usize) -> Self {
        let steps = points.div_ceil(LANES);
        Self {
            n: 0,
            x: Vec::with_capacity(steps),
            y: Vec::with_capacity(steps),
            weight: Vec::with_capacity(points),
            near: vec![[0.0; LANES]; steps],
            next: vec![[0.0; LANES]; steps],
            label: Vec::with_capacity(points),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.n
    }

    pub(super) fn labels(&self) -> &[u16] {
        &self.label
    }

    pub(super) fn relabel(&mut self, n: usize, id: usize) {
        self.label[n] = id as u16;
    }

    /// A point and its weight.
    pub(super) fn point(&self, n: usize) -> (f64, f64, f64) {
        (
            f64::from(self.x[n / LANES][n % LANES]),
            f64::from(self.y[n / LANES][n % LANES]),
            self.weight.get(n).map_or(1.0, |w| f64::from(*w)),
        )
    }

    /// Squared distances of a point to the two nearest centroids.
    pub(super) fn distances(&self, n: usize) -> (f64, f64) {
        (
            f64::from(self.near[n / LANES][n % LANES]),
            f64::from(self.next[n / LANES][n % LANES]),
        )
    }

    /// Takes the points of a frame. Steps are filled up with copies of the last point.
    pub(super) fn place(&mut self, points: Plane<'_>, weights: Option<&[f64]>) {
        self.n = points.len();
        for (columns, values) in [(&mut self.x, points.x), (&mut self.y, points.y)] {
            columns.clear();
            columns.extend(values.chunks(LANES).map(|chunk| {
                let mut step = [chunk[chunk.len() - 1] as f32; LANES];
                for (to, from) in step.iter_mut().zip(chunk) {
                    *to = *from as f32;
                }
                step
            }));
        }
        self.weight.clear();
        self.weight
            .extend(weights.unwrap_or(&[]).iter().map(|w| *w as f32));
        self.label.clear();
        self.label.resize(self.n, u16::MAX);
    }

    /// Assigns every point to its nearest centroid, ties to the lowest id; says whether any label changed.
    pub(super) fn assign(&mut self, x: &[f32], y: &[f32]) -> bool {
        let mut changed = false;
        let steps = self
            .x
            .iter()
            .zip(&self.y)
            .zip(self.near.iter_mut().zip(&mut self.next));
        for (((px, py), (near, next)), labels) in steps.zip(self.label.chunks_mut(LANES)) {
            let mut first = [f32::INFINITY; LANES];
            let mut second = [f32::INFINITY; LANES];
            let mut nearest = [0f32; LANES];
            let mut id = 0f32;
            for (x, y) in x.iter().zip(y) {
                for lane in 0..LANES {
                    let (dx, dy) = (px[lane] - x, py[lane] - y);
                    let distance = dx * dx + dy * dy;
                    let less = distance < first[lane];
                    let farther = if less { first[lane] } else { distance };
                    second[lane] = if farther < second[lane] {
                        farther
                    } else {
                        second[lane]
                    };
                    first[lane] = if less { distance } else { first[lane] };
                    nearest[lane] = if less { id } else { nearest[lane] };
                }
                id += 1.0;
            }
            *near = first;
            *next = second;
            for (label, nearest) in labels.iter_mut().zip(nearest) {
                changed |= *label != nearest as u16;
                *label = nearest as u16;
            }
        }
        changed
    }

    /// Weighted sum of squared distances to the nearest centroids.
    pub(super) fn cost(&self) -> f64 {
        (0..self.n).map(|n| self.point(n).2 * self.distances(n).0).sum()
    }

    /// Computes the distance of each point to the nearest of some centroids.
    pub(super) fn distances_to(&mut self, x: &[f32], y: &[f32], used: &[bool]) {
        self.near.fill([f32::INFINITY; LANES]);
        for id in (0..x.len()).filter(|id| used[*id]) {
            self.approach(x[id], y[id]);
        }
    }

    /// Takes one more centroid into account.
    pub(super) fn approach(&mut self, x: f32, y: f32) {
        for ((px, py), near) in self.x.iter().zip(&self.y).zip(&mut self.near) {
            for lane in 0..LANES {
                let (dx, dy) = (px[lane] - x, py[lane] - y);
                let distance = dx * dx + dy * dy;
                near[lane] = if distance < near[lane] {
                    distance
                } else {
                    near[lane]
                };
            }
        }
    }

    /// The point farthest from its nearest centroid; the first among equals.
    pub(super) fn farthest(&self) -> (f32, f32) {
        let mut farthest = (0, f32::NEG_INFINITY);
        for n in 0..self.n {
            let near = self.near[n / LANES][n % LANES];
            if near > farthest.1 {
                farthest = (n, near);
            }
        }
        let n = farthest.0;
        (self.x[n / LANES][n % LANES], self.y[n / LANES][n % LANES])
    }
}
