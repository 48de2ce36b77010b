//! What is usual of samples: their level, their variance and their peak, outliers left out.

use super::magnitude::MagnitudeMode;
use super::spread::{MAD_TO_SIGMA, median};

/// Samples vary more slowly than noise where their variance is more than this many times the one from sample to sample
/// (von Neumann's ratio): about once in noise, however strong it is, 3 to 60 times in recorded hands that move.
pub(super) const SLOW_VARIANCES: f64 = 3.0;
/// ... and wander where it is more than this many times as much: in noise it is so of no taxel, filtered though it be.
const WANDER_VARIANCES: f64 = 12.0;
/// ... and their spread is more than this, counts, and than a step: what wanders less moves no threshold far.
const WANDER_COUNTS: f64 = 20.0;
/// Of the few samples at the end of the window those of slow noise vary by so many times as much as from sample to sample, since
/// their mean goes with them.
const END_VARIANCES: f64 = 2.0;
/// A part is noisier than the window where its variance from sample to sample is more than this many times as much,
const NOISIER_VARIANCES: f64 = 2.0;
/// ... it goes more than this many times as far,
const NOISIER_PEAKS: f64 = 1.25;
/// ... and its mean is no further from that of the window than this share of its spread: movement goes away.
const NOISE_OFF_LEVEL: f64 = 0.6;

/// Where a taxel rests, and how far it goes from there at rest. Without outliers.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct Rest {
    /// Mean of x, y, z, counts.
    pub(super) baseline: [f64; 3],
    /// Largest magnitude above the baseline.
    pub(super) peak: f64,
}

/// Where the samples of each axis usually are; what is further from `centre` than `reach`, counts, is an outlier.
pub(super) struct Usual {
    centre: [f64; 3],
    reach: [f64; 3],
}

/// No sample is an outlier.
pub(super) const ALL_USUAL: Usual = Usual {
    centre: [0.0; 3],
    reach: [f64::INFINITY; 3],
};

impl Usual {
    pub(super) fn of(
        samples: &[[i32; 3]],
        steps: [u32; 3],
        outlier_sigmas: f64,
        sorted: &mut Vec<i32>,
    ) -> Self {
        let (mut centre, mut reach) = ([0.0; 3], [0.0; 3]);
        for a in 0..3 {
            sorted.clear();
            sorted.extend(samples.iter().map(|s| s[a]));
            centre[a] = median(sorted);
            sorted.clear();
            sorted.extend(
                samples
                    .iter()
                    .map(|s| (2 * s[a]).abs_diff((2.0 * centre[a]) as i32) as i32),
            );
            let sigma = MAD_TO_SIGMA * median(sorted) / 2.0;
            // Quiet axes move by one step now and then; that is resolution, not an outlier.
            reach[a] = outlier_sigmas * sigma.max(f64::from(steps[a]) / 2.0);
        }
        Self { centre, reach }
    }

    pub(super) fn keeps(&self, sample: &[i32; 3]) -> bool {
        (0..3).all(|a| (f64::from(sample[a]) - self.centre[a]).abs() <= self.reach[a])
    }

    /// Variance of each axis from sample to sample, which slow motion does not raise; an outlier interrupts.
    pub(super) fn successive_variance(&self, samples: &[[i32; 3]]) -> [f64; 3] {
        let (mut squares, mut pairs) = ([0.0; 3], 0u32);
        for pair in samples.windows(2) {
            if self.keeps(&pair[0]) && self.keeps(&pair[1]) {
                pairs += 1;
                for a in 0..3 {
                    squares[a] += f64::from(pair[1][a] - pair[0][a]).powi(2) / 2.0;
                }
            }
        }
        squares.map(|s| s / f64::from(pairs.max(1)))
    }

    /// Sum of the axes' variances, of the samples that [`Usual::successive_variance`] is of, those with a neighbour that is
    /// none either: of noise that is mostly outliers, what is left stands alone, and would be movement.
    pub(super) fn variance(&self, samples: &[[i32; 3]]) -> f64 {
        let pairs = samples
            .windows(2)
            .filter(|pair| pair.iter().all(|s| self.keeps(s)));
        let (mut sum, mut used) = ([0i64; 3], 0u32);
        for s in pairs.clone().flatten() {
            used += 1;
            for a in 0..3 {
                sum[a] += i64::from(s[a]);
            }
        }
        let used = f64::from(used.max(1));
        let mean = sum.map(|s| s as f64 / used);
        let off = |s: &[i32; 3]| (0..3).map(|a| (f64::from(s[a]) - mean[a]).powi(2)).sum::<f64>();
        pairs.flatten().map(off).sum::<f64>() / used
    }

    /// Whether the samples are noisier than those of the window, of which it has the variance from sample to sample, and
    /// more slowly than noise.
    pub(super) fn goes_slowly(&self, samples: &[[i32; 3]], over: f64, step: u32) -> bool {
        let noise: f64 = self.successive_variance(samples).iter().sum();
        let variance = self.variance(samples);
        noise > NOISIER_VARIANCES * over && variance > END_VARIANCES * noise && is_far(variance, step)
    }

    /// How far the samples go from their mean, outliers left out, where they are noisier than those `over` the window, of
    /// which it has the variance from sample to sample and the rest, about the same level; 0 where they are not.
    pub(super) fn peak_where_noisier(
        &self,
        samples: &[[i32; 3]],
        over: (f64, Rest),
        mode: MagnitudeMode,
    ) -> f64 {
        let noise: f64 = self.successive_variance(samples).iter().sum();
        let rest = self.rest(samples, None, mode);
        let is_noisier = noise > NOISIER_VARIANCES * over.0 && rest.peak > NOISIER_PEAKS * over.1.peak;
        let variance = self.variance(samples);
        let off: f64 = (0..3)
            .map(|a| (rest.baseline[a] - over.1.baseline[a]).powi(2))
            .sum();
        let stays = off <= NOISE_OFF_LEVEL * NOISE_OFF_LEVEL * variance && variance <= SLOW_VARIANCES * noise;
        match is_noisier && stays {
            true => rest.peak,
            false => 0.0,
        }
    }

    /// The rest of samples, outliers left out.
    pub(super) fn rest(&self, samples: &[[i32; 3]], baseline: Option<[f64; 3]>, mode: MagnitudeMode) -> Rest {
        let kept = || samples.iter().filter(|s| self.keeps(s));
        let (mut sum, mut used) = ([0i64; 3], 0u32);
        for s in kept() {
            used += 1;
            for a in 0..3 {
                sum[a] += i64::from(s[a]);
            }
        }
        let mean = if used > 0 {
            sum.map(|s| s as f64 / f64::from(used))
        } else {
            self.centre
        };
        let from = baseline.unwrap_or(mean);
        Rest {
            baseline: mean,
            peak: kept().map(|s| mode.of(*s, from)).fold(0.0, f64::max),
        }
    }
}

/// Whether samples of this variance, and of so much from one to the next, vary far more slowly than noise.
pub(super) fn wanders(variance: f64, noise: f64, step: u32) -> bool {
    is_far(variance, step) && variance > WANDER_VARIANCES * noise
}

/// Whether samples of this variance go far enough to matter. On the edge of a step they may rest above it for long, and then
/// below.
fn is_far(variance: f64, step: u32) -> bool {
    let least = WANDER_COUNTS.max(f64::from(step));
    variance > least * least
}
