//! The calibration window: baseline, noise and largest idle magnitude of each taxel, with outliers left out.
//!
//! A window keeps at most [`KEPT`] samples per taxel, evenly spread over its length: when it is
//! full, every other sample is dropped and only every second one kept from then on. Memory is 12
//! bytes per kept sample, 1.5 KiB per taxel (360 KiB for 240 taxels), taken once.

use super::magnitude::MagnitudeMode;
use super::spread::median;
use super::step::{AxisSteps, HandSteps};
use super::usual::{ALL_USUAL, Rest, SLOW_VARIANCES, Usual, wanders};

/// Most samples kept of a taxel's window.
const KEPT: usize = 128;
/// An axis whose level moves less than this over the window has not been touched, counts.
const TOUCH_FLOOR_COUNTS: f64 = 60.0;
/// ... nor one that moves less than this many times its noise.
const TOUCH_SIGMAS: f64 = 4.0;
/// Fewest samples from which a touch is judged.
const TOUCH_SAMPLES: usize = 8;
/// Fewest samples at the end of the window in which slow noise is looked for; the last half, where that has fewer.
const END_SAMPLES: usize = 11;
/// Noise is looked for in parts of a half of the window that have so many samples at least, or in the half,
const NOISE_SAMPLES: usize = 10;
/// ... in at most so many of them.
const NOISE_PARTS: usize = 4;
/// What a taxel of eight bits goes up and down by, counts.
const COARSE_STEP_COUNTS: u32 = 16;

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
        let step = match coarse {
            true => COARSE_STEP_COUNTS,
            false => steps.into_iter().fold(1, u32::max),
        };
        let mut rules = Rules {
            steps,
            step,
            baseline,
            mode,
            outlier_sigmas,
            scratch: &mut self.scratch,
        };
        let usual = rules.usual(samples);
        let variance = usual.successive_variance(samples);
        let noise = variance.iter().sum::<f64>();
        let length_ns = window.end_ns.saturating_sub(window.start_ns);
        let pairs = (kept - 1).max(1);
        let equal = samples.windows(2).filter(|pair| pair[0] == pair[1]).count();
        let step_ns = length_ns.max(1) as f64 / pairs as f64;
        let shift = rules.level_shift(samples);
        let mut idle = TaxelIdle {
            constant: equal == pairs,
            changes_per_ns: -(equal as f64 / pairs as f64).ln() / step_ns,
            rest: usual.rest(samples, baseline, mode),
            step,
            outliers: samples.iter().filter(|s| !usual.keeps(s)).count() as u32,
            noise_counts: noise.sqrt(),
            wanders: wanders(usual.variance(samples), noise, step),
            touched: is_touch(shift, variance),
            ..TaxelIdle::default()
        };
        if kept >= 2 * TOUCH_SAMPLES {
            let (first, last) = samples.split_at(kept / 2);
            let halves = [first, last].map(|half| rules.half(half, (noise, idle.rest)));
            // Under a touch, what presses trembles. Loud noise takes the level of a quarter as far, as outliers.
            idle.noise_peak = match is_touch(shift, ALL_USUAL.successive_variance(samples)) {
                true => 0.0,
                false => halves.iter().map(|half| half.noise_peak).fold(0.0, f64::max),
            };
            idle.halves = Some(halves);
            // An odd number: what a clean touch begins with is never half of them, and an outlier.
            let end = ((kept / 4).max(END_SAMPLES).min(last.len()) - 1) | 1;
            let end = &last[last.len() - end..];
            idle.ends_slow = rules.usual(end).goes_slowly(end, noise, step);
        }
        Some(idle)
    }
}

/// How the samples of one taxel are judged.
struct Rules<'a> {
    /// What each axis goes up and down by, counts.
    steps: [u32; 3],
    /// The longest of them.
    step: u32,
    baseline: Option<[f64; 3]>,
    mode: MagnitudeMode,
    outlier_sigmas: f64,
    scratch: &'a mut Vec<i32>,
}

impl Rules<'_> {
    fn usual(&mut self, samples: &[[i32; 3]]) -> Usual {
        Usual::of(samples, self.steps, self.outlier_sigmas, self.scratch)
    }

    /// Judges half of a window, and looks in parts of it for noise beyond that `over` the whole window, of which it has the
    /// variance from sample to sample and the rest.
    fn half(&mut self, half: &[[i32; 3]], over: (f64, Rest)) -> Half {
        let usual = self.usual(half);
        let noise: f64 = usual.successive_variance(half).iter().sum();
        let variance = usual.variance(half);
        let parts = (half.len() / NOISE_SAMPLES).clamp(1, NOISE_PARTS);
        let mut noise_peak = 0.0;
        for p in 0..parts {
            let part = &half[p * half.len() / parts..(p + 1) * half.len() / parts];
            noise_peak = f64::max(
                noise_peak,
                self.usual(part).peak_where_noisier(part, over, self.mode),
            );
        }
        Half {
            rest: usual.rest(half, self.baseline, self.mode),
            is_slow: variance > SLOW_VARIANCES * noise,
            wanders: wanders(variance, noise, self.step),
            noise_peak,
        }
    }

    /// How far the level of each axis moves within the window, counts; 0 of too few samples to tell.
    fn level_shift(&mut self, samples: &[[i32; 3]]) -> [f64; 3] {
        match samples.len() >= TOUCH_SAMPLES {
            true => std::array::from_fn(|a| level_shift(samples, a, self.scratch)),
            false => [0.0; 3],
        }
    }
}

/// Whether the level of an axis moves further than noise of this variance would take it.
fn is_touch(shift: [f64; 3], variance: [f64; 3]) -> bool {
    let far = |a: usize| shift[a] > TOUCH_FLOOR_COUNTS.max(TOUCH_SIGMAS * variance[a].sqrt());
    (0..3).any(far)
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
