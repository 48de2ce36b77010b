//! Hands that move in a part of the window that they are calibrated in.

use super::noisy_hand::{NoisyHand, Normal, TAXELS};
use super::skin::Skin;
use taxel_hand::Fault;
use taxel_skin::{ConditionConfig, Movement};

const RATE_HZ: u64 = 60;

/// A hand that wobbles by a few counts, calibrated while `motion` of a taxel and a time in seconds is on its last axis.
fn calibrated(motion: impl Fn(usize, f64) -> f64) -> Skin {
    calibrated_with(|_| [2, 2, 3], motion)
}

/// ... and with noise of so many counts at a time.
fn calibrated_with(noise: impl Fn(f64) -> [i32; 3], motion: impl Fn(usize, f64) -> f64) -> Skin {
    let mut hand = Skin::new(TAXELS, RATE_HZ, ConditionConfig::robust());
    let rest = hand.truth.clone();
    let mut t = 0.0;
    while hand.conditioner.is_calibrating() {
        hand.noise.fill(noise(t));
        for (n, truth) in hand.truth.iter_mut().enumerate() {
            let wobble = 6.0 * (11.0 * t + n as f64).sin();
            truth[2] = rest[n][2] + (wobble + motion(n, t)).round() as i32;
        }
        hand.step_with(|_| {});
        t += 1.0 / RATE_HZ as f64;
    }
    hand.truth = rest;
    hand
}

/// Movement by tens of counts that begins at `begin_s`, slowly, and wobbles.
fn ramp(n: usize, t: f64, begin_s: f64) -> f64 {
    let since = (t - begin_s).max(0.0);
    (30.0 + 2.0 * n as f64) * (since / 0.2).min(1.0) * (1.0 + 0.4 * (16.0 * since).sin())
}

/// Checks that it rests where it is, and feels nothing.
fn check_rest(hand: &mut Skin, case: &str) {
    for (n, [.., z]) in hand.conditioner.baseline().iter().enumerate() {
        let off = z - f64::from(hand.truth[n][2]);
        assert!(off.abs() < 5.0, "{case}: taxel {n} rests {off} counts off");
    }
    feels_nothing(hand, case);
}

fn moved(hand: &Skin) -> Movement {
    hand.conditioner.report().unwrap().moved
}

fn feels_nothing(hand: &mut Skin, case: &str) {
    for _ in 0..60 {
        hand.step_with(|_| {});
        assert_eq!(hand.out.contacts(), 0, "{case}");
    }
}

#[test]
fn a_hand_that_begins_to_move_while_it_is_calibrated_rests_as_before() {
    let still = calibrated(|_, _| 0.0);
    assert_eq!(moved(&still), Movement::None);
    // It moves at the end, or until it comes to rest.
    for case in ["at the end", "at the beginning"] {
        let mut hand = calibrated(|n, t| match case {
            "at the end" => ramp(n, t, 1.05),
            _ => ramp(n, 0.45 - t, 0.0),
        });
        let report = hand.conditioner.report().unwrap();
        assert!(
            report.moved == Movement::InOneHalf && report.is_touched(),
            "{case}"
        );
        assert!(
            report.threshold < 1.4 * still.conditioner.threshold(),
            "{case}: {report:?}"
        );
        check_rest(&mut hand, case);
        hand.truth.iter_mut().for_each(|truth| truth[2] += 45);
        hand.step_with(|_| {});
        assert_eq!(hand.out.contacts(), TAXELS, "{case}");
    }
}

#[test]
fn a_hand_that_moves_for_more_than_half_of_the_time_it_is_calibrated_in_rests_as_in_the_rest_of_it() {
    // The half in which it is mostly still has outliers, the other has none.
    for case in ["at the end", "at the beginning"] {
        let mut hand = calibrated(|n, t| match case {
            "at the end" => 10.0 * ramp(n, t, 0.55),
            _ => 10.0 * ramp(n, 0.95 - t, 0.0),
        });
        assert_eq!(moved(&hand), Movement::InOneHalf, "{case}");
        // A jump back of hundreds of counts is held until the next sample confirms it.
        hand.step_with(|_| {});
        feels_nothing(&mut hand, case);
        hand.truth.iter_mut().for_each(|truth| truth[2] += 150);
        hand.step_with(|_| {});
        assert_eq!(hand.out.contacts(), TAXELS, "{case}");
    }
}

