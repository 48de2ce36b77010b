//! Whether touch is touch: how far a squeeze's images are from those of the training (Hotelling's T² of their scores, Q, what
//! the components leave of them, and how much is felt in all, which an array of another gain tells by).

use crate::phase::PHASES;
use serde::{Deserialize, Serialize};

/// A score spreads by at least this share of its widest spread at any phase: at rest, where hardly anything is felt, a count
/// of noise is not to tell.
const LEAST_SPREAD: f64 = 0.1;
/// Components leave at least this share of what they explain at some phase.
const LEAST_REST: f64 = 0.01;
/// Totals differ by at least this much from squeeze to squeeze, as the square of a logarithm: two percent.
const LEAST_APART: f64 = 0.02 * 0.02;
/// Totals are told apart above this share of the largest: before anything is felt, a count of noise is not to tell.
const LEAST_TOTAL: f64 = 0.05;

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
    /// What is felt in all at each phase, counts.
    total: Vec<f64>,
    /// The furthest squeeze of the training when it has come to each phase: T² and Q, means over the phases so far, and the
    /// square of the logarithm of its total so far, in multiples of the mean one.
    furthest: Vec<[f64; 3]>,
    /// Least square of what scores move by from where PWM begins to rise to its peak.
    least_felt: f64,
}

impl Likeness {
    /// Of `components` scores, each at all phases, of each squeeze, of what the components leave, and of totals, at all phases.
    pub(crate) fn of(components: usize, scores: &[f64], rests: &[f64], totals: &[f64]) -> Self {
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
        let least = [0.0, LEAST_REST * explained.fold(0.0, f64::max), LEAST_APART];
        let total = (0..PHASES).map(|step| totals.iter().skip(step).step_by(PHASES).sum::<f64>() / count);
        let mut furthest = vec![least; PHASES];
        let mut likeness = Self {
            mean,
            spread,
            total: total.collect(),
            furthest: Vec::new(),
            least_felt: squeezes().map(felt).fold(f64::INFINITY, f64::min),
        };
        let at_phases = rests.chunks_exact(PHASES).zip(totals.chunks_exact(PHASES));
        for (scores, (rests, totals)) in squeezes().zip(at_phases) {
            let distances = likeness.distances(scores, rests, totals);
            for (furthest, distances) in furthest.iter_mut().zip(distances) {
                *furthest = [0, 1, 2].map(|n| furthest[n].max(distances[n]));
            }
        }
        likeness.furthest = furthest;
        likeness
    }

    /// How far a squeeze is that has come through `steps` phases, in multiples of the furthest of the training.
    pub(crate) fn times_as_far(&self, scores: &[f64], rests: &[f64], totals: &[f64], steps: usize) -> f64 {
        let at = self
            .distances(scores, rests, totals)
            .zip(&self.furthest)
            .take(steps.max(1));
        let times = at.last().map(|(distances, furthest)| {
            [0, 1, 2].map(|n| distances[n] / furthest[n].max(f64::MIN_POSITIVE))
        });
        let times = times.map_or(f64::INFINITY, |times| times.into_iter().fold(0.0, f64::max));
        match steps > PEAK {
            // The other way round, so that touch that stands still is far away.
            true => times.max(self.least_felt / felt(scores).max(f64::MIN_POSITIVE)),
            false => times,
        }
    }

    /// T² and Q at each phase, means over the phases so far, and how far the total so far is from the mean one.
    fn distances(&self, scores: &[f64], rests: &[f64], totals: &[f64]) -> impl Iterator<Item = [f64; 3]> {
        let mut sums = [0.0; 2];
        let (mut total, mut expected) = (0.0, 0.0);
        let least = LEAST_TOTAL * self.total.iter().copied().fold(0.0, f64::max);
        (0..PHASES).map(move |step| {
            let of_step = (step..self.mean.len()).step_by(PHASES);
            sums[0] += of_step
                .map(|n| ((scores[n] - self.mean[n]) / self.spread[n]).powi(2))
                .sum::<f64>();
            sums[1] += rests[step];
            total += totals[step] + least;
            expected += self.total[step] + least;
            let [scores, rests] = sums.map(|sum| sum / (step + 1) as f64);
            // Nothing was felt in the whole training where nothing is expected.
            let apart = if expected > 0.0 {
                (total / expected).ln().powi(2)
            } else {
                0.0
            };
            [scores, rests, apart]
        })
    }

    /// Whether one that was read is one.
    pub(crate) fn is_whole(&self, components: usize) -> bool {
        let furthest = self.furthest.as_flattened();
        let numbers = (self.mean.iter().chain(furthest).chain(&self.total)).chain([&self.least_felt]);
        self.mean.len() == components * PHASES
            && self.spread.len() == self.mean.len()
            && self.furthest.len() == PHASES
            && self.total.len() == PHASES
            && numbers.copied().all(f64::is_finite)
            && self.spread.iter().all(|spread| *spread > 0.0)
    }
}

/// The square of what scores move by from where PWM begins to rise to its peak.
fn felt(scores: &[f64]) -> f64 {
    let moved = |of_component: &[f64]| of_component[PEAK] - of_component[BEGINS];
    scores.chunks_exact(PHASES).map(|c| moved(c).powi(2)).sum()
}
