//! A hand's life: calibration, touch, faults that come and go, drift, re-zero.

use taxel_skin::{
    BaselineSource, ConditionConfig, ConditionError, Conditioner, Fault, FaultRule, ForceFrame, Freshness,
    MagnitudeMode, TactileFrame, ThresholdSource,
};

use crate::skin::{MS, Skin};

fn skin(taxels: usize) -> Skin {
    Skin::new(taxels, 100, ConditionConfig::robust())
}

fn calibrated(taxels: usize) -> Skin {
    let mut skin = skin(taxels);
    skin.calibrate();
    skin
}

fn press(skin: &mut Skin, taxel: usize, counts: i32) {
    skin.truth[taxel][0] += counts / 3;
    skin.truth[taxel][1] += counts / 3;
    skin.truth[taxel][2] -= counts;
}

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
fn a_taxel_that_dies_is_flagged_after_three_samples_and_recovers_when_it_speaks() {
    for rail in [0, u16::MAX] {
        let mut skin = calibrated(4);
        for i in 1..=6 {
            let out = skin.step_with(|f| f.counts[2] = [rail; 3]);
            assert_eq!(
                out.faults[2].contains(Fault::Dead),
                i >= 3,
                "rail {rail}, sample {i}"
            );
            assert!(!out.contact[2] && out.contacts() == 0);
        }
        let mut alive_after = None;
        for i in 1..=10 {
            let out = skin.step();
            assert_eq!(out.contacts(), 0);
            if out.faults[2].is_empty() {
                alive_after.get_or_insert(i);
            }
        }
        assert_eq!(alive_after, Some(5), "rail {rail}");
        press(&mut skin, 2, 900);
        skin.run_ms(20);
        assert!(skin.out.contact[2]);
    }
}

#[test]
fn a_single_sample_at_the_rails_is_held_back() {
    let mut skin = calibrated(1);
    let out = skin.step_with(|f| f.counts[0] = [u16::MAX; 3]);
    assert!(out.repaired[0] && !out.contact[0] && out.faults[0].is_empty());
}

#[test]
fn a_taxel_dead_throughout_calibration_finds_its_own_baseline_later() {
    let mut skin = skin(4);
    while skin.step_with(|f| f.counts[1] = [0; 3]).calibrating {}
    let report = skin.conditioner.report().expect("calibrated").clone();
    assert_eq!(
        (
            report.faulty,
            report.faulty_for(Fault::Dead),
            report.without_baseline
        ),
        (1, 1, 1)
    );
    skin.run_ms(1_000);
    assert!(
        skin.out.faults[1].contains(Fault::Dead),
        "no baseline yet, so it may not be felt"
    );
    skin.run_ms(1_000);
    assert!(
        skin.out.faults[1].is_empty() && skin.out.contacts() == 0,
        "{:?}",
        skin.out
    );
    press(&mut skin, 1, 900);
    skin.run_ms(20);
    assert!(
        skin.out.contact[1] && (skin.out.force[1] - 995.0).abs() < 60.0,
        "{:?}",
        skin.out.force
    );
}

#[test]
fn a_stuck_taxel_is_flagged_in_calibration_and_at_run_time() {
    let mut skin = skin(4);
    skin.noise[3] = [0; 3];
    skin.calibrate();
    skin.step();
    assert!(skin.out.faults[3].contains(Fault::Stuck));
    assert_eq!(
        skin.conditioner
            .report()
            .expect("calibrated")
            .faulty_for(Fault::Stuck),
        1
    );
    skin.noise[3] = skin.noise[0];
    skin.run_ms(2_000);
    assert!(
        skin.out.faults[3].is_empty(),
        "it varies again and has a baseline"
    );

    skin.noise[0] = [0; 3];
    skin.run_ms(1_900);
    assert!(skin.out.faults[0].is_empty());
    skin.run_ms(200);
    assert!(skin.out.faults[0].contains(Fault::Stuck));
    skin.noise[0] = skin.noise[1];
    skin.run_ms(50);
    assert!(skin.out.faults[0].is_empty());
}

#[test]
fn one_noisy_taxel_is_flagged_and_does_not_blind_the_hand() {
    let alone = calibrated(16).conditioner.threshold();
    let mut skin = skin(16);
    skin.noise[5] = [3_000; 3];
    skin.calibrate();
    let report = skin.conditioner.report().expect("calibrated").clone();
    assert_eq!(
        (report.faulty, report.faulty_for(Fault::Noisy)),
        (1, 1),
        "{report:?}"
    );
    assert!(
        skin.conditioner.threshold() < 1.5 * alone,
        "{} against {alone}",
        skin.conditioner.threshold()
    );
    press(&mut skin, 6, 300);
    skin.run_ms(50);
    assert!(skin.out.contact[6] && !skin.out.contact[5] && skin.out.force[5] == 0.0);
}

