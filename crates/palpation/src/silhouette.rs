//! How clear categories are: the silhouette, in its three readings.

use crate::error::PalpationError;
use crate::labels::canonical;
use crate::matrix::{Matrix, squared_distance};

/// The silhouette of categories, each reading from -1 to 1. They differ by much: always say which.
#[derive(Debug, Clone, PartialEq)]
pub struct Silhouette {
    /// The publication's eqs (9) and (10) as printed: of each category, `a` the mean distance between two of its
    /// touches (0 where there is one), `b` that to the touches of the nearest category; then the mean over categories.
    pub cluster: f64,
    /// Rousseeuw's silhouette of each touch, averaged in each category, then over categories.
    pub macro_average: f64,
    /// Rousseeuw's silhouette of each touch, averaged over all touches; a touch alone in its category counts 0. What
    /// scikit-learn calls `silhouette_score`.
    pub standard: f64,
    /// Of each category, as printed.
    pub clusters: Vec<f64>,
    /// The publication's `a(i)` of each category: mean distance between two of its touches.
    pub within: Vec<f64>,
    /// Its `b(i)`: mean distance to the touches of the nearest category.
    pub between: Vec<f64>,
}

impl Silhouette {
    /// Of a map, `C x N`, and the category of each touch. Categories without touches do not count.
    ///
    /// # Errors
    /// Not one label per touch; fewer than two categories.
    pub fn of(map: &Matrix, labels: &[usize]) -> Result<Self, PalpationError> {
        let touches = map.ncols();
        if labels.len() != touches {
            return Err(PalpationError::Labels {
                labels: labels.len(),
                touches,
            });
        }
        let labels = canonical(labels);
        let clusters = labels.iter().max().map_or(0, |most| most + 1);
        if clusters < 2 {
            return Err(PalpationError::OneCluster { clusters });
        }
        let mut counts = vec![0.0; clusters];
        labels.iter().for_each(|label| counts[*label] += 1.0);
        // Sums of distances: of a touch to each category, and between categories.
        let mut pairs = Matrix::zeros(clusters, clusters);
        let mut sums = vec![0.0; clusters];
        let mut of_cluster = vec![0.0; clusters];
        for (touch, own) in map.column_iter().zip(&labels) {
            sums.fill(0.0);
            for (other, label) in map.column_iter().zip(&labels) {
                sums[*label] += squared_distance(touch, other).sqrt();
            }
            let others = (0..clusters).filter(|k| k != own);
            let b = others.map(|k| sums[k] / counts[k]).fold(f64::INFINITY, f64::min);
            if counts[*own] > 1.0 {
                of_cluster[*own] += ratio(sums[*own] / (counts[*own] - 1.0), b);
            }
            for k in 0..clusters {
                pairs[(*own, k)] += sums[k];
            }
        }
        let within: Vec<f64> = (0..clusters)
            .map(|k| {
                if counts[k] > 1.0 {
                    pairs[(k, k)] / (counts[k] * (counts[k] - 1.0))
                } else {
                    0.0
                }
            })
            .collect();
        let distance = |k: usize, j: usize| pairs[(k, j)] / (counts[k] * counts[j]);
        let between: Vec<f64> = (0..clusters)
            .map(|k| {
                (0..clusters)
                    .filter(|j| *j != k)
                    .map(|j| distance(k, j))
                    .fold(f64::INFINITY, f64::min)
            })
            .collect();
        let printed: Vec<f64> = within.iter().zip(&between).map(|(a, b)| ratio(*a, *b)).collect();
        let average = of_cluster
            .iter()
            .zip(&counts)
            .map(|(sum, count)| sum / count)
            .sum::<f64>();
        Ok(Self {
            cluster: printed.iter().sum::<f64>() / clusters as f64,
            macro_average: average / clusters as f64,
            standard: of_cluster.iter().sum::<f64>() / touches as f64,
            clusters: printed,
            within,
            between,
        })
    }
}

/// `(b - a) / max(a, b)`, 0 where both are 0.
fn ratio(a: f64, b: f64) -> f64 {
    match a.max(b) {
        most if most > 0.0 => (b - a) / most,
        _ => 0.0,
    }
}
