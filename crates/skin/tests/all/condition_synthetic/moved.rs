//! Hands that move in a part of the window that they are calibrated in.

use super::skin::Skin;
use taxel_skin::ConditionConfig;

const RATE_HZ: u64 = 60;
const TAXELS: usize = 16;

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

fn feels_nothing(hand: &mut Skin, case: &str) {
    for _ in 0..60 {
        hand.step_with(|_| {});
        assert_eq!(hand.out.contacts(), 0, "{case}");
    }
}

#[test]
fn a_hand_that_begins_to_move_while_it_is_calibrated_rests_as_before() {
    let still = calibrated(|_, _| 0.0);
    assert!(!still.conditioner.report().unwrap().moved);
    // It moves at the end, or until it comes to rest.
    for case in ["at the end", "at the beginning"] {
        let mut hand = calibrated(|n, t| match case {
            "at the end" => ramp(n, t, 1.05),
            _ => ramp(n, 0.45 - t, 0.0),
        });
        let report = hand.conditioner.report().unwrap();
        assert!(report.moved && report.is_touched(), "{case}");
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
        assert!(hand.conditioner.report().unwrap().moved, "{case}");
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
            assert!(!hand.conditioner.report().unwrap().moved, "{case}");
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
        assert!(!hand.conditioner.report().unwrap().moved, "{case}");
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
    assert!(!hand.conditioner.report().unwrap().moved);
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
