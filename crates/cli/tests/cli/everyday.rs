//! `taxel pause`, `resume`, `profile` and their like, of a real daemon in this process.

use crate::{fails, simulated, succeeds};
use serde_json::{Value, json};
use std::fs::{self, File};
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;

const CONTROL: [&str; 2] = ["--socket", "control.sock"];

/// The JSON that a request prints.
fn object(dir: &TempDir, args: &[&str]) -> Value {
    let (out, _) = succeeds(dir, &[args, &CONTROL].concat());
    serde_json::from_str(&out).unwrap_or_else(|e| panic!("{args:?}: {e}: {out}"))
}

/// The status follows with the next tick.
fn waits_until_paused(dir: &TempDir, paused: bool) {
    let end = Instant::now() + Duration::from_secs(60);
    while object(dir, &["status", "--json"])["paused"] != paused {
        assert!(Instant::now() < end, "the status does not say paused: {paused}");
    }
}

#[test]
fn every_request_can_be_answered_in_json() {
    let dir = TempDir::new().unwrap();
    let daemon = simulated(dir.path(), "tap");
    assert_eq!(object(&dir, &["pause", "--json"]), json!({ "paused": true }));
    waits_until_paused(&dir, true);
    assert_eq!(object(&dir, &["resume", "--json"]), json!({ "paused": false }));
    waits_until_paused(&dir, false);
    let (out, _) = succeeds(&dir, &[&["pause"], &CONTROL[..]].concat());
    assert_eq!(out, "");
    let profile = object(&dir, &["profile", "{\"levels\": 5}", "--json"]);
    assert_eq!(profile["levels"], 5);
    assert_eq!(object(&dir, &["profile", "--json"]), profile);
    // What nobody stated is in force, too.
    let implied = ["force_fit", "placement", "actuator_force"].map(|key| profile[key].as_str());
    assert_eq!(implied, ["exact", "follow", "closest"].map(Some));
    let (metrics, _) = succeeds(&dir, &[&["metrics", "--json"], &CONTROL[..]].concat());
    let samples: Vec<Value> = metrics
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let of = |name: &str| samples.iter().find(|sample| sample["name"] == name).unwrap();
    assert_eq!(of("taxeld_up")["value"], 1);
    assert_eq!(of("taxeld_info")["labels"]["layout"], "allegro-uskin-15");
    daemon.stop().unwrap();
}

#[test]
fn a_profile_is_read_from_stdin() {
    let dir = TempDir::new().unwrap();
    let daemon = simulated(dir.path(), "tap");
    fs::write(dir.path().join("glove.json"), "{\"levels\": 3}\n").unwrap();
    let mut taxel = Command::new(env!("CARGO_BIN_EXE_taxel"));
    let taxel = taxel
        .args(["profile", "-"])
        .args(CONTROL)
        .current_dir(dir.path())
        .stdin(File::open(dir.path().join("glove.json")).unwrap());
    assert!(taxel.status().unwrap().success());
    assert_eq!(object(&dir, &["profile"])["levels"], 3);
    daemon.stop().unwrap();
}

#[test]
fn what_is_wrong_with_a_profile_is_said_without_the_request_around_it() {
    let dir = TempDir::new().unwrap();
    let daemon = simulated(dir.path(), "tap");
    for (profile, wanted) in [("{\"level\": 4}", "levels"), ("{\"levels\": \"four\"}", "four")] {
        let said = fails(&dir, &[&["profile", profile], &CONTROL[..]].concat(), 1);
        assert!(said.contains(wanted), "{profile}: {said}");
        assert!(
            !said.contains("column") && !said.contains("cmd"),
            "{profile}: {said}"
        );
    }
    daemon.stop().unwrap();
}
