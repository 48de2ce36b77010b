//! `taxel doctor` as a user runs it: what it says of a hand, against simulated boards over UDP and simulated servos on a
//! pseudo terminal, and where a daemon has the hand.

mod recordings;
mod scan;
mod several_hands;

use serde_json::Value;
use std::net::UdpSocket;
use std::os::unix::net::UnixListener;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
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

/// What takes longer has hung.
const HANGS_AFTER: Duration = Duration::from_secs(200);

/// Tries again where the machine may have been too busy to simulate a hand in real time.
fn eventually<T>(mut attempt: impl FnMut() -> Result<T, String>) -> T {
    let begun = Instant::now();
    loop {
        match attempt() {
            Ok(done) => return done,
            Err(why) => assert!(begun.elapsed() < HANGS_AFTER, "never: {why}"),
        }
    }
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

/// A simulated hand in a process of its own, until it is dropped. Nobody else is given the ports of the sockets meanwhile, which
/// hear nothing of groups.
struct Hand(Child, #[expect(dead_code)] Vec<UdpSocket>);

impl Drop for Hand {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Puts a scene on as many UDP buses as are wanted, with the config's sources to reach it.
fn hand(dir: &TempDir, scene: &str, extra: &[&str], buses: usize) -> (Hand, Vec<String>) {
    let ports: Vec<UdpSocket> = (0..buses)
        .map(|_| UdpSocket::bind("127.0.0.1:0").unwrap())
        .collect();
    let port = |socket: &UdpSocket| socket.local_addr().unwrap().port();
    let sources: Vec<String> = (ports.iter())
        .map(|socket| format!("udp:239.74.163.2:{}?hops=0", port(socket)))
        .collect();
    let mut command = taxel(dir, &["sim", scene]);
    for source in &sources {
        command.args(["--to", source]);
    }
    let child = command.args(extra).stderr(Stdio::null()).spawn().unwrap();
    (Hand(child, ports), sources)
}

/// Runs `taxel sim` to its end: a scene into a log.
fn recorded(dir: &TempDir, sim: &str) {
    let made = taxel(dir, &["sim"]).args(sim.split(' ')).output().unwrap();
    assert!(made.status.success(), "{}", said(&made));
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
        // Before any board speaks there is another sentence.
        let dead = dead.ok_or_else(|| format!("the board without power is not found: {boards:?}"))?;
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
    let checks = eventually(|| {
        let known = ["--layout", "uskin-module", "log:empty.log"];
        let (code, checks) = doctor(
            &dir,
            &[&known[..], &["--joints", &joints, "--ids", "1-3"]].concat(),
        );
        assert_eq!(code, Some(1));
        // On a machine that is held up others may be silent, or late.
        let is_alone = bad(&checks, "answers").is_empty() && bad(&checks, "servo-silent").len() == 1;
        match is_alone {
            true => Ok(checks),
            false => Err(format!("{checks:?}")),
        }
    });
    let missing = bad(&checks, "servo-silent");
    assert_eq!(missing[0][..2], ["servo 3", "error"]);
    assert!(
        missing[0][2].ends_with("joints: servo 3 is silent"),
        "{missing:?}"
    );
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
    ] {
        let output = taxel(&dir, args).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{args:?}");
        assert!(said(&output).contains(words), "{args:?}: {}", said(&output));
    }
}
