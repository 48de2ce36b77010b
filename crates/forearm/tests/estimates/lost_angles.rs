//! Angles that a squeeze lacks, for a while or for good.

use super::{model, session, squeeze};
use taxel_forearm::{Disturbance, Estimator, Model, Squeeze};

#[test]
fn an_estimate_names_the_angles_that_it_was_made_without() {
    let model = model();
    let whole = squeeze(37.0, 0.0);
    let names = |squeeze: &Squeeze| -> Vec<_> { model.estimate(squeeze).unwrap().left_out.names().collect() };
    assert!(names(&whole).is_empty());
    let mut one = whole.clone();
    one.theta_p_deg[1].fill(40.0);
    assert_eq!(names(&one), ["theta_p of finger 1"]);
    one.theta_a_deg[1].fill(f64::NAN);
    assert_eq!(names(&one), ["theta_p of finger 1", "theta_a of finger 1"]);
}

#[test]
fn an_angle_that_is_missing_in_samples_is_lost_where_it_stays_away_or_most_of_the_squeeze_lacks_it() {
    let model = model();
    let whole = squeeze(37.0, 0.0);
    let at = |rows: &'static [usize]| move |row: usize| rows.contains(&row);
    type Missing = Box<dyn Fn(usize) -> bool>;
    let table: [(&str, usize, Missing, bool); 9] = [
        ("its first sample", 2, Box::new(at(&[0])), false),
        ("both samples", 2, Box::new(at(&[0, 1])), true),
        ("the newest", 2, Box::new(at(&[1])), false),
        (
            "all but the first and the last",
            20,
            Box::new(|row| row > 0 && row < 19),
            false,
        ),
        ("the newest eight", 40, Box::new(|row| row >= 32), false),
        ("the newest nine", 40, Box::new(|row| row >= 31), true),
        (
            "eight before the newest",
            40,
            Box::new(|row| (31..39).contains(&row)),
            false,
        ),
        ("less than half of all", 95, Box::new(|row| row % 2 == 1), false),
        ("most of all", 95, Box::new(|row| row % 2 == 0), true),
    ];
    for (what, len, is_missing, is_lost) in table {
        for motor in [false, true] {
            let mut part = whole.prefix(len);
            let [p, a] = [&mut part.theta_p_deg, &mut part.theta_a_deg];
            let column = if motor { &mut a[0] } else { &mut p[0] };
            for (row, angle) in column.iter_mut().enumerate() {
                *angle = if is_missing(row) { f64::NAN } else { *angle };
            }
            let estimate = model.estimate(&part).unwrap();
            let left_out = estimate.left_out.names().next().is_some();
            assert_eq!(left_out, is_lost, "{what}, motor {motor}: {estimate:?}");
        }
    }
    // Both motors are known, and never in the same sample: one of them is enough.
    let mut torn = whole.prefix(20);
    for row in 0..20 {
        torn.theta_a_deg[row % 2][row] = f64::NAN;
    }
    let estimate = model.estimate(&torn).unwrap();
    assert_eq!(
        estimate.left_out.names().collect::<Vec<_>>(),
        ["theta_a of finger 0"]
    );
}

#[test]
fn angles_that_no_training_squeeze_has_are_done_without_unsaid() {
    for (lost, names) in [
        (vec![0, 1], vec!["theta_p of finger 0", "theta_p of finger 1"]),
        (vec![1], vec!["theta_p of finger 1"]),
        (vec![1, 3], vec!["theta_p of finger 1", "theta_a of finger 1"]),
    ] {
        for value in [f64::NAN, 12.0] {
            let without = |mut squeeze: Squeeze| {
                let [p, a] = [&mut squeeze.theta_p_deg, &mut squeeze.theta_a_deg];
                for (n, column) in p.iter_mut().chain(a).enumerate() {
                    if lost.contains(&n) {
                        column.fill(value);
                    }
                }
                squeeze
            };
            let mut session = session();
            for trial in &mut session.trials {
                trial.squeeze = without(trial.squeeze.clone());
            }
            let model = Model::train(&session).unwrap();
            assert_eq!(model.kinesthetic.never_there().collect::<Vec<_>>(), names);
            assert!(model.kinesthetic.half_width_90() > 0.0);
            let model = Model::from_bytes(&model.to_bytes()).unwrap();
            // Whether the squeeze has them or not.
            for squeeze in [without(squeeze(37.0, 0.0)), squeeze(37.0, 0.0)] {
                let estimate = model.estimate(&squeeze).unwrap();
                assert!((estimate.percent - 37.0).abs() < 4.0, "{lost:?}: {estimate:?}");
                assert_eq!(estimate.left_out.names().count(), 0);
            }
            let mut lost = squeeze(37.0, 0.0);
            lost.theta_a_deg[0].fill(f64::NAN);
            lost.theta_p_deg[0].fill(f64::NAN);
            if let Ok(estimate) = model.estimate(&lost) {
                assert!(estimate.left_out.names().all(|name| !names.contains(&name)));
            }
        }
    }
    let mut session = session();
    for trial in &mut session.trials {
        trial
            .squeeze
            .theta_a_deg
            .iter_mut()
            .for_each(|a| a.fill(f64::NAN));
    }
    let error = Model::train(&session).unwrap_err().to_string();
    assert!(
        error.contains("no squeeze has theta_a of finger 0, theta_a of finger 1"),
        "{error}"
    );
}

