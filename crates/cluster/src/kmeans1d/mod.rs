//! Exactly optimal k-means in one dimension.
//!
//! The clusters of an optimum are intervals of the sorted values, so an optimum is a cheapest path
//! from 0 to `n` with `K` edges, where the edge `j -> i` costs the squared error of the values
//! `j..i`. These costs satisfy the quadrangle inequality, and two things follow (Aggarwal, Schieber
//! and Tokuyama 1994; Grønlund et al. 2017, arXiv 1701.07204):
//!
//! - The least cost with `K` clusters is convex in `K`. So if every edge costs a penalty more, and
//!   the cheapest path of any number of edges happens to have `K`, it is a cheapest path of `K`
//!   edges. One pass over the values ([`penalised`]) finds it for one penalty, whatever `K`; a
//!   search over the penalty finds the right one, and one guessed from the last frame's partition
//!   is mostly right.
//! - Where no penalty gives `K` (several numbers of clusters cost the same for the decisive
//!   penalty, as on evenly spaced values), a path with fewer edges and one with more can be spliced
//!   into one with exactly `K` ([`search`]).
//!
//! A few dozen values are solved by the plain recurrence instead ([`band`]), which is less work then.
//!
//! # Exactness
//!
//! Values are moved to their median, which is exact in the sense that matters (equal values stay
//! equal, order is kept), and put on a grid of integers: a step is a power of two, such that the
//! total of weight times distance stays below `2^62`. Counts and squared counts of 65,536 taxels
//! are on it exactly; other values move by less than `2^-44` of the range for 65,536 points,
//! `2^-53` for 240. On the grid prefix sums are integers, without error.
//!
//! The search then runs on doubles made from those sums ([`cost::Fast`]), whose error, relative to
//! the sum of squares around the median, is a few units in the last place. If that could hide more
//! than `2^-32` of the cost of the partition found, because the clusters are tight on far offsets,
//! the search is repeated with costs `(w * S2 - S1 * S1) / w` whose numerator is exact in 128-bit
//! integers ([`cost::Exact`]): each is then off by no more than two units in its own last place,
//! and so is their sum, since nothing is subtracted any more.

mod band;
mod cost;
mod grid;
mod penalised;
mod search;

use band::Band;
use cost::{Exact, Fast};
use grid::Grid;
use penalised::Pass;
use search::Search;

/// A solver for one-dimensional k-means with all the memory it needs.
///
/// It remembers the partition and the penalty that solved the last problem, so that a similar one
/// next mostly costs a single pass. That changes the time a solution takes; it can change the
/// solution only among partitions of equal cost.
///
/// ```
/// let mut solver = taxel_cluster::Kmeans1d::new(6, 3);
/// let levels = solver.solve(&[10.0, 12.0, 20.0, 22.0, 98.0, 100.0], 3)?;
/// assert_eq!(levels.starts, [0, 2, 4]);
/// assert_eq!(levels.centroids, [11.0, 21.0, 99.0]);
/// assert_eq!(levels.cost, 6.0);
/// # Ok::<(), taxel_cluster::Kmeans1dError>(())
/// ```
#[derive(Debug)]
pub struct Kmeans1d {
    band: Band,
    grid: Grid,
    pass: Pass,
    search: Search,
    centroids: Vec<f64>,
    /// The penalty that solved the last problem, in the unit of the values squared.
    penalty: Option<f64>,
}

/// An optimal partition of sorted values into clusters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Partition<'a> {
    /// First value of each cluster, ascending; the first is 0. Empty if there were no values.
    pub starts: &'a [u32],
    /// Mean of each cluster, ascending. As many as `starts`: the number asked for, or the number of
    /// different values if that is less.
    pub centroids: &'a [f64],
    /// The weighted sum of squared distances of the values from their means; infinite if it is too
    /// large for a double.
    pub cost: f64,
}

