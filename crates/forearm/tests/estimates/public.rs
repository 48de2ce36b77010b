//! What an estimator tells of the public squeezes.

use taxel_forearm::{Disturbance, Errors, Estimator, Judged, Kinesthetic, Session, Squeeze, Trial, splits};

#[test]
fn public_squeezes_are_of_their_gripper_whatever_happens_to_them_and_most_reversed_ones_are_not() {
    let Some(path) = taxel_recordings::find("forearm_kinesthetic.npz") else {
        return;
    };
    let session = Session::open(&path).unwrap();
    let split = &splits(&session, 1, 1)[0];
    let trials: Vec<&Trial> = split.train.iter().map(|n| &session.trials[*n]).collect();
    let model = Kinesthetic::train(&trials).unwrap();
    let mut told = 0;
    for n in &split.test {
        let trial = &session.trials[*n];
        for what in [
            Disturbance::Missing(0.3),
            Disturbance::Gap(2000.0),
            Disturbance::Noise(1.0),
            Disturbance::Faster(2),
            Disturbance::Slower(2),
            Disturbance::Zero(1.0),
            Disturbance::PotentiometerSticks,
            Disturbance::PotentiometerElsewhere,
            Disturbance::PotentiometerDead,
        ] {
            let estimate = model.estimate(&what.apply(&trial.squeeze, *n as u64));
            assert!(estimate.is_ok(), "{}, {what}: {estimate:?}", trial.name());
        }
        let mut reversed = trial.squeeze.clone();
        let Squeeze {
            theta_p_deg,
            theta_a_deg,
            ..
        } = &mut reversed;
        for column in theta_p_deg.iter_mut().chain(theta_a_deg) {
            column.reverse();
        }
        let error = model.estimate(&reversed).err().map(|error| error.to_string());
        told += usize::from(error.is_some_and(|error| error.contains("is it the same gripper")));
    }
    let all = split.test.len();
    println!("{told} of {all} reversed squeezes are told");
    assert!(4 * told > 3 * all, "{told} of {all}");
}

/// The figures of docs/forearm.md, with room for another order of additions.
#[test]
fn on_the_public_squeezes_errors_are_those_of_the_page() {
    let Some(path) = taxel_recordings::find("forearm_kinesthetic.npz") else {
        return;
    };
    let session = Session::open(&path).unwrap();
    let mut judged = Vec::new();
    for (repetition, split) in splits(&session, 5, 1).iter().enumerate() {
        let trials: Vec<&Trial> = split.train.iter().map(|n| &session.trials[*n]).collect();
        let model = Kinesthetic::train(&trials).unwrap();
        for trial in split.test.iter().map(|n| &session.trials[*n]) {
            let estimate = model.estimate(&trial.squeeze).unwrap();
            judged.push(Judged {
                repetition,
                percent: trial.location_percent,
                estimate: estimate.percent,
                half_width_90: estimate.half_width_90,
                seen: trials
                    .iter()
                    .any(|t| t.location_percent == trial.location_percent),
            });
        }
    }
    let errors = Errors::of(&judged).unwrap();
    assert!(
        errors.macro_rmse < 6.4 && errors.macro_mae < 5.7,
        "{:?}",
        errors.macro_rmses
    );
    assert!(errors.pooled_rmse < 8.9 && errors.half_width_90 < 15.5);
    assert!(
        errors.coverage_seen_and_new[1] > 0.87,
        "{:?}",
        errors.coverage_seen_and_new
    );
}
