//! Whether angles are those of the training's gripper: how far they are, at phases all over the squeeze, from those of the
//! training (Hotelling's T² of their principal components, and Q, what these leave of them).

use crate::phase::PHASES;
use crate::regression::{Rows, picks_evenly};
use serde::{Deserialize, Serialize};
use taxel_palpation::{Matrix, Pca, Solver};

/// Of fewer squeezes at a place it is not told what others may be like.
const LEAST_SQUEEZES: usize = 4;
/// Phases that are looked at, whichever a line looks at: six components leave next to nothing of the five phases that a choice
/// may have, and tell nobody by it.
const POINTS: usize = 16;
/// Components of the features.
const COMPONENTS: usize = 6;
/// Features that differ by no more are the same, degrees: the squeezes of a training may be as like as one arm's in one
/// minute.
const SAME_DEG: f64 = 0.6;

/// What the features of whole squeezes are like in a training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Domain {
    picks: Vec<usize>,
    /// Of each feature, degrees.
    mean: Vec<f64>,
    /// One for each feature, component after component.
    loadings: Vec<f64>,
    /// Of the score of each component, degrees.
    spreads: Vec<f64>,
    /// The furthest squeeze of the training: T² and Q.
    furthest: [f64; 2],
}

impl Domain {
    /// How far squeezes of the training are is asked of the half of the repetitions that each is not of: to its own, one of
    /// few is near. None where a place has few, or all are the same: nothing tells them from others.
    pub(crate) fn of(rows: &Rows) -> Option<Self> {
        let at = |place| rows.places.iter().filter(|at| **at == place).count();
        if (0..rows.percents.len()).any(|place| at(place) < LEAST_SQUEEZES) {
            return None;
        }
        let picks = picks_evenly(rows.columns, POINTS);
        let halves = rows.parts(2);
        let mut domain = Self::fit(rows, &picks, (0..halves.len()).collect())?;
        for half in [0, 1] {
            let (these, others) = (0..halves.len()).partition::<Vec<_>, _>(|n| halves[*n] == half);
            let Some(apart) = Self::fit(rows, &picks, others) else {
                continue;
            };
            for n in these {
                let distances = apart.distances(rows.row(n));
                domain.furthest = [0, 1].map(|of| domain.furthest[of].max(distances[of]));
            }
        }
        Some(domain)
    }

    /// Of some squeezes.
    fn fit(rows: &Rows, picks: &[usize], squeezes: Vec<usize>) -> Option<Self> {
        let count = squeezes.len();
        let features = squeezes
            .iter()
            .flat_map(|n| picks.iter().map(|pick| rows.row(*n)[*pick]));
        let features = Matrix::new(picks.len(), count, features.collect());
        let pca = Pca::fit(&features, COMPONENTS.min(picks.len()), Solver::Exact).ok()?;
        let spread = |value: &f64| (value * value / count as f64).sqrt().hypot(SAME_DEG);
        Some(Self {
            picks: picks.into(),
            mean: pca.mean().to_vec(),
            loadings: pca.components().as_slice().to_vec(),
            spreads: pca.singular_values().iter().map(spread).collect(),
            furthest: [1.0, SAME_DEG * SAME_DEG],
        })
    }

    /// How far a squeeze is, in multiples of the furthest of the training.
    pub(crate) fn times_as_far(&self, features: &[f64]) -> f64 {
        let [scores, rest] = self.distances(features);
        (scores / self.furthest[0]).max(rest / self.furthest[1])
    }

    /// T², mean over the components, and Q, mean over the features, square degrees.
    fn distances(&self, features: &[f64]) -> [f64; 2] {
        let count = self.picks.len();
        let off = self.picks.iter().zip(&self.mean);
        let mut rest: Vec<f64> = off.map(|(pick, mean)| features[*pick] - mean).collect();
        let mut squares = 0.0;
        for (loadings, spread) in self.loadings.chunks_exact(count).zip(&self.spreads) {
            // Components are orthogonal: what others have taken away does not change a score.
            let score: f64 = loadings.iter().zip(&rest).map(|(l, x)| l * x).sum();
            squares += (score / spread).powi(2);
            (rest.iter_mut().zip(loadings)).for_each(|(rest, loading)| *rest -= score * loading);
        }
        let left: f64 = rest.iter().map(|x| x * x).sum();
        [squares / self.spreads.len() as f64, left / count as f64]
    }

    /// Whether one that was read is one, of so many columns.
    pub(crate) fn is_whole(&self, columns: usize) -> bool {
        let (count, components) = (self.picks.len(), self.spreads.len());
        let numbers = self.mean.iter().chain(&self.loadings);
        let scales = self.spreads.iter().chain(&self.furthest);
        count > 0
            && components > 0
            && self.picks.iter().all(|pick| *pick < columns * PHASES)
            && self.mean.len() == count
            && self.loadings.len() == components * count
            && numbers.copied().all(f64::is_finite)
            && scales.copied().all(|scale| scale.is_finite() && scale > 0.0)
    }
}
