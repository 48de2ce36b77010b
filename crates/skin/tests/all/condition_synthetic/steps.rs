//! Counts that go in steps of several, as of a converter of few bits or of values that were scaled.

use super::skin::Skin;
use taxel_hand::{Freshness, TactileFrame};
use taxel_skin::ConditionConfig;

const RATE_HZ: u64 = 30;
/// Frames of the time in which nothing touches a hand; it may be in contact in a hundredth of them.
const REST: usize = 300;
/// Frames of a touch, fewer than those after which a taxel of few changes is called stuck.
const TOUCH: usize = 50;

/// A hand at rest somewhere between two steps, with normally distributed noise.
struct Stepped {
    skin: Skin,
    /// Where each axis rests, steps.
    rest: Vec<[f64; 3]>,
    /// The step of each axis, counts; 0 of one that reads 0.
    steps: Vec<[f64; 3]>,
    /// Standard deviation, steps.
    noise: f64,
    /// Added to all counts.
    offset: f64,
    /// How often each sample comes.
    times: usize,
    frames: usize,
    seed: u64,
}

impl Stepped {
    fn new(steps: Vec<[f64; 3]>, noise: f64) -> Self {
        let mut hand = Self {
            skin: Skin::new(steps.len(), RATE_HZ, ConditionConfig::robust()),
            rest: vec![[0.0; 3]; steps.len()],
            noise,
            offset: 0.0,
            times: 1,
            frames: 0,
            seed: 7 * steps.len() as u64,
            steps,
        };
        for n in 0..hand.rest.len() {
            for axis in 0..3 {
                let counts = 8_000.0 + 24_000.0 * hand.uniform();
                hand.rest[n][axis] = counts / hand.steps[n][axis].max(1.0);
            }
        }
        hand
    }

    fn uniform(&mut self) -> f64 {
        self.seed = self
            .seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.seed >> 33) as f64 / (1u64 << 31) as f64
    }

    /// A number of normal distribution, but for the tails beyond six deviations.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn step_with(&mut self, spoil: impl FnOnce(&mut TactileFrame)) {
        let mut counts = self.skin.frame.counts.clone();
        if self.frames.is_multiple_of(self.times) {
            for (n, taxel) in counts.iter_mut().enumerate() {
                *taxel = std::array::from_fn(|axis| {
                    let steps = (self.rest[n][axis] + self.noise * self.normal()).round();
                    (steps * self.steps[n][axis] + self.offset).round() as u16
                });
            }
        }
        self.frames += 1;
        self.skin.step_with(|frame| {
            frame.counts = counts;
            spoil(frame);
        });
    }

    /// In how many of the next frames any taxel is in contact.
    fn images(&mut self, frames: usize) -> usize {
        let mut images = 0;
        for _ in 0..frames {
            self.step_with(|_| {});
            images += usize::from(self.skin.out.contacts() > 0);
        }
        images
    }

    /// Calibrates, rests, and is touched on the last axis of taxel 3.
    fn check(&mut self, case: &str) {
        while self.skin.conditioner.is_calibrating() {
            self.step_with(|_| {});
        }
        let images = self.images(REST);
        assert!(images <= REST / 100, "{case}: {images} of {REST} images at rest");
        // Ten steps or, where it is more, ten times the noise; and above the thresholds of the hand's other steps.
        let longest = self.steps.as_flattened().iter().copied().fold(2.0, f64::max);
        self.rest[3][2] -= 10.0 * self.noise.max(1.0) * longest / self.steps[3][2];
        let images = self.images(TOUCH);
        assert!(
            images >= TOUCH - self.times && self.skin.out.contact[3],
            "{case}: {images} of {TOUCH} images of a touch"
        );
    }
}

#[test]
fn a_hand_whose_counts_go_in_steps_feels_nothing_at_rest_and_a_touch_of_ten_steps() {
    for (taxels, first) in [(16, 1.0), (16, 0.0), (160, 0.0)] {
        for step in [1.0, 4.0, 8.0, 10.0, 16.0, 25.0, 64.0, 100.0] {
            for noise in [0.15, 0.2, 0.3, 0.4, 0.6, 1.0, 2.0] {
                let mut hand = Stepped::new(vec![[first * step, first * step, step]; taxels], noise);
                hand.check(&format!(
                    "{taxels} taxels, {first} * xy, steps of {step}, noise of {noise} steps"
                ));
            }
        }
    }
}

