//! A hand's life: calibration, touch, drift, re-zero.

use super::skin::{MS, Skin, calibrated, press, robust};
use taxel_hand::{Fault, ForceFrame, TactileFrame};
use taxel_skin::ConditionConfig;

#[test]
fn calibration_takes_its_time_at_every_rate_and_feels_nothing_meanwhile() {
    // 1.5 s and ten frames, then up to 50 ms of judging or the next frame.
    for (rate_hz, least_ms, most_ms) in [
        (1, 9_000, 12_000),
        (10, 1_500, 1_800),
        (30, 1_500, 1_650),
        (1_000, 1_500, 1_560),
    ] {
        let mut skin = Skin::new(240, rate_hz, ConditionConfig::robust());
        let mut progress = 0.0;
        while skin.step().calibrating {
            assert!(skin.out.contacts() == 0 && skin.out.force.iter().all(|f| *f == 0.0));
            let now = skin.conditioner.calibration_progress();
            assert!(now >= progress, "{rate_hz} Hz: {now} after {progress}");
            progress = now;
            assert!(skin.frame.t_ns < 60_000 * MS);
        }
        let took_ms = (skin.frame.t_ns - 2 * skin.interval_ns) / MS;
        assert!(
            (least_ms..=most_ms).contains(&took_ms),
            "{rate_hz} Hz: {took_ms} ms"
        );
        let report = skin.conditioner.report().expect("calibrated");
        assert_eq!(
            (report.faulty, report.touched, report.without_baseline),
            (0, 0, 0),
            "{rate_hz} Hz: {report:?}"
        );
        for (baseline, truth) in skin.conditioner.baseline().iter().zip(&skin.truth) {
            for a in 0..3 {
                assert!(
                    (baseline[a] - f64::from(truth[a])).abs() < 20.0,
                    "{rate_hz} Hz: {baseline:?} for {truth:?}"
                );
            }
        }
        for _ in 0..300 {
            assert_eq!(skin.step().contacts(), 0, "{rate_hz} Hz: idle");
        }
    }
}

#[test]
fn force_is_the_distance_from_the_baseline_and_the_frame_carries_the_threshold() {
    let mut skin = calibrated(2);
    skin.truth[1][0] += 300;
    skin.truth[1][1] += 400;
    let out = skin.step();
    assert!(
        (out.force[1] - 500.0).abs() < 40.0 && out.contact[1] && !out.contact[0],
        "{out:?}"
    );
    assert_eq!(skin.out.threshold, skin.conditioner.threshold());
    assert!(
        skin.out.threshold > 30.0 && skin.out.threshold < 100.0,
        "{}",
        skin.out.threshold
    );
}

#[test]
fn values_that_are_not_new_are_not_counted_again() {
    // A 1 kHz tick on a 25 Hz skin: each value is seen forty times, with growing age.
    let mut skin = Skin::new(4, 25, ConditionConfig::robust());
    let mut out = ForceFrame::new(4);
    for _ in 0..200 {
        skin.step();
        let (mut again, t_ns) = (skin.frame.clone(), skin.frame.t_ns);
        for ms in 1..40 {
            again.t_ns = t_ns + ms * MS;
            again.age_ns.fill(ms * MS);
            skin.conditioner.process(&again, &mut out);
        }
        // The next frame of the skin is 40 ms after the last.
        assert!(out.faults.iter().all(|f| f.is_empty()), "{:?}", out.faults);
    }
    assert_eq!(skin.conditioner.counters().samples, 4 * 200);
    assert!(skin.conditioner.report().expect("calibrated").frames <= 39);
    press(&mut skin, 0, 900);
    let felt = skin.step().clone();
    let mut again = skin.frame.clone();
    again.t_ns += 7 * MS;
    again.age_ns.fill(7 * MS);
    skin.conditioner.process(&again, &mut out);
    assert_eq!((out.force[0], out.contact[0]), (felt.force[0], true));
}

#[test]
fn a_touch_during_calibration_is_reported_and_does_not_raise_the_threshold() {
    let alone = calibrated(16).conditioner.threshold();
    let mut skin = robust(16);
    skin.run_ms(700);
    for n in [3, 4] {
        press(&mut skin, n, 2_000);
    }
    skin.calibrate();
    let report = skin.conditioner.report().expect("calibrated").clone();
    assert!(report.is_touched() && report.touched == 2, "{report:?}");
    assert!(skin.conditioner.touched()[3] && !skin.conditioner.touched()[5]);
    assert!(skin.conditioner.threshold() < 1.5 * alone);
    assert_eq!(report.faulty, 0, "a touch is no fault");
}

