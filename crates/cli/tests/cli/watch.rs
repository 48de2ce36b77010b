//! `taxel watch`: what a daemon publishes, line by line.

use crate::{HANGS_AFTER, command, fails, simulated, succeeds, texts, words};
use nix::sys::socket::{AddressFamily, Backlog, SockFlag, SockType, UnixAddr, bind, listen, socket};
use serde_json::Value;
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::process::Stdio;
use std::time::{Duration, Instant};
use tempfile::TempDir;

#[test]
fn without_a_daemon_watch_says_where_it_looked() {
    let dir = TempDir::new().unwrap();
    let err = fails(&dir, &["watch", "--socket", "nowhere.sock"], 1);
    assert!(
        err.contains("nowhere.sock") && err.contains("is taxeld running"),
        "{err}"
    );
}

#[test]
fn of_a_daemon_that_says_nothing_it_is_told_that_it_may_hang() {
    let dir = TempDir::new().unwrap();
    let kind = (SockType::SeqPacket, SockFlag::SOCK_CLOEXEC);
    let hangs = socket(AddressFamily::Unix, kind.0, kind.1, None).unwrap();
    bind(
        hangs.as_raw_fd(),
        &UnixAddr::new(&dir.path().join("images.sock")).unwrap(),
    )
    .unwrap();
    listen(&hangs, Backlog::new(1).unwrap()).unwrap();
    let mut child = command(&dir, &["watch", "--socket", "images.sock"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
    let told = said.next().unwrap().unwrap();
    assert!(
        told.contains("taxeld says nothing") && told.contains("restart it"),
        "{told}"
    );
    // It has gone on waiting until the daemon is gone.
    drop(hangs);
    let ended = said.next().unwrap().unwrap();
    assert!(ended.contains("taxeld closed the connection"), "{ended}");
    child.wait().unwrap();
}

#[test]
fn watch_prints_one_object_per_image_with_the_keys_of_the_contract() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "worst-case");
    let (out, _) = succeeds(
        &dir,
        &["watch", "--socket", "images.sock", "--json", "--count", "3"],
    );
    let lines: Vec<Value> = out
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 3);
    let mut keys: Vec<&str> = lines[0].as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    let mut contract = [
        "seq",
        "t_ns",
        "latency_us",
        "width",
        "height",
        "image",
        "levels",
        "actuators",
        "contacts",
        "faulty",
        "missing",
        "joints",
        "skipped",
        "calibrating",
        "saturated",
        "repaired",
    ];
    contract.sort_unstable();
    assert_eq!(keys, contract);
    let (help, _) = succeeds(&dir, &["watch", "--help"]);
    let of_images = help.split("With --raw").next().unwrap();
    for key in keys {
        assert!(of_images.contains(&format!("\"{key}\"")), "{key}: {help}");
    }
    assert_eq!(lines[0]["image"].as_array().unwrap().len(), 256);
    assert!(lines[0]["latency_us"].as_f64().unwrap() > 0.0);
    assert!(lines[2]["seq"].as_u64() > lines[0]["seq"].as_u64());
}

#[test]
fn watch_prints_words_and_raw_frames_on_request() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "idle");
    let (out, err) = succeeds(&dir, &["watch", "--socket", "images.sock", "--count", "2"]);
    assert_eq!(out.lines().count(), 2);
    assert!(out.contains("contacts") && out.contains("ms"), "{out}");
    assert!(err.contains("allegro-uskin-15, 240 taxels, 16x16"), "{err}");
    let (out, _) = succeeds(&dir, &words("watch --socket images.sock --raw --json --count 1"));
    let raw: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(raw["taxels"].as_array().unwrap().len(), 240);
    assert_eq!(raw["taxels"][0]["counts"].as_array().unwrap().len(), 3);
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "idle");
    let mut child = command(&dir, &["watch", "--socket", "images.sock"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap())
        .read_line(&mut line)
        .unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}: {:?}", output.status, texts(&output));
    assert!(!texts(&output).1.contains("pipe"), "{:?}", texts(&output));
}

#[test]
fn a_parent_that_never_reads_stderr_is_printed_images_to_the_end_and_told_by_the_exit_code() {
    let dir = TempDir::new().unwrap();
    let daemon = simulated(dir.path(), "idle");
    // What a child of Node.js has, full to the brim.
    let (_unread, mut stderr) = UnixStream::pair().unwrap();
    stderr.set_nonblocking(true).unwrap();
    let full = loop {
        if let Err(error) = stderr.write(b".") {
            break error;
        }
    };
    assert_eq!(full.kind(), ErrorKind::WouldBlock);
    stderr.set_nonblocking(false).unwrap();
    let mut child = command(&dir, &["watch", "--socket", "images.sock"])
        .stdout(Stdio::piped())
        .stderr(OwnedFd::from(stderr))
        .spawn()
        .unwrap();
    // It has told of the hand before.
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    for _ in 0..3 {
        assert!(lines.next().unwrap().unwrap().contains("contacts"));
    }
    daemon.stop().unwrap();
    lines.for_each(|line| assert!(line.unwrap().contains("contacts")));
    assert_eq!(child.wait().unwrap().code(), Some(1));
}