#[test]
fn noise_that_begins_or_ends_while_a_hand_is_calibrated_is_no_movement() {
    for (before, from_then_on) in [(1, 12), (2, 20), (12, 1)] {
        for at_s in [0.5, 0.75, 0.9, 1.1] {
            let case = format!("noise of {before} counts, and of {from_then_on} from {at_s} s on");
            let noise = |t: f64| if t < at_s { before } else { from_then_on };
            let mut hand = calibrated_with(|t| [noise(t); 3], |_, _| 0.0);
            assert_eq!(moved(&hand), Movement::None, "{case}");
            feels_nothing(&mut hand, &case);
        }
    }
}

#[test]
fn what_a_clean_touch_changes_while_it_is_calibrated_is_left_out() {
    // Which taxels, by how many counts, from when to when.
    for (taxels, by, begin_s, end_s) in [
        (16, 200.0, 0.0, 0.4),
        (16, 200.0, 0.5, 1.0),
        (16, 1_000.0, 1.0, 1.5),
        (9, 200.0, 1.0, 1.5),
        (16, 1_000.0, 0.9, 1.5),
        // Glitches: a first frame before the sensors measure, and one later.
        (16, -4_000.0, 0.0, 0.01),
        (16, 180.0, 0.7, 0.72),
    ] {
        let case = format!("{taxels} taxels by {by} counts from {begin_s} to {end_s} s");
        let mut hand = calibrated(|n, t| match n < taxels && (begin_s..end_s).contains(&t) {
            true => by,
            false => 0.0,
        });
        assert_eq!(moved(&hand), Movement::None, "{case}");
        check_rest(&mut hand, &case);
    }
}

#[test]
fn a_light_touch_for_half_the_time_puts_no_untouched_hand_in_contact() {
    // It is no outlier, and as still as what is before or after it.
    for (taxels, begin_s, end_s) in [(16, 0.8, 1.6), (8, 0.8, 1.6), (16, 0.0, 0.7), (8, 0.0, 0.7)] {
        let touch = |n: usize, t: f64| n < taxels && (begin_s..end_s).contains(&t);
        let mut hand = calibrated(|n, t| if touch(n, t) { 60.0 } else { 0.0 });
        for _ in 0..60 {
            hand.step_with(|_| {});
            assert_eq!(
                hand.out.contacts(),
                0,
                "{taxels} taxels from {begin_s} to {end_s} s"
            );
        }
    }
}

#[test]
fn a_hand_that_sways_all_the_time_while_it_is_calibrated_feels_nothing_when_it_sways_on() {
    let sway = |t: f64| 30.0 * (12.0 * t).sin();
    let mut hand = calibrated(|_, t| sway(t));
    assert_eq!(moved(&hand), Movement::InBothHalves);
    let rest = hand.truth.clone();
    for i in 0..120 {
        let t = f64::from(i) / RATE_HZ as f64;
        for (truth, rest) in hand.truth.iter_mut().zip(&rest) {
            truth[2] = rest[2] + sway(t).round() as i32;
        }
        hand.step_with(|_| {});
        assert_eq!(hand.out.contacts(), 0);
    }
}

#[test]
fn a_hand_that_moves_in_both_halves_of_the_time_it_is_calibrated_in_is_said_to() {
    // From when to when it moves by 300 counts, and whether it goes back.
    for (begin_s, end_s, back) in [
        (0.45, 1.05, false),
        (0.4, 1.1, true),
        (0.0, 1.5, false),
        (0.0, 6.0, false),
    ] {
        let mut hand = calibrated(|_, t| {
            let part = ((t - begin_s) / (end_s - begin_s)).clamp(0.0, 1.0);
            300.0
                * if back {
                    1.0 - (2.0 * part - 1.0).abs()
                } else {
                    part
                }
        });
        let report = hand.conditioner.report().unwrap();
        assert_eq!(report.moved, Movement::InBothHalves, "{begin_s} to {end_s} s");
        // Measured again while it is still, it is said no longer.
        hand.conditioner.rezero();
        hand.calibrate();
        assert_eq!(moved(&hand), Movement::None, "{begin_s} to {end_s} s");
    }
}

