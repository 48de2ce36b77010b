//! The `taxel` command as a user runs it.

mod advice;
mod advice_on_columns;
mod advised_commands;
mod arrays_beside_boards;
mod begun_in_a_touch;
mod categorize;
mod categorize_clocks;
mod categorize_sweep;
mod categorize_told;
mod codebook;
mod compress;
mod config;
mod counts;
mod counts_told;
mod doctor;
mod eval;
mod eval_task;
mod everyday;
mod extension;
mod figures;
mod files;
mod forearm;
mod forearm_eval;
mod forearm_scene;
mod forearm_sessions;
mod foxglove;
mod interfaces;
mod journal;
mod manual;
mod metrics;
mod named_columns;
mod options;
mod publication;
mod recorded_hands;
mod recorded_times;
mod recordings;
mod replay;
mod setup;
mod several_hands;
mod shown_images;
mod silent_hands;
mod sim;
mod streams;
mod view;
mod watch;

use std::fs::OpenOptions;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use taxel_can::SourceAddress;
use taxel_skin::Layout;
use taxeld::{Config, Daemon};
use tempfile::TempDir;

/// What takes longer has hung, also on a busy machine.
pub(crate) const HANGS_AFTER: Duration = Duration::from_secs(200);

/// The command in this folder, to be run.
pub(crate) fn command(dir: &TempDir, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxel"));
    command.args(args).current_dir(dir.path());
    command
}

pub(crate) fn taxel(dir: &TempDir, args: &[&str]) -> Output {
    command(dir, args).output().unwrap()
}

/// Runs and expects success; returns stdout and stderr.
pub(crate) fn succeeds(dir: &TempDir, args: &[&str]) -> (String, String) {
    let output = taxel(dir, args);
    let (out, err) = texts(&output);
    assert!(
        output.status.success(),
        "taxel {args:?}: {}\n{out}{err}",
        output.status
    );
    (out, err)
}

/// Runs and expects failure with this exit code; returns stderr.
pub(crate) fn fails(dir: &TempDir, args: &[&str], code: i32) -> String {
    let output = taxel(dir, args);
    let (out, err) = texts(&output);
    assert_eq!(output.status.code(), Some(code), "taxel {args:?}\n{out}{err}");
    err
}

/// Arguments without blanks, as they are typed.
pub(crate) fn words(line: &str) -> Vec<&str> {
    line.split(' ').collect()
}

pub(crate) fn texts(output: &Output) -> (String, String) {
    (
        String::from_utf8_lossy(&output.stdout).into(),
        String::from_utf8_lossy(&output.stderr).into(),
    )
}

pub(crate) fn config(dir: &Path, sources: [SourceAddress; 2]) -> Config {
    let mut config = Config::new(Layout::builtin("allegro-uskin-15").unwrap(), sources.into());
    config.socket.images = dir.join("images.sock");
    config.socket.control = dir.join("control.sock");
    config.realtime.priority = 0;
    config
}

pub(crate) fn simulated(dir: &Path, scene: &str) -> Daemon {
    let source = || SourceAddress::Sim { scene: scene.into() };
    Daemon::start(config(dir, [source(), source()])).unwrap()
}

