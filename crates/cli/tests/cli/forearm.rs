//! `taxel forearm` on a simulated forearm.

use crate::{fails, succeeds, taxel, texts, words};
use serde_json::{Value, json};
use std::fs;
use taxel_forearm::{Sample, Session, Squeeze};
use tempfile::TempDir;

#[test]
fn a_session_is_trained_on_and_its_squeezes_and_more_are_placed() {
    let dir = TempDir::new().unwrap();
    for (name, repetitions) in [("train.npz", "2"), ("more.npz", "3")] {
        succeeds(
            &dir,
            &["forearm", "simulate", "--out", name, "--repetitions", repetitions],
        );
    }
    let (out, _) = succeeds(&dir, &["forearm", "train", "train.npz", "--out", "arm.model"]);
    assert!(
        out.contains("trained on 26 squeezes at 13 places of a simulated forearm, from angles and touch")
            && out.contains("90 % interval"),
        "{out}"
    );
    let told = |args: &[&str]| -> Value {
        let (out, _) = succeeds(&dir, &[&["forearm"], args, &["--json"]].concat());
        serde_json::from_str(&out).unwrap_or_else(|error| panic!("{error}: {out}"))
    };
    let made = told(&["simulate", "--out", "train.npz", "--repetitions", "2"]);
    assert_eq!(made, json!({ "out": "train.npz", "squeezes": 26, "places": 13 }));
    let trained = told(&["train", "train.npz", "--out", "arm.model"]);
    assert_eq!(
        (&trained["squeezes"], &trained["touch"], &trained["simulated"]),
        (&json!(26), &json!(true), &json!(true))
    );
    let width = trained["half_width_90"].as_f64().unwrap();
    assert!(
        out.contains(&format!("90 % interval: +-{width:.1} %, of this arm and gripper")),
        "{trained}: {out}"
    );
    let (out, _) = succeeds(&dir, &["forearm", "estimate", "arm.model", "more.npz", "--json"]);
    let lines: Vec<Value> = out
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 39);
    // As files are numbered.
    let numbers: Vec<_> = lines
        .iter()
        .map(|line| line["repetition"].as_u64().unwrap())
        .collect();
    assert_eq!(numbers, [1, 2, 3].repeat(13));
    let (out, _) = succeeds(&dir, &["forearm", "estimate", "arm.model", "more.npz"]);
    assert!(out.starts_with("more.npz, squeeze 1 at 0.0 %: "), "{out}");
    for line in &lines {
        let number = |key: &str| line[key].as_f64().unwrap();
        let off = number("location_percent") - number("true_percent");
        assert!(
            off.abs() < 2.0 * number("half_width_90") && line["source"] == "fused",
            "{line}"
        );
    }
    let text = fs::read_to_string(dir.path().join("arm.model")).unwrap();
    assert!(text.lines().next().unwrap().contains("\"simulated\":true"));
    fs::write(dir.path().join("torn.model"), &text[..text.len() / 2]).unwrap();
    let error = fails(&dir, &["forearm", "estimate", "torn.model", "more.npz"], 1);
    assert!(
        error.contains("torn.model: no model") && error.contains("checksum"),
        "{error}"
    );
    fs::write(dir.path().join("torn.mat"), [0; 100]).unwrap();
    let error = fails(&dir, &["forearm", "estimate", "arm.model", "torn.mat"], 1);
    assert!(error.contains("torn.mat: byte 100: cut off"), "{error}");
}