#[test]
fn a_hand_that_keeps_still_is_not_said_to_move_however_noisy_it_is() {
    for rate_hz in [15, 30, 100, 200] {
        for sigma in [0.3, 2.0, 20.0, 60.0] {
            for inertia in [0.0, 0.5, 0.8] {
                let case = format!("{rate_hz} Hz, noise of {sigma}, of which {inertia} stays");
                let noisy = NoisyHand::calibrated(rate_hz, inertia, |_, _| sigma);
                assert_eq!(moved(&noisy.hand), Movement::None, "{case}");
            }
        }
    }
}

#[test]
fn a_few_taxels_that_move_are_counted_and_rest_as_in_their_quieter_half() {
    // A finger that comes in the second half and stays, or is soon gone in it.
    for case in ["comes", "leaves"] {
        let hand = calibrated(|n, t| match case {
            _ if n >= 7 => 0.0,
            "comes" => 300.0 * ((t - 0.8) / 0.5).clamp(0.0, 1.0),
            _ => 300.0 * ((0.95 - t) / 0.8).clamp(0.0, 1.0),
        });
        assert_eq!(moved(&hand), Movement::Taxels(7), "{case}");
        let still = calibrated(|_, _| 0.0).conditioner.threshold();
        assert!(hand.conditioner.threshold() < 1.4 * still, "{case}");
        let mut hand = hand;
        // The jump back is held until the next sample confirms it.
        hand.step_with(|_| {});
        check_rest(&mut hand, case);
    }
    // One that comes and leaves.
    let hand = calibrated(|n, t| match n < 7 {
        true => 300.0 * ((t - 0.3) / 0.4).min((1.2 - t) / 0.5).clamp(0.0, 1.0),
        false => 0.0,
    });
    assert_eq!(moved(&hand), Movement::Taxels(7));
}

#[test]
fn a_light_touch_of_a_few_taxels_that_holds_still_moves_no_rest() {
    // It lies on them for about half of the time, and after it: in either half the level is one.
    for (begin_s, end_s) in [(0.8, 1.6), (0.0, 0.7)] {
        let touch = |n: usize, t: f64| n < 4 && (begin_s..end_s).contains(&t);
        let hand = calibrated(|n, t| if touch(n, t) { 60.0 } else { 0.0 });
        let baseline = hand.conditioner.baseline();
        let off = |n: usize| (baseline[n][2] - f64::from(hand.truth[n][2])).abs();
        assert!((0..4).all(|n| off(n) < 40.0), "{:?}", baseline);
        assert!((4..TAXELS).all(|n| off(n) < 5.0), "{:?}", baseline);
    }
}

#[test]
fn contact_is_above_normal_noise_that_begins_while_a_hand_is_calibrated() {
    for rate_hz in [30, 100, 400] {
        for at_s in [0.3, 0.5, 0.65, 0.75, 0.9, 1.1, 1.25] {
            let case = format!("from {at_s} s on at {rate_hz} Hz");
            let sigma = |_: usize, t: f64| if t < at_s { 2.0 } else { 20.0 };
            let mut noisy = NoisyHand::calibrated(rate_hz, 0.0, sigma);
            assert_eq!(moved(&noisy.hand), Movement::None, "{case}");
            let share = noisy.share_in_contact(1_000);
            assert!(share < 0.02, "{case}: {share} of the frames with contacts");
        }
    }
}

#[test]
fn noise_of_any_strength_in_a_part_of_the_time_a_hand_is_calibrated_in_is_no_movement() {
    for (begin_s, end_s) in [(0.0, 0.4), (0.5, 1.0), (0.75, 9.0), (1.1, 9.0)] {
        for loud in [10.0, 20.0, 40.0, 80.0, 800.0] {
            for rate_hz in [20, 60, 200] {
                let sigma = |_: usize, t: f64| if t >= begin_s && t < end_s { loud } else { 2.0 };
                let told: Vec<_> = (0..8)
                    .map(|seed| moved(&NoisyHand::calibrated_of(seed, rate_hz, 0.0, sigma).hand))
                    .filter(|moved| !matches!(moved, Movement::None | Movement::Noise))
                    .collect();
                let case = format!("noise of {loud} from {begin_s} to {end_s} s at {rate_hz} Hz");
                assert!(told.is_empty(), "{case}: {told:?}");
            }
        }
    }
}