/// Why values cannot be clustered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kmeans1dError {
    /// A value that is not a number, or whose magnitude exceeds 1e300.
    NotFinite {
        /// Where it is.
        index: usize,
    },
    /// A value smaller than the one before it.
    NotAscending {
        /// Where it is.
        index: usize,
    },
    /// A weight of zero.
    ZeroWeight {
        /// Where it is.
        index: usize,
    },
    /// Not one weight per value.
    WeightsMissing {
        /// Number of values.
        values: usize,
        /// Number of weights.
        weights: usize,
    },
    /// More values, or more clusters, than the solver was made for, or no cluster at all.
    OutOfRange {
        /// Number of values or clusters.
        asked: usize,
        /// The most this solver was made for.
        most: usize,
    },
}

impl std::fmt::Display for Kmeans1dError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NotFinite { index } => write!(f, "value {index} is not a number within 1e300 of zero"),
            Self::NotAscending { index } => {
                write!(f, "value {index} is less than the one before it; sort the values")
            }
            Self::ZeroWeight { index } => write!(f, "value {index} has weight 0; leave it out"),
            Self::WeightsMissing { values, weights } => write!(f, "{values} values have {weights} weights"),
            Self::OutOfRange { asked, most } => {
                write!(f, "{asked} is outside 1..={most}, what the solver was made for")
            }
        }
    }
}

impl std::error::Error for Kmeans1dError {}

impl Kmeans1d {
    /// Memory for up to `points` values and `clusters` clusters.
    pub fn new(points: usize, clusters: usize) -> Self {
        Self {
            band: Band::new(points),
            grid: Grid::new(points),
            pass: Pass::new(points),
            search: Search::new(points),
            centroids: Vec::with_capacity(clusters),
            penalty: None,
        }
    }

    /// Forgets the last problem, so that the next solution does not depend on it at all.
    pub fn forget(&mut self) {
        self.search.forget();
        self.penalty = None;
    }

