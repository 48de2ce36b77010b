use super::*;
use taxel_forearm::{Estimate, Kinesthetic, LeftOut, Source, TACTELS, Trial};

/// Says the angle of the first finger, from two samples on; refuses PWM beyond 500.
struct FirstAngle;

impl Estimator for FirstAngle {
    fn estimate(&self, squeeze: &Squeeze) -> Result<Estimate, ForearmError> {
        let samples = squeeze.len();
        let last = samples - 1;
        if samples < 2 {
            return Err(ForearmError::TooShort { samples, least: 2 });
        }
        if squeeze.pwm[last] > 500.0 {
            let (peak, expected) = (squeeze.pwm[last], 400.0);
            return Err(ForearmError::Profile { peak, expected });
        }
        Ok(Estimate {
            percent: squeeze.theta_a_deg[0][last],
            half_width_90: 10.0,
            source: Source::Kinesthetic,
            left_out: LeftOut::default(),
            phase: squeeze.time_ms[last],
        })
    }
}

fn live() -> Live<'static> {
    Live {
        estimator: &FirstAngle,
        theta_a: [0, 1],
        theta_p: Some([2, 3]),
        frame: None,
        image: Vec::new(),
        squeeze: None,
        seen: Seen::default(),
        pwm: None,
        marked_ns: None,
        told: false,
    }
}

fn frame(live: &mut Live<'_>, ms: u64, degrees: f32) {
    let angles = [degrees.to_radians(), 0.0, 0.0, 0.0].map(|angle| (angle, 0));
    live.frame = Some((ms, ms * 1_000_000, angles.into_iter().collect()));
}

#[test]
fn a_sample_is_estimated_with_the_newest_frame_when_the_next_begins() {
    let mut live = live();
    frame(&mut live, 1000, 5.0);
    assert!(live.handle_mark("pwm 10").is_none(), "of no squeeze");
    assert!(live.handle_mark(BEGINS).is_none());
    assert!(live.handle_mark("pwm 10").is_none(), "it has just begun");
    frame(&mut live, 1121, 7.0);
    assert!(
        live.handle_mark("pwm 20").is_none(),
        "one sample is too short, and there will be more"
    );
    frame(&mut live, 1200, 8.0);
    frame(&mut live, 1242, 9.0);
    let line = live.handle_mark("pwm 30").unwrap().unwrap();
    assert!(
        (line.location_percent - 9.0).abs() < 1e-5 && line.phase == 121.0,
        "{line:?}"
    );
    assert_eq!((line.low, line.samples, line.ended), (0.0, 2, false));
    assert!(live.handle_mark("pwm 40").is_none(), "no frame has come since");
    assert!(live.handle_mark("a cup").is_none());
    frame(&mut live, 1363, 95.0);
    let line = live.handle_mark(ENDS).unwrap().unwrap();
    assert_eq!((line.high, line.samples, line.ended), (100.0, 3, true));
    assert!(live.handle_mark(ENDS).is_none());
    assert!(live.handle_mark("pwm 10").is_none());
}

/// Says of how many samples it knows the touch.
struct Touched;

impl Estimator for Touched {
    fn estimate(&self, squeeze: &Squeeze) -> Result<Estimate, ForearmError> {
        let images = squeeze
            .tactile
            .as_ref()
            .map_or(0, |counts| counts.len() / TACTELS);
        Ok(Estimate {
            percent: images as f64,
            half_width_90: 1.0,
            source: Source::Fused,
            left_out: LeftOut::default(),
            phase: 0.0,
        })
    }
}

