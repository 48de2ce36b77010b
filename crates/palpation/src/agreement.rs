//! How categories agree with classes that are known.

use crate::error::PalpationError;
use taxel_cluster::Matching;

/// Categories beside classes.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    /// Touches of each category, a row of one number per class.
    pub confusion: Vec<Vec<usize>>,
    /// The class that each category stands for: such that most touches agree, and the smallest of such matchings in
    /// the order of numbers. Numbers beyond the classes are new ones, for categories that stand for none.
    pub class_of: Vec<usize>,
    /// Share of the touches whose category stands for their class.
    pub accuracy: f64,
    /// Adjusted Rand index (Hubert and Arabie 1985): 1 for equal partitions, about 0 for chance.
    pub ari: f64,
}

impl Agreement {
    /// Of the category and the class of each touch, both numbered from 0.
    ///
    /// # Errors
    /// Lists of different lengths, or of nothing.
    pub fn of(labels: &[usize], classes: &[usize]) -> Result<Self, PalpationError> {
        if labels.len() != classes.len() {
            return Err(PalpationError::Labels {
                labels: labels.len(),
                touches: classes.len(),
            });
        }
        let (Some(most_label), Some(most_class)) = (labels.iter().max(), classes.iter().max()) else {
            return Err(PalpationError::TooFew { touches: 0 });
        };
        let mut confusion = vec![vec![0; most_class + 1]; most_label + 1];
        for (label, class) in labels.iter().zip(classes) {
            confusion[*label][*class] += 1;
        }
        let class_of = matched(&confusion);
        let agree = labels
            .iter()
            .zip(classes)
            .filter(|(label, class)| class_of[**label] == **class);
        Ok(Self {
            accuracy: agree.count() as f64 / labels.len() as f64,
            ari: adjusted_rand_index(&confusion, labels.len()),
            class_of,
            confusion,
        })
    }

    /// The class that each touch's category stands for: the publication's `v'`, eq. (13).
    pub fn relabelled(&self, labels: &[usize]) -> Vec<usize> {
        labels.iter().map(|label| self.class_of[*label]).collect()
    }
}

/// The matching of most touches, by the Hungarian method; among equals the smallest in the order of numbers, found by
/// holding the class of one category after another as small as the sum allows.
fn matched(confusion: &[Vec<usize>]) -> Vec<usize> {
    let (categories, classes) = (confusion.len(), confusion[0].len());
    let size = categories.max(classes);
    let mut matching = Matching::new(size, size);
    let mut held: Vec<usize> = Vec::new();
    let mut most = |held: &[usize]| {
        let cost = |row: usize, column: usize| match held.get(row) {
            Some(class) if *class != column => (categories * classes) as f64 * f64::from(u32::MAX),
            _ => {
                -(confusion
                    .get(row)
                    .and_then(|row| row.get(column))
                    .copied()
                    .unwrap_or(0) as f64)
            }
        };
        let found = matching.solve(size, size, cost);
        found
            .iter()
            .enumerate()
            .map(|(row, column)| cost(row, *column))
            .sum::<f64>()
    };
    let least = most(&[]);
    for row in 0..categories {
        held.push(0);
        while most(&held) > least {
            held[row] += 1;
        }
    }
    held
}

fn adjusted_rand_index(confusion: &[Vec<usize>], touches: usize) -> f64 {
    let pairs = |n: usize| n as f64 * (n as f64 - 1.0) / 2.0;
    let both: f64 = confusion.iter().flatten().map(|n| pairs(*n)).sum();
    let rows: f64 = confusion.iter().map(|row| pairs(row.iter().sum())).sum();
    let column = |class: usize| confusion.iter().map(|row| row[class]).sum();
    let columns: f64 = (0..confusion[0].len()).map(|class| pairs(column(class))).sum();
    let chance = if touches > 1 {
        rows * columns / pairs(touches)
    } else {
        0.0
    };
    let most = (rows + columns) / 2.0;
    if most == chance {
        1.0
    } else {
        (both - chance) / (most - chance)
    }
}
