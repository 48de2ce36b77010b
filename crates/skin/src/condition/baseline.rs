//! The calibration window: baseline, noise and largest idle magnitude of each taxel, with outliers left out.
//!
//! A window keeps at most [`KEPT`] samples per taxel, evenly spread over its length: when it is
//! full, every other sample is dropped and only every second one kept from then on. Memory is 12
//! bytes per kept sample, 1.5 KiB per taxel (360 KiB for 240 taxels), taken once.

use super::magnitude::MagnitudeMode;
use super::step::{AxisSteps, HandSteps};

/// Most samples kept of a taxel's window.
const KEPT: usize = 128;
/// Makes the median absolute deviation of a normal distribution its standard deviation.
pub(super) const MAD_TO_SIGMA: f64 = 1.4826;
/// An axis whose level moves less than this over the window has not been touched, counts.
const TOUCH_FLOOR_COUNTS: f64 = 60.0;
/// ... nor one that moves less than this many times its noise.
const TOUCH_SIGMAS: f64 = 4.0;
/// Fewest samples from which a touch is judged.
const TOUCH_SAMPLES: usize = 8;
/// Samples vary more slowly than noise where their variance is more than this many times the one from sample to sample
/// (von Neumann's ratio): about once in noise, however strong it is, 3 to 60 times in recorded hands that move.
const SLOW_VARIANCES: f64 = 3.0;
/// ... and wander where it is more than this many times as much: in noise it is so of no taxel, filtered though it be.
const WANDER_VARIANCES: f64 = 12.0;
/// ... and their spread is more than this, counts, and than a step: what wanders less moves no threshold far.
const WANDER_COUNTS: f64 = 20.0;
/// Of the few samples at the end of the window those of slow noise vary by so many times as much as from sample to sample, since
/// their mean goes with them: in the last quarter of the window,
const END_VARIANCES: f64 = 2.0;
/// ... but in so many samples at least, or its last half.
const END_SAMPLES: usize = 11;
/// Noise is looked for in parts of a half of the window that have so many samples at least, or in the half,
const NOISE_SAMPLES: usize = 10;
/// ... in at most so many of them.
const NOISE_PARTS: usize = 4;
/// A part is noisier than the window where its variance from sample to sample is more than this many times as much
const NOISIER_VARIANCES: f64 = 2.0;
/// ... and it goes more than this many times as far.
const NOISIER_PEAKS: f64 = 1.25;
/// ... about the level of the window, if its mean is no further from it than this share of its spread: movement goes away.
const NOISE_OFF_LEVEL: f64 = 0.6;

/// What a taxel of eight bits goes up and down by, counts.
const COARSE_STEP_COUNTS: u32 = 16;

/// Where a taxel rests, and how far it goes from there at rest. Without outliers.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct Rest {
    /// Mean of x, y, z, counts.
    pub(super) baseline: [f64; 3],
    /// Largest magnitude above the baseline.
    pub(super) peak: f64,
}

/// What half of a taxel's window says about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Half {
    pub(super) rest: Rest,
    /// Whether its samples vary more slowly than noise.
    pub(super) is_slow: bool,
    /// Whether they do by far.
    pub(super) wanders: bool,
    /// How far it goes where it is noisier than the whole window; 0 where it is not.
    pub(super) noise_peak: f64,
}

/// What a taxel's window says about it.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct TaxelIdle {
    pub(super) rest: Rest,
    /// The first half of the window, and the last; none of a few samples.
    pub(super) halves: Option<[Half; 2]>,
    /// The longest step of its axes, counts.
    pub(super) step: u32,
    /// Root of the summed variances of the axes from sample to sample, counts; slow motion does not raise it.
    pub(super) noise_counts: f64,
    /// Samples left out.
    pub(super) outliers: u32,
    /// How far it goes where it is noisier than over the window, which takes such noise for outliers if it is there for half of
    /// the time or less.
    pub(super) noise_peak: f64,
    /// Whether its samples vary far more slowly than noise, outliers left out.
    pub(super) wanders: bool,
    /// Whether its last samples go further than noise, and more slowly: whatever began is not over when the window is.
    pub(super) ends_slow: bool,
    /// Whether the level moved, as under a touch.
    pub(super) touched: bool,
    /// Whether no axis changed by one count.
    pub(super) constant: bool,
    /// How often the counts change, per nanosecond: changes at random, as often as that, leave as many samples equal to
    /// the one before. 0 where none changed, infinite where all did.
    pub(super) changes_per_ns: f64,
}

