//! Categories on a map: the publication's rule, and the best there are.

use crate::branch_and_bound::least;
use crate::error::PalpationError;
use crate::labels::canonical;
use crate::matrix::{Matrix, squared_distance};
use crate::silhouette::Silhouette;
use std::cmp::Ordering;
use std::ops::RangeInclusive;
use taxel_cluster::{LocalSearch, Random};

/// Attempts of three runs each after which the publication's rule gives up.
pub const PAPER_ATTEMPTS: u32 = 100;
/// Random starts whose best is taken.
const STARTS: usize = 32;
/// Those taken first where there may be a proof.
const QUICK_STARTS: usize = 2;
/// Branches after which a proof is given up, at first and after all starts.
const QUICK_BRANCHES: u64 = 30_000;
const BRANCHES: u64 = 3_000_000;
/// Touches up to which a proof is tried.
const PROVED_UP_TO: usize = 48;

/// Which touches belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Categories {
    /// The category of each touch, numbered from 0 in the order of their first touches.
    pub labels: Vec<usize>,
    /// The mean of each category on the map, `C x K`.
    pub centroids: Matrix,
    /// Sum of squared distances from the means.
    pub cost: f64,
    /// Whether it is known that no other categories have a lower cost.
    pub proved: bool,
    /// Attempts of three runs that the publication's rule took; 0 where it was not asked.
    pub attempts: u32,
}

impl Categories {
    /// Categories of a map, `C x N`, that are labelled already.
    ///
    /// # Panics
    ///
    /// If there is not one label per touch.
    fn labelled(map: &Matrix, labels: &[usize]) -> Self {
        assert_eq!(labels.len(), map.ncols(), "one label per touch");
        let labels = canonical(labels);
        let count = labels.iter().max().map_or(0, |most| most + 1);
        let mut centroids = Matrix::zeros(map.nrows(), count);
        let mut counts = vec![0.0; count];
        for (column, label) in map.column_iter().zip(&labels) {
            counts[*label] += 1.0;
            let centroid = centroids.column_mut(*label);
            centroid.iter_mut().zip(column).for_each(|(sum, x)| *sum += x);
        }
        for (centroid, count) in centroids.column_iter_mut().zip(counts) {
            centroid.iter_mut().for_each(|x| *x /= count);
        }
        let own = map.column_iter().zip(&labels);
        let cost = own.map(|(touch, label)| squared_distance(touch, centroids.column(*label)));
        Self {
            cost: cost.sum(),
            labels,
            centroids,
            proved: false,
            attempts: 0,
        }
    }

    /// The number of categories.
    pub fn len(&self) -> usize {
        self.centroids.ncols()
    }

    /// Always false.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The category whose mean is nearest to a touch on the map, and how far it is.
    pub fn nearest(&self, touch: &[f64]) -> (usize, f64) {
        let distances = (self.centroids.column_iter()).map(|mean| squared_distance(touch, mean).sqrt());
        let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.unwrap_or((0, f64::INFINITY))
    }
}

/// Categories by the publication's rule: k-means from three random starts, each on different touches, discarded unless
/// all three agree up to the numbering and every category has touches; then again, [`PAPER_ATTEMPTS`] times at most.
///
/// # Errors
/// `clusters` that are not 2 to the number of different touches, and [`PalpationError::NoAgreement`].
pub fn paper(map: &Matrix, clusters: usize, seed: u64) -> Result<Categories, PalpationError> {
    check(map, clusters)?;
    let mut random = Random::new(seed);
    let mut search = LocalSearch::new(map.ncols(), map.nrows(), clusters);
    for attempt in 1..=PAPER_ATTEMPTS {
        let mut run = || {
            search.seed_anywhere(map.as_slice(), || random.unit());
            search.lloyd(map.as_slice()).then(|| canonical(search.labels()))
        };
        if let [Some(first), Some(second), Some(third)] = [run(), run(), run()]
            && first == second
            && second == third
        {
            return Ok(Categories {
                attempts: attempt,
                ..Categories::labelled(map, &first)
            });
        }
    }
    Err(PalpationError::NoAgreement {
        clusters,
        attempts: PAPER_ATTEMPTS,
    })
}