#[test]
fn rates_are_a_line_a_second() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "idle");
    let (out, _) = succeeds(&dir, &words("watch --socket images.sock --hz --json --count 2"));
    for line in out.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        assert!(line["hz"].as_f64().unwrap() > 0.0, "{line}");
        assert!(
            line["latency_p99_us"].as_f64() >= line["latency_p50_us"].as_f64(),
            "{line}"
        );
    }
    assert_eq!(out.lines().count(), 2);
}

#[test]
fn watch_waits_for_a_daemon_that_is_not_there_and_for_one_that_ended() {
    let dir = TempDir::new().unwrap();
    let mut child = command(&dir, &["watch", "--socket", "images.sock", "--reconnect"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let waits = said.next().unwrap().unwrap();
    assert!(waits.contains("waiting for it"), "{waits}");
    assert_eq!(waits.matches("No such file").count(), 1, "{waits}");
    // What one daemon published may be read while the next one starts, so each has contacts of its own.
    for (scene, contacts) in [("idle", "  0 contacts"), ("worst-case", "240 contacts")] {
        let daemon = simulated(dir.path(), scene);
        assert!(lines.any(|line| line.unwrap().contains(contacts)));
        daemon.stop().unwrap();
        let waits = said.find(|line| line.as_ref().is_ok_and(|line| line.contains("waiting for it")));
        assert!(waits.is_some());
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_number_of_lines_is_printed_though_nobody_reads_them_yet() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "idle");
    let mut child = command(
        &dir,
        &["watch", "--socket", "images.sock", "--json", "--count", "3"],
    )
    .stdout(Stdio::piped())
    .spawn()
    .unwrap();
    let began = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if began.elapsed() > HANGS_AFTER {
            child.kill().unwrap();
            panic!("it waits for a reader");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert_eq!(lines.count(), 3);
}

/// Lines of `taxel watch --json` with these options, of a hand that is pressed everywhere.
fn pressed(dir: &TempDir, options: &[&str]) -> Vec<Value> {
    let arguments = [&["watch", "--socket", "images.sock", "--json"], options].concat();
    let (out, _) = succeeds(dir, &arguments);
    let lines: Vec<Value> = out
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 4, "{options:?}");
    for pair in lines.windows(2) {
        let skipped = pair[1]["seq"].as_u64().unwrap() - pair[0]["seq"].as_u64().unwrap() - 1;
        assert_eq!(pair[1]["skipped"], skipped, "{options:?}");
    }
    lines
}

#[test]
fn a_display_that_states_what_it_can_do_is_given_that_from_the_first_line_on() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "worst-case");
    let mut watch = command(&dir, &["watch", "--socket", "images.sock"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(watch.stdout.take().unwrap()).lines();
    assert!(lines.any(|line| line.unwrap().contains("240 contacts")));
    drop(lines);
    watch.wait().unwrap();
    let profile = r#"{"levels": 2, "actuators": 3}"#;
    std::fs::write(dir.path().join("glove.json"), profile).unwrap();
    for profile in [profile, "glove.json"] {
        let lines = pressed(
            &dir,
            &["--count", "4", "--profile", profile, "--region", "index,thumb"],
        );
        for line in lines {
            assert_eq!(line["contacts"], 112, "{line}");
            let actuators = line["actuators"].as_array().unwrap();
            assert!((1..=3).contains(&actuators.len()), "{line}");
            assert_eq!(line["levels"].as_array().unwrap().len(), 2, "{line}");
        }
    }
    let slow = pressed(&dir, &["--count", "4", "--max-rate", "5"]);
    assert!(slow[3]["skipped"].as_u64().unwrap() > 0, "{slow:?}");
}

#[test]
fn a_display_that_no_hand_can_serve_is_told_why() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "idle");
    std::fs::write(dir.path().join("taxeld.toml"), "[profile]\nlevels = 4\n").unwrap();
    for (options, code, words) in [
        (
            &["--region", "index,nose"][..],
            1,
            "taxeld refuses that: region: the hand has no part `nose`; it has index",
        ),
        (&["--region", "nose", "--reconnect"], 1, "has no part `nose`"),
        (
            &["--profile", r#"{"budgets": {"nose": 2}}"#],
            1,
            "taxeld refuses that: ",
        ),
        (
            &["--profile", r#"{"levels": 400}"#],
            1,
            "taxel: --profile: levels = 400 is outside 1 to 255",
        ),
        (
            &["--profile", r#"{"level": 4}"#],
            1,
            "unknown key `level`; did you mean `levels`",
        ),
        (
            &["--profile", "{levels: 4}"],
            1,
            "a profile is a JSON object such as",
        ),
        (
            &["--profile", "taxeld.toml"],
            1,
            "a part of the daemon's configuration",
        ),
        (
            &["--profile", "nowhere.json"],
            1,
            "nowhere.json, which is neither a file nor a JSON object: No such file",
        ),
        (&["--max-rate", "0"], 2, "0 is no rate; give images per second"),
        (&["--max-rate", "inf"], 2, "inf is no rate"),
        (&["--max-rate", "5", "--every"], 2, "cannot be used with"),
        (&["--hz", "--every"], 2, "cannot be used with"),
        (&["--newest"], 2, "cannot be used with"),
        (&["--raw", "--region", "thumb"], 2, "cannot be used with"),
        (&["--raw", "--profile", "{}"], 2, "cannot be used with"),
    ] {
        let arguments = [&["watch", "--socket", "images.sock", "--count", "1"], options].concat();
        let told = fails(&dir, &arguments, code);
        assert!(told.contains(words), "{options:?}: {told}");
    }
}
