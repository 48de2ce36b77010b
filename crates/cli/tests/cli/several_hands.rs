//! Where no socket is named and only daemons of several hands run, as `taxeld@left` and `taxeld@right`.

use crate::{config, texts};
use std::fs;
use std::net::UdpSocket;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use taxeld::Daemon;
use tempfile::TempDir;

const SOCKETS: [&str; 3] = ["status.sock", "control.sock", "images.sock"];

/// The folder of a daemon that has ended, of this name.
fn ended(dir: &TempDir, name: &str) -> PathBuf {
    let folder = dir.path().join(name);
    fs::create_dir(&folder).unwrap();
    for socket in SOCKETS {
        drop(UnixListener::bind(folder.join(socket)).unwrap());
    }
    folder
}

/// The same of one that runs, as long as what is returned is kept.
fn running(dir: &TempDir, name: &str) -> (PathBuf, UnixListener) {
    let folder = ended(dir, name);
    let status = folder.join("status.sock");
    fs::remove_file(&status).unwrap();
    let listener = UnixListener::bind(status).unwrap();
    (folder, listener)
}

fn taxel_with(default: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_taxel"))
        .args(args)
        .env("RUNTIME_DIRECTORY", default)
        .current_dir(default.parent().unwrap())
        .output()
        .unwrap()
}

/// What a command says that fails.
fn said(default: &Path, args: &[&str]) -> String {
    let output = taxel_with(default, args);
    let (out, err) = texts(&output);
    // Of a daemon that does not run `metrics` tells that.
    let code = i32::from(args != ["metrics"]);
    assert_eq!(output.status.code(), Some(code), "taxel {args:?}\n{out}{err}");
    err
}

/// Commands of each kind, and the socket that each takes.
const COMMANDS: [(&[&str], &str); 9] = [
    (&["status"], "status.sock"),
    (&["metrics"], "status.sock"),
    (&["profile"], "status.sock"),
    (&["rezero"], "control.sock"),
    (&["mark", "a"], "control.sock"),
    (&["servo", "index 0", "--torque", "off"], "control.sock"),
    (&["watch"], "images.sock"),
    (&["view", "--seconds", "0.1"], "images.sock"),
    (&["record", "a.mcap", "--seconds", "0.1"], "images.sock"),
];

#[test]
fn the_hands_that_have_a_daemon_are_named_with_the_option_that_takes_one() {
    let dir = TempDir::new().unwrap();
    let default = ended(&dir, "taxeld");
    ended(&dir, "taxeld-gone");
    let (right, _right) = running(&dir, "taxeld-right");
    for (args, socket) in COMMANDS {
        let wanted = format!("taxeld runs as right: --socket {}", right.join(socket).display());
        let said = said(&default, args);
        assert!(said.contains(&wanted), "{args:?}: {said}");
        assert!(!said.contains("no taxeld runs"), "{args:?}: {said}");
    }
    let (left, _left) = running(&dir, "taxeld-left");
    for (args, socket) in COMMANDS {
        let wanted = format!(
            "taxeld runs as left and right: --socket {}",
            left.join(socket).display()
        );
        let said = said(&default, args);
        assert_eq!(said.matches(&wanted).count(), 1, "{args:?}: {said}");
    }
}

#[test]
fn a_command_with_two_sockets_is_told_both() {
    let dir = TempDir::new().unwrap();
    let default = ended(&dir, "taxeld");
    let (left, _left) = running(&dir, "taxeld-left");
    let [_, control, images] = SOCKETS.map(|socket| left.join(socket).display().to_string());
    let said = said(&default, &["forearm", "record", "arm", "--allow-motion"]);
    let wanted = format!("taxeld runs as left: --control {control} --socket {images}\n");
    assert!(said.contains(&wanted), "{said}");
}

#[test]
fn who_named_a_socket_or_is_one_of_the_hands_is_told_of_no_other() {
    let dir = TempDir::new().unwrap();
    let default = ended(&dir, "taxeld");
    let left = ended(&dir, "taxeld-left");
    let (_, _right) = running(&dir, "taxeld-right");
    let elsewhere = TempDir::new().unwrap();
    let named = ended(&elsewhere, "taxeld").join("status.sock");
    let (_, _another) = running(&elsewhere, "taxeld-right");
    for (default, args) in [
        (&default, &["status", "--socket", named.to_str().unwrap()][..]),
        // As `taxel-metrics@left` is.
        (&left, &["status"]),
    ] {
        let said = said(default, args);
        assert!(said.contains("no taxeld runs there"), "{args:?}: {said}");
        assert!(!said.contains("right"), "{args:?}: {said}");
    }
}

#[test]
fn a_bus_that_the_daemon_of_one_of_several_hands_reads_is_not_set_up_beside_it() {
    let dir = TempDir::new().unwrap();
    let default = ended(&dir, "taxeld");
    let port = || UdpSocket::bind("0.0.0.0:0").unwrap().local_addr().unwrap().port();
    let [first, second] = [port(), port()].map(|port| format!("udp:239.74.163.2:{port}?hops=0"));
    let folder = dir.path().join("taxeld-left");
    fs::create_dir(&folder).unwrap();
    let sources = [&first, &second].map(|source| source.parse().unwrap());
    let _left = Daemon::start(config(&folder, sources)).unwrap();
    let said = said(
        &default,
        &["setup", "--yes", "--dry-run", "--seconds", "0.1", &second],
    );
    // Lines are wrapped.
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    for wanted in ["A daemon reads udp:", "systemctl stop taxeld@left", "beside it"] {
        assert!(said.contains(wanted), "{wanted}: {said}");
    }
    assert!(!said.contains("Ask for boards"), "{said}");
}