#[test]
fn steps_of_some_boards_axes_and_taxels_are_found_beside_those_of_others() {
    let coarse = || vec![[16.0; 3]; 64];
    let mut cases = vec![(coarse(), "all alike"); 7];
    cases[1].0[32..].fill([1.0; 3]);
    cases[2].0[16..].fill([10.0, 16.0, 20.0]);
    cases[3].0[7] = [1.0; 3];
    cases[4].0[7][0] = 1.0;
    cases[5].0.iter_mut().for_each(|taxel| taxel[0] = 1.0);
    cases[6].0[48..].fill([8.0; 3]);
    for (i, (steps, _)) in cases.into_iter().enumerate() {
        for noise in [0.15, 0.3] {
            Stepped::new(steps.clone(), noise).check(&format!("case {i}, noise of {noise} steps"));
        }
    }
}

#[test]
fn steps_are_found_beside_an_offset_and_after_rounding() {
    for (step, offset) in [
        (16.0, 5.0),
        (12.5, 0.0),
        (65_535.0 / 4_095.0, 0.0),
        (65_535.0 / 1_023.0, 3.0),
    ] {
        for noise in [0.15, 0.4] {
            let mut hand = Stepped::new(vec![[step; 3]; 32], noise);
            hand.offset = offset;
            hand.check(&format!(
                "steps of {step} beside {offset}, noise of {noise} steps"
            ));
        }
    }
}

#[test]
fn steps_of_a_few_taxels_among_finer_ones_and_of_hands_of_one_or_two_are_found() {
    for (taxels, coarse) in [(32, 4), (32, 8), (240, 16), (1, 1), (2, 2)] {
        for noise in [0.15, 0.3] {
            let mut steps = vec![[16.0; 3]; coarse];
            steps.resize(taxels, [1.0; 3]);
            let mut hand = Stepped::new(steps, noise);
            while hand.skin.conditioner.is_calibrating() {
                hand.step_with(|_| {});
            }
            let images = hand.images(REST);
            assert!(
                images <= REST / 100,
                "{coarse} of {taxels}, noise of {noise} steps: {images} images at rest"
            );
        }
    }
}

#[test]
fn taxels_that_flick_to_one_value_once_show_no_step() {
    let mut hand = Stepped::new(vec![[0.0; 3]; 32], 0.0);
    let mut i = 0;
    while hand.skin.conditioner.is_calibrating() {
        i += 1;
        // Three taxels for two frames each.
        hand.step_with(|frame| frame.counts[i / 10][2] = 100 * u16::from(i < 30 && i % 10 < 2));
    }
    assert_eq!(hand.skin.conditioner.threshold(), 10.0);
}

#[test]
fn steps_are_found_where_samples_come_several_times() {
    for times in [2, 3] {
        let mut hand = Stepped::new(vec![[16.0; 3]; 16], 0.25);
        hand.times = times;
        hand.check(&format!("each sample {times} times"));
    }
}

#[test]
fn what_a_hand_without_noise_feels_while_it_is_calibrated_is_no_step_of_its_counts() {
    // By how much, which taxels, and in which frames.
    let every = |n: usize| move |i: usize| i % n == n - 1;
    type Case<'a> = (u16, std::ops::Range<usize>, &'a dyn Fn(usize) -> bool);
    let cases: [Case<'_>; 7] = [
        (100, 5..6, &every(6)),
        (128, 5..7, &every(5)),
        (100, 0..8, &every(6)),
        (100, 0..64, &every(6)),
        (100, 0..8, &|i| (9..12).contains(&i) || (20..23).contains(&i)),
        (64, 0..8, &|i| i == 0),
        (1_000, 0..64, &every(6)),
    ];
    for (by, taxels, is_off) in cases {
        for rest in [20_000, 32_768] {
            let mut hand = Skin::new(64, RATE_HZ, ConditionConfig::robust());
            hand.noise.fill([0; 3]);
            hand.truth.fill([rest; 3]);
            let mut i = 0;
            while hand.conditioner.is_calibrating() {
                hand.step_with(|frame| {
                    let off = by * u16::from(is_off(i));
                    frame.counts[taxels.clone()].iter_mut().for_each(|c| c[2] += off);
                });
                i += 1;
            }
            let case = format!("{taxels:?} by {by} from {rest}");
            assert_eq!(hand.conditioner.threshold(), 10.0, "{case}");
            let baseline = hand.conditioner.baseline();
            assert!(baseline.iter().all(|b| *b == [f64::from(rest); 3]), "{case}");
        }
    }
}

