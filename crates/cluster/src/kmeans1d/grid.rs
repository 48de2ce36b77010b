//! Values as integers around their median, and their exact prefix sums.

/// The values of a problem on a grid of integers, with prefix sums.
#[derive(Debug)]
pub(super) struct Grid {
    /// Number of points.
    pub(super) n: usize,
    /// Each point as an integer multiple of the step, in a double.
    at: Vec<f64>,
    /// Weight of each point; empty where every weight is 1.
    weights: Vec<u32>,
    /// Total weight of the first `i` points.
    pub(super) weight: Vec<f64>,
    /// Exact sum of weight times place of the first `i` points.
    pub(super) sum_exact: Vec<i64>,
    /// The same, rounded to a double.
    pub(super) sum: Vec<f64>,
    /// Sum of weight times squared place of the first `i` points, with rounding errors.
    pub(super) square: Vec<f64>,
    /// The same, exact; filled in by [`Grid::place_squares`] only.
    pub(super) square_exact: Vec<i128>,
    /// `1 / m` at index `capacity - m`, so that it ascends with the first point of an interval.
    pub(super) reciprocals: Vec<f64>,
    /// Sum of weight times distance from the median.
    distances: f64,
    /// The greatest distance from the median.
    farthest: f64,
    /// Scaling of values before the median is subtracted, and after.
    scale: (f64, f64),
}

impl Grid {
    pub(super) fn new(points: usize) -> Self {
        let reciprocals = (0..points).map(|j| 1.0 / (points - j) as f64).collect();
        Self {
            n: 0,
            at: Vec::with_capacity(points),
            weights: Vec::with_capacity(points),
            weight: Vec::with_capacity(points + 1),
            sum_exact: Vec::with_capacity(points + 1),
            sum: Vec::with_capacity(points + 1),
            square: Vec::with_capacity(points + 1),
            square_exact: Vec::with_capacity(points + 1),
            reciprocals,
            distances: 0.0,
            farthest: 0.0,
            scale: (1.0, 1.0),
        }
    }

    /// Points there is memory for.
    pub(super) fn capacity(&self) -> usize {
        self.reciprocals.len()
    }

    /// Whether every weight is 1.
    pub(super) fn is_unweighted(&self) -> bool {
        self.weights.is_empty()
    }

    /// Length of a step in the unit of the values.
    pub(super) fn step(&self) -> f64 {
        (1.0 / self.scale.0) / self.scale.1
    }

    /// Puts ascending finite values, not all equal, on the grid.
    ///
    /// A distance from the median is an integer of at most `2^(62 - b)` where the total weight is
    /// below `2^b`: so the sum of weights times distances stays below `2^62`, and the product of a
    /// weight and a sum of squares below `2^124`.
    pub(super) fn place(&mut self, values: &[f64], weights: Option<&[u32]>) {
        let (least, greatest) = (values[0], values[values.len() - 1]);
        let total: u64 = weights.map_or(values.len() as u64, |w| w.iter().map(|w| u64::from(*w)).sum());
        let bits = 62 - (u64::BITS - total.leading_zeros()) as i32;
        // Doubles near either end of their range are first moved to its middle.
        let before = match least.abs().max(greatest.abs()) {
            large if large > 2f64.powi(900) => 2f64.powi(-200),
            small if small < 2f64.powi(-800) => 2f64.powi(250),
            _ => 1.0,
        };
        let median = values[values.len() / 2] * before;
        let farthest = (greatest * before - median).max(median - least * before);
        let after = power_of_two((bits - 1 - exponent(farthest)).min(1023));
        self.scale = (before, after);
        self.n = values.len();
        self.weights.clear();
        self.weights.extend_from_slice(weights.unwrap_or(&[]));
        self.at.clear();
        self.at.extend(
            values
                .iter()
                .map(|v| ((v * before - median) * after) as i64 as f64),
        );
        self.add_up();
    }

