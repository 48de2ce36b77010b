//! Classes in the order of their distance from one of them.

use crate::error::PalpationError;
use crate::matrix::{Matrix, squared_distance};
use taxel_cluster::Random;

/// How far the mean of each class is from that of a reference, such as tissue without an inclusion.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranking {
    reference: usize,
    distances: Vec<f64>,
}

impl Ranking {
    /// Of a map, `C x N`, and the class of each touch, numbered from 0: its own, or the one that its category stands
    /// for.
    ///
    /// # Errors
    /// Not one class per touch; a reference or a class up to the greatest that no touch has.
    pub fn of(map: &Matrix, classes: &[usize], reference: usize) -> Result<Self, PalpationError> {
        let touches: Vec<usize> = (0..map.ncols()).collect();
        if classes.len() != touches.len() {
            return Err(PalpationError::Labels {
                labels: classes.len(),
                touches: touches.len(),
            });
        }
        let count = classes.iter().max().map_or(0, |most| most + 1).max(reference + 1);
        let members = |class: usize| -> Vec<usize> {
            touches
                .iter()
                .copied()
                .filter(|touch| classes[*touch] == class)
                .collect()
        };
        Self::between(map, &(0..count).map(members).collect::<Vec<_>>(), reference)
    }

    fn between(map: &Matrix, members: &[Vec<usize>], reference: usize) -> Result<Self, PalpationError> {
        if let Some(class) = members.iter().position(Vec::is_empty) {
            return Err(PalpationError::NoSuchClass { class });
        }
        let means: Vec<Vec<f64>> = members
            .iter()
            .map(|touches| map.select_columns(touches).column_mean())
            .collect();
        Ok(Self {
            reference,
            distances: means
                .iter()
                .map(|mean| squared_distance(mean, &means[reference]).sqrt())
                .collect(),
        })
    }

    /// Distance of the mean of each class from that of the reference, on the map.
    pub fn distances(&self) -> &[f64] {
        &self.distances
    }

    /// Classes from the nearest to the farthest; the reference is the first.
    pub fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.distances.len()).collect();
        order.sort_by(|a, b| {
            let key = |class: usize| {
                if class == self.reference {
                    -1.0
                } else {
                    self.distances[class]
                }
            };
            key(*a).total_cmp(&key(*b))
        });
        order
    }

    /// Whether all classes of each group are nearer than all of the next: the publication's rank-1 is the groups
    /// none, deep, shallow; its rank-2 none, small, big.
    pub fn has_order(&self, groups: &[&[usize]]) -> bool {
        let distance = |class: &usize| self.distances.get(*class).copied().unwrap_or(f64::NAN);
        groups.windows(2).all(|pair| {
            let farthest = pair[0].iter().map(distance).fold(f64::NEG_INFINITY, f64::max);
            pair[1].iter().all(|class| distance(class) > farthest)
        })
    }

    /// The share of draws in which the groups have their order, when touches are drawn anew with replacement within
    /// each class. A class of one touch is always that touch, so where classes are small this is too sure.
    ///
    /// # Errors
    /// As [`Ranking::of`].
    pub fn probability(
        map: &Matrix,
        classes: &[usize],
        reference: usize,
        groups: &[&[usize]],
        draws: u32,
        seed: u64,
    ) -> Result<f64, PalpationError> {
        Self::of(map, classes, reference)?;
        let count = classes.iter().max().map_or(0, |most| most + 1);
        let members = |class: usize| {
            (0..classes.len())
                .filter(|touch| classes[*touch] == class)
                .collect()
        };
        let members: Vec<Vec<usize>> = (0..count).map(members).collect();
        let mut random = Random::new(seed);
        let mut held = 0;
        for _ in 0..draws {
            let drawn: Vec<Vec<usize>> = members
                .iter()
                .map(|touches| {
                    touches
                        .iter()
                        .map(|_| touches[random.below(touches.len())])
                        .collect()
                })
                .collect();
            held += u32::from(Self::between(map, &drawn, reference)?.has_order(groups));
        }
        Ok(f64::from(held) / f64::from(draws.max(1)))
    }
}
