//! Wraps and glitches put into signals whose truth is known.

use proptest::prelude::*;
use taxel_hand::{Fault, Freshness};
use taxel_skin::ConditionConfig;

use super::skin::Skin;

fn quiet(taxels: usize) -> Skin {
    let mut skin = Skin::new(taxels, 100, ConditionConfig::robust());
    skin.noise = vec![[2, 2, 2]; taxels];
    skin
}

#[test]
fn a_press_that_wraps_twice_is_repaired_exactly_and_says_so() {
    let mut skin = quiet(2);
    skin.calibrate();
    skin.noise[1] = [0; 3];
    let rest = skin.truth[1];
    let depth = |i: i32| if i <= 100 { 900 * i } else { 900 * (200 - i) };
    for i in 0..=200 {
        skin.truth[1] = [
            rest[0] + depth(i) / 10,
            rest[1] - depth(i) / 3,
            rest[2] - depth(i),
        ];
        let expected = skin.truth[1];
        skin.step();
        assert_eq!(skin.conditioner.repaired_counts(1), expected, "frame {i}");
        assert_eq!(
            skin.out.repaired[1],
            expected.iter().any(|c| !(0..65_536).contains(c)),
            "frame {i}"
        );
        assert!(skin.out.faults[1].is_empty());
        let force = f64::from(depth(i)) * (1.0 + 0.01 + 1.0 / 9.0_f64).sqrt();
        assert!(
            (skin.out.force[1] - force).abs() < 3.0,
            "frame {i}: {} for {force}",
            skin.out.force[1]
        );
    }
    assert!(!skin.out.repaired[0]);
    // -77,500 and back crosses the border at 0 and at -65536, twice each.
    assert_eq!(skin.conditioner.counters().wraps, 4);
}

#[test]
fn one_byte_gone_wrong_in_one_sample_is_never_felt() {
    let mut skin = quiet(1);
    skin.calibrate();
    let mut rejected = 0;
    for (axis, flip) in (0..3).flat_map(|axis| (8..16).map(move |bit| (axis, 1u16 << bit))) {
        let before = skin.conditioner.repaired_counts(0);
        let out = skin.step_with(|f| f.counts[0][axis] ^= flip);
        assert!(
            out.repaired[0] && !out.contact[0],
            "axis {axis}, flip {flip:#06x}: {:?}",
            out.force
        );
        assert_eq!(skin.conditioner.repaired_counts(0), before);
        rejected += 1;
        for _ in 0..20 {
            let out = skin.step();
            assert!(
                !out.repaired[0] && !out.contact[0],
                "axis {axis}, flip {flip:#06x}: {:?}",
                out.force
            );
        }
        assert_eq!(skin.conditioner.counters().glitches, rejected);
    }
    assert!(
        skin.out.faults[0].is_empty(),
        "a glitch in twenty samples is no fault"
    );
}

#[test]
fn a_real_jump_of_one_axis_is_felt_one_sample_late_and_no_later() {
    for jump in [-300, 1_000, -12_000, 20_000] {
        let mut skin = quiet(1);
        skin.calibrate();
        skin.truth[0][2] += jump;
        assert!(!skin.step().contact[0], "{jump}: held back");
        let out = skin.step();
        assert!(
            out.contact[0] && (out.force[0] - f64::from(jump.abs())).abs() < 10.0,
            "{jump}: {:?}",
            out.force
        );
        assert_eq!(skin.conditioner.counters().glitches, 0);
    }
}

#[test]
fn a_press_on_all_axes_is_felt_at_once() {
    let mut skin = quiet(1);
    skin.calibrate();
    for axis in 0..3 {
        skin.truth[0][axis] -= 700;
    }
    assert!(skin.step().contact[0]);
}

#[test]
fn with_glitch_rejection_off_nothing_is_held_back() {
    let mut skin = Skin::new(
        1,
        100,
        ConditionConfig {
            reject_glitches: false,
            ..ConditionConfig::robust()
        },
    );
    skin.calibrate();
    let out = skin.step_with(|f| f.counts[0][0] ^= 0x0800);
    assert!(out.contact[0] && !out.repaired[0]);
}

#[test]
fn frames_lost_around_a_wrap_cost_nothing_while_the_step_is_below_half_a_turn() {
    let mut skin = quiet(1);
    skin.calibrate();
    let rest = skin.truth[0];
    for i in 1..=120 {
        let depth = if i <= 60 { i } else { 120 - i };
        skin.truth[0] = [rest[0], rest[1] + 40 * depth, rest[2] - 700 * depth];
        let expected = skin.truth[0];
        let lost = i % 10 < 4;
        let freshness = if lost { Freshness::Stale } else { Freshness::Fresh };
        let out = skin.step_with(|f| f.freshness[0] = freshness);
        assert_eq!(out.faults[0].contains(Fault::Missing), lost);
        if !lost {
            let z = skin.conditioner.repaired_counts(0)[2];
            assert!(
                (z - expected[2]).abs() <= 5 * 700 + 4,
                "frame {i}: {z} for {}",
                expected[2]
            );
        }
    }
    skin.truth[0] = rest;
    skin.run_ms(100);
    assert!(
        !skin.out.repaired[0] && !skin.out.contact[0],
        "{:?}",
        skin.conditioner.repaired_counts(0)
    );
}

