//! Places from squeezes that follow a simple rule: what an estimator tells of their angles, and what it refuses and why.

mod bytes;
mod few;
mod goes_on;
mod lost_angles;
mod public;
mod touch;

use taxel_forearm::{
    Disturbance, Estimator, FULL_PWM, Model, PLACES, Sample, Session, Squeeze, TACTELS, TACTILE_COLUMNS,
    Trial, location_percent,
};

/// A squeeze whose angles fall evenly from wrist to elbow, and move with PWM.
fn squeeze(percent: f64, off: f64) -> Squeeze {
    let mut squeeze = Squeeze::default();
    for row in 0..95 {
        let pwm = 10.0 * (40.0 - (f64::from(row) - 50.0).abs()).max(0.0);
        let closed = 60.0 - 0.4 * percent + 0.05 * pwm * (1.0 + 0.005 * percent) + off;
        squeeze.push(Sample {
            time_ms: 121.0 * f64::from(row),
            theta_p_deg: [
                45.0 - 0.05 * percent + 0.01 * pwm,
                40.0 - 0.05 * percent + 0.01 * pwm,
            ],
            theta_a_deg: [closed, closed + 8.0],
            pwm,
        });
    }
    squeeze
}

fn session() -> Session {
    let trial = |n: usize| Trial {
        location_percent: location_percent(n / 6),
        repetition: n % 6,
        squeeze: squeeze(location_percent(n / 6), (n % 6) as f64 - 2.5),
    };
    Session {
        name: "test".into(),
        simulated: false,
        passed_over: Vec::new(),
        trials: (0..6 * PLACES).map(trial).collect(),
    }
}

/// The same with touch: a ridge that is wider towards the elbow, and stronger with PWM.
fn session_with_touch() -> Session {
    let mut session = session();
    session.trials.retain(|trial| trial.repetition < 2);
    for trial in &mut session.trials {
        touch(&mut trial.squeeze, trial.location_percent);
    }
    session
}

fn touch(squeeze: &mut Squeeze, percent: f64) {
    let width = 4.0 + percent / 10.0;
    let tactel = |n: usize| {
        let across = (n % TACTILE_COLUMNS) as f64 - 24.5;
        (-across * across / (width * width)).exp()
    };
    let image: Vec<f64> = (0..TACTELS).map(tactel).collect();
    let counts = squeeze
        .pwm
        .iter()
        .flat_map(|pwm| image.iter().map(move |felt| (0.5 * pwm * felt) as u16));
    squeeze.tactile = Some(counts.collect());
}

fn model() -> Model {
    Model::train(&session()).unwrap()
}

#[test]
fn a_place_between_those_of_the_training_is_estimated_from_any_part_of_a_squeeze() {
    let model = model();
    let whole = squeeze(37.0, 0.0);
    let estimate = model.estimate(&whole).unwrap();
    assert!((estimate.percent - 37.0).abs() < 2.0, "{estimate:?}");
    for len in 2..=whole.len() {
        let part = model.estimate(&whole.prefix(len)).unwrap();
        assert!((0.0..=100.0).contains(&part.percent) && part.half_width_90 > 0.0);
        assert!(part.phase <= estimate.phase);
    }
    assert_eq!(model.estimate(&whole.prefix(95)).unwrap(), estimate);
}

#[test]
fn what_happens_to_a_squeeze_is_survived_without_being_told() {
    let model = model();
    let whole = squeeze(37.0, 0.0);
    for what in [
        Disturbance::Missing(0.3),
        Disturbance::Gap(2000.0),
        Disturbance::Noise(0.3),
        Disturbance::Faster(2),
        Disturbance::Slower(2),
        Disturbance::PotentiometerStuck,
        Disturbance::PotentiometerLost,
        Disturbance::PotentiometerDead,
    ] {
        for seed in 0..20 {
            let percent = model.estimate(&what.apply(&whole, seed)).unwrap().percent;
            assert!((percent - 37.0).abs() < 6.0, "{what}, seed {seed}: {percent}");
        }
    }
}