#[derive(Debug, Default, Clone)]
struct Window {
    start_ns: u64,
    end_ns: u64,
    seen: u32,
    kept: usize,
    stride: u32,
    steps: [AxisSteps; 3],
}

/// The windows of all taxels.
#[derive(Debug, Clone)]
pub(super) struct Windows {
    samples: Vec<[i32; 3]>,
    windows: Vec<Window>,
    scratch: Vec<i32>,
    steps: HandSteps,
}

impl Windows {
    pub(super) fn new(taxels: usize) -> Self {
        Self {
            samples: vec![[0; 3]; taxels * KEPT],
            windows: vec![Window::default(); taxels],
            scratch: Vec::with_capacity(KEPT),
            steps: HandSteps::new(taxels),
        }
    }

    /// Finds the steps that the hand's counts go in. They hold until they are looked for again.
    pub(super) fn find_steps(&mut self) {
        self.steps.find(self.windows.iter().map(|window| &window.steps));
    }

    pub(super) fn clear(&mut self, taxel: usize) {
        self.windows[taxel] = Window::default();
    }

    pub(super) fn push(&mut self, taxel: usize, counts: [i32; 3], t_ns: u64) {
        let window = &mut self.windows[taxel];
        let samples = &mut self.samples[taxel * KEPT..][..KEPT];
        if window.seen == 0 {
            (window.start_ns, window.stride) = (t_ns, 1);
        }
        window.end_ns = t_ns;
        let last = *window.kept.checked_sub(1).map_or(&counts, |kept| &samples[kept]);
        for (a, steps) in window.steps.iter_mut().enumerate() {
            steps.take(counts[a], last[a], window.seen);
        }
        if window.kept == KEPT && window.seen.is_multiple_of(window.stride) {
            for i in 1..KEPT / 2 {
                samples[i] = samples[2 * i];
            }
            (window.kept, window.stride) = (KEPT / 2, window.stride.saturating_mul(2));
        }
        if window.seen.is_multiple_of(window.stride) && window.kept < KEPT {
            samples[window.kept] = counts;
            window.kept += 1;
        }
        window.seen = window.seen.saturating_add(1);
    }

    /// Samples seen, and nanoseconds from the first to the last.
    pub(super) fn extent(&self, taxel: usize) -> (u32, u64) {
        let w = &self.windows[taxel];
        (w.seen, w.end_ns.saturating_sub(w.start_ns))
    }