#[test]
fn a_touch_that_rolls_over_a_hand_without_noise_shows_no_step() {
    // Up to five times as much and down again; or up at once, and soon again.
    let rises = |since: i32| 20 * (5 - (since - 5).abs()).clamp(0, 5);
    let taps = |since: i32| 100 * i32::from(matches!(since, 1..=3 | 6..=8));
    for (case, force) in [("rises", &rises as &dyn Fn(i32) -> i32), ("taps", &taps)] {
        for taxels in [1, 2, 16] {
            let mut hand = Skin::new(taxels, RATE_HZ, ConditionConfig::robust());
            hand.noise.fill([0; 3]);
            let mut i = 0;
            while hand.conditioner.is_calibrating() {
                hand.step_with(|frame| {
                    for (n, counts) in frame.counts.iter_mut().enumerate() {
                        counts[2] += force(i - 3 - 2 * n as i32) as u16;
                    }
                });
                i += 1;
            }
            assert_eq!(hand.conditioner.threshold(), 10.0, "{case} on {taxels} taxels");
        }
    }
}

#[test]
fn taxels_at_rest_at_0_that_are_brushed_over_show_no_step() {
    let mut hand = Stepped::new(vec![[0.0; 3]; 160], 0.0);
    let mut brush = 0;
    while hand.skin.conditioner.is_calibrating() {
        brush += 6;
        // Every one of these is touched once; four of them as strongly as three others each.
        let force = |n: usize| if n.is_multiple_of(10) { 60 } else { 61 + n as u16 };
        hand.step_with(|frame| (brush..(brush + 6).min(96)).for_each(|n| frame.counts[n][2] = force(n)));
    }
    assert_eq!(hand.skin.conditioner.threshold(), 10.0);
}

#[test]
fn a_taxel_that_speaks_late_has_the_steps_of_its_hand_and_a_new_calibration_finds_them_anew() {
    let mut hand = Stepped::new(vec![[64.0; 3]; 16], 0.2);
    let late = |frame: &mut TactileFrame| frame.freshness[5] = Freshness::Missing;
    while hand.skin.conditioner.is_calibrating() {
        hand.step_with(late);
    }
    let threshold = hand.skin.conditioner.threshold();
    assert!((64.0..200.0).contains(&threshold), "{threshold}");
    // Between two steps it is at the one above in every ninth sample, and no other sample tells that these are no outliers.
    let mut i = 0;
    while !hand.skin.conditioner.has_baseline(5) {
        i += 1;
        hand.step_with(|frame| {
            frame.freshness[5] = Freshness::Fresh;
            frame.counts[5] = [6_400, 6_400, 6_400 + 64 * u16::from(i % 9 == 0)];
        });
        assert!(i < 100);
    }
    let [_, _, z] = hand.skin.conditioner.baseline()[5];
    assert!((6_405.0..6_410.0).contains(&z), "{z}");

    // The same taxels of one count's resolution from now on: their steps are 1 again.
    hand.steps.fill([1.0; 3]);
    hand.rest
        .iter_mut()
        .for_each(|rest| *rest = rest.map(|r| 64.0 * r));
    hand.skin.conditioner.rezero();
    let mut frames = 0;
    while hand.skin.conditioner.is_calibrating() {
        frames += 1;
        let spike = 64 * u16::from(frames % 7 == 0);
        hand.step_with(|frame| frame.counts[..8].iter_mut().for_each(|c| c[2] += spike));
    }
    assert_eq!(hand.skin.conditioner.threshold(), 10.0);
    // And once more, over a clock that goes back in the middle of the window.
    hand.steps.fill([64.0; 3]);
    hand.rest
        .iter_mut()
        .for_each(|rest| *rest = rest.map(|r| r / 64.0));
    hand.skin.conditioner.rezero();
    (0..20).for_each(|_| hand.step_with(|_| {}));
    hand.skin.frame.t_ns = 0;
    hand.check("after the clock went back");
}
