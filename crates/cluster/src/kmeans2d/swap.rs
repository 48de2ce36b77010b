//! Which cluster is missed least, and which gains most from being two.

use super::Sums;
use super::assign::Assignment;

/// Memory for judging swaps.
#[derive(Debug)]
pub(super) struct Splits {
    shape: Vec<Shape>,
    halves: Vec<Sums>,
}

/// A cluster's second moments, and what its points would lose without it.
#[derive(Debug, Default, Clone, Copy)]
struct Shape {
    xx: f64,
    xy: f64,
    yy: f64,
    loss: f64,
    /// Principal axis, not normalised.
    axis: (f64, f64),
}

/// A swap: one cluster is dissolved, and takes over half of another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Swap {
    pub(super) dissolved: usize,
    pub(super) split: usize,
    /// Means of the halves of the split cluster.
    halves: [(f32, f32); 2],
    /// What it saves before the points settle.
    pub(super) saving: f64,
}

impl Swap {
    /// The halves, the one nearer to a place first.
    pub(super) fn halves_from(&self, place: (f32, f32)) -> [(f32, f32); 2] {
        let [a, b] = self.halves;
        let distance = |half: (f32, f32)| {
            let (dx, dy) = (half.0 - place.0, half.1 - place.1);
            dx * dx + dy * dy
        };
        if distance(b) < distance(a) { [b, a] } else { [a, b] }
    }
}

impl Splits {
    pub(super) fn new(clusters: usize) -> Self {
        Self {
            shape: vec![Shape::default(); clusters],
            halves: vec![Sums::default(); clusters],
        }
    }

    /// The swap that saves most, judged by the second nearest centroids and by halving clusters across their principal axis.
    pub(super) fn best(&mut self, points: &Assignment, sums: &[Sums], x: &[f32], y: &[f32]) -> Option<Swap> {
        self.measure(points, x, y);
        self.merge(sums, x, y);
        self.halve(points, x, y);
        let mut best: Option<Swap> = None;
        let mut least = [(usize::MAX, f64::INFINITY); 2];
        for (id, shape) in self.shape.iter().enumerate() {
            if shape.loss < least[0].1 {
                least = [(id, shape.loss), least[0]];
            } else if shape.loss < least[1].1 {
                least[1] = (id, shape.loss);
            }
        }
        for (split, (all, half)) in sums.iter().zip(&self.halves).enumerate() {
            let rest = Sums {
                x: all.x - half.x,
                y: all.y - half.y,
                weight: all.weight - half.weight,
            };
            if half.weight <= 0.0 || rest.weight <= 0.0 {
                continue;
            }
            let (ax, ay) = (half.x / half.weight, half.y / half.weight);
            let (bx, by) = (rest.x / rest.weight, rest.y / rest.weight);
            let gain =
                half.weight * rest.weight / all.weight * ((ax - bx) * (ax - bx) + (ay - by) * (ay - by));
            let (dissolved, loss) = if least[0].0 == split { least[1] } else { least[0] };
            let saving = gain - loss;
            if dissolved < usize::MAX && best.is_none_or(|b| saving > b.saving) {
                best = Some(Swap {
                    dissolved,
                    split,
                    halves: [(ax as f32, ay as f32), (bx as f32, by as f32)],
                    saving,
                });
            }
        }
        best
    }

    fn measure(&mut self, points: &Assignment, x: &[f32], y: &[f32]) {
        self.shape.fill(Shape::default());
        for n in 0..points.len() {
            let id = usize::from(points.labels()[n]);
            let (px, py, weight) = points.point(n);
            let (near, next) = points.distances(n);
            let (dx, dy) = (px - f64::from(x[id]), py - f64::from(y[id]));
            let shape = &mut self.shape[id];
            shape.xx += weight * dx * dx;
            shape.xy += weight * dx * dy;
            shape.yy += weight * dy * dy;
            shape.loss += weight * (next - near);
        }
        for shape in &mut self.shape {
            let half = 0.5 * (shape.xx - shape.yy);
            let root = (half * half + shape.xy * shape.xy).sqrt();
            shape.axis = if half >= 0.0 {
                (half + root, shape.xy)
            } else {
                (shape.xy, root - half)
            };
        }
    }

    /// Lowers the loss of each cluster to the cost of merging it with the best other, `n m / (n + m) d^2`, where that is less: the points'
    /// distances to second nearest centroids do not know that a centroid makes room for them.
    fn merge(&mut self, sums: &[Sums], x: &[f32], y: &[f32]) {
        for a in 0..sums.len() {
            for b in 0..a {
                let (dx, dy) = (f64::from(x[a] - x[b]), f64::from(y[a] - y[b]));
                let (n, m) = (sums[a].weight, sums[b].weight);
                let cost = n * m / (n + m) * (dx * dx + dy * dy);
                for id in [a, b] {
                    if cost < self.shape[id].loss {
                        self.shape[id].loss = cost;
                    }
                }
            }
        }
    }

    /// Adds up the points on one side of each cluster's centroid, along its principal axis.
    fn halve(&mut self, points: &Assignment, x: &[f32], y: &[f32]) {
        self.halves.fill(Sums::default());
        for n in 0..points.len() {
            let id = usize::from(points.labels()[n]);
            let (px, py, weight) = points.point(n);
            let axis = self.shape[id].axis;
            if (px - f64::from(x[id])) * axis.0 + (py - f64::from(y[id])) * axis.1 > 0.0 {
                let half = &mut self.halves[id];
                half.x += weight * px;
                half.y += weight * py;
                half.weight += weight;
            }
        }
    }
}