    /// The optimal partition of ascending values into `clusters` clusters.
    ///
    /// # Errors
    ///
    /// Values that are not finite (or beyond 1e300), or not ascending; more of them, or more
    /// clusters, than the solver was made for.
    pub fn solve(&mut self, values: &[f64], clusters: usize) -> Result<Partition<'_>, Kmeans1dError> {
        self.run(values, None, clusters)
    }

    /// The same for values that count `weights[n]` times each.
    ///
    /// # Errors
    ///
    /// As [`Kmeans1d::solve`]; weights of zero, or not one per value.
    pub fn solve_weighted(
        &mut self,
        values: &[f64],
        weights: &[u32],
        clusters: usize,
    ) -> Result<Partition<'_>, Kmeans1dError> {
        if weights.len() != values.len() {
            return Err(Kmeans1dError::WeightsMissing {
                values: values.len(),
                weights: weights.len(),
            });
        }
        if weights.contains(&0)
            && let Some(index) = weights.iter().position(|w| *w == 0)
        {
            return Err(Kmeans1dError::ZeroWeight { index });
        }
        self.run(values, Some(weights), clusters)
    }

    fn run(
        &mut self,
        values: &[f64],
        weights: Option<&[u32]>,
        clusters: usize,
    ) -> Result<Partition<'_>, Kmeans1dError> {
        check(values)?;
        self.check_size(values.len(), clusters)?;
        if distinct_ascending(values, clusters + 1) <= clusters {
            let starts = (0..values.len()).filter(|n| *n == 0 || values[*n] != values[n - 1]);
            self.search.take(starts.map(|n| n as u32), values.len());
        } else if let Some(starts) = self.band.solve(values, weights, clusters)
            && !splits_equals(values, starts)
        {
            self.search.take(starts.iter().copied(), values.len());
            self.penalty = None;
        } else {
            self.grid.place(values, weights);
            self.partition(values, clusters);
        }
        let cost = self.describe(values, weights);
        Ok(Partition {
            starts: &self.search.starts,
            centroids: &self.centroids,
            cost,
        })
    }

    /// Finds the starts of the clusters, with the fast costs if they are good enough.
    fn partition(&mut self, values: &[f64], clusters: usize) {
        let unit = self.grid.step() * self.grid.step();
        let last = self.penalty.map(|p| p / unit).filter(|p| p.is_normal());
        let fast = Fast::new(&self.grid);
        let mut penalty = self.search.run(&fast, &mut self.pass, clusters, last);
        let may_hide = |cost: f64| 2.0 * self.grid.uncertainty(clusters) > cost * 2f64.powi(-32);
        // Mostly the least that the cost can be is enough to tell.
        let starts = &self.search.starts;
        let is_sure =
            penalty.is_some() && (!may_hide(fast.least_cost(starts)) || !may_hide(self.grid.cost(starts)));
        if !is_sure || splits_equals(values, &self.search.starts) {
            self.grid.place_squares();
            penalty = self
                .search
                .run(&Exact::new(&self.grid), &mut self.pass, clusters, penalty);
        }
        self.penalty = penalty.map(|p| p * unit);
    }

    fn check_size(&self, values: usize, clusters: usize) -> Result<(), Kmeans1dError> {
        for (asked, most, least) in [
            (values, self.grid.capacity(), 0),
            (clusters, self.centroids.capacity(), 1),
        ] {
            if asked > most || asked < least {
                return Err(Kmeans1dError::OutOfRange { asked, most });
            }
        }
        Ok(())
    }

    /// Computes the mean of each cluster, and the cost. Distances are taken from the first value of
    /// each cluster, so that a mean of equal values is that value and offsets do not cancel.
    fn describe(&mut self, values: &[f64], weights: Option<&[u32]>) -> f64 {
        self.centroids.clear();
        let mut cost = 0.0;
        let starts = &self.search.starts;
        for (k, start) in starts.iter().enumerate() {
            let start = *start as usize;
            let end = starts.get(k + 1).map_or(values.len(), |e| *e as usize);
            let first = values[start];
            let (mut sum, mut total) = (0.0, 0.0);
            for n in start..end {
                let weight = weights.map_or(1.0, |w| f64::from(w[n]));
                sum += weight * (values[n] - first);
                total += weight;
            }
            let mean = first + sum / total;
            self.centroids.push(mean);
            for n in start..end {
                let distance = values[n] - mean;
                cost += weights.map_or(1.0, |w| f64::from(w[n])) * (distance * distance);
            }
        }
        cost
    }
}

/// Whether a cluster starts amid equal values, which no optimum has: taking all of them to one side
/// costs less.
fn splits_equals(values: &[f64], starts: &[u32]) -> bool {
    (starts.iter().skip(1)).any(|start| values[*start as usize] == values[*start as usize - 1])
}

/// Magnitudes up to which sums of distances stay finite.
const LARGEST: f64 = 1e300;

/// Refuses values that are not finite and ascending.
fn check(values: &[f64]) -> Result<(), Kmeans1dError> {
    // Without a branch for each value: they are hardly ever wrong.
    let finite = |value: &f64| value.abs() <= LARGEST;
    let ascend = |pair: &[f64]| pair[0] <= pair[1];
    let fine = values.iter().fold(true, |fine, value| fine & finite(value))
        & values.windows(2).fold(true, |fine, pair| fine & ascend(pair));
    if fine {
        return Ok(());
    }
    for (index, value) in values.iter().enumerate() {
        if !finite(value) {
            return Err(Kmeans1dError::NotFinite { index });
        }
        if index > 0 && !ascend(&values[index - 1..=index]) {
            return Err(Kmeans1dError::NotAscending { index });
        }
    }
    Ok(())
}

/// Counts the different values, but no further than `most`.
fn distinct_ascending(values: &[f64], most: usize) -> usize {
    let mut count = usize::from(!values.is_empty());
    for pair in values.windows(2) {
        if count == most {
            break;
        }
        count += usize::from(pair[0] != pair[1]);
    }
    count
}

#[cfg(test)]
mod tests;