    /// Judges a taxel's window; `None` while it is empty. Peaks are above `baseline` where given,
    /// else above the window's own mean. Those of eight bits, `coarse`, have a rule of their own for their steps.
    pub(super) fn judge(
        &mut self,
        taxel: usize,
        baseline: Option<[f64; 3]>,
        mode: MagnitudeMode,
        outlier_sigmas: f64,
        coarse: bool,
    ) -> Option<TaxelIdle> {
        let kept = self.windows[taxel].kept;
        let samples = &self.samples[taxel * KEPT..][..kept];
        if samples.is_empty() {
            return None;
        }
        let window = &self.windows[taxel];
        // Those of eight bits are judged by their own least threshold.
        let steps = match coarse {
            true => [1; 3],
            false => window.steps.each_ref().map(|axis| self.steps.of(axis)),
        };
        let usual = Usual::of(samples, steps, outlier_sigmas, &mut self.scratch);
        let length_ns = window.end_ns.saturating_sub(window.start_ns);
        let pairs = (kept - 1).max(1);
        let equal = samples.windows(2).filter(|pair| pair[0] == pair[1]).count();
        let step_ns = length_ns.max(1) as f64 / pairs as f64;
        let mut idle = TaxelIdle {
            constant: equal == pairs,
            changes_per_ns: -(equal as f64 / pairs as f64).ln() / step_ns,
            rest: usual.rest(samples, baseline, mode),
            step: if coarse {
                COARSE_STEP_COUNTS
            } else {
                steps.into_iter().fold(1, u32::max)
            },
            ..TaxelIdle::default()
        };
        idle.outliers = samples.iter().filter(|s| !usual.keeps(s)).count() as u32;
        let variance = usual.successive_variance(samples);
        let noise = variance.iter().sum::<f64>();
        idle.noise_counts = noise.sqrt();
        idle.wanders = wanders(usual.variance(samples), noise, idle.step);
        let shift = match kept >= TOUCH_SAMPLES {
            true => std::array::from_fn(|a| level_shift(samples, a, &mut self.scratch)),
            false => [0.0; 3],
        };
        let is_above = |noise: [f64; 3]| {
            let far = |a: usize| shift[a] > TOUCH_FLOOR_COUNTS.max(TOUCH_SIGMAS * noise[a].sqrt());
            (0..3).any(far)
        };
        idle.touched = is_above(variance);
        if kept >= 2 * TOUCH_SAMPLES {
            let (first, last) = samples.split_at(kept / 2);
            let over = (noise, idle.rest);
            let halves = [first, last].map(|half| {
                let usual = Usual::of(half, steps, outlier_sigmas, &mut self.scratch);
                let rest = usual.rest(half, baseline, mode);
                let noise: f64 = usual.successive_variance(half).iter().sum();
                let variance = usual.variance(half);
                let parts = (half.len() / NOISE_SAMPLES).clamp(1, NOISE_PARTS);
                let parts = (0..parts).map(|p| &half[p * half.len() / parts..(p + 1) * half.len() / parts]);
                Half {
                    rest,
                    is_slow: variance > SLOW_VARIANCES * noise,
                    wanders: wanders(variance, noise, idle.step),
                    noise_peak: parts
                        .map(|part| {
                            let usual = Usual::of(part, steps, outlier_sigmas, &mut self.scratch);
                            usual.peak_where_noisier(part, over, mode)
                        })
                        .fold(0.0, f64::max),
                }
            });
            // Under a touch, what presses trembles. Loud noise takes the level of a quarter as far, as outliers.
            idle.noise_peak = match is_above(ALL_USUAL.successive_variance(samples)) {
                true => 0.0,
                false => halves.iter().map(|half| half.noise_peak).fold(0.0, f64::max),
            };
            idle.halves = Some(halves);
            // An odd number: what a clean touch begins with is never half of them, and an outlier.
            let end = ((kept / 4).max(END_SAMPLES).min(last.len()) - 1) | 1;
            let end = &last[last.len() - end..];
            let usual = Usual::of(end, steps, outlier_sigmas, &mut self.scratch);
            idle.ends_slow = usual.goes_slowly(end, noise, idle.step);
        }
        Some(idle)
    }
}

/// Within which an axis' samples usually are; what is beyond is an outlier.
struct Usual {
    centre: [f64; 3],
    reach: [f64; 3],
}

/// No sample is an outlier.
const ALL_USUAL: Usual = Usual {
    centre: [0.0; 3],
    reach: [f64::INFINITY; 3],
};

