//! `taxel pause`, `resume`, `profile` and their like, of a real daemon in this process.

use crate::{HANGS_AFTER, command, fails, simulated, succeeds, texts};
use serde_json::{Value, json};
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixListener;
use std::process::Command;
use std::thread::JoinHandle;
use std::time::Instant;
use tempfile::TempDir;

const CONTROL: [&str; 2] = ["--socket", "control.sock"];

/// The JSON that a request prints.
fn object(dir: &TempDir, args: &[&str]) -> Value {
    let (out, _) = succeeds(dir, &[args, &CONTROL].concat());
    serde_json::from_str(&out).unwrap_or_else(|e| panic!("{args:?}: {e}: {out}"))
}

/// The status follows with the next tick.
fn waits_until_paused(dir: &TempDir, paused: bool) {
    let end = Instant::now() + HANGS_AFTER;
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
    // Subscribers are told a moment after the status, and from then on everyone who comes.
    let watch = |count: &[&str]| {
        let (_, said) = succeeds(&dir, &[&["watch", "--socket", "images.sock"], count].concat());
        said.contains("paused: images show no contact")
    };
    let end = Instant::now() + HANGS_AFTER;
    while !watch(&["--count", "1"]) {
        assert!(Instant::now() < end, "nobody is told of the pause");
    }
    assert!(watch(&["--count", "1"]) && watch(&["--hz", "--count", "1"]));
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

/// Gives each client its reply, one after another, in place of a daemon.
fn answer(dir: &TempDir, replies: Vec<Value>) -> JoinHandle<()> {
    let listener = UnixListener::bind(dir.path().join("control.sock")).unwrap();
    std::thread::spawn(move || {
        for reply in replies {
            let mut client = BufReader::new(listener.accept().unwrap().0);
            client.read_line(&mut String::new()).unwrap();
            writeln!(client.get_mut(), "{reply}").unwrap();
        }
    })
}

#[test]
fn a_checked_status_is_a_failure_where_an_error_is_among_the_problems() {
    let dir = TempDir::new().unwrap();
    let (none, warning, error) = (
        json!([]),
        json!([{ "severe": false }]),
        json!([{ "severe": true }]),
    );
    let cases = [
        (none, &["status", "--check"][..], true),
        (warning, &["status", "--check"], true),
        (error.clone(), &["status"], true),
        (error.clone(), &["status", "--check"], false),
        (error, &["status", "--check", "--json"], false),
    ];
    let reply = |problems: &Value| json!({ "ok": true, "status": { "problems": problems } });
    let daemon = answer(&dir, cases.iter().map(|(problems, ..)| reply(problems)).collect());
    for (problems, args, is_well) in &cases {
        let args = [args, &CONTROL[..]].concat();
        match is_well {
            true => drop(succeeds(&dir, &args)),
            false => assert!(
                fails(&dir, &args, 1).contains("1 of the problems is"),
                "{problems}"
            ),
        }
    }
    daemon.join().unwrap();
}

#[test]
fn what_a_servo_was_told_is_printed_in_json() {
    let dir = TempDir::new().unwrap();
    let daemon = answer(
        &dir,
        vec![json!({ "ok": true, "warning": "hot" }), json!({ "ok": true })],
    );
    for (told, wanted) in [
        (&["--torque", "on", "--pwm", "5"][..], json!([true, 5.0, "hot"])),
        (&["--torque", "off"], json!([false, null, null])),
    ] {
        let told = object(&dir, &[&["servo", "index 0", "--json"], told].concat());
        let [joint, torque, pwm, warning] =
            ["joint", "torque", "pwm_percent", "warning"].map(|key| &told[key]);
        assert_eq!(
            (joint, json!([torque, pwm, warning])),
            (&json!("index 0"), wanted)
        );
    }
    daemon.join().unwrap();
}

#[test]
fn a_profile_is_read_from_stdin() {
    let dir = TempDir::new().unwrap();
    let daemon = simulated(dir.path(), "tap");
    fs::write(dir.path().join("glove.json"), "{\"levels\": 3}\n").unwrap();
    let status = command(&dir, &["profile", "-"])
        .args(CONTROL)
        .stdin(File::open(dir.path().join("glove.json")).unwrap())
        .status();
    assert!(status.unwrap().success());
    assert_eq!(object(&dir, &["profile"])["levels"], 3);
    daemon.stop().unwrap();
}

#[test]
fn a_file_in_place_of_a_profile_is_told_with_where_it_belongs() {
    let dir = TempDir::new().unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    write("my glove.json", "{\"levels\": 3}\n");
    write(
        "cb.toml",
        "# Learned.\n[profile]\nlevels = 3\ncodebook = [1.0, 2.0, 4.0]\n",
    );
    // No daemon is asked.
    for (profile, wanted) in [
        (
            "my glove.json",
            "my glove.json is a file, which is read by `taxel profile - < 'my glove.json'`",
        ),
        (
            "cb.toml",
            "cb.toml: it has a table [profile], which is a part of the daemon's configuration",
        ),
        (
            "{levels: 3}",
            "{levels: 3}: key must be a string at line 1 column 2; a profile is a JSON object such as",
        ),
        (
            "none.json",
            "none.json: expected ident at line 1 column 2; a profile is a JSON object",
        ),
    ] {
        let said = fails(&dir, &[&["profile", profile], &CONTROL[..]].concat(), 1);
        assert!(said.contains(wanted), "{profile}: {said}");
    }
    let mut taxel = Command::new(env!("CARGO_BIN_EXE_taxel"));
    let taxel = taxel
        .args(["profile", "-"])
        .stdin(File::open(dir.path().join("cb.toml")).unwrap());
    let said = texts(&taxel.output().unwrap()).1;
    assert!(said.contains("stdin: it has a table [profile]"), "{said}");
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
