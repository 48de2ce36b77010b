//! `taxel config`.

use crate::{fails, succeeds, texts};
use std::fs::{self, Permissions};
use std::io::Write;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use taxel_skin::Layout;
use tempfile::TempDir;

#[test]
fn a_file_to_start_from_is_one_that_is_well_for_every_hand_with_buses() {
    let dir = TempDir::new().unwrap();
    for name in Layout::builtin_names() {
        let layout = Layout::builtin(name).unwrap();
        if layout.buses.is_empty() {
            assert!(fails(&dir, &["config", "init", "--layout", name], 1).contains("no buses"));
            continue;
        }
        let source = |bus: usize| match layout.array_on(bus) {
            Some(_) => format!("pressure:/tmp/{}.sock", 43113 + bus),
            None => format!("udp::{}", 43113 + bus),
        };
        let sources: Vec<String> = (0..layout.buses.len()).map(source).collect();
        let mut args = vec!["config", "init", "--layout", name, "--out", "taxeld.toml"];
        let _ = std::fs::remove_file(dir.path().join("taxeld.toml"));
        sources
            .iter()
            .for_each(|source| args.extend(["--source", source]));
        succeeds(&dir, &args);
        // It is there to be edited, and stays as it is.
        assert!(fails(&dir, &args, 1).contains("taxeld.toml exists; --force"));
        let (out, _) = succeeds(&dir, &["config", "check", "taxeld.toml"]);
        assert!(
            out.starts_with(&format!("{name}: ")) && out.contains("43113"),
            "{out}"
        );
    }
    let err = fails(&dir, &["config", "init", "--source", "udp:"], 1);
    assert!(err.contains("2 buses (can0, can1)"), "{err}");
}

#[test]
fn boards_that_are_too_many_for_their_bus_are_triggered_in_a_file_to_start_from() {
    let dir = TempDir::new().unwrap();
    let boards_of = |options: &[&str]| {
        let (text, _) = succeeds(&dir, &[&["config", "init"], options].concat());
        let config: toml::Table = text.parse().unwrap();
        config["boards"].as_table().unwrap().clone()
    };
    // Eight modules on a bus, as /etc/taxeld/taxeld.toml of the service has them.
    let boards = boards_of(&[]);
    assert_eq!(boards["mode"].as_str(), Some("triggered"), "{boards}");
    assert_eq!(boards["trigger_hz"].as_float(), Some(49.0), "{boards}");
    // One module has the bus for itself, and simulated and recorded boards need none.
    assert!(boards_of(&["--layout", "uskin-module"]).is_empty());
    assert!(boards_of(&["--source", "udp:", "--source", "udp::43114"]).is_empty());
}

#[test]
fn an_array_too_great_for_simulated_boards_is_said_to_be_a_pressure_array() {
    let dir = TempDir::new().unwrap();
    let init = |grid| fails(&dir, &["config", "init", "--layout", grid], 1);
    assert!(init("grid:16x10").contains("taxel sim roll --layout grid:16x10 --show"));
    let said = init("grid:16x24");
    assert!(
        said.contains("pressure-array") && !said.contains("taxel sim"),
        "{said}"
    );
    let said = init("tekscan-6077");
    assert!(
        said.contains("give --source pressure:PATH") && !said.contains("taxeld.toml"),
        "{said}"
    );
    let said = fails(
        &dir,
        &["sim", "roll", "--layout", "grid:16x24", "--to", "udp:"],
        1,
    );
    assert!(
        said.contains("pressure-array") && !said.contains("--show"),
        "{said}"
    );
}