    fn add_up(&mut self) {
        let (mut sum, mut square, mut weight, mut distances) = (0i64, 0.0, 0.0, 0.0);
        self.weight.clear();
        self.sum_exact.clear();
        self.sum.clear();
        self.square.clear();
        self.weight.push(0.0);
        self.sum_exact.push(0);
        self.sum.push(0.0);
        self.square.push(0.0);
        if self.weights.is_empty() {
            for (n, at) in self.at.iter().enumerate() {
                sum += *at as i64;
                square += at * at;
                distances += at.abs();
                self.weight.push((n + 1) as f64);
                self.sum_exact.push(sum);
                self.sum.push(sum as f64);
                self.square.push(square);
            }
        } else {
            for (at, w) in self.at.iter().zip(&self.weights) {
                sum += *at as i64 * i64::from(*w);
                weight += f64::from(*w);
                square += f64::from(*w) * (at * at);
                distances += f64::from(*w) * at.abs();
                self.weight.push(weight);
                self.sum_exact.push(sum);
                self.sum.push(sum as f64);
                self.square.push(square);
            }
        }
        self.distances = distances;
        self.farthest = self.at[self.n - 1].max(-self.at[0]);
    }

    /// Adds up squares exactly.
    pub(super) fn place_squares(&mut self) {
        let mut square = 0i128;
        self.square_exact.clear();
        self.square_exact.push(0);
        for (n, at) in self.at.iter().enumerate() {
            let weight = self.weights.get(n).map_or(1, |w| i128::from(*w));
            square += weight * (*at as i128 * *at as i128);
            self.square_exact.push(square);
        }
    }

    /// Weighted squared error of a partition, in steps squared, to nearly full precision.
    pub(super) fn cost(&self, starts: &[u32]) -> f64 {
        let mut cost = 0.0;
        for (k, start) in starts.iter().enumerate() {
            let start = *start as usize;
            let end = starts.get(k + 1).map_or(self.n, |e| *e as usize);
            let mean = (self.sum_exact[end] - self.sum_exact[start]) as f64
                / (self.weight[end] - self.weight[start]);
            for n in start..end {
                let distance = self.at[n] - mean;
                cost += self.weights.get(n).map_or(1.0, |w| f64::from(*w)) * (distance * distance);
            }
        }
        cost
    }

    /// Where the points `begin..end`, two clusters with a border at `at`, part: the first point
    /// nearer to the mean of the second.
    pub(super) fn border(&self, begin: usize, at: usize, end: usize) -> usize {
        let mean = |j: usize, i: usize| (self.sum[i] - self.sum[j]) / (self.weight[i] - self.weight[j]);
        let middle = 0.5 * (mean(begin, at) + mean(at, end));
        begin + self.at[begin..end].partition_point(|place| *place < middle)
    }

    /// How far the cost of the partition that [`super::cost::Fast`] finds may exceed the optimum,
    /// in steps squared.
    ///
    /// A fast cost is `S1 * S1 / w` taken from the (common) sum of squares. Its `S1` is off by at
    /// most two roundings of a prefix sum, `2^-53 * distances` each, which `2 S1 / w` turns into an
    /// error of at most `2^-51 * farthest * distances`; none if the prefix sums fit a double
    /// exactly. Forming the square, the quotient and the total of `K` of them adds `K + 4`
    /// roundings relative to the sum of squares. Twice that, since both the partition found and the
    /// optimum are misjudged.
    pub(super) fn uncertainty(&self, clusters: usize) -> f64 {
        let clusters = clusters as f64;
        let sums = if self.distances < 2f64.powi(53) {
            0.0
        } else {
            2f64.powi(-51) * clusters * self.farthest * self.distances
        };
        2.0 * (sums + (clusters + 4.0) * 2f64.powi(-53) * self.square[self.n])
    }
}

/// The exponent of a positive double: `2^exponent <= x < 2^(exponent + 1)`; for subnormals at least that.
fn exponent(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

/// `2^exponent`, for the exponent of a normal double.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}