#[test]
fn contact_is_above_loud_noise_that_begins_while_a_hand_is_calibrated() {
    // It takes the level of a quarter of that time as far as a touch does.
    for (rate_hz, at_s, most) in [(11, 0.9, 0.5), (20, 0.8, 0.2), (60, 0.9, 0.05), (100, 0.9, 0.02)] {
        for loud in [60.0, 200.0, 800.0] {
            let shares = (0..8).map(|seed| {
                let sigma = |_: usize, t: f64| if t < at_s { 2.0 } else { loud };
                NoisyHand::calibrated_of(seed, rate_hz, 0.0, sigma).share_in_contact(300)
            });
            let share = shares.sum::<f64>() / 8.0;
            let case = format!("noise of {loud} from {at_s} s on at {rate_hz} Hz");
            assert!(share < most, "{case}: {share} of the frames with contacts");
        }
    }
}

#[test]
fn slow_noise_that_begins_at_the_end_of_the_time_a_hand_is_calibrated_in_is_told() {
    // It is an outlier of most of that time, and cannot be told from movement.
    for rate_hz in [30, 60, 100, 200] {
        for loud in [100.0, 300.0, 1000.0] {
            for seed in 0..8 {
                let inertia = (-1.0 / (0.3 * rate_hz as f64)).exp();
                let sigma = |_: usize, t: f64| if t < 1.1 { 2.0 } else { loud };
                let noisy = NoisyHand::calibrated_of(seed, rate_hz, inertia, sigma);
                let case = format!("noise of {loud} that changes in 0.3 s, at {rate_hz} Hz");
                assert_eq!(moved(&noisy.hand), Movement::InOneHalf, "{case}");
            }
        }
    }
}

#[test]
fn a_touch_of_the_whole_hand_that_begins_when_its_calibration_ends_is_left_out() {
    // Where not even half of its last half is touched. It may tremble, from sample to sample.
    for tremble in [3, 15] {
        for frame in 69..90 {
            let begin_s = f64::from(frame) / RATE_HZ as f64;
            let is_touched = |t: f64| t > begin_s - 1e-6;
            let noise = |t: f64| if is_touched(t) { [tremble; 3] } else { [2, 2, 3] };
            let mut hand = calibrated_with(noise, |_, t| if is_touched(t) { 300.0 } else { 0.0 });
            let case = format!("from {begin_s} s on, trembling by {tremble}");
            assert_eq!(moved(&hand), Movement::None, "{case}");
            hand.noise.fill([2, 2, 3]);
            hand.step_with(|_| {});
            check_rest(&mut hand, &case);
        }
    }
}

#[test]
fn contact_is_above_noise_that_has_all_taxels_out_of_use_when_the_calibration_ends() {
    // It is over before that, or goes on.
    for (begin_s, end_s) in [(0.3, 1.1), (0.0, f64::INFINITY)] {
        for (rate_hz, loud) in [
            (30, 1000.0),
            (100, 300.0),
            (100, 400.0),
            (100, 1500.0),
            (200, 600.0),
        ] {
            let sigma = |_: usize, t: f64| if (begin_s..end_s).contains(&t) { loud } else { 2.0 };
            let mut noisy = NoisyHand::calibrated(rate_hz, 0.0, sigma);
            let report = noisy.hand.conditioner.report().unwrap().clone();
            let case = format!("noise of {loud} from {begin_s} to {end_s} s at {rate_hz} Hz: {report:?}");
            let noisy_taxels = report.faulty_for(Fault::Noisy);
            let is_told = report.moved == Movement::Noise;
            assert_eq!(is_told, 2 * noisy_taxels > TAXELS as u32, "{case}");
            let share = noisy.share_in_contact(1_000);
            assert!(share < 0.02, "{case}: {share} of the frames with contacts");
        }
    }
}