impl Usual {
    fn of(samples: &[[i32; 3]], steps: [u32; 3], outlier_sigmas: f64, sorted: &mut Vec<i32>) -> Self {
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

    fn keeps(&self, sample: &[i32; 3]) -> bool {
        (0..3).all(|a| (f64::from(sample[a]) - self.centre[a]).abs() <= self.reach[a])
    }

    /// Variance of each axis from sample to sample, which slow motion does not raise; an outlier interrupts.
    fn successive_variance(&self, samples: &[[i32; 3]]) -> [f64; 3] {
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
    fn variance(&self, samples: &[[i32; 3]]) -> f64 {
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
    fn goes_slowly(&self, samples: &[[i32; 3]], over: f64, step: u32) -> bool {
        let noise: f64 = self.successive_variance(samples).iter().sum();
        let variance = self.variance(samples);
        noise > NOISIER_VARIANCES * over && variance > END_VARIANCES * noise && is_far(variance, step)
    }

    /// How far the samples go from their mean, outliers left out, where they are noisier than those `over` the window, of
    /// which it has the variance from sample to sample and the rest, about the same level; 0 where they are not.
    fn peak_where_noisier(&self, samples: &[[i32; 3]], over: (f64, Rest), mode: MagnitudeMode) -> f64 {
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
    fn rest(&self, samples: &[[i32; 3]], baseline: Option<[f64; 3]>, mode: MagnitudeMode) -> Rest {
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
fn wanders(variance: f64, noise: f64, step: u32) -> bool {
    is_far(variance, step) && variance > WANDER_VARIANCES * noise
}

/// Whether samples of this variance go far enough to matter. On the edge of a step they may rest above it for long, and then
/// below.
fn is_far(variance: f64, step: u32) -> bool {
    let least = WANDER_COUNTS.max(f64::from(step));
    variance > least * least
}

/// Largest difference between the medians of the window's four quarters on one axis.
fn level_shift(samples: &[[i32; 3]], axis: usize, scratch: &mut Vec<i32>) -> f64 {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for quarter in 0..4 {
        let part = &samples[quarter * samples.len() / 4..(quarter + 1) * samples.len() / 4];
        scratch.clear();
        scratch.extend(part.iter().map(|s| s[axis]));
        let level = median(scratch);
        (low, high) = (low.min(level), high.max(level));
    }
    high - low
}

/// Median of integers, the mean of the middle two where their number is even. Reorders them; they
/// must not be empty.
fn median(values: &mut [i32]) -> f64 {
    let (length, middle) = (values.len(), values.len() / 2);
    let (below, upper, _) = values.select_nth_unstable(middle);
    let upper = f64::from(*upper);
    if length % 2 == 1 {
        return upper;
    }
    let lower = f64::from(
        *below
            .iter()
            .max()
            .expect("an even number of values has one below the middle"),
    );
    (lower + upper) / 2.0
}

/// Median and 1.4826 MAD of finite numbers; zeros where there are none. Reorders them.
pub(super) fn robust_spread(values: &mut [f64]) -> (f64, f64) {
    if values.is_empty() {
        return (0.0, 0.0);
    }
    let middle = values.len() / 2;
    let centre = *values.select_nth_unstable_by(middle, f64::total_cmp).1;
    for v in values.iter_mut() {
        *v = (*v - centre).abs();
    }
    (
        centre,
        MAD_TO_SIGMA * *values.select_nth_unstable_by(middle, f64::total_cmp).1,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judge(samples: impl IntoIterator<Item = [i32; 3]>) -> TaxelIdle {
        let mut windows = Windows::new(2);
        for (i, s) in samples.into_iter().enumerate() {
            windows.push(1, s, i as u64);
        }
        windows
            .judge(1, None, MagnitudeMode::Vector, 5.0, false)
            .expect("not empty")
    }

    #[test]
    fn outliers_do_not_move_the_baseline() {
        let wave = |i: i32| [20_000 + i % 3, 30_000 - i % 2, 5_000 + i % 5];
        let clean = judge((0..60).map(wave));
        let spiked = judge((0..60).map(|i| if i % 15 == 7 { [65_535, 0, 3] } else { wave(i) }));
        assert_eq!((clean.outliers, spiked.outliers), (0, 4));
        for a in 0..3 {
            assert!(
                (clean.rest.baseline[a] - spiked.rest.baseline[a]).abs() < 0.3,
                "{clean:?} {spiked:?}"
            );
        }
        assert!(spiked.rest.peak < 5.0);
        assert!(!spiked.touched);
    }

    #[test]
    fn a_level_that_moves_is_a_touch_and_not_noise() {
        let idle = judge((0..60).map(|i| {
            [
                20_000 + i % 3,
                30_000 + if i > 40 { 25 * (i - 40) } else { 0 },
                5_000,
            ]
        }));
        assert!(idle.touched);
        assert!(idle.noise_counts < 15.0, "{idle:?}");
    }

    #[test]
    fn white_noise_is_noise_and_not_a_touch() {
        let mut seed = 7u64;
        let mut noise = || {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as i32 % 4_000
        };
        let idle = judge((0..128).map(|_| [20_000 + noise(), 30_000 + noise(), 9_000 + noise()]));
        assert!(idle.noise_counts > 1_500.0, "{idle:?}");
        assert!(!idle.touched, "{idle:?}");
    }

    #[test]
    fn a_long_window_keeps_samples_from_all_of_it() {
        let idle = judge((0..100_000).map(|i| [i, 0, 0]));
        assert!(
            (idle.rest.baseline[0] - 50_000.0).abs() < 1_000.0,
            "{:?}",
            idle.rest.baseline
        );
    }

    #[test]
    fn an_empty_window_says_nothing() {
        assert_eq!(
            Windows::new(1).judge(0, None, MagnitudeMode::Vector, 5.0, false),
            None
        );
    }
}