#[test]
fn wrong_usage_is_told_from_failure_by_the_exit_code() {
    let dir = TempDir::new().unwrap();
    let (out, _) = succeeds(&dir, &["--help"]);
    for command in ["demo", "watch", "replay", "compress", "eval", "figures", "sim"] {
        assert!(out.contains(command), "{out}");
    }
    fails(&dir, &["wach"], 2);
    fails(&dir, &["sim"], 2);
    for (wrong, word) in [
        (&["demo", "--seconds", "nan"][..], "give seconds"),
        (&["demo", "--levels", "999"], "1..=255"),
        (&["replay", "a.log", "--to", "-", "--speed", "0"], "no speed"),
        (
            &["replay", "a.log", "--to", "-", "--speed", "1e-300"],
            "0.000001 the least",
        ),
        (&["servo", "index 0", "--pwm", "nan"], "-100 to 100"),
        (&["watch", "--count", "0"], "give 1 or more"),
        (&["watch", "--raw", "--hz"], "cannot be used with"),
        (
            &["metrics", "--listen", "127.0.0.1:0", "--every", "3"],
            "cannot be used with",
        ),
        (&["sim", "tap", "--to", "log:x", "--json"], "cannot be used with"),
        (
            &["sim", "forearm", "--to", "-", "--place", "150"],
            "to 100 (elbow)",
        ),
        (
            &["sim", "forearm", "--to", "-", "--place", "abc"],
            "to 100 (elbow)",
        ),
        (
            &["compress", "sim:tap", "--out", "x.npz", "--conditioning", "robst"],
            "did you mean `robust`?",
        ),
        (&["view", "can:can0"], "where taxeld reads it"),
        (&["compress", "udp::43113"], "a bus is no recording"),
        (&["compress", "log:a.log?interface=can0"], "name a.log"),
        (&["record", "a.mcap", "--seconds", "0"], "give seconds from 0.001"),
        (
            &["sim", "roll", "--to", "udp:", "--seconds", "1e300"],
            "give seconds",
        ),
        (&["setup", "--seconds", "0"], "give seconds"),
        (&["setup", "--patience", "1h"], "give seconds"),
        (&["record", "a.mcap", "--most-files", "3"], "--split-size"),
        (&["servo", "a", "--torque", "off", "--pwm", "3"], "takes no PWM"),
        (&["doctor", "--joints", "dynamixel:/dev/x"], "needs --ids"),
        (
            &["doctor", "--joints", "dynamixel:/dev/x", "--ids", "300"],
            "ids are 0 to 252",
        ),
        (&["view", "sim:tap", "--levels", "300"], "1..=255"),
        (&["view", "sim:tap", "--actuators", "0"], "1..=1024"),
        (
            &["compress", "sim:tap", "--out", "-", "--json"],
            "give --out a file",
        ),
        (&["convert", "sim:tap", "-", "--json"], "name a file"),
        (&["figures", "sim:tap", "--out", "-"], "name a folder"),
        (&["sim", "forearm", "--show"], "has no file"),
        // None of these recordings is there: what is wrong is told before one is opened.
        (
            &["eval", "x.npz", "--rate", "0"],
            "no rate of frames; it is a number from 0.001",
        ),
        (
            &["categorize", "x.csv", "--classes", "2", "--rate", "nan"],
            "no rate of frames",
        ),
        (&["eval", "x.npz", "--method", "optimal levels=0"], "levels"),
        (&["eval", "x.npz", "--method", "optimal,foo"], "optimal,foo"),
        (&["eval", "x.npz", "--method", "optimal foo"], "is no method"),
        (
            &[
                "eval",
                "x.npz",
                "--method",
                "paper",
                "--method",
                "optimal levels=3",
            ],
            "give them with --levels",
        ),
        (
            &["eval", "x.npz", "--task", "--method", "optimal codebook=learned"],
            "leave codebook=learned out",
        ),
        (
            &["eval", "x.npz", "--threshold", "nan"],
            "no force; it is a number from 0 on",
        ),
        (
            &["eval", "x.npz", "--export", "q.mat"],
            "only .npz is written; name it so",
        ),
        (
            &["eval", "x.npz", "--times", "q.csv"],
            "only .npz is written; name it so",
        ),
        (
            &["compress", "x.npz", "--out", "q.txt"],
            "images are written as .npz",
        ),
        (
            &["compress", "x.npz", "--out", "q.npz", "--frames", "q.txt"],
            "frames are written as .csv",
        ),
        (&["convert", "x.npz", "x.foo"], "a recording is written as .log"),
        (
            &["convert", "x.mcap", "x.txt", "--images"],
            "images are written as .npz",
        ),
        (
            &["figures", "a.npz", "b.npz", "--out", "f", "--at", "1"],
            "--at is for one recording",
        ),
        (
            &["figures", "a.npz", "b.npz", "--out", "f", "--module", "m"],
            "--module is for one recording",
        ),
        (
            &["replay", "a.log", "--to", "-", "--start", "5", "--end", "2"],
            "--end 2 is not after --start 5",
        ),
        (
            &["replay", "a.log", "--to", "-", "--end", "inf"],
            "no time in a recording",
        ),
        (&["record", "a.log"], "a recording is called NAME.mcap"),
        (
            &["categorize", "x.csv", "--classes", "2-4", "--rule", "paper"],
            "give one number",
        ),
        (
            &["categorize", "x.csv", "--classes", "2", "--depth", "0"],
            "depth",
        ),
    ] {
        let err = fails(&dir, wrong, 2);
        assert!(err.contains(word), "{wrong:?}: {err}");
    }
    let err = fails(&dir, &["replay", "a.log", "--to", "vcan0"], 2);
    assert!(err.contains("can:INTERFACE"), "{err}");
}

