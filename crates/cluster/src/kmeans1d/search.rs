//! The search for the penalty that gives the number of clusters asked for.

use super::cost::Cost;
use super::penalised::Pass;

/// The search and its memory.
#[derive(Debug)]
pub(super) struct Search {
    /// Starts of the clusters found.
    pub(super) starts: Vec<u32>,
    /// Number of points they are starts of.
    points: usize,
    few: Vec<u32>,
    many: Vec<u32>,
}

/// A partition that is optimal for its number of clusters, and a penalty for which it is optimal.
#[derive(Debug, Clone, Copy)]
struct Found {
    penalty: f64,
    clusters: usize,
    cost: f64,
}

impl Search {
    pub(super) fn new(points: usize) -> Self {
        Self {
            starts: Vec::with_capacity(points),
            points: 0,
            few: Vec::with_capacity(points),
            many: Vec::with_capacity(points),
        }
    }

    /// Forgets the last problem.
    pub(super) fn forget(&mut self) {
        self.starts.clear();
    }

    /// Takes a partition found otherwise.
    pub(super) fn take(&mut self, starts: impl Iterator<Item = u32>, points: usize) {
        self.starts.clear();
        self.starts.extend(starts);
        self.points = points;
    }

    /// Leaves an optimal partition into `clusters` clusters in `starts`, and returns a penalty for
    /// which it is optimal; `None` if costs are too coarse to tell so many clusters apart.
    ///
    /// There must be more different points than clusters. `hint` is a penalty to begin with.
    ///
    /// The least cost `c(k)` is convex, so a penalty gives the `k` at which a line of that slope
    /// touches it. Until there is a partition with too few clusters and one with too many, the next
    /// penalty assumes that `c(k)` falls as `1 / k^2` (the high-rate law of quantisation), in
    /// strides that double. Then the chord between the two ends it: either the line of the chord's
    /// slope touches `c(k)` at a new place in between, or there is none, both partitions are
    /// optimal for that penalty, and they can be spliced.
    pub(super) fn run<C: Cost>(
        &mut self,
        cost: &C,
        pass: &mut Pass,
        clusters: usize,
        hint: Option<f64>,
    ) -> Option<f64> {
        let n = cost.points();
        let block = block_of(n, clusters);
        let all = cost.between(0, n) + cost.offset(n);
        let wanted = clusters as f64;
        let mut few: Option<Found> = None;
        let mut many: Option<Found> = None;
        let mut stride = 3u32;
        let mut penalty = self
            .guess(cost, clusters, hint)
            .or(hint)
            .unwrap_or(2.0 * all / (wanted * wanted * wanted));
        self.points = n;
        loop {
            let mut chord = None;
            if let (Some(few), Some(many)) = (few, many) {
                let narrow = many.clusters - few.clusters <= 2;
                if narrow || stride > 3 || penalty <= many.penalty || penalty >= few.penalty {
                    penalty = (few.cost - many.cost) / (many.clusters - few.clusters) as f64;
                    if penalty <= 0.0 {
                        return None;
                    }
                    chord = Some(few.cost + penalty * few.clusters as f64);
                }
            }
            pass.run(cost, penalty, block, &mut self.starts);
            let found = Found {
                penalty,
                clusters: self.starts.len(),
                cost: cost.of_partition(&self.starts),
            };
            if found.clusters == clusters {
                return Some(penalty);
            }
            let is_new = few.is_none_or(|f| f.clusters < found.clusters)
                && many.is_none_or(|m| found.clusters < m.clusters);
            if let Some(chord) = chord {
                let line = found.cost + penalty * found.clusters as f64;
                let margin = cost.margin(clusters, penalty * wanted);
                if !is_new || line >= chord - margin {
                    self.splice(clusters);
                    return Some(penalty);
                }
            }
            if found.clusters < clusters {
                if penalty == 0.0 {
                    return None;
                }
                few = Some(found);
                self.few.clone_from(&self.starts);
            } else {
                many = Some(found);
                self.many.clone_from(&self.starts);
            }
            stride = if is_new && few.is_some() && many.is_some() {
                3
            } else {
                stride * 2
            };
            penalty = self.next_penalty(cost, &found, clusters, stride).min(2.0 * all);
        }
    }

