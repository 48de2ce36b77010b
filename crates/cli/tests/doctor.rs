//! `taxel doctor` as a user runs it: against simulated boards over UDP and simulated servos on a
//! pseudo terminal.

use serde_json::Value;
use std::net::UdpSocket;
use std::os::unix::net::UnixListener;
use std::process::{Child, Command, Output, Stdio};
use taxel_sim::servo::{ServoBuild, ServoBus, ServoFault, ServoPty};
use tempfile::TempDir;

fn taxel(dir: &TempDir, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxel"));
    command.args(args).current_dir(dir.path());
    command
}

/// Runs the doctor with `--json`; returns its exit code and the checks.
fn doctor(dir: &TempDir, args: &[&str]) -> (Option<i32>, Vec<Value>) {
    let output = taxel(dir, &["doctor", "--json"]).args(args).output().unwrap();
    let report: Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)));
    let checks = report["checks"].as_array().unwrap().clone();
    for check in &checks {
        let mut keys: Vec<&str> = check.as_object().unwrap().keys().map(String::as_str).collect();
        keys.sort_unstable();
        assert_eq!(
            keys,
            ["area", "found", "mend", "name", "object", "state", "wanted"]
        );
    }
    let errors = checks.iter().any(|c| c["state"] == "error");
    assert_eq!(report["healthy"], !errors);
    assert_eq!(output.status.code(), Some(i32::from(errors)));
    (output.status.code(), checks)
}

fn said(output: &Output) -> String {
    format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}

/// Tries again where the machine may have been too busy to simulate a hand in real time.
fn eventually<T>(mut attempt: impl FnMut() -> Result<T, String>) -> T {
    let mut last = String::new();
    for _ in 0..6 {
        match attempt() {
            Ok(done) => return done,
            Err(why) => last = why,
        }
    }
    panic!("never: {last}");
}

/// The checks of this name that are neither good nor skipped: object, state, found, mend.
fn bad<'a>(checks: &'a [Value], name: &str) -> Vec<[&'a str; 4]> {
    let text = |value: &'a Value| value.as_str().unwrap_or("");
    checks
        .iter()
        .filter(|c| c["name"] == name && (c["state"] == "error" || c["state"] == "warning"))
        .map(|c| {
            [
                text(&c["object"]),
                text(&c["state"]),
                text(&c["found"]),
                text(&c["mend"]),
            ]
        })
        .collect()
}

fn free_port() -> u16 {
    UdpSocket::bind("0.0.0.0:0").unwrap().local_addr().unwrap().port()
}

/// A simulated hand in a process of its own, until it is dropped.
struct Hand(Child);

