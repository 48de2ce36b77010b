//! Few values, solved directly: no penalty to search for, and nothing to prove.

/// Most values that are solved so.
const MOST: usize = 64;
/// Most work that is less than that of a search: spare values squared times the clusters and four,
/// what costs count for. With 8 clusters that is up to 44 values.
const WORK: usize = 16_000;

/// Values side by side in one step.
const LANES: usize = 8;
/// Length of a row, with room for a step that begins at its last value, and for one that ends at its first.
const ROW: usize = MOST + 2 * LANES;

/// The plain recurrence, cluster by cluster: the least cost of the first `i` values in `t` clusters
/// is the least over `e` of that of the first `i - 1 - e` in `t - 1`, and the cost of the last `1 +
/// e`.
///
/// Where `n` values become `K` clusters of at least one value each, `t` clusters end at `t` to `t +
/// n - K`, and none is longer than `n - K + 1`: a band of `K (n - K)^2 / 2` steps without a branch,
/// side by side. For few values that is less work than to find the penalty and to show that it is
/// right.
///
/// Costs are made by adding value by value to each cluster (Chan, Golub and LeVeque 1983), with
/// distances from the cluster's first value. Every term is positive, and no sum is subtracted from
/// another: a cost is off by a few units in the last place times the number of values and the root
/// of the total weight ([`HEAVIEST`]), a sum of costs as well.
///
/// Steps run over the ends of rows. What they find there is not used.
#[derive(Debug)]
pub(super) struct Band {
    /// `cost[e * ROW + j]`: what the values `j..=j + e` cost as one cluster.
    cost: Vec<f64>,
    /// `least[t * ROW + LANES + o]`: the least cost of the first `t + 1 + o` values in `t + 1`
    /// clusters; infinite before that.
    least: Vec<f64>,
    values: [f64; ROW],
    weights: [f64; ROW],
    starts: Vec<u32>,
}

/// Total weight up to which costs are good to a part in `2^36`.
const HEAVIEST: u64 = 1 << 16;
/// Ranges of values whose squares are neither too large nor too small.
const RANGE: std::ops::Range<f64> = 1e-120..1e120;

impl Band {
    pub(super) fn new(points: usize) -> Self {
        let rows = points.min(MOST);
        Self {
            cost: vec![0.0; rows * ROW],
            least: vec![f64::INFINITY; rows * ROW],
            values: [0.0; ROW],
            weights: [0.0; ROW],
            starts: Vec::with_capacity(rows),
        }
    }

    /// The starts of the clusters of an optimum, for more values than clusters; `None` where the
    /// search is quicker or sums would not be good enough.
    pub(super) fn solve(
        &mut self,
        values: &[f64],
        weights: Option<&[u32]>,
        clusters: usize,
    ) -> Option<&[u32]> {
        let (n, spare) = (values.len(), values.len() - clusters);
        let short = n <= MOST && spare * spare * (clusters + 4) <= WORK && clusters > 1;
        if !short || !RANGE.contains(&(values[n - 1] - values[0])) {
            return None;
        }
        self.values[..n].copy_from_slice(values);
        if let Some(weights) = weights {
            if weights.iter().map(|w| u64::from(*w)).sum::<u64>() > HEAVIEST {
                return None;
            }
            for (to, from) in self.weights.iter_mut().zip(weights) {
                *to = f64::from(*from);
            }
            self.weigh(n, spare);
        } else {
            self.count(n, spare);
        }
        self.layers(clusters, spare);
        self.walk_back(clusters, spare);
        Some(&self.starts)
    }