#[test]
fn a_taxel_that_becomes_noisy_is_flagged_and_forgiven() {
    let mut skin = calibrated(4);
    skin.noise[1] = [2_000; 3];
    skin.run_ms(2_000);
    assert!(skin.out.faults[1].contains(Fault::Noisy));
    skin.noise[1] = skin.noise[0];
    skin.run_ms(3_000);
    assert!(skin.out.faults[1].is_empty());
}

#[test]
fn hard_and_fast_presses_are_no_fault() {
    let mut skin = Skin::new(4, 30, ConditionConfig::robust());
    skin.calibrate();
    let rest = skin.truth.clone();
    for i in 0..600 {
        // Half a second of contact every second, to 20,000 counts and back within four frames.
        let level = [0, 0, 2, 7, 12, 16, 19, 20, 20, 18, 12, 6, 2, 0, 0][i % 15];
        skin.truth[2] = std::array::from_fn(|a| rest[2][a] + [-500, 300, -1_000][a] * level);
        skin.step();
        assert!(
            skin.out.faults[2].is_empty(),
            "frame {i}: {:?}",
            skin.out.faults[2]
        );
    }
}

#[test]
fn a_bad_status_byte_excludes_the_sample_and_only_it() {
    let mut skin = calibrated(2);
    for status in [0x10, 0xFF] {
        let out = skin.step_with(|f| (f.status[1], f.counts[1]) = (status, [9; 3]));
        assert!(out.faults[1].contains(Fault::Status) && !out.contact[1] && out.force[1] == 0.0);
        let out = skin.step_with(|f| f.status[1] = 0);
        assert!(out.faults[1].is_empty() && !out.contact[1]);
    }
    assert_eq!(skin.conditioner.counters().status_errors, 2);
}

#[test]
fn masked_missing_and_stale_taxels_are_named() {
    let config = ConditionConfig {
        masked_taxels: vec![0],
        ..ConditionConfig::robust()
    };
    let mut skin = Skin::new(4, 100, config);
    skin.calibrate();
    for n in 0..4 {
        press(&mut skin, n, 900);
    }
    let out = skin.step_with(|f| {
        f.freshness[1] = Freshness::Missing;
        f.freshness[2] = Freshness::Stale;
    });
    assert!(out.faults[0].contains(Fault::Masked));
    assert!(out.faults[1].contains(Fault::Missing) && out.faults[2].contains(Fault::Missing));
    assert_eq!(
        (&out.contact[..], &out.force[..3]),
        (&[false, false, false, true][..], &[0.0; 3][..])
    );
}