#[test]
fn a_gripper_without_potentiometers_is_trained_on_and_what_cannot_be_estimated_hides_nothing() {
    let dir = TempDir::new().unwrap();
    succeeds(
        &dir,
        &["forearm", "simulate", "--out", "all.npz", "--repetitions", "2"],
    );
    let session = Session::open(&dir.path().join("all.npz")).unwrap();
    let file = |place: usize, repetition: usize| {
        let folder = dir.path().join(format!("session/{place}"));
        fs::create_dir_all(&folder).unwrap();
        folder.join(format!("distance{place}_{repetition}.mat"))
    };
    for trial in &session.trials {
        let mut squeeze = trial.squeeze.clone();
        squeeze.theta_p_deg.iter_mut().for_each(|p| p.fill(f64::NAN));
        let place = (trial.location_percent * 0.12).round() as usize;
        let path = file(place, trial.repetition + 1);
        if (place, trial.repetition) != (0, 0) {
            fs::write(
                path.with_file_name(format!("tactile{place}_{}.npy", trial.repetition + 1)),
                squeeze.to_npy().unwrap(),
            )
            .unwrap();
        }
        fs::write(path, squeeze.to_mat()).unwrap();
    }
    let (out, _) = succeeds(&dir, &["forearm", "train", "session", "--out", "arm.model"]);
    assert!(
        out.contains("at 13 places, from angles alone: 1 of them have no touch")
            && out.contains("without theta_p of finger 0 and theta_p of finger 1: no squeeze has it"),
        "{out}"
    );
    let keep = words("forearm record session --repetitions 2 --npz kept.npz");
    // Not all touch of the session is lost for the one that has none.
    let error = fails(&dir, &keep, 1);
    assert!(
        error.contains("squeeze 1 at 0.0 %: it has no tactile images, and others have"),
        "{error}"
    );
    let touch = session.trials[0].squeeze.to_npy().unwrap();
    fs::write(file(0, 1).with_file_name("tactile0_1.npy"), touch).unwrap();
    let (_, said) = succeeds(&dir, &keep);
    assert!(
        said.contains("nothing moves") && said.contains("all squeezes of session are in kept.npz"),
        "{said}"
    );
    let kept = Session::open(&dir.path().join("kept.npz")).unwrap();
    assert!(kept.trials.len() == 26 && kept.has_touch());
    // One that is torn, one whose PWM never rises, two that are broken off: one says something, the other too little.
    let whole = Session::open(&dir.path().join("session")).unwrap().trials[0]
        .squeeze
        .clone();
    let write = |name: &str, squeeze: &Squeeze| fs::write(dir.path().join(name), squeeze.to_mat()).unwrap();
    fs::write(dir.path().join("torn.mat"), &whole.to_mat()[..300]).unwrap();
    write("whole.mat", &whole);
    write("half.mat", &whole.prefix(whole.len() / 2));
    write("tip.mat", &whole.prefix(14));
    let mut still = whole;
    still.pwm.fill(0.0);
    write("still.mat", &still);
    let files = [
        "torn.mat",
        "whole.mat",
        "half.mat",
        "nosuch.mat",
        "still.mat",
        "tip.mat",
    ];
    let output = taxel(
        &dir,
        &[&["forearm", "estimate", "arm.model"], &files[..]].concat(),
    );
    let (out, err) = texts(&output);
    assert_eq!(output.status.code(), Some(1), "{out}{err}");
    let lines: Vec<&str> = out.lines().collect();
    assert!(
        lines[0].starts_with("whole.mat: ") && lines[0].ends_with("(kinesthetic)"),
        "{out}"
    );
    assert!(
        lines[1].starts_with("half.mat: ") && lines[1].contains("breaks off at phase 0."),
        "{out}"
    );
    assert_eq!(lines.len(), 2, "{out}");
    assert!(
        err.contains("still.mat: PWM never rises above rest")
            && err.contains("tip.mat: the squeeze breaks off at phase 0."),
        "{err}"
    );
    assert!(
        err.contains("taxel: torn.mat: byte 128") && err.contains("taxel: nosuch.mat: "),
        "{err}"
    );
    let error = fails(&dir, &["forearm", "train", "session", "--out", "-"], 1);
    assert!(
        error.contains("name a file") && !dir.path().join("-").exists(),
        "{error}"
    );
}

#[test]
fn a_model_of_another_gripper_estimates_none_of_the_public_squeezes() {
    let Some(public) = taxel_recordings::find("forearm_kinesthetic.npz") else {
        return;
    };
    let dir = TempDir::new().unwrap();
    // The line of the first looks at five phases alone.
    let mut err = String::new();
    for (seed, repetitions) in [("4", "20"), ("1", "5")] {
        let simulate = ["forearm", "simulate", "--out", "own.npz", "--seed", seed];
        succeeds(&dir, &[&simulate[..], &["--repetitions", repetitions]].concat());
        succeeds(&dir, &["forearm", "train", "own.npz", "--out", "own.model"]);
        let args = ["forearm", "estimate", "own.model", public.to_str().unwrap()];
        let out;
        (out, err) = texts(&taxel(&dir, &args));
        assert_eq!(out, "", "seed {seed}");
        let refused = err.lines().filter(|line| line.contains("the same gripper"));
        assert_eq!(refused.count(), 780, "seed {seed}: {err}");
    }
    let synthetic =
        "taxel: own.model: it was trained on a simulated forearm: what it says is no evidence about people";
    assert_eq!(err.lines().next(), Some(synthetic));
    let (out, err) = succeeds(&dir, &["forearm", "estimate", "own.model", "own.npz"]);
    assert_eq!((out.lines().count(), err.trim()), (65, synthetic));
    let public = public.to_str().unwrap();
    succeeds(&dir, &["forearm", "train", public, "--out", "public.model"]);
    let (_, err) = texts(&taxel(&dir, &["forearm", "estimate", "public.model", public]));
    assert_eq!(err, "");
    let (_, err) = texts(&taxel(&dir, &["forearm", "estimate", "public.model", "own.npz"]));
    assert!(
        err.contains("taxel: own.npz: its squeezes are of a simulated forearm, and those that the model was trained on are not"),
        "{err}"
    );
}

