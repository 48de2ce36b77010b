//! Categories that later touches are put into.

use crate::categories::Categories;
use crate::error::PalpationError;
use crate::matrix::{Matrix, squared_distance};
use crate::pca::Pca;
use serde::{Deserialize, Serialize};

/// A map with its categories, for touches to come. It can be kept in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Classifier {
    /// The mean touch, `D` numbers.
    mean: Vec<f64>,
    /// Loadings of each component, `C` times `D`.
    components: Vec<Vec<f64>>,
    /// Means of the categories on the map, `K` times `C`.
    centroids: Vec<Vec<f64>>,
    /// A touch further from every mean on the map, or from the map itself, is like none.
    far_on_map: f64,
    far_off_map: f64,
}

/// Where a touch belongs.
#[derive(Debug, Clone, PartialEq)]
pub struct Classified {
    /// The nearest category, from 0.
    pub category: usize,
    /// Where it is on the map, a number for each component.
    pub place: Vec<f64>,
    /// Distance to the mean of each category, on the map.
    pub distances: Vec<f64>,
    /// 0 where two categories are equally near, towards 1 where the second is far off: `1 - nearest / second`.
    pub confidence: f64,
    /// Whether the touch is like none of those that the map was made of.
    pub unknown: bool,
}

/// How many times further than any touch of the map a known one may be.
const MARGIN: f64 = 3.0;

impl Classifier {
    /// Of touches, `D x N`, their map and its categories.
    ///
    /// Known is what is no further from the map than three times the furthest of these touches, and no further from the
    /// nearest mean than three times the furthest of its own touches, or than half way to the nearest other mean.
    ///
    /// # Errors
    /// Touches that the map is not of.
    pub fn new(pca: &Pca, touches: &Matrix, categories: &Categories) -> Result<Self, PalpationError> {
        let map = pca.project(touches)?;
        let rows = |matrix: &Matrix| matrix.column_iter().map(<[f64]>::to_vec).collect();
        let mut new = Self {
            mean: pca.mean().to_vec(),
            components: rows(pca.components()),
            centroids: rows(&categories.centroids),
            far_on_map: 0.0,
            far_off_map: 0.0,
        };
        for (touch, label) in map.column_iter().zip(&categories.labels) {
            let own = distance(touch, categories.centroids.column(*label));
            new.far_on_map = new.far_on_map.max(MARGIN * own);
        }
        let means = &new.centroids;
        let others = means
            .iter()
            .enumerate()
            .flat_map(|(n, a)| means[n + 1..].iter().map(|b| distance(a, b)));
        new.far_on_map = new.far_on_map.max(others.fold(f64::INFINITY, f64::min) / 2.0);
        for touch in touches.column_iter() {
            new.far_off_map = new.far_off_map.max(MARGIN * new.place(touch).1);
        }
        Ok(new)
    }

    /// Refuses a map, as from a file, whose parts do not fit; `features` are those of a touch.
    pub fn is_whole(&self, features: usize) -> bool {
        let numbers = |values: &[f64]| values.iter().all(|x| x.is_finite());
        self.mean.len() == features
            && numbers(&self.mean)
            && numbers(&[self.far_on_map, self.far_off_map])
            && self.components.iter().all(|c| c.len() == features && numbers(c))
            && self.centroids.len() > 1
            && self
                .centroids
                .iter()
                .all(|c| c.len() == self.components.len() && numbers(c))
    }

    /// The number of categories.
    pub fn categories(&self) -> usize {
        self.centroids.len()
    }

    /// Puts a touch, `D` numbers, into the nearest category.
    ///
    /// # Errors
    /// Another number of features, and numbers that are not finite.
    pub fn classify(&self, touch: &[f64]) -> Result<Classified, PalpationError> {
        if touch.len() != self.mean.len() {
            return Err(PalpationError::OtherProbe {
                expected: self.mean.len(),
                found: touch.len(),
            });
        }
        if let Some(feature) = touch.iter().position(|x| !x.is_finite()) {
            return Err(PalpationError::NotFinite {
                touch: 0,
                feature,
                value: touch[feature],
            });
        }
        let (place, off_map) = self.place(touch);
        let distances: Vec<f64> = self.centroids.iter().map(|mean| distance(&place, mean)).collect();
        let mut order: Vec<usize> = (0..distances.len()).collect();
        order.sort_by(|a, b| distances[*a].total_cmp(&distances[*b]));
        let (nearest, second) = (distances[order[0]], distances[order[1]]);
        Ok(Classified {
            category: order[0],
            confidence: if second > 0.0 { 1.0 - nearest / second } else { 0.0 },
            unknown: nearest > self.far_on_map || off_map > self.far_off_map,
            distances,
            place,
        })
    }

    /// Where a touch is on the map, and how far it is from it.
    fn place(&self, touch: &[f64]) -> (Vec<f64>, f64) {
        let mut rest: Vec<f64> = touch.iter().zip(&self.mean).map(|(x, mean)| x - mean).collect();
        let mut place = Vec::with_capacity(self.components.len());
        for component in &self.components {
            let score: f64 = rest.iter().zip(component).map(|(x, loading)| x * loading).sum();
            rest.iter_mut()
                .zip(component)
                .for_each(|(x, loading)| *x -= score * loading);
            place.push(score);
        }
        (place, rest.iter().map(|x| x * x).sum::<f64>().sqrt())
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    squared_distance(a, b).sqrt()
}