#[test]
fn dead_taxels_are_none_of_those_of_which_most_move() {
    // Of nine that are alive five move.
    let mut hand = Skin::new(TAXELS, RATE_HZ, ConditionConfig::robust());
    let rest = hand.truth.clone();
    let mut t = 0.0;
    while hand.conditioner.is_calibrating() {
        for (n, truth) in hand.truth.iter_mut().enumerate() {
            truth[2] = rest[n][2] + if n < 5 { (200.0 * t) as i32 } else { 0 };
            hand.noise[n] = [if n < 9 { 2 } else { 0 }; 3];
        }
        hand.step_with(|_| {});
        t += 1.0 / RATE_HZ as f64;
    }
    assert_eq!(moved(&hand), Movement::InBothHalves);
}

/// A skin without noise, of which the first taxels are pressed by so many counts in the time that it is calibrated in.
fn quiet_skin(taxels: usize, press: impl Fn(f64) -> f64) -> Skin {
    let mut skin = Skin::new(TAXELS, RATE_HZ, ConditionConfig::robust());
    skin.noise.fill([0; 3]);
    let rest = skin.truth.clone();
    let mut t = 0.0;
    while skin.conditioner.is_calibrating() {
        for (truth, rest) in skin.truth.iter_mut().zip(&rest).take(taxels) {
            truth[2] = rest[2] + press(t).round() as i32;
        }
        skin.step();
        t += 1.0 / RATE_HZ as f64;
    }
    skin.truth = rest;
    skin.run_ms(100);
    skin
}

#[test]
fn taxels_that_are_pressed_while_a_skin_without_noise_is_calibrated_are_not_the_hand() {
    for taxels in [1, 3, 7] {
        // From when to when, and how long it takes to press as much.
        for (begin_s, end_s, rise_s, moves) in [
            (0.2, 1.3, 0.4, true),
            (0.8, 1.5, 0.3, false),
            (0.9, 9.0, 0.3, false),
            (0.0, 0.6, 0.3, false),
        ] {
            let press = |t: f64| 300.0 * ((t - begin_s) / rise_s).min((end_s - t) / rise_s).clamp(0.0, 1.0);
            let mut skin = quiet_skin(taxels, press);
            let case = format!("{taxels} taxels from {begin_s} to {end_s} s");
            let told = if moves {
                Movement::Taxels(taxels as u32)
            } else {
                Movement::None
            };
            assert_eq!(moved(&skin), told, "{case}");
            assert_eq!(skin.conditioner.threshold(), 10.0, "{case}");
            skin.truth[12..15].iter_mut().for_each(|truth| truth[2] += 60);
            skin.run_ms(100);
            assert!(skin.out.contact[12..15].iter().all(|felt| *felt), "{case}");
        }
    }
}

#[test]
fn noise_of_a_few_taxels_among_those_that_keep_one_value_makes_the_threshold() {
    let mut hand = Skin::new(TAXELS, RATE_HZ, ConditionConfig::robust());
    for (n, noise) in hand.noise.iter_mut().enumerate() {
        *noise = [if n < 5 { 20 } else { 0 }; 3];
    }
    hand.calibrate();
    assert_eq!(moved(&hand), Movement::None);
    feels_nothing(&mut hand, "five of sixteen are alive");
}

#[test]
fn a_still_taxel_on_the_edge_of_a_step_does_not_move() {
    // In steps of 128 counts: noise takes most taxels up by one now and then, and the first for good, halfway.
    let mut hand = Skin::new(TAXELS, 100, ConditionConfig::robust());
    hand.noise.fill([0; 3]);
    let mut normal = Normal { seed: 3 };
    let mut frames = 0;
    while hand.conditioner.is_calibrating() {
        hand.step_with(|frame| {
            for (n, counts) in frame.counts.iter_mut().enumerate() {
                for count in counts {
                    let is_above = if n == 0 { frames > 75 } else { normal.next() > 0.7 };
                    *count = *count / 128 * 128 + if is_above { 128 } else { 0 };
                }
            }
        });
        frames += 1;
    }
    assert_eq!(moved(&hand), Movement::None);
}