/// The best categories: proved to be the optimum where there are few touches, else the best of many starts of
/// [`LocalSearch`]. `proved` says which.
///
/// # Errors
/// `clusters` that are not 2 to the number of different touches.
pub fn optimal(map: &Matrix, clusters: usize, seed: u64) -> Result<Categories, PalpationError> {
    check(map, clusters)?;
    if map.ncols() > PROVED_UP_TO {
        return Ok(best_of(STARTS, map, clusters, seed));
    }
    // Where a proof is easy, a few starts have found the optimum, or the proof does.
    let quick = prove(best_of(QUICK_STARTS, map, clusters, seed), map, QUICK_BRANCHES);
    Ok(if quick.proved {
        quick
    } else {
        prove(best_of(STARTS, map, clusters, seed), map, BRANCHES)
    })
}

/// Categories, or better ones if there are and the search comes to its end.
fn prove(found: Categories, map: &Matrix, branches: u64) -> Categories {
    let (better, proved) = least(map, found.len(), &found.labels, found.cost, branches);
    Categories {
        proved,
        ..better.map_or(found, |labels| Categories::labelled(map, &labels))
    }
}

/// The best of many starts, without a proof.
pub(crate) fn best_of_many(map: &Matrix, clusters: usize, seed: u64) -> Categories {
    best_of(STARTS, map, clusters, seed)
}

fn best_of(starts: usize, map: &Matrix, clusters: usize, seed: u64) -> Categories {
    let mut random = Random::new(seed);
    let mut search = LocalSearch::new(map.ncols(), map.nrows(), clusters);
    let (mut labels, mut least) = (Vec::new(), f64::INFINITY);
    for _ in 0..starts {
        search.seed_far(map.as_slice(), || random.unit());
        search.lloyd(map.as_slice());
        let cost = search.improve(map.as_slice());
        if cost < least {
            least = cost;
            labels.clear();
            labels.extend_from_slice(search.labels());
        }
    }
    Categories::labelled(map, &labels)
}

/// The categories of the number in `range` whose standard silhouette is greatest; the least number among equals.
/// Numbers that the touches do not allow are left out.
///
/// # Errors
/// Where the touches allow none of them.
pub fn clusters_by_silhouette(
    map: &Matrix,
    range: RangeInclusive<usize>,
    seed: u64,
) -> Result<Categories, PalpationError> {
    let mut best: Option<(f64, Categories)> = None;
    check(map, *range.start())?;
    for clusters in range {
        let Ok(categories) = optimal(map, clusters, seed) else {
            break;
        };
        let silhouette = Silhouette::of(map, &categories.labels)?.standard;
        if best.as_ref().is_none_or(|(most, _)| silhouette > *most) {
            best = Some((silhouette, categories));
        }
    }
    Ok(best
        .map(|(_, categories)| categories)
        .expect("the first number is allowed"))
}

fn check(map: &Matrix, clusters: usize) -> Result<(), PalpationError> {
    if map.ncols() < 2 {
        return Err(PalpationError::TooFew { touches: map.ncols() });
    }
    if let Some((feature, touch)) = map.not_finite() {
        return Err(PalpationError::NotFinite {
            touch,
            feature,
            value: map[(feature, touch)],
        });
    }
    // Lexically; -0 is 0.
    let compare = |a: &&[f64], b: &&[f64]| {
        let places = a.iter().zip(*b).map(|(a, b)| a.partial_cmp(b));
        places
            .flatten()
            .find(|order| order.is_ne())
            .unwrap_or(Ordering::Equal)
    };
    let mut different: Vec<&[f64]> = map.column_iter().collect();
    different.sort_unstable_by(compare);
    different.dedup();
    match different.len() {
        most if (2..=most).contains(&clusters) => Ok(()),
        different => Err(PalpationError::Clusters { clusters, different }),
    }
}