#[test]
fn a_touch_during_calibration_is_reported_and_does_not_raise_the_threshold() {
    let alone = calibrated(16).conditioner.threshold();
    let mut skin = skin(16);
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
fn thresholds_per_taxel_let_quiet_taxels_feel_less() {
    let config = ConditionConfig {
        threshold_per_taxel: true,
        ..ConditionConfig::robust()
    };
    let mut skin = Skin::new(3, 100, config);
    skin.noise[0] = [1, 1, 1];
    skin.calibrate();
    assert_eq!(skin.conditioner.threshold_of(0), 10.0, "the least threshold");
    assert!(skin.conditioner.threshold_of(1) > 30.0);
    for n in 0..2 {
        skin.truth[n][0] += 20;
    }
    skin.run_ms(30);
    assert!(skin.out.contact[0] && !skin.out.contact[1]);
}

#[test]
fn the_paper_preset_is_equations_1_and_2_on_two_frames() {
    let mut conditioner = Conditioner::new(5, ConditionConfig::paper()).expect("valid");
    let (mut frame, mut out) = (TactileFrame::new(5), ForceFrame::new(5));
    frame.freshness[..4].fill(Freshness::Fresh);
    frame.age_ns[..4].fill(0);
    // x of frame 0: 10, 10, 10, 50: mean 20, population sd 17.3, so taxel 3 is faulty; taxel 4 is absent.
    let frames = [
        [[10, 1, 2], [10, 1, 2], [10, 1, 2], [50, 1, 2]],
        [[11, 1, 2], [10, 1, 3], [10, 1, 2], [90, 1, 2]],
        [[11, 1, 2], [12, 1, 2], [8, 1, 2], [50, 9, 9]],
    ];
    // Taxel 4 never speaks, so frame 0 is the tenth, when waiting ends.
    for counts in std::iter::repeat_n(frames[0], 10).chain([frames[1], frames[2]]) {
        frame.t_ns += 33 * MS;
        frame.counts[..4].copy_from_slice(&counts);
        conditioner.process(&frame, &mut out);
    }
    assert_eq!(
        conditioner.threshold(),
        21.0,
        "the largest of |121-100|, |9-4|; the faulty taxel's 5600 is left out"
    );
    assert_eq!(out.force, [21.0, 44.0, 36.0, 0.0, 0.0]);
    assert_eq!(
        out.contact,
        [false, true, true, false, false],
        "strictly above 21"
    );
    assert!(out.faults[3].contains(Fault::PaperRule) && out.faults[4].contains(Fault::Missing));
    assert_eq!(
        conditioner
            .report()
            .expect("calibrated")
            .faulty_for(Fault::PaperRule),
        1
    );
}

#[test]
fn every_switch_of_the_paper_preset_works_on_its_own() {
    let robust = ConditionConfig::robust;
    for config in [
        ConditionConfig {
            baseline: BaselineSource::FirstFrame,
            ..robust()
        },
        ConditionConfig {
            threshold: ThresholdSource::FirstPair,
            threshold_margin: 4.0,
            ..robust()
        },
        ConditionConfig {
            fault_rule: FaultRule::Paper,
            paper_sigmas: 10.0,
            ..robust()
        },
        ConditionConfig {
            magnitude: MagnitudeMode::Literal,
            ..robust()
        },
        ConditionConfig {
            magnitude: MagnitudeMode::LiteralSquared,
            ..robust()
        },
        ConditionConfig {
            magnitude: MagnitudeMode::VectorSquared,
            ..robust()
        },
    ] {
        let mut skin = Skin::new(8, 100, config.clone());
        skin.calibrate();
        assert!(skin.conditioner.threshold() > 0.0, "{config:?}");
        for a in 0..3 {
            skin.truth[4][a] += 5_000;
        }
        skin.run_ms(50);
        assert!(
            skin.out.contact[4],
            "{config:?}: {:?}, theta {}",
            skin.out.force, skin.out.threshold
        );
    }
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
        let mut skin = skin(6);
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

#[test]
fn settings_read_from_toml_refuse_unknown_keys_and_values_out_of_range() {
    let config: ConditionConfig =
        toml::from_str("magnitude = \"literal_squared\"\nmasked_taxels = [3]\n").expect("valid");
    assert_eq!(config.magnitude, MagnitudeMode::LiteralSquared);
    assert_eq!(
        config.threshold_margin,
        ConditionConfig::robust().threshold_margin
    );
    let paper = toml::to_string(&ConditionConfig::paper()).expect("serializable");
    assert_eq!(
        toml::from_str::<ConditionConfig>(&paper).expect("its own output"),
        ConditionConfig::paper()
    );
    assert!(toml::from_str::<ConditionConfig>("treshold_margin = 2.0").is_err());

    assert!(matches!(
        Conditioner::new(3, config).err(),
        Some(ConditionError::MaskedTaxel { taxel: 3, taxels: 3 })
    ));
    assert_eq!(
        Conditioner::new(0, ConditionConfig::robust()).err(),
        Some(ConditionError::Taxels { taxels: 0 })
    );
    let robust = ConditionConfig::robust;
    for (config, key) in [
        (
            ConditionConfig {
                threshold_margin: f64::NAN,
                ..robust()
            },
            "threshold_margin",
        ),
        (
            ConditionConfig {
                threshold_margin: 0.5,
                ..robust()
            },
            "threshold_margin",
        ),
        (
            ConditionConfig {
                threshold_release: 1.5,
                ..robust()
            },
            "threshold_release",
        ),
        (
            ConditionConfig {
                calibration_ms: 0,
                ..robust()
            },
            "calibration_ms",
        ),
        (
            ConditionConfig {
                calibration_min_frames: 1,
                ..robust()
            },
            "calibration_min_frames",
        ),
        (
            ConditionConfig {
                paper_sigmas: 0.0,
                ..robust()
            },
            "paper_sigmas",
        ),
        (
            ConditionConfig {
                drift_quiet_share: 0.9,
                ..robust()
            },
            "drift_quiet_share",
        ),
        (
            ConditionConfig {
                jump_counts: 70_000,
                ..robust()
            },
            "jump_counts",
        ),
    ] {
        match Conditioner::new(3, config) {
            Err(ConditionError::OutOfRange { key: found, .. }) => assert_eq!(found, key),
            other => panic!("{key}: {:?}", other.err()),
        }
    }
}