#[test]
fn touch_that_falls_silent_is_done_without_until_the_next_squeeze() {
    let mut live = Live {
        estimator: &Touched,
        ..live()
    };
    let mut ms = 0;
    for expected in [[1.0, 2.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [1.0, 2.0, 3.0, 4.0]] {
        live.handle_mark(BEGINS);
        live.handle_mark("pwm 10");
        for (sample, expected) in expected.into_iter().enumerate() {
            ms += 100;
            frame(&mut live, ms, 5.0);
            let is_felt = ms < 300 || ms == 600 || ms > 800;
            live.image = if is_felt { vec![3; TACTELS] } else { Vec::new() };
            let line = live.handle_mark("pwm 20").unwrap().unwrap();
            assert_eq!(line.location_percent, expected, "sample {sample} at {ms} ms");
        }
        live.handle_mark(ENDS);
    }
}

#[test]
fn every_squeeze_has_a_last_message_however_it_ends() {
    let second = |live: &mut Live<'_>, from_ms: u64, pwm: f64, degrees: f32| {
        live.handle_mark(&format!("pwm {pwm}"));
        frame(live, from_ms, degrees);
    };
    let begun = |pwm: f64| {
        let mut live = live();
        live.handle_mark(BEGINS);
        for (n, ms) in [1000, 1121, 1242].into_iter().enumerate() {
            second(&mut live, ms, pwm + n as f64, 9.0);
        }
        live
    };
    // Released without a frame since the last mark: the estimate is of what there is.
    let mut live = begun(10.0);
    live.handle_mark("pwm 40");
    let line = live.handle_mark(ENDS).unwrap().unwrap();
    assert_eq!((line.samples, line.ended), (3, true));
    // Refused while it went on, and at its end.
    let mut live = begun(600.0);
    let untold = live.handle_mark(ENDS).unwrap().unwrap_err();
    assert!(
        untold.ended && untold.error.contains("PWM rises to 602"),
        "{untold:?}"
    );
    let line = serde_json::to_value(&untold).unwrap();
    assert_eq!(
        (&line["location_percent"], &line["samples"]),
        (&serde_json::Value::Null, &3.into())
    );
    // Never released: another begins, or no mark comes.
    let mut live = begun(10.0);
    let untold = live.handle_mark(BEGINS).unwrap().unwrap_err();
    assert!(
        untold.ended && untold.error.contains("another squeeze begins"),
        "{untold:?}"
    );
    let mut live = begun(10.0);
    live.handle_mark("pwm 40");
    let ms = |ms: u64| ms * 1_000_000;
    assert_eq!(live.handle_frame(7, ms(6242), JointAngles::default()), None);
    let untold = live.handle_frame(8, ms(6243), JointAngles::default()).unwrap();
    assert!(
        untold.ended && untold.error.contains("no mark has come for 5 s"),
        "{untold:?}"
    );
    assert!(live.handle_mark(ENDS).is_none());
}

#[test]
fn a_squeeze_in_which_pwm_never_rises_ends_without_an_estimate() {
    let trials = trials();
    let estimator = Kinesthetic::train(&trials.iter().collect::<Vec<_>>()).unwrap();
    let mut live = Live {
        estimator: &estimator,
        theta_p: None,
        ..live()
    };
    live.handle_mark(BEGINS);
    for row in 0..20 {
        live.handle_mark("pwm 0");
        let angles = arm(37.0, 0.0)
            .sample(0)
            .theta_a_deg
            .map(|a| (a.to_radians() as f32, 0));
        live.handle_frame(row, 121_000_000 * row, angles.into_iter().collect());
    }
    let untold = live.handle_mark(ENDS).unwrap().unwrap_err();
    assert!(
        untold
            .error
            .contains("PWM never rises above rest in its 20 samples"),
        "{untold:?}"
    );
}

#[test]
fn why_a_squeeze_has_no_estimate_is_said_once() {
    let mut live = live();
    for _ in 0..2 {
        live.handle_mark(BEGINS);
        let mut errors = 0;
        for ms in 1..9 {
            live.handle_mark("pwm 600");
            frame(&mut live, ms, 1.0);
            errors += live
                .handle_mark("pwm 600")
                .map_or(0, |line| usize::from(line.is_err()));
        }
        assert_eq!(errors, 1);
        live.handle_mark(ENDS);
        live.frame = Some((0, 0, JointAngles::default()));
    }
}

/// Softer from wrist to elbow.
fn arm(percent: f64, off: f64) -> Squeeze {
    let mut squeeze = Squeeze::default();
    for row in 0..95 {
        let pwm = 10.0 * (40.0 - (f64::from(row) - 50.0).abs()).max(0.0);
        let closed = 60.0 - 0.4 * percent + 0.05 * pwm * (1.0 + 0.005 * percent) + off;
        squeeze.push(Sample {
            time_ms: 121.0 * f64::from(row),
            theta_p_deg: [f64::NAN; FINGERS],
            theta_a_deg: [closed, closed + 8.0],
            pwm,
        });
    }
    squeeze
}