#[test]
fn a_wrong_turn_is_put_right_when_the_taxel_comes_to_rest_and_is_counted() {
    let mut skin = quiet(1);
    skin.calibrate();
    let rest = skin.truth[0];
    // Down by 30,000 in slow steps, then a loss of frames in which it goes on by 40,000: the
    // nearest way is up.
    for i in 1..=30 {
        skin.truth[0][2] = rest[2] - 1_000 * i;
        skin.step();
    }
    for i in 1..=40 {
        skin.truth[0][2] -= 1_000;
        if i < 40 {
            skin.step_with(|f| f.freshness[0] = Freshness::Stale);
        }
    }
    skin.frame.freshness[0] = Freshness::Fresh;
    for i in (1..=70).rev() {
        skin.truth[0][2] = rest[2] - 1_000 * i;
        skin.step();
    }
    skin.truth[0] = rest;
    skin.run_ms(300);
    assert!(!skin.out.contact[0] && !skin.out.repaired[0]);
    let got = skin.conditioner.repaired_counts(0);
    assert!((got[2] - rest[2]).abs() <= 2, "{got:?} for {rest:?}");
    let counters = skin.conditioner.counters();
    assert!(counters.recoveries + counters.long_ways >= 1, "{counters:?}");
}

#[test]
fn a_wrong_turn_is_put_right_also_where_the_counts_are_within_the_border() {
    let config = ConditionConfig {
        reject_glitches: false,
        threshold_min_counts: 100.0,
        ..ConditionConfig::robust()
    };
    let mut skin = Skin::new(1, 100, config);
    skin.noise = vec![[2, 2, 2]];
    skin.truth[0][2] = 65_530;
    skin.calibrate();
    // Up by more than half a turn at once, which is taken for down, and back in two steps: a turn
    // below the baseline. The taxel rests a few counts above where it did, so that neither its
    // counts nor the baseline are beyond the border.
    for z in [105_530, 85_530, 65_540] {
        skin.truth[0][2] = z;
        skin.step();
    }
    assert!(skin.out.contact[0], "{:?}", skin.conditioner.repaired_counts(0));
    skin.run_ms(100);
    assert!(!skin.out.contact[0], "{:?}", skin.conditioner.repaired_counts(0));
    assert_eq!(skin.conditioner.counters().recoveries, 1);
}

#[test]
fn noise_around_the_border_of_2_to_the_16_is_neither_force_nor_fault() {
    let mut skin = Skin::new(3, 100, ConditionConfig::robust());
    skin.truth[1][2] = 65_536;
    skin.calibrate();
    for _ in 0..3_000 {
        skin.step();
        assert!(
            skin.out.faults[1].is_empty() && !skin.out.contact[1],
            "{:?}",
            skin.out
        );
    }
    assert!(skin.conditioner.counters().wraps > 500);
    assert!((skin.conditioner.baseline()[1][2].rem_euclid(65_536.0) - 32_768.0).abs() > 32_700.0);
}

#[test]
fn counts_that_run_through_turn_after_turn_are_a_fault() {
    let mut skin = quiet(2);
    skin.calibrate();
    let mut flagged = false;
    for _ in 0..2_000 {
        skin.truth[1][0] += 400;
        skin.truth[1][1] += 390;
        flagged |= skin.step().faults[1].contains(Fault::Wrapping);
        assert!(skin.out.faults[0].is_empty());
    }
    assert!(flagged);
    assert!(skin.conditioner.counters().runaways > 0);
}

#[test]
fn random_counts_are_a_fault_within_seconds() {
    let mut skin = Skin::new(4, 30, ConditionConfig::robust());
    skin.calibrate();
    skin.noise[2] = [30_000; 3];
    skin.run_ms(5_000);
    assert!(!skin.out.faults[2].is_empty());
    assert!([0, 1, 3].iter().all(|n| skin.out.faults[*n].is_empty()));
    skin.noise[2] = skin.noise[0];
    skin.run_ms(30_000);
    assert!(
        skin.out.faults[2].is_empty(),
        "{:?}: it is well again",
        skin.out.faults[2]
    );
}

#[test]
fn with_unwrapping_off_counts_stay_as_the_board_sent_them() {
    let config = ConditionConfig {
        repair_wraps: false,
        reject_glitches: false,
        ..ConditionConfig::robust()
    };
    let mut skin = Skin::new(1, 100, config);
    skin.calibrate();
    for _ in 0..100 {
        skin.truth[0][2] -= 500;
        skin.step();
        assert_eq!(
            skin.conditioner.repaired_counts(0),
            skin.frame.counts[0].map(i32::from)
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Smooth motion through wraps, with glitches: the repaired signal is never further from the
    /// truth than a sample's motion.
    #[test]
    fn glitched_and_wrapped_signals_stay_with_the_truth(
        amplitudes in prop::array::uniform3(-60_000.0..60_000.0f64),
        period in 200.0..600.0f64,
        glitches in prop::collection::vec((any::<u16>(), 0usize..3, 1u16..256), 0..20),
    ) {
        let mut skin = quiet(1);
        skin.calibrate();
        let rest = skin.truth[0];
        let mut since = 0;
        for i in 0..600u16 {
            let swing = (1.0 - (std::f64::consts::TAU * f64::from(i) / period).cos()) / 2.0;
            let before = skin.truth[0];
            skin.truth[0] = std::array::from_fn(|a| rest[a] + (amplitudes[a] * swing) as i32);
            let expected = skin.truth[0];
            let glitch = glitches.iter().find(|g| g.0 % 600 == i && since > 4);
            since = if glitch.is_some() { 0 } else { since + 1 };
            skin.step_with(|f| if let Some((_, axis, byte)) = glitch { f.counts[0][*axis] ^= byte << 8; });
            let got = skin.conditioner.repaired_counts(0);
            for a in 0..3 {
                // A glitch smaller than the motion of the sample cannot be told from it.
                let motion = 2 * (0..3).map(|b| (expected[b] - before[b]).abs()).max().unwrap();
                let allowed = 8 + 5 * motion;
                prop_assert!((got[a] - expected[a]).abs() <= allowed, "frame {i}: {got:?} for {expected:?}");
            }
        }
    }
}
