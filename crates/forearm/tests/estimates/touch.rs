//! What touch tells, alone and with angles, and when it is done without.

use super::{session_with_touch, squeeze, touch};
use taxel_forearm::{Disturbance, Estimate, Estimator, Model, Source, Squeeze, TACTELS};

#[test]
fn touch_alone_and_with_angles_tells_the_place_and_a_lost_sense_is_done_without() {
    let session = session_with_touch();
    let model = Model::train(&session).unwrap();
    let tactile = &model.touch.as_ref().unwrap().0;
    let mut whole = squeeze(37.0, 0.0);
    assert_eq!(model.estimate(&whole).unwrap().source, Source::Kinesthetic);
    assert!(
        tactile
            .estimate(&whole)
            .unwrap_err()
            .to_string()
            .contains("no tactile images")
    );
    touch(&mut whole, 37.0);
    let felt = tactile.estimate(&whole).unwrap();
    assert!(
        (felt.percent - 37.0).abs() < 3.0 && felt.source == Source::Tactile,
        "{felt:?}"
    );
    let fused = model.estimate(&whole).unwrap();
    assert!(
        (fused.percent - 37.0).abs() < 2.0 && fused.source == Source::Fused,
        "{fused:?}"
    );
    for len in (2..whole.len()).step_by(9) {
        assert!(model.estimate(&whole.prefix(len)).is_ok());
    }
    whole
        .theta_a_deg
        .iter_mut()
        .for_each(|column| column.fill(f64::NAN));
    let alone = model.estimate(&whole).unwrap();
    let motors = ["theta_a of finger 0", "theta_a of finger 1"];
    assert_eq!(alone.left_out.names().collect::<Vec<_>>(), motors);
    let left_out = felt.left_out;
    assert_eq!(Estimate { left_out, ..alone }, felt);
    let back = Model::from_bytes(&model.to_bytes()).unwrap();
    assert!((back.estimate(&whole).unwrap().percent - felt.percent).abs() < 1e-6);
}

#[test]
fn touch_of_an_array_of_another_gain_is_done_without() {
    // A ridge that is as strong in all wherever it is, so that the array's gain tells.
    let even = |squeeze: &mut Squeeze, percent: f64| {
        touch(squeeze, percent);
        let times = 4.0 / (4.0 + percent / 10.0);
        let counts = squeeze.tactile.iter_mut().flatten();
        counts.for_each(|count| *count = (f64::from(*count) * times).round() as u16);
    };
    let mut session = session_with_touch();
    for trial in &mut session.trials {
        even(&mut trial.squeeze, trial.location_percent);
    }
    let model = Model::train(&session).unwrap();
    let mut felt = squeeze(37.0, 0.0);
    let angles = model.estimate(&felt).unwrap();
    even(&mut felt, 37.0);
    assert_eq!(model.estimate(&felt).unwrap().source, Source::Fused);
    for gain in [0.6, 0.8, 0.9, 1.1, 1.2, 1.5] {
        let other = Disturbance::Gain(gain).apply(&felt, 1);
        let estimate = model.estimate(&other).unwrap();
        assert_eq!(estimate.percent, angles.percent, "gain {gain}: {estimate:?}");
        assert_eq!(estimate.left_out.names().collect::<Vec<_>>(), ["touch"], "{gain}");
    }
}

#[test]
fn touch_that_is_unlike_that_of_the_training_is_done_without_and_said() {
    let model = Model::train(&session_with_touch()).unwrap();
    let mut felt = squeeze(37.0, 0.0);
    let angles = model.estimate(&felt).unwrap();
    touch(&mut felt, 37.0);
    let still = felt.tactile_image(50).unwrap().to_vec();
    let felt_by = |count: &dyn Fn(usize, u16) -> u16| {
        let mut felt = felt.clone();
        let counts = felt.tactile.iter_mut().flatten().enumerate();
        counts.for_each(|(n, felt)| *felt = count(n, *felt));
        felt
    };
    for (what, mut squeeze) in [
        ("dead", felt_by(&|_, _| 0)),
        ("saturated", felt_by(&|_, _| 255)),
        (
            "half of it dead",
            felt_by(&|n, felt| if n % 50 < 25 { 0 } else { felt }),
        ),
        ("noise", felt_by(&|n, _| (n * 7919 % 251) as u16)),
        ("still", felt_by(&|n, _| still[n % TACTELS])),
    ] {
        let estimate = model.estimate(&squeeze).unwrap();
        assert_eq!(
            (estimate.percent, estimate.source),
            (angles.percent, Source::Kinesthetic),
            "{what}"
        );
        assert_eq!(estimate.left_out.names().collect::<Vec<_>>(), ["touch"], "{what}");
        // Nor does it stand in where angles are lost.
        for angle in squeeze.theta_a_deg.iter_mut().flatten() {
            *angle = f64::NAN;
        }
        let error = model
            .touch
            .as_ref()
            .unwrap()
            .0
            .estimate(&squeeze)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("times as far from those of the training"),
            "{what}: {error}"
        );
        assert!(model.estimate(&squeeze).is_err(), "{what}");
    }
}

#[test]
fn touch_does_not_hide_angles_of_another_gripper() {
    let model = Model::train(&session_with_touch()).unwrap();
    for (scale, words) in [
        (std::f64::consts::PI / 180.0, "moves by 0."),
        (-1.0, "is it in degrees, and of the same gripper"),
    ] {
        let mut other = squeeze(37.0, 0.0);
        touch(&mut other, 37.0);
        for angle in other
            .theta_a_deg
            .iter_mut()
            .chain(&mut other.theta_p_deg)
            .flatten()
        {
            *angle *= scale;
        }
        let error = model.estimate(&other).unwrap_err().to_string();
        assert!(
            error.contains("is it in degrees") && (error.contains(words) || scale > 0.0),
            "{error}"
        );
    }
}

#[test]
fn touch_that_is_the_same_in_all_squeezes_is_named_by_the_array() {
    for count in [0, 7] {
        let mut session = session_with_touch();
        for trial in &mut session.trials {
            trial.squeeze.tactile = Some(vec![count; TACTELS * trial.squeeze.len()]);
        }
        let error = Model::train(&session).unwrap_err().to_string();
        let words = "the tactile images of all 26 squeezes are the same; is the array connected?";
        assert!(error.contains(words), "{error}");
    }
}