    /// A penalty that the last problem's partition suggests for this one: `None` if it had another
    /// number of clusters.
    ///
    /// The old starts, in proportion, are moved by a few of Lloyd's iterations. The penalties for
    /// which a partition is optimal lie above what its best split saves and below what its best
    /// merger costs; the last penalty is a good guess if it does, else their geometric mean, which
    /// leaves room on both sides.
    fn guess<C: Cost>(&mut self, cost: &C, clusters: usize, last: Option<f64>) -> Option<f64> {
        if self.starts.len() != clusters || clusters < 2 {
            return None;
        }
        let n = cost.points();
        let starts = &mut self.starts;
        for (k, start) in starts.iter_mut().enumerate() {
            *start = (*start as usize * n / self.points).clamp(k, n - clusters + k) as u32;
        }
        for k in 1..clusters {
            starts[k] = starts[k].max(starts[k - 1] + 1);
        }
        for _ in 0..3 {
            let mut moved = false;
            for k in 1..clusters {
                let begin = starts[k - 1] as usize;
                let end = starts.get(k + 1).map_or(n, |e| *e as usize);
                let border = cost.border(begin, starts[k] as usize, end);
                let border = border.clamp(begin + 1, end - 1) as u32;
                moved |= starts[k] != border;
                starts[k] = border;
            }
            if !moved {
                break;
            }
        }
        let (split, merger) = self.saved_and_lost(cost);
        // Both bounds are too far off, the upper one by more.
        let guess = match last {
            Some(last) if split < last && last < merger => last,
            _ => (split * merger).sqrt(),
        };
        guess.is_normal().then_some(guess)
    }

    /// What the best split of a cluster saves, and what the best merger of neighbours costs.
    fn saved_and_lost<C: Cost>(&self, cost: &C) -> (f64, f64) {
        let (n, starts) = (cost.points(), &self.starts);
        let (mut split, mut merger) = (0.0, f64::INFINITY);
        for (k, start) in starts.iter().enumerate() {
            let begin = *start as usize;
            let end = starts.get(k + 1).map_or(n, |e| *e as usize);
            let whole = cost.between(begin, end);
            for at in begin + 1..end {
                let saved = whole - cost.between(begin, at) - cost.between(at, end);
                split = if saved > split { saved } else { split };
            }
            if k > 0 {
                let before = starts[k - 1] as usize;
                let lost = cost.between(before, end) - cost.between(before, begin) - whole;
                merger = if lost < merger { lost } else { merger };
            }
        }
        (split, merger)
    }

    /// The next penalty to try after one that gave `found` clusters. With one cluster too few or
    /// too many, just beyond what would give one more by a split, or one less by a merger; else by
    /// the law that `c(k)` falls as `1 / k^2`.
    fn next_penalty<C: Cost>(&self, cost: &C, found: &Found, clusters: usize, stride: u32) -> f64 {
        let by_law = found.penalty * power(found.clusters as f64 / clusters as f64, stride);
        if stride > 6 || found.clusters.abs_diff(clusters) != 1 {
            return by_law;
        }
        let (split, merger) = self.saved_and_lost(cost);
        if found.clusters < clusters {
            if split > 0.0 { 0.97 * split } else { by_law }
        } else if merger.is_finite() {
            1.03 * merger
        } else {
            by_law
        }
    }

    /// Splices a partition with too few clusters and one with too many, both optimal for the same
    /// penalty, into one with exactly `clusters`, optimal too.
    ///
    /// Where cluster `u` of the many lies inside cluster `t` of the few, the first `t` clusters of
    /// the few, one from the start of that `t` to the end of that `u`, and the rest of the many
    /// make a partition; swapping both tails does not change the total cost for the better or the
    /// worse. As `u - t` goes from 0 to the difference in numbers, some pair exists for each value.
    fn splice(&mut self, clusters: usize) {
        let ahead = self.many.len() - clusters;
        let contained = |t: &usize| {
            let (few, many) = (&self.few, &self.many);
            let u = t + ahead;
            let ends_inside = t + 1 == few.len() || (u + 1 < many.len() && many[u + 1] <= few[t + 1]);
            u < many.len() && few[*t] <= many[u] && ends_inside
        };
        let t = (0..self.few.len())
            .find(contained)
            .expect("some cluster contains the one `ahead` places further");
        self.starts.clear();
        self.starts.extend_from_slice(&self.few[..=t]);
        self.starts.extend_from_slice(&self.many[t + ahead + 1..]);
    }
}

/// `x^n`, multiplied one by one: what `powi` gives may differ from one platform to the next.
fn power(x: f64, n: u32) -> f64 {
    (0..n).fold(1.0, |product, _| product * x)
}

/// How many rows a pass treats together: short clusters are scanned row by row, long ones by
/// halving. The longer clusters are, the more columns remain for a block, and the more rows should
/// share them: with these sizes a pass over 4,096 to 65,536 values tries 10 to 15 columns for each
/// row, where blocks of 32 rows tried 11 to 74.
fn block_of(points: usize, clusters: usize) -> usize {
    match points / clusters {
        0..20 => 1,
        20..64 => 4,
        64..256 => 8,
        256..1024 => 64,
        1024..4096 => 256,
        _ => 512,
    }
}
