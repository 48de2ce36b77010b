//! Whether touch is touch: how far a squeeze's images are from those of the training (Hotelling's T² of their scores, and Q,
//! what the components leave of them).

use crate::phase::PHASES;
use serde::{Deserialize, Serialize};

/// A score spreads by at least this share of its widest spread at any phase: at rest, where hardly anything is felt, a count
/// of noise is not to tell.
const LEAST_SPREAD: f64 = 0.1;
/// Components leave at least this share of what they explain at some phase.
const LEAST_REST: f64 = 0.01;

/// The phases where PWM begins to rise, and of its peak.
const BEGINS: usize = 5;
const PEAK: usize = 25;

/// What scores at phases are like in the squeezes of a training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Likeness {
    /// Of each score at each phase, component after component.
    mean: Vec<f64>,
    spread: Vec<f64>,
    /// The furthest squeeze of the training when it has come to each phase: T² and Q, means over the phases so far.
    furthest: Vec<[f64; 2]>,
    /// Least square of what scores move by from where PWM begins to rise to its peak.
    least_felt: f64,
}

impl Likeness {
    /// Of `components` scores, each at all phases, of each squeeze, and of what the components leave, at all phases.
    pub(crate) fn of(components: usize, scores: &[f64], rests: &[f64]) -> Self {
        let each = components * PHASES;
        let squeezes = || scores.chunks_exact(each);
        let count = squeezes().len().max(1) as f64;
        let mean_of = |value: &dyn Fn(&[f64], usize) -> f64| -> Vec<f64> {
            let sum = |n| squeezes().map(|squeeze| value(squeeze, n)).sum::<f64>();
            (0..each).map(|n| sum(n) / count).collect()
        };
        let mean = mean_of(&|squeeze, n| squeeze[n]);
        let mut spread = mean_of(&|squeeze, n| (squeeze[n] - mean[n]).powi(2));
        for of_component in spread.chunks_exact_mut(PHASES) {
            of_component.iter_mut().for_each(|square| *square = square.sqrt());
            let widest = of_component.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
            (of_component.iter_mut()).for_each(|spread| *spread = spread.max(LEAST_SPREAD * widest));
        }
        let squares = mean_of(&|squeeze, n| squeeze[n].powi(2));
        let explained = (0..PHASES).map(|step| squares.iter().skip(step).step_by(PHASES).sum::<f64>());
        let least = [0.0, LEAST_REST * explained.fold(0.0, f64::max)];
        let mut furthest = vec![least; PHASES];
        let mut likeness = Self {
            mean,
            spread,
            furthest: Vec::new(),
            least_felt: squeezes().map(felt).fold(f64::INFINITY, f64::min),
        };
        for (scores, rests) in squeezes().zip(rests.chunks_exact(PHASES)) {
            for (furthest, distances) in furthest.iter_mut().zip(likeness.distances(scores, rests)) {
                *furthest = [0, 1].map(|n| furthest[n].max(distances[n]));
            }
        }
        likeness.furthest = furthest;
        likeness
    }

    /// How far a squeeze is that has come through `steps` phases, in multiples of the furthest of the training.
    pub(crate) fn times_as_far(&self, scores: &[f64], rests: &[f64], steps: usize) -> f64 {
        let at = self
            .distances(scores, rests)
            .zip(&self.furthest)
            .take(steps.max(1));
        let times = at
            .last()
            .map(|(distances, furthest)| [0, 1].map(|n| distances[n] / furthest[n].max(f64::MIN_POSITIVE)));
        let times = times.map_or(f64::INFINITY, |[scores, rests]| scores.max(rests));
        match steps > PEAK {
            // The other way round, so that touch that stands still is far away.
            true => times.max(self.least_felt / felt(scores).max(f64::MIN_POSITIVE)),
            false => times,
        }
    }

    /// T² and Q at each phase, means over the phases so far.
    fn distances(&self, scores: &[f64], rests: &[f64]) -> impl Iterator<Item = [f64; 2]> {
        let mut sums = [0.0; 2];
        (0..PHASES).map(move |step| {
            let of_step = (step..self.mean.len()).step_by(PHASES);
            sums[0] += of_step
                .map(|n| ((scores[n] - self.mean[n]) / self.spread[n]).powi(2))
                .sum::<f64>();
            sums[1] += rests[step];
            sums.map(|sum| sum / (step + 1) as f64)
        })
    }

    /// Whether one that was read is one.
    pub(crate) fn is_whole(&self, components: usize) -> bool {
        let furthest = self.furthest.as_flattened();
        let numbers = self.mean.iter().chain(furthest).chain([&self.least_felt]);
        self.mean.len() == components * PHASES
            && self.spread.len() == self.mean.len()
            && self.furthest.len() == PHASES
            && numbers.copied().all(f64::is_finite)
            && self.spread.iter().all(|spread| *spread > 0.0)
    }
}

/// The square of what scores move by from where PWM begins to rise to its peak.
fn felt(scores: &[f64]) -> f64 {
    let moved = |of_component: &[f64]| of_component[PEAK] - of_component[BEGINS];
    scores.chunks_exact(PHASES).map(|c| moved(c).powi(2)).sum()
}
