//! `taxel forearm` on a simulated forearm.

use crate::{fails, succeeds};
use serde_json::Value;
use std::fs;
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
        out.contains("trained on 26 squeezes at 13 places") && out.contains("90 % interval"),
        "{out}"
    );
    let (out, _) = succeeds(&dir, &["forearm", "estimate", "arm.model", "more.npz", "--json"]);
    let lines: Vec<Value> = out
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 39);
    for line in &lines {
        let number = |key: &str| line[key].as_f64().unwrap();
        let off = number("location_percent") - number("true_percent");
        assert!(
            off.abs() < 2.0 * number("half_width_90") && line["source"] == "fused",
            "{line}"
        );
    }
    let text = fs::read_to_string(dir.path().join("arm.model")).unwrap();
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
fn the_protocol_is_one_object_with_what_there_is() {
    let dir = TempDir::new().unwrap();
    succeeds(
        &dir,
        &[
            "forearm",
            "simulate",
            "--out",
            "session.npz",
            "--repetitions",
            "3",
        ],
    );
    let (out, _) = succeeds(
        &dir,
        &["forearm", "eval", "session.npz", "--repetitions", "1", "--json"],
    );
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(report["repetitions"], 1);
    for source in ["kinesthetic", "tactile", "fused"] {
        for key in [
            "macro_rmse",
            "macro_mae",
            "pooled_rmse",
            "pooled_mae",
            "coverage_90",
            "train_s",
            "estimate_us",
        ] {
            assert!(
                report[source][key].as_f64().is_some_and(f64::is_finite),
                "{source} {key}: {out}"
            );
        }
    }
}
