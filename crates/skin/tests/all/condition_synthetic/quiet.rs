//! Counts that do not change at rest, or hardly: simulated skins, eight bits, noise below half a count.

use super::skin::{Skin, press, robust};
use taxel_hand::{Fault, Freshness};
use taxel_skin::{Calibrated, ConditionConfig, Conditioner, Layout};

/// A skin without noise.
fn quiet(taxels: usize, rate_hz: u64) -> Skin {
    let mut skin = Skin::new(taxels, rate_hz, ConditionConfig::robust());
    skin.noise.fill([0; 3]);
    skin
}

/// What is known of a skin by now.
fn known(skin: &Skin) -> Calibrated {
    Calibrated {
        threshold: skin.conditioner.threshold(),
        baseline: skin
            .conditioner
            .baseline()
            .iter()
            .map(|b| b.map(|axis| axis as f32))
            .collect(),
        contact: skin.out.contact.clone(),
        faults: skin.out.faults.clone(),
    }
}

#[test]
fn a_skin_that_never_changes_at_rest_is_felt_from_the_first_frame_of_a_touch_to_its_last() {
    for rate_hz in [10, 30, 1_000] {
        let mut skin = quiet(16, rate_hz);
        skin.calibrate();
        skin.run_ms(5_000);
        assert!(skin.out.faults.iter().all(|faults| faults.contains(Fault::Stuck)));
        let rest = skin.truth.clone();
        let levels = [1, 4, 11, 40, 90, 200, 200, 150, 40, 11, 8, 4, 0];
        for (i, level) in levels.into_iter().enumerate() {
            for n in [5, 6] {
                skin.truth[n] = [rest[n][0] + level, rest[n][1], rest[n][2]];
            }
            skin.step();
            let felt = &skin.out;
            assert_eq!(felt.force[5], f64::from(level), "{rate_hz} Hz, frame {i}");
            // 10 counts begin a contact, 8 end it.
            assert_eq!(felt.contact[5], (2..10).contains(&i), "{rate_hz} Hz, frame {i}");
            assert!(felt.faults[5].is_empty() && felt.faults[4].contains(Fault::Stuck));
            assert_eq!(felt.contacts(), 2 * usize::from(felt.contact[5]));
            // It is also held without a change, at the strongest.
            if i == 6 {
                skin.run_ms(60_000);
                assert_eq!(
                    (skin.out.force[5], skin.out.contacts()),
                    (200.0, 2),
                    "{rate_hz} Hz"
                );
            }
        }
        skin.run_ms(60_000);
        assert_eq!((skin.out.contacts(), skin.out.force[5]), (0, 0.0), "{rate_hz} Hz");
        assert!(skin.out.faults[5].is_empty(), "it has proven that it lives");
    }
}

#[test]
fn a_skin_whose_counts_change_now_and_then_has_no_stuck_taxel_and_holds_what_is_held() {
    for (rate_hz, one_in) in [(10, 6), (30, 10), (30, 40), (100, 25), (100, 200)] {
        let mut skin = quiet(16, rate_hz);
        let mut seed = 9_u64;
        let mut step = |skin: &mut Skin| {
            skin.step_with(|frame| {
                for counts in &mut frame.counts {
                    seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(99);
                    counts[2] += u16::from((seed >> 33).is_multiple_of(one_in));
                }
            });
        };
        while skin.conditioner.is_calibrating() {
            step(&mut skin);
        }
        press(&mut skin, 3, 900);
        for second in 0..60 {
            for _ in 0..rate_hz {
                step(&mut skin);
            }
            let case = format!("{rate_hz} Hz, one in {one_in}, second {second}");
            assert!(skin.out.contact[3] && skin.out.contacts() == 1, "{case}");
            assert!((skin.out.force[3] - 995.0).abs() < 2.0, "{case}");
        }
        let stuck = |n: &usize| skin.out.faults[*n].contains(Fault::Stuck);
        assert_eq!((0..16).filter(stuck).count(), 0, "{rate_hz} Hz, one in {one_in}");
    }
}

#[test]
fn a_stuck_taxel_of_a_hand_with_noise_is_found_each_time_and_rests_at_where_it_was() {
    let mut skin = robust(16);
    skin.noise[3] = [0; 3];
    skin.calibrate();
    skin.run_ms(3_000);
    assert_eq!(skin.out.faults[3].iter().collect::<Vec<_>>(), [Fault::Stuck]);
    for _ in 0..3 {
        skin.noise[3] = skin.noise[0];
        press(&mut skin, 3, 900);
        skin.run_ms(20);
        assert!(skin.out.contact[3] && skin.out.faults[3].is_empty());
        assert!((skin.out.force[3] - 995.0).abs() < 60.0, "{}", skin.out.force[3]);
        press(&mut skin, 3, -900);
        skin.run_ms(1_000);
        assert_eq!((skin.out.contacts(), skin.out.faults[3].is_empty()), (0, true));
        skin.noise[3] = [0; 3];
        skin.run_ms(2_100);
        assert!(skin.out.faults[3].contains(Fault::Stuck) && skin.out.force[3] == 0.0);
    }
}