    /// Costs of values with weights.
    fn weigh(&mut self, n: usize, spare: usize) {
        for first in (0..n - 1).step_by(LANES) {
            let start = lanes(&self.values, first);
            let mut total = lanes(&self.weights, first);
            let (mut mean, mut cost) = ([0.0; LANES], [0.0; LANES]);
            let rows = self.cost[ROW + first..].chunks_mut(ROW);
            let values = self.values[first + 1..n + LANES - 1].windows(LANES);
            let weights = self.weights[first + 1..n + LANES - 1].windows(LANES);
            for ((row, value), weight) in rows.zip(values).zip(weights).take(spare) {
                let (value, weight) = (lanes(value, 0), lanes(weight, 0));
                for lane in 0..LANES {
                    let sum = total[lane] + weight[lane];
                    let share = weight[lane] / sum;
                    let distance = (value[lane] - start[lane]) - mean[lane];
                    cost[lane] += total[lane] * share * (distance * distance);
                    mean[lane] += share * distance;
                    total[lane] = sum;
                }
                row[..LANES].copy_from_slice(&cost);
            }
        }
    }

    /// Costs of values that count once.
    fn count(&mut self, n: usize, spare: usize) {
        for first in (0..n - 1).step_by(LANES) {
            let start = lanes(&self.values, first);
            let (mut mean, mut cost) = ([0.0; LANES], [0.0; LANES]);
            let rows = self.cost[ROW + first..].chunks_mut(ROW);
            let values = self.values[first + 1..n + LANES - 1].windows(LANES);
            for (e, (row, value)) in rows.zip(values).take(spare).enumerate() {
                let value = lanes(value, 0);
                let share = 1.0 / (e + 2) as f64;
                let factor = (e + 1) as f64 * share;
                for lane in 0..LANES {
                    let distance = (value[lane] - start[lane]) - mean[lane];
                    cost[lane] += factor * (distance * distance);
                    mean[lane] += share * distance;
                }
                row[..LANES].copy_from_slice(&cost);
            }
        }
    }

    /// Layers but the last, of which one value is asked.
    fn layers(&mut self, clusters: usize, spare: usize) {
        for (o, least) in self.least[LANES..=LANES + spare].iter_mut().enumerate() {
            *least = self.cost[o * ROW];
        }
        // Beyond the end, where nothing is sought, nothing holds up the others.
        self.least[LANES + spare + 1..ROW].fill(0.0);
        for t in 1..clusters - 1 {
            let (before, now) = self.least[(t - 1) * ROW..(t + 1) * ROW].split_at_mut(ROW);
            for o in (0..=spare).step_by(LANES) {
                let mut least = lanes(before, LANES + o);
                // One value more at the end is one fewer before it: costs are a row further on, and
                // one to the left.
                let costs = self.cost[ROW - 1 + t + o..].chunks(ROW - 1);
                let rests = before[..o + 2 * LANES - 1].windows(LANES).rev();
                for (e, (cost, rest)) in costs.zip(rests).take(spare).enumerate() {
                    let (cost, rest) = (lanes(cost, 0), lanes(rest, 0));
                    for lane in 0..LANES {
                        let value = rest[lane] + cost[lane];
                        least[lane] = if value < least[lane] { value } else { least[lane] };
                    }
                    // A longer last cluster costs still more.
                    if e % 4 == 3 && (0..LANES).all(|lane| cost[lane] >= least[lane]) {
                        break;
                    }
                }
                now[LANES + o..][..LANES].copy_from_slice(&least);
            }
        }
    }

    /// Finds the cheapest last cluster, and the one before that with which its cost came about, and so on.
    fn walk_back(&mut self, clusters: usize, spare: usize) {
        self.starts.clear();
        let mut o = spare;
        for t in (1..clusters).rev() {
            let least = &self.least[(t - 1) * ROW + LANES..t * ROW];
            let mut best = (f64::INFINITY, 0);
            let costs = self.cost[t + o..].iter().step_by(ROW - 1);
            for (e, (rest, cost)) in least[..=o].iter().rev().zip(costs).enumerate() {
                let value = rest + cost;
                best = if value <= best.0 { (value, e) } else { best };
            }
            o -= best.1;
            self.starts.push((t + o) as u32);
        }
        self.starts.push(0);
        self.starts.reverse();
    }
}

/// A step's values.
#[inline(always)]
fn lanes(values: &[f64], first: usize) -> [f64; LANES] {
    let values: &[f64; LANES] = values[first..first + LANES].try_into().expect("as many");
    *values
}