#[test]
fn sockets_in_the_folder_that_systemd_makes_are_said_not_to_be_checked() {
    let dir = TempDir::new().unwrap();
    let at = |name: &str| dir.path().join(name);
    let open = |path: &Path, mode| fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
    // Root may make the folder, so where root tests it, nobody asks, who can run what is in an open folder.
    open(dir.path(), 0o755);
    // By another process: while a test beside this one forks, nobody can run what is open here to be written.
    let copied = Command::new("cp")
        .arg(env!("CARGO_BIN_EXE_taxel"))
        .arg(at("taxel"))
        .status();
    assert!(copied.unwrap().success());
    fs::create_dir(at("open")).unwrap();
    open(&at("open"), 0o777);
    let is_root = fs::metadata(dir.path()).unwrap().uid() == 0;
    let hand = "layout = 'uskin-module'\n[[bus]]\nsource = 'udp:'\n[socket]\n";
    for (folder, is_told) in [("/run/taxeld-nobodys", true), ("open", false)] {
        let text = format!("{hand}images = '{folder}/images.sock'\ncontrol = '{folder}/control.sock'\n");
        fs::write(at("a.toml"), text).unwrap();
        let mut check = Command::new(at("taxel"));
        check.args(["config", "check", "a.toml"]).current_dir(dir.path());
        if is_root {
            check.uid(65534).gid(65534);
        }
        let output = check.output().unwrap();
        let said = texts(&output).1;
        let told = format!("not checked: {folder}/images.sock");
        assert!(
            output.status.success() && said.contains(&told) == is_told,
            "{said}"
        );
    }
}

#[test]
fn what_is_in_force_is_a_configuration_that_says_the_same() {
    let dir = TempDir::new().unwrap();
    let text = "layout = 'uskin-module'\n[[bus]]\nsource = 'udp:'\n[profile]\nmethod = 'paper'\n[joints]\n\
                source = 'allegro:can2'\nallegro.version = 4\n";
    fs::write(dir.path().join("a.toml"), text).unwrap();
    let (shown, _) = succeeds(&dir, &["config", "show", "a.toml"]);
    for wanted in [
        "layout = \"uskin-module\"",
        "rate_hz = 30.0",
        "fault_rule = \"paper\"",
        "placement = \"lloyd\"",
        "version = 4",
        "own_bus = false",
        "hold_ms = 250.0",
    ] {
        assert!(shown.contains(wanted), "{wanted} in {shown}");
    }
    fs::write(dir.path().join("b.toml"), &shown).unwrap();
    assert_eq!(succeeds(&dir, &["config", "show", "b.toml"]).0, shown);
    let (json, _) = succeeds(&dir, &["config", "show", "a.toml", "--json"]);
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(value["tick"]["rate_hz"], 30.0);
    assert_eq!(value["bus"][0]["source"], "udp:239.74.163.2:43113");
}

#[test]
fn what_is_wrong_is_told_with_file_and_line_and_stdin_is_a_file_too() {
    let dir = TempDir::new().unwrap();
    fs::write(dir.path().join("a.toml"), "[bus]\nsource = 'udp:'\n").unwrap();
    let err = fails(&dir, &["config", "check", "a.toml"], 1);
    assert!(err.contains("a.toml:1: write [[bus]]"), "{err}");
    for (command, wants) in [
        (&["config", "check", "a.toml"][..], "1"),
        (&["doctor", "--config", "a.toml"], "full"),
        (
            &["compress", "a.log", "--config", "a.toml", "--out", "a.npz"],
            "full",
        ),
    ] {
        let mut taxel = crate::command(&dir, command);
        taxel
            .env("RUST_BACKTRACE", wants)
            .env("RUST_LIB_BACKTRACE", wants);
        let (_, err) = texts(&taxel.output().unwrap());
        assert!(
            err.contains("a.toml:1: ") && err.lines().count() == 1,
            "{command:?}: {err}"
        );
    }
    let err = fails(&dir, &["config", "check", "none.toml"], 1);
    assert!(err.contains("none.toml"), "{err}");
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxel"));
    command
        .args(["config", "check", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped());
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"rate = 3\n").unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(texts(&output).1.contains("stdin:1: unknown key `rate`"));
}
