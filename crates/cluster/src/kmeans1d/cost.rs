//! What a cluster costs: the squared error of the points `j..i` around their mean.

use super::grid::Grid;

/// Costs of intervals, as the search needs them.
///
/// Totals are kept as `g[i] = f[i] - offset(i)`, where `f[i]` is the total cost of the first `i` points.
pub(super) trait Cost {
    /// Number of points.
    fn points(&self) -> usize;

    /// What `g` leaves out of the total cost of the first `i` points.
    fn offset(&self, i: usize) -> f64;

    /// How far a total with its offset may be off.
    fn slack(&self) -> f64;

    /// How far the total of `clusters` clusters, and penalties of `value` in all, may be off.
    fn margin(&self, clusters: usize, value: f64) -> f64;

    /// Cost of the points `j..i`, less `offset(i) - offset(j)`.
    fn between(&self, j: usize, i: usize) -> f64;

    /// Where the points `begin..end`, two clusters with a border at `at`, part: the first point
    /// nearer to the mean of the second.
    fn border(&self, begin: usize, at: usize, end: usize) -> usize;

    /// What the total `g[i]` would be if the last cluster began at `j`.
    #[inline]
    fn at(&self, g: &[f64], j: usize, i: usize) -> f64 {
        g[j] + self.between(j, i)
    }

    /// Cost of a partition, less the offset of all points.
    fn of_partition(&self, starts: &[u32]) -> f64 {
        let ends = starts.iter().skip(1).copied().chain([self.points() as u32]);
        starts
            .iter()
            .zip(ends)
            .map(|(j, i)| self.between(*j as usize, i as usize))
            .sum()
    }

    /// The least of [`Cost::at`] over `first..=last`, and the first `j` that has it.
    fn least(&self, g: &[f64], first: usize, last: usize, i: usize) -> (f64, usize) {
        let mut best = (self.at(g, first, i), first);
        for j in first + 1..=last {
            let value = self.at(g, j, i);
            if value < best.0 {
                best = (value, j);
            }
        }
        best
    }
}

/// Costs in doubles: `-S1 * S1 / w`, with the sum of squares left to the offset.
pub(super) struct Fast<'a> {
    grid: &'a Grid,
    slack: f64,
}

impl<'a> Fast<'a> {
    pub(super) fn new(grid: &'a Grid) -> Self {
        // `square` adds up with a rounding each; `uncertainty` bounds the rest.
        let roundings = grid.n as f64 * 2f64.powi(-52) * grid.square[grid.n];
        Self {
            grid,
            slack: roundings + grid.uncertainty(grid.n.min(64)),
        }
    }
}

impl Fast<'_> {
    /// What a partition costs at least, whatever the rounding; it may be negative.
    pub(super) fn least_cost(&self, starts: &[u32]) -> f64 {
        self.of_partition(starts) + self.offset(self.grid.n) - self.slack
    }
}

/// Values side by side in one step of a scan.
const LANES: usize = 4;

impl Cost for Fast<'_> {
    fn border(&self, begin: usize, at: usize, end: usize) -> usize {
        self.grid.border(begin, at, end)
    }

    fn points(&self) -> usize {
        self.grid.n
    }

    fn offset(&self, i: usize) -> f64 {
        self.grid.square[i]
    }

    fn slack(&self) -> f64 {
        self.slack
    }

    fn margin(&self, clusters: usize, _: f64) -> f64 {
        self.grid.uncertainty(clusters)
    }

    #[inline]
    fn between(&self, j: usize, i: usize) -> f64 {
        let sum = self.grid.sum[i] - self.grid.sum[j];
        if self.grid.is_unweighted() {
            -(sum * sum) * self.grid.reciprocals[self.grid.reciprocals.len() - (i - j)]
        } else {
            -(sum * sum) / (self.grid.weight[i] - self.grid.weight[j])
        }
    }

    #[inline]
    fn least(&self, g: &[f64], first: usize, last: usize, i: usize) -> (f64, usize) {
        let grid = self.grid;
        let (g, sums, sum) = (&g[first..=last], &grid.sum[first..=last], grid.sum[i]);
        let (value, at) = if grid.is_unweighted() {
            let skip = grid.reciprocals.len() - i;
            let reciprocals = &grid.reciprocals[skip + first..=skip + last];
            scan(g, sums, reciprocals, |g, s, r| g - ((sum - s) * (sum - s)) * r)
        } else {
            let weight = grid.weight[i];
            let weights = &grid.weight[first..=last];
            scan(g, sums, weights, |g, s, w| {
                g - ((sum - s) * (sum - s)) / (weight - w)
            })
        };
        (value, first + at)
    }
}

/// The least value of `f` over three columns, and where it is first.
///
/// Lanes keep their own minimum and where it was; a minimum does not depend on the order in which
/// it is taken, so the result is the same at every vector width.
#[inline]
fn scan(a: &[f64], b: &[f64], c: &[f64], f: impl Fn(f64, f64, f64) -> f64) -> (f64, usize) {
    let (a4, a_rest) = a.as_chunks::<LANES>();
    let (b4, b_rest) = b.as_chunks::<LANES>();
    let (c4, c_rest) = c.as_chunks::<LANES>();
    let mut best = (f64::INFINITY, 0);
    if !a4.is_empty() {
        let mut least = [f64::INFINITY; LANES];
        let mut at = [0.0; LANES];
        let mut place = 0.0;
        for ((a, b), c) in a4.iter().zip(b4).zip(c4) {
            for lane in 0..LANES {
                let value = f(a[lane], b[lane], c[lane]);
                at[lane] = if value < least[lane] { place } else { at[lane] };
                least[lane] = if value < least[lane] { value } else { least[lane] };
            }
            place += LANES as f64;
        }
        for lane in 0..LANES {
            let here = at[lane] as usize + lane;
            if least[lane] < best.0 || (least[lane] == best.0 && here < best.1) {
                best = (least[lane], here);
            }
        }
    }
    let done = a4.len() * LANES;
    for (n, ((a, b), c)) in a_rest.iter().zip(b_rest).zip(c_rest).enumerate() {
        let value = f(*a, *b, *c);
        if value < best.0 {
            best = (value, done + n);
        }
    }
    best
}

/// Costs whose numerator is exact: `(w * S2 - S1 * S1) / w`.
pub(super) struct Exact<'a> {
    grid: &'a Grid,
}

impl<'a> Exact<'a> {
    /// The grid must have its squares: [`Grid::place_squares`].
    pub(super) fn new(grid: &'a Grid) -> Self {
        Self { grid }
    }
}

impl Cost for Exact<'_> {
    fn border(&self, begin: usize, at: usize, end: usize) -> usize {
        self.grid.border(begin, at, end)
    }

    fn points(&self) -> usize {
        self.grid.n
    }

    fn offset(&self, _: usize) -> f64 {
        0.0
    }

    fn slack(&self) -> f64 {
        0.0
    }

    fn margin(&self, clusters: usize, value: f64) -> f64 {
        value * (clusters as f64 + 2.0) * 2f64.powi(-52)
    }

    fn between(&self, j: usize, i: usize) -> f64 {
        let grid = self.grid;
        let weight = grid.weight[i] - grid.weight[j];
        let sum = i128::from(grid.sum_exact[i] - grid.sum_exact[j]);
        let square = grid.square_exact[i] - grid.square_exact[j];
        (weight as i128 * square - sum * sum) as f64 / weight
    }
}