#[test]
fn what_a_calibration_found_stands_until_the_next_one_has_ended() {
    let mut skin = calibrated(64);
    let found = skin.conditioner.report().cloned();
    skin.conditioner.rezero();
    while skin.conditioner.is_calibrating() {
        assert_eq!(skin.conditioner.report(), found.as_ref());
        skin.step();
    }
    assert_ne!(skin.conditioner.report(), found.as_ref());
}

#[test]
fn a_rezero_takes_what_is_held_as_rest_and_a_second_one_lets_go() {
    let mut skin = calibrated(2);
    press(&mut skin, 1, 900);
    skin.run_ms(100);
    assert!(skin.out.contact[1]);
    skin.conditioner.rezero();
    assert!(skin.conditioner.is_calibrating() && skin.conditioner.calibration_progress() == 0.0);
    assert!(skin.step().calibrating && skin.out.contacts() == 0);
    skin.calibrate();
    skin.run_ms(100);
    assert_eq!((skin.out.calibrating, skin.out.contacts()), (false, 0));
    press(&mut skin, 1, -900);
    skin.run_ms(100);
    assert!(skin.out.contact[1]);
    skin.conditioner.rezero();
    skin.calibrate();
    skin.run_ms(100);
    assert_eq!(skin.out.contacts(), 0);
}

#[test]
fn a_lasting_contact_is_never_erased() {
    let mut skin = Skin::new(2, 10, ConditionConfig::robust());
    skin.calibrate();
    let counts = 2 * skin.conditioner.threshold() as i32;
    press(&mut skin, 1, counts);
    skin.run_ms(100);
    let before = skin.conditioner.baseline()[1];
    skin.run_ms(3_600_000);
    assert!(skin.out.contact[1], "after an hour");
    assert_eq!(skin.conditioner.baseline()[1], before);
}

#[test]
fn slow_drift_is_followed_while_untouched_to_its_limit_and_said() {
    let mut skin = Skin::new(2, 10, ConditionConfig::robust());
    skin.calibrate();
    // One count per axis every ten seconds, for an hour: 360 counts, several times the threshold.
    for _ in 0..360 {
        for a in 0..3 {
            skin.truth[1][a] += 1;
        }
        skin.run_ms(10_000);
        assert_eq!(skin.out.contacts(), 0);
    }
    assert!((skin.conditioner.baseline()[1][0] - f64::from(skin.truth[1][0])).abs() < 20.0);
    assert_eq!(skin.conditioner.drifted(), 0);

    let config = ConditionConfig {
        drift_limit_counts: 100.0,
        ..ConditionConfig::robust()
    };
    let mut skin = Skin::new(2, 10, config);
    skin.calibrate();
    for _ in 0..120 {
        skin.truth[1][0] += 1;
        skin.run_ms(10_000);
    }
    assert_eq!(
        (
            skin.conditioner.drifted(),
            skin.conditioner.counters().drift_limited > 0
        ),
        (1, true)
    );

    let mut skin = Skin::new(
        1,
        10,
        ConditionConfig {
            follow_drift: false,
            ..ConditionConfig::robust()
        },
    );
    skin.calibrate();
    let before = skin.conditioner.baseline()[0];
    skin.run_ms(60_000);
    assert_eq!(skin.conditioner.baseline()[0], before);
}

#[test]
fn frames_of_another_hand_and_clocks_that_go_back_are_counted_and_survived() {
    let mut skin = calibrated(3);
    let other = TactileFrame::new(2);
    let mut out = ForceFrame::default();
    skin.conditioner.process(&other, &mut out);
    assert_eq!(out.faults.len(), 3);
    assert!(out.faults.iter().all(|f| f.contains(Fault::Missing)));
    assert_eq!(skin.conditioner.counters().mismatched_frames, 1);

    skin.frame.t_ns = 0;
    skin.run_ms(200);
    assert_eq!(skin.conditioner.counters().clock_restarts, 1);
    assert!(skin.out.faults.iter().all(|f| f.is_empty()) && skin.out.contacts() == 0);
    press(&mut skin, 0, 900);
    skin.run_ms(20);
    assert!(skin.out.contact[0]);
}

#[test]
fn the_same_frames_give_the_same_forces_to_the_bit() {
    let run = || {
        let mut skin = robust(6);
        let mut all = Vec::new();
        for i in 0..600 {
            if i == 300 {
                press(&mut skin, 2, 40_000);
            }
            all.extend(skin.step().force.iter().map(|f| f.to_bits()));
        }
        all
    };
    assert_eq!(run(), run());
}
