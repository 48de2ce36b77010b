//! Which cluster is missed least, and which gains most from being two.

use super::assign::Assignment;
use super::{MOST_PAIRED, Sums};

/// Memory for judging swaps.
#[derive(Debug)]
pub(super) struct Splits {
    shape: Vec<Shape>,
    halves: Vec<Sums>,
    /// Pairs that may be dissolved and split, by what that is judged to save.
    ranked: Vec<(f64, u16, u16)>,
    /// The swaps found last, that which saves most first.
    found: Vec<(f64, Swap)>,
}

/// Most swaps that are found at once.
pub(super) const MOST_FOUND: usize = 8;
/// Most pairs that are kept in a ranking.
const RANKED: usize = 64;

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
    /// Means of the halves of the split cluster; the first stays with it.
    pub(super) halves: [[f32; 3]; 2],
    /// What it has to save to be made.
    pub(super) asked: f64,
}

/// What a swap has to save.
#[derive(Debug)]
pub(super) struct Judge<'a> {
    /// For each cluster that jumps.
    pub(super) gain: f64,
    /// For a swap in which none jumps.
    pub(super) least: f64,
    /// So many times as much, where it is judged to save too little.
    pub(super) times_if_doubtful: f64,
    /// Square of the distance that is no jump.
    pub(super) reach: f64,
    /// Ids that were in use in the last frame.
    pub(super) pinned: &'a [bool],
    /// Ids that have jumped in this frame already.
    pub(super) moved: &'a [bool],
    /// Where ids stood.
    pub(super) stands: &'a [[f32; 2]],
}

impl Judge<'_> {
    /// Whether an id would jump if it went elsewhere.
    fn is_bound(&self, id: usize) -> bool {
        self.pinned[id] && !self.moved[id]
    }

    /// What a swap has to save that puts the split cluster's own half to `kept`.
    fn asks(&self, dissolved: usize, split: usize, kept: [f32; 3]) -> f64 {
        let jumps = u8::from(self.is_bound(dissolved)) + u8::from(self.way(split, kept) > self.reach);
        self.least.max(f64::from(jumps) * self.gain)
    }

    /// Squared distance from where an id stood; 0 where that does not matter.
    fn way(&self, id: usize, to: [f32; 3]) -> f64 {
        if !self.is_bound(id) {
            return 0.0;
        }
        let [x, y] = self.stands[id];
        let (dx, dy) = (f64::from(to[0] - x), f64::from(to[1] - y));
        dx * dx + dy * dy
    }
}

impl Splits {
    pub(super) fn new(clusters: usize) -> Self {
        Self {
            shape: vec![Shape::default(); clusters],
            halves: vec![Sums::default(); clusters],
            ranked: Vec::with_capacity(if clusters <= MOST_PAIRED {
                clusters * clusters
            } else {
                0
            }),
            found: Vec::with_capacity(MOST_FOUND),
        }
    }

    /// Finds the swaps that save most beyond what they have to save, judged by the second nearest centroids and by
    /// halving clusters across their principal axis: `most` of them, or if that is 1, only one that saves enough. Returns
    /// how many save enough, and how many were found.
    pub(super) fn find(
        &mut self,
        points: &Assignment,
        sums: &[Sums],
        at: [&[f32]; 3],
        judge: &Judge<'_>,
        most: usize,
    ) -> (usize, usize) {
        self.measure(points, sums, at);
        self.merge(sums, at);
        self.halve(points, at);
        // The two that are missed least, among those that would jump and those that would not.
        let mut least = [[(usize::MAX, f64::INFINITY); 2]; 2];
        for (id, shape) in self.shape.iter().enumerate() {
            let least = &mut least[usize::from(judge.is_bound(id))];
            if shape.loss < least[0].1 {
                *least = [(id, shape.loss), least[0]];
            } else if shape.loss < least[1].1 {
                least[1] = (id, shape.loss);
            }
        }
        self.found.clear();
        for split in 0..sums.len() {
            let Some((gain, halves)) = self.split(split, sums, judge) else {
                continue;
            };
            for least in &least {
                let (dissolved, loss) = if least[0].0 == split { least[1] } else { least[0] };
                if dissolved == usize::MAX {
                    continue;
                }
                let asked = judge.asks(dissolved, split, halves[0]);
                let beyond = gain - loss - asked;
                let rank = self
                    .found
                    .iter()
                    .take_while(|(other, _)| *other >= beyond)
                    .count();
                if rank < most && (beyond > 0.0 || most > 1) {
                    self.found.truncate(most - 1);
                    let swap = Swap {
                        dissolved,
                        split,
                        halves,
                        asked: if beyond > 0.0 {
                            asked
                        } else {
                            judge.times_if_doubtful * asked
                        },
                    };
                    self.found.insert(rank, (beyond, swap));
                }
            }
        }
        let sure = self.found.iter().take_while(|(beyond, _)| *beyond > 0.0).count();
        (sure, self.found.len())
    }

    /// The swap that was found, by rank from 0.
    pub(super) fn found(&self, rank: usize) -> Swap {
        self.found[rank].1
    }

