//! Contacts that go on without a change.

use super::skin::{Skin, press};
use taxel_hand::Freshness;
use taxel_skin::{ConditionConfig, MagnitudeMode};

fn unchanging(skin: &Skin) -> Vec<usize> {
    let taxels = 0..skin.truth.len();
    taxels.filter(|t| skin.conditioner.is_unchanging(*t)).collect()
}

#[test]
fn a_contact_that_rests_is_unchanging_after_two_minutes_until_it_changes_or_ends() {
    for (rate_hz, magnitude) in [
        (10, MagnitudeMode::Vector),
        (100, MagnitudeMode::Vector),
        (10, MagnitudeMode::VectorSquared),
    ] {
        let config = ConditionConfig {
            magnitude,
            ..ConditionConfig::robust()
        };
        let mut skin = Skin::new(4, rate_hz, config);
        skin.calibrate();
        press(&mut skin, 1, 900);
        press(&mut skin, 2, 2_000);
        skin.run_ms(119_000);
        assert_eq!(unchanging(&skin), [], "{rate_hz} Hz");
        skin.run_ms(20_000);
        assert_eq!(unchanging(&skin), [1, 2], "{rate_hz} Hz");
        // Of the grip on one of them; the other rests on.
        press(&mut skin, 2, 100);
        skin.run_ms(3_000);
        assert_eq!(unchanging(&skin), [1], "{rate_hz} Hz");
        press(&mut skin, 1, -900);
        skin.run_ms(1_000);
        assert_eq!(unchanging(&skin), [], "{rate_hz} Hz");
        skin.run_ms(140_000);
        assert_eq!(unchanging(&skin), [2], "{rate_hz} Hz");
        assert!(skin.out.contact[2], "it is felt all the while");
        skin.conditioner.rezero();
        skin.calibrate();
        assert_eq!(unchanging(&skin), [], "{rate_hz} Hz");
        skin.run_ms(300_000);
        assert_eq!(unchanging(&skin), [], "{rate_hz} Hz: nothing touches");
    }
}

#[test]
fn what_moves_now_and_then_is_not_unchanging() {
    let mut skin = Skin::new(1, 25, ConditionConfig::robust());
    skin.calibrate();
    press(&mut skin, 0, 900);
    for _ in 0..10 {
        for counts in [60, -60] {
            press(&mut skin, 0, counts);
            skin.run_ms(60_000);
            assert!(!skin.conditioner.is_unchanging(0) && skin.out.contact[0]);
        }
    }
}

#[test]
fn drift_too_fast_to_be_followed_makes_contacts_that_are_told() {
    let mut skin = Skin::new(16, 25, ConditionConfig::robust());
    skin.calibrate();
    // Three counts a second for half a minute, and then it stands.
    for _ in 0..30 {
        for counts in &mut skin.truth {
            counts[2] += 3;
        }
        skin.run_ms(1_000);
    }
    assert_eq!(unchanging(&skin), []);
    skin.run_ms(140_000);
    let told = unchanging(&skin);
    assert!(told.len() > 8, "{told:?}");
    let contacts: Vec<usize> = (0..16).filter(|t| skin.out.contact[*t]).collect();
    assert!(told.iter().all(|t| contacts.contains(t)), "{told:?} {contacts:?}");
}

#[test]
fn a_contact_that_noise_ends_for_moments_is_unchanging_too() {
    let mut skin = Skin::new(1, 25, ConditionConfig::robust());
    skin.calibrate();
    skin.truth[0][2] += (1.05 * skin.conditioner.threshold()) as i32;
    let mut ends = 0;
    for _ in 0..140 * 25 {
        let before = skin.out.contact[0];
        let now = skin.step().contact[0];
        ends += u32::from(before && !now);
    }
    assert!(ends > 20, "{ends}");
    assert_eq!(unchanging(&skin), [0]);
}

#[test]
fn time_that_begins_anew_begins_contacts_anew() {
    let mut skin = Skin::new(1, 25, ConditionConfig::robust());
    skin.calibrate();
    press(&mut skin, 0, 900);
    skin.run_ms(130_000);
    assert_eq!(unchanging(&skin), [0]);
    skin.frame.t_ns = 0;
    skin.run_ms(110_000);
    assert_eq!(unchanging(&skin), []);
    skin.run_ms(20_000);
    assert_eq!(unchanging(&skin), [0]);
}

#[test]
fn a_board_that_pauses_touches_what_it_touched() {
    let pause = |skin: &mut Skin, ms: u64| {
        for _ in 0..ms / 40 {
            skin.step_with(|frame| frame.freshness.fill(Freshness::Stale));
        }
        assert!(!skin.out.contact[0], "without a value nothing is felt");
        skin.frame.freshness.fill(Freshness::Fresh);
    };
    let mut skin = Skin::new(2, 25, ConditionConfig::robust());
    skin.calibrate();
    press(&mut skin, 0, 900);
    for _ in 0..13 {
        skin.run_ms(10_000);
        pause(&mut skin, 280);
    }
    assert_eq!(unchanging(&skin), [0]);
    // It touches something else behind the pause, or nothing is known of it for long.
    pause(&mut skin, 1_000);
    press(&mut skin, 0, 300);
    skin.run_ms(2_000);
    assert_eq!(unchanging(&skin), []);
    skin.run_ms(125_000);
    assert_eq!(unchanging(&skin), [0]);
    pause(&mut skin, 3_000);
    assert_eq!(unchanging(&skin), []);
    skin.run_ms(10_000);
    assert_eq!(unchanging(&skin), []);
}
