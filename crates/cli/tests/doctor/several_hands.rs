//! Where each hand has a daemon of its own, as `taxeld@left`, and the configuration names no socket.

use crate::{bad, said, taxel};
use serde_json::Value;
use std::fs;
use std::net::UdpSocket;
use std::os::unix::net::UnixListener;
use std::path::Path;
use taxeld::{Config, Daemon};
use tempfile::TempDir;

/// A daemon of one of several hands, in a folder beside `taxeld`.
fn daemon(dir: &TempDir, hand: &str, source: &str) -> Daemon {
    let folder = dir.path().join(format!("taxeld-{hand}"));
    fs::create_dir(&folder).unwrap();
    let sockets =
        ["images", "control"].map(|name| format!("{name} = \"{}/{name}.sock\"\n", folder.display()));
    let text = format!(
        "{}[realtime]\npriority = 0\n[socket]\n{}",
        hand_of(source),
        sockets.concat()
    );
    Daemon::start(Config::parse(&text, &dir.path().join("hand.toml")).unwrap()).unwrap()
}

/// The configuration of a hand, as `config init` writes it.
fn hand_of(source: &str) -> String {
    format!("layout = \"uskin-module\"\n[[bus]]\nsource = \"{source}\"\n")
}

/// What the doctor finds with a configuration without sockets, or without any.
fn doctor(dir: &TempDir, config: Option<&str>) -> Vec<Value> {
    let mut doctor = taxel(dir, &["doctor", "--json", "--seconds", "0.1"]);
    if let Some(config) = config {
        fs::write(dir.path().join("hand.toml"), config).unwrap();
        doctor.args(["--config", "hand.toml"]);
    }
    let output = doctor
        .env("RUNTIME_DIRECTORY", dir.path().join("taxeld"))
        .output()
        .unwrap();
    let report: Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)));
    report["checks"].as_array().unwrap().clone()
}

/// What is said of daemons: of which hand, and what.
fn daemons(checks: &[Value]) -> Vec<[&str; 2]> {
    let of = checks
        .iter()
        .filter(|c| c["area"] == "daemon" && c["name"] == "taxeld");
    of.map(|c| ["object", "found"].map(|key| c[key].as_str().unwrap()))
        .collect()
}

fn is_looked_at(checks: &[Value]) -> bool {
    checks.iter().any(|c| c["area"] == "hand")
}

#[test]
fn the_daemon_that_reads_the_buses_of_the_configuration_is_asked_and_they_are_left_alone() {
    let dir = TempDir::new().unwrap();
    let port = UdpSocket::bind("0.0.0.0:0").unwrap().local_addr().unwrap().port();
    let _left = daemon(&dir, "left", &format!("udp:239.74.163.2:{port}?hops=0"));
    let _right = daemon(&dir, "right", "sim:idle");
    let checks = doctor(&dir, Some(&hand_of("sim:idle")));
    let [right, says] = daemons(&checks)[..] else {
        panic!("{checks:?}");
    };
    assert!(
        right[0] == "right" && right[1].contains("taxeld-right/status.sock"),
        "{right:?}"
    );
    assert!(says[1].contains("its buses are left alone"), "{says:?}");
    assert!(!is_looked_at(&checks), "{checks:?}");
    // A hand of neither.
    fs::write(dir.path().join("empty.log"), "(0.000000) can0 123#00\n").unwrap();
    let checks = doctor(&dir, Some(&hand_of("log:empty.log")));
    let told = daemons(&checks);
    let others = told.iter().filter(|[_, found]| found.contains("on other buses"));
    assert_eq!(others.count(), 2, "{told:?}");
    assert!(is_looked_at(&checks), "{checks:?}");
}

#[test]
fn without_a_configuration_the_only_hand_that_has_a_daemon_is_looked_at() {
    if Path::new("/etc/taxeld/taxeld.toml").is_file() {
        return;
    }
    let dir = TempDir::new().unwrap();
    let _left = daemon(&dir, "left", "sim:idle");
    let checks = doctor(&dir, None);
    assert_eq!(daemons(&checks)[0][0], "left", "{checks:?}");
    assert!(!is_looked_at(&checks), "{checks:?}");
}

#[test]
fn a_daemon_that_does_not_say_what_it_reads_may_have_the_buses() {
    let dir = TempDir::new().unwrap();
    let folder = dir.path().join("taxeld-left");
    fs::create_dir(&folder).unwrap();
    let _asked_in_vain = UnixListener::bind(folder.join("status.sock")).unwrap();
    let checks = doctor(&dir, Some(&hand_of("sim:idle")));
    let [[socket, "error", ..]] = bad(&checks, "status socket")[..] else {
        panic!("{checks:?}");
    };
    assert_eq!(socket, folder.join("status.sock").to_str().unwrap());
    assert!(!is_looked_at(&checks), "{checks:?}");
}