    /// What a cluster gains by being halved, and the means of its halves, the one nearer to where
    /// it stood first.
    fn split(&self, split: usize, sums: &[Sums], judge: &Judge<'_>) -> Option<(f64, [[f32; 3]; 2])> {
        let (all, half) = (&sums[split], &self.halves[split]);
        let rest = Sums {
            x: all.x - half.x,
            y: all.y - half.y,
            height: all.height - half.height,
            weight: all.weight - half.weight,
        };
        if half.weight <= 0.0 || rest.weight <= 0.0 {
            return None;
        }
        let [a, b] = [half, &rest].map(Sums::mean);
        let [dx, dy, dz] = [0, 1, 2].map(|axis| a[axis] - b[axis]);
        let gain = half.weight * rest.weight / all.weight * (dx * dx + dy * dy + dz * dz);
        let [a, b] = [a, b].map(|mean| mean.map(|x| x as f32));
        let halves = if judge.way(split, b) < judge.way(split, a) {
            [b, a]
        } else {
            [a, b]
        };
        Some((gain, halves))
    }

    /// Forgets the ranking.
    pub(super) fn forget(&mut self) {
        self.ranked.clear();
    }

    /// Whether there is a ranking of the present clusters.
    pub(super) fn is_ranked(&self) -> bool {
        !self.ranked.is_empty()
    }

    /// Ranks the swaps of the present clusters, whether or not they are judged to save anything.
    pub(super) fn rank(&mut self, points: &Assignment, sums: &[Sums], at: [&[f32]; 3], judge: &Judge<'_>) {
        self.ranked.clear();
        if sums.len() > MOST_PAIRED {
            return;
        }
        self.measure(points, sums, at);
        self.merge(sums, at);
        self.halve(points, at);
        for split in 0..sums.len() {
            let Some((gain, _)) = self.split(split, sums, judge) else {
                continue;
            };
            for dissolved in (0..sums.len()).filter(|d| *d != split) {
                let saving = gain - self.shape[dissolved].loss;
                self.ranked.push((saving, dissolved as u16, split as u16));
            }
        }
        let by_saving =
            |a: &(f64, u16, u16), b: &(f64, u16, u16)| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2)));
        if self.ranked.len() > RANKED {
            self.ranked.select_nth_unstable_by(RANKED - 1, by_saving);
            self.ranked.truncate(RANKED);
        }
        self.ranked.sort_unstable_by(by_saving);
    }

    /// The `n`-th best swap by the ranking; the clusters must be those that were ranked.
    pub(super) fn ranked(&self, n: usize, sums: &[Sums], judge: &Judge<'_>) -> Option<Swap> {
        let (_, dissolved, split) = *self.ranked.get(n)?;
        let (dissolved, split) = (usize::from(dissolved), usize::from(split));
        let (_, halves) = self.split(split, sums, judge)?;
        Some(Swap {
            dissolved,
            split,
            halves,
            asked: judge.asks(dissolved, split, halves[0]),
        })
    }

    fn measure(&mut self, points: &Assignment, sums: &[Sums], [x, y, _]: [&[f32]; 3]) {
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
            let second = points.second(n);
            let other = sums[second].weight;
            // The other centroid comes to meet a point that joins it; one without points rests where it is.
            let share = if other > 0.0 {
                other / (other + weight)
            } else {
                1.0
            };
            shape.loss += weight * (share * f64::from(next) - f64::from(near));
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

    /// Lowers the loss of each cluster to the cost of merging it with the best other, `n m / (n +
    /// m) d^2`, where that is less: the points' distances to second nearest centroids do not know
    /// that a centroid makes room for them.
    fn merge(&mut self, sums: &[Sums], [x, y, height]: [&[f32]; 3]) {
        for a in 0..sums.len() {
            for b in 0..a {
                if sums[a].weight <= 0.0 || sums[b].weight <= 0.0 {
                    continue;
                }
                let (dx, dy) = (f64::from(x[a] - x[b]), f64::from(y[a] - y[b]));
                let dz = f64::from(height[a] - height[b]);
                let (n, m) = (sums[a].weight, sums[b].weight);
                let most = self.shape[a].loss.max(self.shape[b].loss);
                let product = n * m * (dx * dx + dy * dy + dz * dz);
                if product >= most * (n + m) {
                    continue;
                }
                let cost = product / (n + m);
                for id in [a, b] {
                    self.shape[id].loss = self.shape[id].loss.min(cost);
                }
            }
        }
    }

    /// Adds up the points on one side of each cluster's centroid, along its principal axis.
    fn halve(&mut self, points: &Assignment, [x, y, _]: [&[f32]; 3]) {
        self.halves.fill(Sums::default());
        for n in 0..points.len() {
            let id = usize::from(points.labels()[n]);
            let (px, py, weight) = points.point(n);
            let axis = self.shape[id].axis;
            let side = (px - f64::from(x[id])) * axis.0 + (py - f64::from(y[id])) * axis.1;
            // Half of the points are on either side, in no order: a branch would be guessed wrongly as often.
            let weight = if side > 0.0 { weight } else { 0.0 };
            self.halves[id].add(px as f32, py as f32, points.height(n), weight);
        }
    }
}