impl Drop for Hand {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Puts a scene on as many UDP buses as are wanted, with the config's sources to reach it.
fn hand(dir: &TempDir, scene: &str, extra: &[&str], buses: usize) -> (Hand, Vec<String>) {
    let sources: Vec<String> = (0..buses)
        .map(|_| format!("udp:239.74.163.2:{}?hops=0", free_port()))
        .collect();
    let mut command = taxel(dir, &["sim", scene]);
    for source in &sources {
        command.args(["--to", source]);
    }
    let child = command.args(extra).stderr(Stdio::null()).spawn().unwrap();
    (Hand(child), sources)
}

/// A configuration in which no daemon of this machine is found.
fn configure(dir: &TempDir, layout: &str, sources: &[String], rest: &str) {
    let mut text = format!("layout = \"{layout}\"\n");
    for source in sources {
        text += &format!("[[bus]]\nsource = \"{source}\"\n");
    }
    text += "[socket]\nimages = \"images.sock\"\ncontrol = \"control.sock\"\n";
    text += rest;
    std::fs::write(dir.path().join("hand.toml"), text).unwrap();
}

const DEAD_BOARD: &str = "\
name = \"dead-board\"
seconds = 60.0
[[fault]]
kind = \"silent\"
on = [\"tip end\"]
[[fault]]
kind = \"dead\"
on = [\"tip pad\"]
taxels = [3]
";

#[test]
fn a_dead_board_and_a_dead_taxel_are_found_and_the_others_are_well() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("scene.toml"), DEAD_BOARD).unwrap();
    let (_hand, sources) = hand(&dir, "scene.toml", &["--layout", "uskin-fingertip"], 1);
    configure(&dir, "uskin-fingertip", &sources, "");
    eventually(|| {
        let (code, checks) = doctor(&dir, &["--config", "hand.toml"]);
        let boards = [
            bad(&checks, "board"),
            bad(&checks, "board-unheard"),
            bad(&checks, "board-silent"),
        ]
        .concat();
        let dead = boards.iter().find(|b| b[0].starts_with("tip end"));
        let dead = dead.unwrap_or_else(|| panic!("the board without power is not found: {boards:?}"));
        assert_eq!((dead[1], code), ("error", Some(1)));
        assert!(dead[2].contains("was not heard since the start"), "{dead:?}");
        let living = boards
            .iter()
            .all(|b| b[1] != "error" || b[0].starts_with("tip end"));
        let taxel = bad(&checks, "taxels")
            .iter()
            .any(|t| t[0].starts_with("tip pad") && t[2].contains("k 3 dead"));
        let told = checks
            .iter()
            .filter(|c| c["name"] == "firmware" && c["state"] == "ok")
            .count()
            == 1;
        (living && taxel && told)
            .then_some(())
            .ok_or(format!("{checks:?}"))
    });
    // In words, the hand is drawn with the dead taxel.
    eventually(|| {
        let output = taxel(&dir, &["doctor", "--config", "hand.toml"])
            .output()
            .unwrap();
        let text = said(&output);
        assert!(!text.contains('\x1b'), "no colour where there is no terminal");
        (text.contains("D dead (1)") && text.contains("1 error,"))
            .then_some(())
            .ok_or(text)
    });
}

#[test]
fn listening_only_starts_nobody_and_says_so() {
    let dir = TempDir::new().unwrap();
    let (_hand, sources) = hand(&dir, "idle", &["--layout", "uskin-fingertip"], 1);
    configure(&dir, "uskin-fingertip", &sources, "");
    let (_, checks) = doctor(
        &dir,
        &["--config", "hand.toml", "--listen-only", "--seconds", "0.5"],
    );
    let silent = bad(&checks, "bus-silent");
    assert_eq!(silent.len(), 1, "{checks:?}");
    assert!(silent[0][3].contains("--listen-only"), "{silent:?}");
    assert!(bad(&checks, "board").is_empty() && bad(&checks, "board-unheard").is_empty());
    assert!(bad(&checks, "firmware").is_empty());
}

#[test]
fn a_bus_on_which_others_speak_is_only_listened_to() {
    let dir = TempDir::new().unwrap();
    let (_hand, sources) = hand(&dir, "idle", &["--layout", "uskin-module", "--autostart"], 1);
    configure(&dir, "uskin-module", &sources, "");
    eventually(|| {
        let (_, checks) = doctor(&dir, &["--config", "hand.toml", "--seconds", "3"]);
        let of = |name: &str| checks.iter().find(|c| c["name"] == name);
        let heard = of("board").is_some_and(|b| b["found"].as_str().unwrap().contains("Hz"));
        let left_alone = of("start").is_some_and(|c| c["state"] == "skipped") && of("firmware").is_none();
        (heard && left_alone).then_some(()).ok_or(format!("{checks:?}"))
    });
}

#[test]
fn a_recording_is_examined_in_its_own_time() {
    let dir = TempDir::new().unwrap();
    let sim = [
        "sim",
        "idle",
        "--layout",
        "uskin-module",
        "--to",
        "log:idle.log",
        "--seconds",
        "30",
    ];
    assert!(
        taxel(&dir, &sim)
            .stderr(Stdio::null())
            .status()
            .unwrap()
            .success()
    );
    let (_, checks) = doctor(&dir, &["--layout", "uskin-module", "log:idle.log"]);
    let of = |name: &str| {
        checks
            .iter()
            .find(|c| c["name"] == name && c["area"] == "hand")
            .unwrap()
    };
    assert_eq!(of("board")["found"], "50.0 Hz");
    assert_eq!(of("taxels")["found"], "16 healthy");
}

#[test]
fn of_a_recording_of_two_buses_the_one_of_the_hands_bus_is_examined() {
    let dir = TempDir::new().unwrap();
    let sim = [
        "sim",
        "idle",
        "--layout",
        "uskin-module",
        "--to",
        "log:idle.log",
        "--seconds",
        "4",
    ];
    let made = taxel(&dir, &sim).output().unwrap();
    assert!(made.status.success(), "{}", said(&made));
    let log = std::fs::read_to_string(dir.path().join("idle.log")).unwrap();
    let twice = |names: [&str; 2]| -> String {
        let lines = log
            .lines()
            .flat_map(|line| names.map(|name| line.replace(" can0 ", name) + "\n"));
        lines.collect()
    };
    std::fs::write(dir.path().join("two.log"), twice([" can0 ", " can1 "])).unwrap();
    let (_, checks) = doctor(&dir, &["--layout", "uskin-module", "log:two.log"]);
    let of = |name: &str| {
        checks
            .iter()
            .find(|c| c["name"] == name && c["area"] == "hand")
            .unwrap()
    };
    assert_eq!(of("board")["found"], "50.0 Hz");
    let left_out = of("source")["found"].as_str().unwrap();
    assert!(
        left_out.contains("frames of can1") && left_out.contains("log:two.log?interface=can1"),
        "{left_out}"
    );

    std::fs::write(dir.path().join("named.log"), twice([" slcan0 ", " slcan1 "])).unwrap();
    let (code, checks) = doctor(&dir, &["--layout", "uskin-module", "log:named.log"]);
    let told = bad(&checks, "source");
    let [[_, "error", refused, _]] = told[..] else {
        panic!("{checks:?}");
    };
    assert!(refused.contains("log:named.log?interface=slcan0"), "{refused}");
    assert_eq!(code, Some(1));
}

#[test]
fn contacts_of_drift_in_a_recording_are_told() {
    let dir = TempDir::new().unwrap();
    let scene = r#"
        name = "drift"
        layout = "uskin-module"
        seconds = 220.0
        [boards]
        rate_hz = 10
        [[fault]]
        kind = "drift"
        on = ["all"]
        counts_per_s = 3.0
        from = 3.0
    "#;
    std::fs::write(dir.path().join("drift.toml"), scene).unwrap();
    let made = taxel(&dir, &["sim", "drift.toml", "--to", "log:drift.log"])
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", said(&made));
    let (code, checks) = doctor(&dir, &["--layout", "uskin-module", "log:drift.log"]);
    let told = bad(&checks, "contact-unchanging");
    let [[_, "warning", found, mend]] = told[..] else {
        panic!("{checks:?}");
    };
    assert!(found.contains("of 16"), "{found}");
    assert!(mend.contains("taxel rezero"), "{mend}");
    assert_eq!(code, Some(0));
}

#[test]
fn one_recording_or_scene_is_all_buses_of_its_hand() {
    let dir = TempDir::new().unwrap();
    let sim = ["sim", "idle", "--to", "log:idle.log", "--seconds", "3"];
    assert!(
        taxel(&dir, &sim)
            .stderr(Stdio::null())
            .status()
            .unwrap()
            .success()
    );
    let log = std::fs::read_to_string(dir.path().join("idle.log")).unwrap();
    std::fs::write(dir.path().join("renamed.log"), log.replace(" can", " vcan")).unwrap();
    for sources in [
        &["log:idle.log"][..],
        &["log:idle.log", "log:idle.log"],
        &["sim:idle"],
        &[
            "log:renamed.log?interface=vcan0",
            "log:renamed.log?interface=vcan1",
        ],
    ] {
        let (_, checks) = doctor(&dir, sources);
        let heard = checks
            .iter()
            .filter(|c| c["name"] == "board" && c["state"] == "ok");
        assert_eq!(heard.count(), 15, "{sources:?}: {checks:?}");
    }
    for (sources, words) in [
        (
            &["log:renamed.log"][..],
            "such as log:renamed.log?interface=vcan0 log:renamed.log?interface=vcan1",
        ),
        (
            &["log:idle.log", "log:idle.log?interface=can0"],
            "log:idle.log?interface=can0 is given twice",
        ),
    ] {
        let output = taxel(&dir, &["doctor"]).args(sources).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{sources:?}");
        assert!(said(&output).contains(words), "{sources:?}: {}", said(&output));
    }
}

#[test]
fn a_running_daemon_is_asked_and_its_bus_left_alone() {
    let dir = TempDir::new().unwrap();
    let scene = "sim:idle".to_string();
    configure(
        &dir,
        "uskin-module",
        std::slice::from_ref(&scene),
        "[realtime]\npriority = 0\n",
    );
    let text = std::fs::read_to_string(dir.path().join("hand.toml")).unwrap();
    let text = text.replace(
        "\"images.sock",
        &format!("\"{}/images.sock", dir.path().display()),
    );
    let text = text.replace(
        "\"control.sock",
        &format!("\"{}/control.sock", dir.path().display()),
    );
    let path = dir.path().join("hand.toml");
    std::fs::write(&path, text).unwrap();
    let _daemon = taxeld::Daemon::start(taxeld::Config::load(&path).unwrap()).unwrap();
    let (_, checks) = doctor(&dir, &["--config", "hand.toml"]);
    assert!(
        checks
            .iter()
            .any(|c| c["area"] == "daemon" && c["name"] == "bus" && c["state"] == "ok")
    );
    assert!(checks.iter().all(|c| c["area"] != "hand"));
}

#[test]
fn a_daemon_that_hangs_is_an_error_and_its_bus_left_alone() {
    let dir = TempDir::new().unwrap();
    configure(&dir, "uskin-module", &["sim:idle".to_string()], "");
    let _asked_in_vain = UnixListener::bind(dir.path().join("status.sock")).unwrap();
    let (_, checks) = doctor(&dir, &["--config", "hand.toml"]);
    let [[_, state, found, mend]] = bad(&checks, "status socket")[..] else {
        panic!("{checks:?}");
    };
    assert_eq!(state, "error");
    assert!(
        mend.contains("restart it") && !found.contains("os error"),
        "{found}: {mend}"
    );
    assert!(checks.iter().all(|c| c["area"] != "hand"), "{checks:?}");
    // Where a daemon of this user is looked for.
    let mut scan = taxel(&dir, &["doctor", "--scan", "--start", "udp::43990?hops=0"]);
    let output = scan.env("RUNTIME_DIRECTORY", dir.path()).output().unwrap();
    let told = said(&output);
    assert!(
        told.contains("nobody answers: its buses are left alone"),
        "{told}"
    );
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn a_missing_servo_a_slow_one_and_a_stranger_are_found() {
    let dir = TempDir::new().unwrap();
    let slow = ServoBuild {
        return_delay: 250,
        ..ServoBuild::new(2)
    };
    let builds = [ServoBuild::new(1), slow, ServoBuild::new(3), ServoBuild::new(9)];
    let pty = ServoPty::open(ServoBus::new(builds, 1_000_000)).unwrap();
    pty.bus().set_fault(3, Some(ServoFault::Silent), 1);
    pty.bus().servo_mut(1).unwrap().set_hardware_error(0x20);
    let joints = format!("dynamixel:{}", pty.path().display());
    let log = dir.path().join("empty.log");
    std::fs::write(&log, "(0.000000) can0 123#00\n").unwrap();
    let (code, checks) = doctor(
        &dir,
        &[
            "--layout",
            "uskin-module",
            "log:empty.log",
            "--joints",
            &joints,
            "--ids",
            "1-3",
        ],
    );
    assert_eq!(code, Some(1));
    let missing = bad(&checks, "servo-silent");
    assert_eq!(missing.len(), 1, "{checks:?}");
    assert_eq!(missing[0][..2], ["servo 3", "error"]);
    assert!(
        missing[0][2].ends_with("joints: servo 3 is silent"),
        "{missing:?}"
    );
    assert!(bad(&checks, "answers").is_empty());
    let delay = bad(&checks, "return delay time");
    assert_eq!(delay.len(), 1);
    assert_eq!(delay[0][..3], ["servo 2", "warning", "500 us before each answer"]);
    assert!(
        delay[0][3].contains("write1ByteTxRx(p, 2, 9, 0)"),
        "{}",
        delay[0][3]
    );
    assert_eq!(bad(&checks, "unexpected")[0][0], "servo 9");
    assert!(bad(&checks, "servo-error")[0][2].contains("a hardware error: overload"));
    assert!(bad(&checks, "baud rate").is_empty(), "{checks:?}");
}

#[test]
fn wrong_usage_is_told_at_once() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("a.mcap"), b"\x89MCAP0\r\n").unwrap();
    let converted = "a bus is played from a candump log: `taxel convert a.mcap a.log` makes one of it";
    for (args, code, words) in [
        (&["doctor", "can:can0"][..], 1, "can0, can1): 2, not 1"),
        (
            &["doctor", "--seconds", "0"],
            2,
            "give seconds from 0.001 to 3600",
        ),
        (&["doctor", "--joints", "dynamixel:/dev/ttyUSB0"], 2, "--ids"),
        (&["doctor", "--config", "none.toml"], 1, "none.toml"),
        (&["doctor", "log:a.mcap"], 1, converted),
        (&["doctor", "--scan", "log:a.mcap"], 1, converted),
        (&["setup", "log:a.mcap", "--yes", "--no-touch"], 1, converted),
        (
            &["doctor", "--config", "a.toml", "can:can0"],
            2,
            "cannot be used with",
        ),
    ] {
        let output = taxel(&dir, args).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{args:?}");
        assert!(said(&output).contains(words), "{args:?}: {}", said(&output));
    }
}

