//! The simulated forearm: `taxel demo --scene forearm` without a terminal, and `taxel forearm simulate`.

use crate::{fails, succeeds};
use std::fs;
use tempfile::TempDir;

#[test]
fn without_a_terminal_a_squeeze_is_estimated_and_summed_up_as_synthetic() {
    let dir = TempDir::new().unwrap();
    // Not waited for: the scene is played as fast as it can be.
    let (out, _) = succeeds(
        &dir,
        &["demo", "--scene", "forearm", "--headless", "--seconds", "16"],
    );
    for part in [
        "no evidence about people",
        "at 7 places",
        "squeeze    at  50.0 %, trained on",
        "of 1 within",
    ] {
        assert!(out.contains(part), "{part}: {out}");
    }
    let err = fails(
        &dir,
        &["demo", "--scene", "forearm", "--headless", "--seconds", "3"],
        1,
    );
    assert!(
        err.contains("no squeeze came to its end; give it --seconds 12"),
        "{err}"
    );
    let err = fails(&dir, &["demo", "--scene", "forearm", "--actuators", "9"], 2);
    assert!(err.contains("--actuators is of hands and displays"), "{err}");
}

#[test]
fn a_simulated_session_can_be_trained_on() {
    let dir = TempDir::new().unwrap();
    let (out, _) = succeeds(
        &dir,
        &["forearm", "simulate", "--out", "s.npz", "--repetitions", "3"],
    );
    assert!(
        out.contains("39 squeezes at 13 places") && out.contains("synthetic"),
        "{out}"
    );
    let (out, _) = succeeds(&dir, &["forearm", "train", "s.npz", "--out", "arm.model"]);
    assert!(out.contains("trained on 39 squeezes at 13 places"), "{out}");
    let err = fails(
        &dir,
        &["forearm", "simulate", "--out", "s.npz", "--repetitions", "0"],
        2,
    );
    assert!(err.contains("--repetitions 0; give 1 to 200"), "{err}");
    let err = fails(
        &dir,
        &["forearm", "simulate", "--out", "s.npz", "--ramp", "fast"],
        2,
    );
    assert!(err.contains("there are data and article"), "{err}");
    assert_eq!(
        fs::read_dir(dir.path()).unwrap().count(),
        2,
        "nothing is left of what failed"
    );
}