#[test]
fn a_potentiometer_whose_wire_comes_off_in_the_squeeze_is_done_without() {
    let model = model();
    for from in [5, 30, 60, 90] {
        for end in [0.0, 333.3] {
            let mut lost = squeeze(37.0, 0.0);
            for (row, angle) in lost.theta_p_deg[0].iter_mut().enumerate().skip(from) {
                *angle = end + 0.33 * (row % 2) as f64;
            }
            let estimate = model.estimate(&lost).unwrap();
            assert!(
                (estimate.percent - 37.0).abs() < 3.0,
                "{from}, {end}: {estimate:?}"
            );
            let left_out = estimate.left_out.names().count();
            assert_eq!(left_out, usize::from(from < 87), "{from}, {end}");
            for samples in 2..95 {
                model.estimate(&lost.prefix(samples)).unwrap();
            }
        }
    }
    // One that moves there is another gripper's.
    let mut other = squeeze(37.0, 0.0);
    other.theta_p_deg[0]
        .iter_mut()
        .skip(5)
        .for_each(|angle| *angle += 90.0);
    let error = model.estimate(&other).unwrap_err().to_string();
    assert!(error.contains("theta_p of finger 0 is 1"), "{error}");
}

#[test]
fn a_potentiometer_that_stands_still_under_noise_or_hangs_free_is_done_without() {
    let model = model();
    let whole = squeeze(37.0, 0.0);
    for what in [
        Disturbance::PotentiometerStuckNoisy,
        Disturbance::PotentiometerElsewhere,
        Disturbance::PotentiometerFloats,
    ] {
        for seed in 0..20 {
            let estimate = match model.estimate(&what.apply(&whole, seed)) {
                Ok(estimate) => estimate,
                // Where no angle of this gripper is, it is said.
                Err(error) => {
                    assert!(error.to_string().contains("theta_p of finger"), "{error}");
                    continue;
                }
            };
            let names: Vec<_> = estimate.left_out.names().collect();
            assert!(
                names.len() == 1 && names[0].starts_with("theta_p"),
                "{what}, {seed}: {names:?}"
            );
            assert!(
                (estimate.percent - 37.0).abs() < 3.0,
                "{what}, {seed}: {estimate:?}"
            );
        }
    }
}

#[test]
fn one_sample_that_is_off_hardly_moves_an_estimate_and_hides_no_lost_potentiometer() {
    let model = model();
    let whole = squeeze(37.0, 0.0);
    let sound = model.estimate(&whole).unwrap();
    let mut stuck = whole.clone();
    stuck.theta_p_deg[0].fill(40.0);
    for row in 0..whole.len() {
        for off in [5.0, -20.0] {
            let mut glitch = whole.clone();
            glitch.theta_p_deg[0][row] += off;
            let estimate = model.estimate(&glitch).unwrap();
            assert!(
                (estimate.percent - sound.percent).abs() < 0.1,
                "{row}, {off}: {estimate:?}"
            );
            assert_eq!(estimate.left_out, sound.left_out);
            let mut glitch = stuck.clone();
            glitch.theta_p_deg[0][row] += off;
            let names: Vec<_> = model.estimate(&glitch).unwrap().left_out.names().collect();
            assert_eq!(names, ["theta_p of finger 0"], "{row}, {off}");
        }
    }
}