#[test]
fn a_scan_of_a_recording_proposes_a_layout_that_the_daemon_takes() {
    let dir = TempDir::new().unwrap();
    let sim = ["sim", "ball-grasp", "--to", "log:grasp.log", "--seconds", "2"];
    assert!(
        taxel(&dir, &sim)
            .stderr(Stdio::null())
            .status()
            .unwrap()
            .success()
    );
    let output = taxel(
        &dir,
        &["doctor", "--scan", "log:grasp.log", "--out", "found.toml"],
    )
    .output()
    .unwrap();
    let text = said(&output);
    assert!(output.status.success(), "{text}");
    assert!(
        text.contains("8 boards of uskin-l2") && text.contains("7 boards of uskin-l2"),
        "{text}"
    );
    assert!(text.contains("built-in hand allegro-uskin-15"), "{text}");
    let sources =
        ["can0", "can1"].map(|bus| format!("log:{}/grasp.log?interface={bus}", dir.path().display()));
    configure(&dir, "found.toml", &sources, "");
    let config = taxeld::Config::load(&dir.path().join("hand.toml")).unwrap();
    assert_eq!((config.layout.modules.len(), config.layout.len()), (15, 240));
    let (_, checks) = doctor(&dir, &["--config", "hand.toml"]);
    assert!(
        [
            "board",
            "board-unheard",
            "board-silent",
            "bus-silent",
            "unknown ids"
        ]
        .iter()
        .all(|name| bad(&checks, name).is_empty()),
        "{checks:?}"
    );
}