#[test]
fn squeezes_that_say_nothing_are_refused_by_what_is_wrong_with_them() {
    let model = model();
    let whole = squeeze(37.0, 0.0);
    let refused = |change: &dyn Fn(&mut Squeeze), words: &str| {
        let mut squeeze = whole.clone();
        change(&mut squeeze);
        let error = model.estimate(&squeeze).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(&|s| *s = s.prefix(1), "1 samples are no squeeze");
    refused(
        &|s| s.pwm.iter_mut().for_each(|p| *p *= 1.5),
        "PWM rises to 600, and to 400",
    );
    refused(&|s| s.pwm[3] = FULL_PWM + 1.0, "row 3 commands PWM 886");
    refused(
        &|s| s.theta_a_deg[1].iter_mut().for_each(|a| *a = a.to_radians()),
        "is it in degrees",
    );
    // Where the numbers lie within the range of the training.
    let in_radians = |s: &mut Squeeze| {
        let inside = whole.theta_a_deg[1][0];
        (s.theta_a_deg[1].iter_mut()).for_each(|a| *a = inside + (*a - inside).to_radians());
    };
    refused(&in_radians, "theta_a of finger 1 moves by 0.");
    refused(&|s| s.time_ms[7] = 0.0, "row 7 is at 0 ms");
    let lose_motors = |s: &mut Squeeze| s.theta_a_deg.iter_mut().for_each(|column| column.fill(f64::NAN));
    refused(&lose_motors, "theta_a of finger 0, theta_a of finger 1: lost");
}

#[test]
fn angles_that_move_in_another_way_within_the_same_range_are_another_grippers() {
    let model = model();
    let mut other = squeeze(37.0, 0.0);
    assert!(model.estimate(&other).is_ok());
    // A finger that stays where it is until PWM is back at rest.
    for angles in &mut other.theta_a_deg {
        let peak = angles[50];
        angles[50..90].fill(peak);
    }
    let error = model.estimate(&other).unwrap_err().to_string();
    let words = "times as far from those of the training as any of its squeezes; is it the same gripper";
    assert!(
        error.contains("the angles are ") && error.contains(words),
        "{error}"
    );
    let back = Model::from_bytes(&model.to_bytes()).unwrap();
    assert_eq!(back.estimate(&other).unwrap_err().to_string(), error);
    // Until it is over, that is not told.
    assert!(model.estimate(&other.prefix(80)).is_ok());
}

#[test]
fn a_course_that_is_no_squeeze_of_the_profile_is_refused_with_the_row_that_tells() {
    let model = model();
    let whole = squeeze(37.0, 0.0);
    let after = |squeeze: &Squeeze, first: usize| squeeze.filtered(|row| row >= first);
    let with_pwm = |of: &dyn Fn(usize, f64) -> f64| {
        let mut changed = whole.clone();
        (changed.pwm.iter_mut().enumerate()).for_each(|(row, pwm)| *pwm = of(row, *pwm));
        changed
    };
    let twice = |mut first: Squeeze, second: &Squeeze| {
        let later = first.time_ms.last().copied().unwrap_or(0.0) + 121.0;
        for row in 0..second.len() {
            let mut sample = second.sample(row);
            sample.time_ms += later;
            first.push(sample);
        }
        first
    };
    let around_the_peak = |ms: f64| {
        let off = |row: usize| (whole.time_ms[row] - whole.time_ms[50]).abs();
        whole.filtered(|row| off(row) >= ms / 2.0)
    };
    let slow_around_the_peak = {
        let mut slow = around_the_peak(3200.0);
        slow.time_ms.iter_mut().for_each(|ms| *ms *= 0.6);
        slow
    };
    for (what, squeeze, words) in [
        (
            "its beginning is cut off",
            after(&whole, 20),
            "row 0 is at PWM 100, and squeezes begin at 0",
        ),
        ("the release alone", after(&whole, 50), "row 0 is at PWM 400"),
        (
            "another rest",
            with_pwm(&|_, pwm| pwm + 20.0),
            "PWM rests at 20 from row 0 on",
        ),
        (
            "a step",
            with_pwm(&|_, pwm| if pwm > 0.0 { 400.0 } else { 0.0 }),
            "row 11 is at PWM 400, its peak, 1 samples",
        ),
        (
            "three lost rows",
            with_pwm(&|row, pwm| if (60..63).contains(&row) { 0.0 } else { pwm }),
            "row 63: PWM rises again, from 0",
        ),
        (
            "two squeezes",
            twice(whole.clone(), &squeeze(90.0, 0.0)),
            "PWM rises again, from 0",
        ),
        (
            "a gap at the peak",
            slow_around_the_peak,
            "no sample for 2033 ms where PWM is highest, 260,",
        ),
        (
            "another peak",
            with_pwm(&|_, pwm| pwm * 0.6),
            "PWM rises to 240, and to 400",
        ),
    ] {
        let error = model.estimate(&squeeze).unwrap_err().to_string();
        assert!(error.contains(words), "{what}: {error}");
        let mut session = session();
        session.trials[7].squeeze = squeeze;
        let error = Model::train(&session).unwrap_err().to_string();
        assert!(error.contains("the squeeze 2 at 8.3 %: "), "{what}: {error}");
    }
    // What hides little is estimated as before.
    let estimate = model.estimate(&whole).unwrap();
    for squeeze in [
        after(&whole, 10),
        after(&whole, 13),
        around_the_peak(2000.0),
        with_pwm(&|row, pwm| if row == 30 { 0.0 } else { pwm }),
        with_pwm(&|row, pwm| {
            if pwm > 0.0 {
                pwm + [-7.0, 0.0, 7.0][row % 3]
            } else {
                pwm
            }
        }),
    ] {
        let other = model.estimate(&squeeze).unwrap();
        assert!((other.percent - estimate.percent).abs() < 2.0, "{other:?}");
    }
}

#[test]
fn training_names_the_squeeze_that_it_cannot_take() {
    let refused = |change: &dyn Fn(&mut Session), words: &str| {
        let mut session = session();
        change(&mut session);
        let error = Model::train(&session).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(
        &|s| s.trials.truncate(12),
        "12 squeezes at 2 places; it takes at least 3",
    );
    for (rows, words) in [
        (60, "the squeeze 2 at 8.3 %: the squeeze breaks off at phase 1."),
        (40, "the squeeze 2 at 8.3 %: the squeeze breaks off at phase 0."),
        (10, "the squeeze 2 at 8.3 %: PWM rises to 0, and to 400"),
    ] {
        refused(&|s| s.trials[7].squeeze = s.trials[7].squeeze.prefix(rows), words);
    }
    refused(
        &|s| s.trials[7].squeeze.theta_p_deg[0].fill(f64::NAN),
        "theta_p of finger 0",
    );
    // Angles in radians, of one squeeze or two; of all.
    let in_radians = |squeeze: &mut Squeeze| {
        let Squeeze {
            theta_p_deg,
            theta_a_deg,
            ..
        } = squeeze;
        for column in theta_p_deg.iter_mut().chain(theta_a_deg) {
            column.iter_mut().for_each(|angle| *angle = angle.to_radians());
        }
    };
    refused(
        &|s| s.trials[6..8].iter_mut().for_each(|t| in_radians(&mut t.squeeze)),
        "the squeeze 1 at 8.3 %: theta_a of finger 0 moves by 0.",
    );
    // One torn reading of a motor, beside which sound motors hardly move.
    refused(
        &|s| s.trials[7].squeeze.theta_a_deg[0][40] = 3000.0,
        "the squeeze 2 at 8.3 %: theta_a of finger 0 is 3000.00",
    );
    refused(
        &|s| {
            s.trials[7].squeeze.theta_p_deg[1]
                .iter_mut()
                .for_each(|a| *a = a.to_radians())
        },
        "the squeeze 2 at 8.3 %: theta_p of finger 1 is 0.",
    );
    refused(
        &|s| s.trials.iter_mut().for_each(|t| in_radians(&mut t.squeeze)),
        "theta_a of finger 0 moves by 0.5",
    );
    for finger in 0..2 {
        let potentiometer = |squeeze: &mut Squeeze| {
            let angles = &mut squeeze.theta_p_deg[finger];
            angles.iter_mut().for_each(|angle| *angle = angle.to_radians());
        };
        refused(
            &|s| s.trials.iter_mut().for_each(|t| potentiometer(&mut t.squeeze)),
            &format!("theta_p of finger {finger} comes to 0."),
        );
    }
}
