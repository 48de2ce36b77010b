//! Faults that come and go.

use super::skin::{Skin, calibrated, press, robust};
use taxel_hand::{Fault, Freshness};
use taxel_skin::ConditionConfig;

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
fn a_chip_that_does_not_answer_is_dead_whatever_its_status_byte_reads() {
    for (rail, status) in [(u16::MAX, 0xFF), (0, 0x10), (0, 0)] {
        let mut skin = calibrated(2);
        for _ in 0..3 {
            skin.step_with(|f| (f.counts[1], f.status[1]) = ([rail; 3], status));
        }
        let reasons: Vec<Fault> = skin.out.faults[1].iter().collect();
        assert_eq!(reasons, [Fault::Dead], "rail {rail}, status {status:#04x}");
        skin.frame.status[1] = 0;
        skin.run_ms(100);
        assert!(skin.out.faults[1].is_empty());
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
    let mut skin = robust(4);
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
    let mut skin = robust(4);
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
    let mut skin = robust(16);
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
    let counters = skin.conditioner.counters();
    assert_eq!((counters.status_errors, counters.dead_samples), (2, 0));
}

#[test]
fn a_chip_that_does_not_answer_is_counted_as_dead_and_by_its_status() {
    let mut skin = calibrated(2);
    for _ in 0..3 {
        let out = skin.step_with(|f| (f.status[1], f.counts[1]) = (0xFF, [u16::MAX; 3]));
        assert!(!out.faults[1].is_empty() && out.force[1] == 0.0);
    }
    let counters = skin.conditioner.counters();
    assert_eq!((counters.status_errors, counters.dead_samples), (3, 3));
    assert_eq!(skin.out.faults[1].iter().collect::<Vec<_>>(), [Fault::Dead]);
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