#[test]
fn a_scan_starts_silent_boards_only_where_it_is_told_to() {
    let dir = TempDir::new().unwrap();
    let (_hand, sources) = hand(&dir, "idle", &["--layout", "uskin-module"], 1);
    let scan = |more: &[&str]| {
        let mut command = taxel(
            &dir,
            &["doctor", "--scan", "--json", "--seconds", "1", &sources[0]],
        );
        let output = command.args(more).output().unwrap();
        let found: Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)));
        (output.status.code(), found)
    };
    let (code, silent) = scan(&[]);
    assert_eq!((code, &silent["layout"]), (Some(1), &Value::Null));
    let found = eventually(|| {
        let (code, found) = scan(&["--start"]);
        let board = &found["buses"][0]["boards"][0];
        let whole = board["taxels"].as_array().is_some_and(|t| t.len() == 16);
        let is_it = (&board["protocol"], &board["board"]) == (&"uskin-l1".into(), &1.into());
        (code == Some(0) && whole && is_it)
            .then_some(found.clone())
            .ok_or(found.to_string())
    });
    let text = found["layout"].as_str().unwrap();
    assert_eq!(taxel_skin::Layout::parse(text, "found.toml").unwrap().len(), 16);
}

#[test]
fn a_scan_that_starts_boards_configures_those_of_an_icub_which_have_to_be() {
    let dir = TempDir::new().unwrap();
    let (_hand, sources) = hand(&dir, "idle", &["--layout", "icub-forearm"], 1);
    let wanted = taxel_skin::Layout::builtin("icub-forearm").unwrap();
    let found = eventually(|| {
        let mut command = taxel(&dir, &["doctor", "--scan", "--start", "--json", "--seconds", "1"]);
        let output = command.arg(&sources[0]).output().unwrap();
        let found: Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)));
        let is_whole = found["layout"]
            .as_str()
            .is_some_and(|text| taxel_skin::Layout::parse(text, "found.toml").unwrap().len() == wanted.len());
        is_whole.then_some(found.clone()).ok_or(found.to_string())
    });
    let boards = found["buses"][0]["boards"].as_array().unwrap();
    assert_eq!(boards.len(), wanted.wiring.len());
    assert!(
        boards.iter().all(|board| board["protocol"] == "icub-mtb3"),
        "{boards:?}"
    );
}
