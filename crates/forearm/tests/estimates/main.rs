//! Places from squeezes: what an estimator promises, on squeezes that follow a simple rule and on the public ones.

mod few;
mod goes_on;
mod lost_angles;

use taxel_forearm::{
    Disturbance, Errors, Estimate, Estimator, FULL_PWM, Judged, Kinesthetic, Model, PLACES, Sample, Session,
    Source, Squeeze, TACTELS, TACTILE_COLUMNS, Trial, location_percent, splits,
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
fn a_model_with_no_interval_or_lines_out_of_order_is_none() {
    let text = String::from_utf8(model().to_bytes()).unwrap();
    let (lines, _) = text.trim_end().rsplit_once('\n').unwrap();
    let width = lines.split("\"half_width_90\":").nth(1).unwrap();
    let width = width.split('}').next().unwrap();
    for (from, to) in [
        (format!("\"half_width_90\":{width}"), "\"half_width_90\":-5.0"),
        ("\"last\":0,".into(), "\"last\":7,"),
        ("\"last\":47,".into(), "\"last\":999,"),
    ] {
        assert!(lines.contains(&from), "{from}");
        let edited = lines.replacen(&from, to, 1) + "\n";
        let checksum = crc32fast::hash(edited.as_bytes());
        let edited = format!("{edited}{{\"checksum\":{checksum}}}\n");
        let error = Model::from_bytes(edited.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("its parts do not fit each other"), "{to}: {error}");
    }
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

#[test]
fn a_model_comes_back_from_its_bytes_and_nothing_else_is_one() {
    let model = model();
    let bytes = model.to_bytes();
    let back = Model::from_bytes(&bytes).unwrap();
    let whole = squeeze(37.0, 0.0);
    let (one, other) = (model.estimate(&whole).unwrap(), back.estimate(&whole).unwrap());
    assert!((one.percent - other.percent).abs() < 1e-9);
    assert_eq!(back.trained_on.squeezes, 78);
    let text = String::from_utf8(bytes).unwrap();
    let refused = |text: &str, words: &str| {
        let error = Model::from_bytes(text.as_bytes()).unwrap_err().to_string();
        assert!(
            error.contains("no model as `taxel forearm train` writes it") && error.contains(words),
            "{error}"
        );
    };
    refused(
        &text.replacen("\"version\":5", "\"version\":4", 1),
        "of version 4, and 5 is read; train it again",
    );
    refused(
        &text.replacen("forearm model", "palm model", 1),
        "taxel palm model",
    );
    refused(
        &text.replacen("\"offset\":", "\"offset\":1", 1),
        "its checksum is wrong",
    );
    refused(&text[..text.len() / 2], "its checksum is wrong");
    // Every line is summed up.
    for (from, to) in [
        ("\"angles\":\"degrees\"", "\"angles\":\"radians\""),
        ("\"squeezes\":78", "\"squeezes\":13"),
        ("100.0],", "50.0],"),
    ] {
        assert!(text.contains(from), "{from}");
        refused(&text.replacen(from, to, 1), "its checksum is wrong");
    }
    refused("{}", "one line");
    refused("{}\n", "its first line");
}

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
    assert!(10 * told > 9 * all, "{told} of {all}");
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