#[test]
fn a_touch_that_begins_as_the_window_ends_is_measured_from_where_the_taxel_rested() {
    let mut skin = quiet(240, 100);
    while skin.conditioner.calibration_progress() < 0.99 {
        skin.step();
    }
    // The taxels are judged over the next frames. This one has moved, and does not again.
    press(&mut skin, 239, 900);
    skin.calibrate();
    for _ in 0..500 {
        skin.step();
        assert!(
            skin.out.contact[239] && skin.out.contacts() == 1,
            "{:?}",
            skin.out.faults[239]
        );
    }
    press(&mut skin, 239, -900);
    assert_eq!(skin.step().contacts(), 0);
}

#[test]
fn a_taxel_of_a_quiet_skin_that_speaks_late_has_the_baseline_that_it_rests_at() {
    let mut skin = quiet(4, 100);
    let without = |frame: &mut taxel_hand::TactileFrame| frame.freshness[2] = Freshness::Missing;
    while skin.step_with(without).calibrating {}
    assert_eq!(skin.conditioner.report().expect("calibrated").without_baseline, 1);
    skin.frame.freshness[2] = Freshness::Fresh;
    skin.run_ms(2_000);
    assert_eq!(skin.out.faults[2].iter().collect::<Vec<_>>(), [Fault::Stuck]);
    press(&mut skin, 2, 900);
    skin.run_ms(20);
    assert!(
        skin.out.contact[2] && (skin.out.force[2] - 995.0).abs() < 1.0,
        "{:?}",
        skin.out.force
    );
    press(&mut skin, 2, -900);
    skin.run_ms(20);
    assert_eq!((skin.out.contacts(), skin.out.force[2]), (0, 0.0));
}

#[test]
fn a_skin_without_boards_may_rest_at_0_and_one_with_boards_is_dead_there() {
    for (layout, rests_at_zero) in [
        (Layout::grid(4, 4).unwrap(), true),
        (Layout::builtin("uskin-module").unwrap(), false),
    ] {
        let mut skin = quiet(16, 100);
        skin.conditioner = Conditioner::for_layout(&layout, ConditionConfig::robust()).unwrap();
        skin.truth.fill([0; 3]);
        skin.run_ms(2_000);
        let fault = if rests_at_zero { Fault::Stuck } else { Fault::Dead };
        assert!(
            skin.out.faults.iter().all(|faults| faults.contains(fault)),
            "{:?}",
            skin.out
        );
        for level in [0, 4, 12, 90, 150, 90, 12, 4, 0] {
            skin.truth[2] = [0, 0, level];
            skin.step();
            let felt = if rests_at_zero { f64::from(level) } else { 0.0 };
            assert_eq!((skin.out.force[2], skin.out.contact[2]), (felt, felt > 10.0));
        }
    }
    // One value in the first frame is enough: chips that read 0 beside it are silent.
    let mut skin = quiet(16, 100);
    skin.conditioner =
        Conditioner::for_layout(&Layout::grid(4, 4).unwrap(), ConditionConfig::robust()).unwrap();
    skin.truth[1..].fill([0; 3]);
    skin.run_ms(2_000);
    assert!(skin.out.faults[1].contains(Fault::Dead) && skin.out.faults[0].contains(Fault::Stuck));
}

#[test]
fn a_first_frame_of_zeros_is_no_rest_where_the_baseline_is_another() {
    let mut skin = Skin::new(16, 100, ConditionConfig::robust());
    let grid = Layout::grid(4, 4).unwrap();
    skin.conditioner = Conditioner::for_layout(&grid, ConditionConfig::robust()).unwrap();
    skin.step_with(|frame| frame.counts.fill([0; 3]));
    skin.calibrate();
    skin.run_ms(1_000);
    let known = known(&skin);
    for goes_on in [false, true] {
        if goes_on {
            skin.conditioner = Conditioner::for_layout(&grid, ConditionConfig::robust()).unwrap();
            skin.conditioner.go_on_from(&known);
            skin.step_with(|frame| frame.counts.fill([0; 3]));
            skin.step();
        }
        for i in 0..100 {
            skin.step_with(|frame| frame.counts[5] = [0; 3]);
            assert_eq!(skin.out.contacts(), 0, "{goes_on}, frame {i}");
        }
        assert_eq!(skin.out.faults[5].iter().collect::<Vec<_>>(), [Fault::Dead]);
    }
}

#[test]
fn what_is_held_still_is_held_by_who_goes_on_from_a_quiet_skin_too() {
    let mut skin = quiet(16, 100);
    skin.calibrate();
    press(&mut skin, 3, 900);
    skin.run_ms(5_000);
    let known = known(&skin);
    skin.conditioner = Conditioner::new(16, ConditionConfig::robust()).unwrap();
    skin.conditioner.go_on_from(&known);
    let faults = skin.out.faults.clone();
    skin.run_ms(5_000);
    assert!(skin.out.contact[3] && skin.out.contacts() == 1, "{:?}", skin.out);
    assert_eq!(skin.out.faults, faults);
    press(&mut skin, 4, 100);
    assert_eq!(skin.step().contacts(), 2);
}
