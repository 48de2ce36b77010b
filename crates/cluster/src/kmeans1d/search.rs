//! The search for the penalty that gives the number of clusters asked for.

use super::cost::Cost;
use super::penalised::Pass;

/// The search and its memory.
#[derive(Debug)]
pub(super) struct Search {
    /// Starts of the clusters found.
    pub(super) starts: Vec<u32>,
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
            few: Vec::with_capacity(points),
            many: Vec::with_capacity(points),
        }
    }

    /// Leaves an optimal partition into `clusters` clusters in `starts`, and returns a penalty for which it is optimal; `None` if costs are too
    /// coarse to tell so many clusters apart.
    ///
    /// There must be more different points than clusters. `hint` is a penalty to begin with.
    ///
    /// The least cost `c(k)` is convex, so a penalty gives the `k` at which a line of that slope touches it. Until there is a partition
    /// with too few clusters and one with too many, the next penalty assumes that `c(k)` falls as `1 / k^2` (the high-rate law of
    /// quantisation), in strides that double. Then the chord between the two ends it: either the line of the chord's slope touches
    /// `c(k)` at a new place in between, or there is none, both partitions are optimal for that penalty, and they can be spliced.
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
        let mut stride = 3;
        let mut penalty = hint.unwrap_or(2.0 * all / (wanted * wanted * wanted));
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
            penalty = (penalty * (found.clusters as f64 / wanted).powi(stride)).min(2.0 * all);
        }
    }

    /// Splices a partition with too few clusters and one with too many, both optimal for the same penalty, into one with exactly
    /// `clusters`, optimal too.
    ///
    /// Where cluster `u` of the many lies inside cluster `t` of the few, the first `t` clusters of the few, one from the start of that `t` to the
    /// end of that `u`, and the rest of the many make a partition; swapping both tails does not change the total cost for the better or
    /// the worse. As `u - t` goes from 0 to the difference in numbers, some pair exists for each value.
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

/// How many rows a pass treats together: short clusters are scanned row by row, long ones by halving.
fn block_of(points: usize, clusters: usize) -> usize {
    match points / clusters {
        0..12 => 1,
        12..512 => 8,
        _ => 32,
    }
}