#[test]
fn the_angle_that_no_sensor_reads_is_printed_by_finger_and_sample() {
    let dir = TempDir::new().unwrap();
    let mut squeeze = Squeeze::default();
    for (row, theta_a) in [20.0, 40.0, f64::NAN].into_iter().enumerate() {
        squeeze.push(Sample {
            time_ms: 120.0 * row as f64,
            theta_p_deg: [42.0, 50.0],
            theta_a_deg: [theta_a; 2],
            pwm: 0.0,
        });
    }
    let folder = dir.path().join("session/3");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("distance3_2.mat"), squeeze.to_mat()).unwrap();
    let (out, _) = succeeds(&dir, &["forearm", "fingers", "session"]);
    let lines: Vec<Vec<&str>> = out.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines.len(), 1 + 3 * 2, "{out}");
    assert!(lines.iter().all(|line| line.len() == lines[0].len()), "{out}");
    let number = |line: usize, name: &str| {
        let column = lines[0].iter().position(|of| *of == name).unwrap();
        lines[line][column].parse::<f64>().ok()
    };
    assert_eq!(lines[3][..4], ["25.0", "2", "120", "0"]);
    // By the page's formula.
    let theta_u = |theta_a: f64, theta_p: f64| {
        let (a, p) = (theta_a.to_radians(), theta_p.to_radians());
        let (gamma, psi) = (56f64.to_radians(), 90f64.to_radians());
        let crank = [
            27.8 * gamma.cos() + 25.0 * a.cos(),
            -27.8 * gamma.sin() + 25.0 * a.sin(),
        ];
        let arm = [40.0 + 20.0 * (p - psi).cos(), 20.0 * (p - psi).sin()];
        let (f, h) = (crank[0].hypot(crank[1]), arm[0].hypot(arm[1]));
        let between = ((f * f + h * h - 3600.0) / (2.0 * f * h)).acos();
        (crank[1].atan2(crank[0]) - arm[1].atan2(arm[0]) + between).to_degrees()
    };
    for (line, theta_a) in [(1, 20.0), (3, 40.0)] {
        let told = number(line, "theta_u_deg").unwrap();
        assert!((told - theta_u(theta_a, 42.0)).abs() < 1e-3, "{told}: {out}");
        let slope = (theta_u(theta_a + 0.5, 42.0) - theta_u(theta_a - 0.5, 42.0)) / 1.0;
        assert!(
            (number(line, "du_da").unwrap() - slope).abs() < 1e-3,
            "{slope}: {out}"
        );
    }
    assert_eq!(number(5, "theta_u_deg"), None, "an angle that is unknown");
}

#[test]
fn options_that_would_do_nothing_are_refused() {
    let dir = TempDir::new().unwrap();
    for (arguments, words) in [
        (
            &["eval", "x.npz", "--reading", "time"][..],
            "--reading is of the publication's networks",
        ),
        (
            &["eval", "x.npz", "--epochs", "3"],
            "--epochs is of the publication's networks",
        ),
        (
            &["estimate", "x.model", "x.mat", "--publish", "x.sock"],
            "--publish is of --live",
        ),
        (
            &["estimate", "x.model", "x.mat", "--fingers", "a,b"],
            "--fingers is of --live",
        ),
        (
            &["estimate", "x.model", "x.mat", "--reconnect"],
            "--reconnect is of --live",
        ),
    ] {
        let error = fails(&dir, &[&["forearm"], arguments].concat(), 2);
        assert!(error.contains(words), "{error}");
    }
    for places in ["6", "8", "12", "14", "0"] {
        let error = fails(&dir, &["forearm", "record", "session", "--places", places], 2);
        assert!(error.contains("1, 2, 3, 4, 5, 7 or 13"), "{error}");
    }
}

#[test]
fn one_squeeze_is_no_session() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("distance0_1.mat"), "MATLAB 5.0 MAT-file").unwrap();
    for arguments in [
        &["train", "distance0_1.mat", "--out", "x.model"][..],
        &["eval", "distance0_1.mat"],
        &["figures", "distance0_1.mat", "--out", "figures"],
    ] {
        let error = fails(&dir, &[&["forearm"], arguments].concat(), 1);
        assert!(
            error.contains("a .mat is one squeeze") && error.contains("name the folder of the places"),
            "{error}"
        );
    }
    let error = fails(&dir, &["forearm", "eval", "absent.mat"], 1);
    assert!(error.contains("No such file"), "{error}");
}