#[test]
fn what_is_asked_for_in_vain_is_refused_with_what_to_do_and_leaves_no_file() {
    let dir = TempDir::new().unwrap();
    for (wrong, word) in [
        (&["eval", "sim:tap", "--csv", "-"][..], "name a file"),
        (&["forearm", "simulate", "--out", "-"], "name a file"),
        (&["sim", "forearn", "--to", "-"], "did you mean `forearm`?"),
        (&["sim", "juggle", "--to", "-"], "marker, forearm\n"),
        (&["sim", "slipp", "--show"], "did you mean `slip`?"),
        (
            &["demo", "--headless", "--scene", "forearn"],
            "did you mean `forearm`?",
        ),
        (
            &["eval", "sim:tap", "--scene", "sim:slipp"],
            "did you mean `slip`?",
        ),
        (
            &["figures", "sim:tap", "--out", "x", "--module", "index tpi"],
            "did you mean `index tip`?",
        ),
    ] {
        let err = fails(&dir, wrong, 1);
        assert!(err.contains(word), "{wrong:?}: {err}");
    }
    assert!(!dir.path().join("-").exists());
    let (log, said) = (dir.path().join("tap.log"), "ends after");
    let to = format!("log:{}", log.display());
    let (_, err) = succeeds(&dir, &["sim", "tap", "--to", &to, "--seconds", "1e9"]);
    assert!(err.contains(said), "{err}");
    let (_, err) = succeeds(&dir, &["sim", "tap", "--to", &to, "--seconds", "1"]);
    assert!(!err.contains(said), "{err}");
    let speed = ["replay", "tap.log", "--to", "log:slow.log", "--speed", "0.5"];
    let (_, err) = succeeds(&dir, &speed);
    assert!(err.contains("--speed 0.5: a log is written at once"), "{err}");
    let (svg, _) = succeeds(&dir, &["view", "tap.log", "--svg", "-"]);
    assert!(svg.starts_with("<svg") || svg.starts_with("<?xml"), "{svg:.80}");
    assert!(!dir.path().join("-").exists());
}

#[test]
fn the_demo_without_a_terminal_prints_a_summary() {
    let dir = TempDir::new().unwrap();
    let (out, _) = succeeds(&dir, &words("demo --scene worst-case --seconds 4 --actuators 9"));
    for part in [
        "worst-case: allegro-uskin-15, 240 taxels",
        "9 actuators",
        "images",
        "latency",
        "240 taxels",
    ] {
        assert!(out.contains(part), "{part}: {out}");
    }
}

#[test]
fn the_demo_tells_programs_what_it_saw() {
    let dir = TempDir::new().unwrap();
    let (out, _) = succeeds(
        &dir,
        &["demo", "--scene", "phantom-1", "--seconds", "3", "--json"],
    );
    let object: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(object["name"], "phantom-1", "{object}");
    assert!(object["touches"]["count"].is_u64(), "{object}");
    assert!(object["images"].as_u64().unwrap() > 0, "{object}");
}

#[test]
fn a_command_that_can_tell_nobody_anything_ends_as_it_would_have() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log"]);
    let code = |args: &[&str], stdout: Stdio, stderr: Stdio| {
        let mut taxel = command(&dir, args);
        taxel.stdout(stdout).stderr(stderr).status().unwrap().code()
    };
    let full = || Stdio::from(OpenOptions::new().write(true).open("/dev/full").unwrap());
    let gone = || Stdio::from(std::io::pipe().unwrap().1);
    let told: [(&[&str], i32); 3] = [
        (&["watch", "--socket", "no.sock"], 1),
        (&["compress", "tap.log", "--out", "images.npz"], 0),
        (&["replay", "tap.log", "--to", "log:again.log"], 0),
    ];
    for (args, wanted) in told {
        for stderr in [full(), gone()] {
            assert_eq!(code(args, Stdio::null(), stderr), Some(wanted), "{args:?}");
        }
    }
    for args in [
        &["eval", "tap.log", "--passes", "1", "--restarts", "1"][..],
        &["demo", "--seconds", "1", "--headless"],
    ] {
        assert_eq!(code(args, gone(), Stdio::null()), Some(0), "{args:?}");
        assert_eq!(code(args, full(), Stdio::null()), Some(1), "{args:?}");
    }
}

#[test]
fn what_a_full_stdout_does_not_take_is_said_of_stdout() {
    for args in [
        &["layouts"][..],
        &["layouts", "--json"],
        &["layouts", "uskin-module", "--file"],
    ] {
        let mut taxel = Command::new(env!("CARGO_BIN_EXE_taxel"));
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = taxel.args(args).stdout(full).output().unwrap();
        let (_, err) = texts(&output);
        assert!(err.starts_with("taxel: stdout: No space left"), "{args:?}: {err}");
    }
}

#[test]
fn what_a_full_disk_does_not_take_is_named() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "1"]);
    for out in ["full.log", "full.mcap"] {
        std::os::unix::fs::symlink("/dev/full", dir.path().join(out)).unwrap();
        let err = fails(&dir, &["convert", "tap.log", out], 1);
        assert!(err.contains(&format!("{out}: No space left")), "{err}");
    }
}