fn trials() -> Vec<Trial> {
    let mut trials = Vec::new();
    for n in 0..10 {
        let location_percent = f64::from(n / 2) * 25.0;
        trials.push(Trial {
            location_percent,
            repetition: n as usize % 2,
            squeeze: arm(location_percent, f64::from(n % 2)),
        });
    }
    trials
}

#[test]
fn a_sample_whose_angles_were_read_late_has_an_estimate_from_those_before() {
    let trials = trials();
    let estimator = Kinesthetic::train(&trials.iter().collect::<Vec<_>>()).unwrap();
    // Which samples' angles are so many milliseconds old, and which then have no estimate.
    let nothing: &[usize] = &[];
    for (late, age_ms, missing) in [
        (&[][..], 0, nothing),
        (&[2, 3], 200, nothing),
        (&[1, 3, 4], 200, nothing),
        (&[2, 3, 4], 200, nothing),
        (&[1, 2], 200, nothing),
        (&[1, 2, 3, 4], 200, nothing),
        (&[3, 5, 6, 7], 200, nothing),
        (&[8, 9, 10], 200, nothing),
        // Longer than two samples ago; and nothing new for nine.
        (&[1, 2], 241, &[2]),
        (&[4, 5, 6, 7, 8, 9, 10, 11, 12, 13], 200, &[12, 13]),
    ] {
        let mut live = Live {
            estimator: &estimator,
            theta_p: None,
            ..live()
        };
        live.handle_mark(BEGINS);
        let (squeeze, mut without, mut said) = (arm(37.0, 0.0), Vec::new(), String::new());
        for row in 0..14 {
            live.handle_mark(&format!("pwm {}", squeeze.pwm[row]));
            let age_us = if late.contains(&(row + 1)) {
                1000 * age_ms
            } else {
                5000
            };
            let angles = squeeze
                .sample(row)
                .theta_a_deg
                .map(|a| (a.to_radians() as f32, age_us));
            let t_ns = 121_000_000 * row as u64;
            live.frame = Some((row as u64, t_ns, angles.into_iter().collect()));
            // The next sample begins.
            let line = live.handle_mark(&format!("pwm {}", squeeze.pwm[row + 1]));
            live.pwm = None;
            match line {
                Some(Ok(_)) => continue,
                Some(Err(untold)) => said += &untold.error,
                None => {}
            }
            without.push(row + 1);
        }
        assert_eq!(without, [&[1], missing].concat(), "{age_ms} ms old at {late:?}");
        assert_eq!(
            said.contains("lost or stuck"),
            !missing.is_empty(),
            "{late:?}: {said}"
        );
    }
}

#[test]
fn joints_are_taken_by_name_or_in_order() {
    let there: Vec<String> = ["a", "b", "ap", "bp"].map(String::from).to_vec();
    let names = |names: &[&str]| -> Vec<String> { names.iter().map(ToString::to_string).collect() };
    for (fingers, potentiometers, wanted) in [
        (&[][..], &[][..], Ok(([0, 1], Some([2, 3])))),
        (&["b", "a"], &["bp", "ap"], Ok(([1, 0], Some([3, 2])))),
        (&["b"], &[], Err("two fingers")),
        (&["a", "a"], &[], Err("a is named twice")),
        (&[], &["a", "b"], Err("a is named twice")),
        (&["ap", "bp"], &[], Ok(([2, 3], None))),
        (
            &["b", "c"],
            &[],
            Err("no joint is called c; there are a, b, ap, bp"),
        ),
    ] {
        match (
            joints(&there, &[], &names(fingers), &names(potentiometers)),
            wanted,
        ) {
            (Ok(got), Ok(wanted)) => assert_eq!(got, wanted),
            (Err(error), Err(words)) => assert!(error.to_string().contains(words), "{error}"),
            (got, _) => panic!("{fingers:?}: {got:?}"),
        }
    }
    // Where the daemon says which joints are servos, a third one is no potentiometer.
    let there: Vec<String> = ["ap", "a", "b", "wrist", "bp"].map(String::from).to_vec();
    let servos = names(&["a", "b", "wrist"]);
    assert_eq!(joints(&there, &servos, &[], &[]).unwrap(), ([1, 2], Some([0, 4])));
    let there: Vec<String> = ["a", "b"].map(String::from).to_vec();
    assert_eq!(joints(&there[..2], &[], &[], &[]).unwrap(), ([0, 1], None));
    assert!(joints(&there[..1], &[], &[], &[]).is_err());
}
