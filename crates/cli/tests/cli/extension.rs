//! `taxel NAME` as the program `taxel-NAME`.

use crate::{fails, texts};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

/// A program that prints its name and its arguments and ends with 7.
fn program(folder: &Path, name: &str) {
    let path = folder.join(name);
    let script = format!("#!/bin/sh\necho \"{} of $0:\" \"$@\"\nexit 7\n", folder.display());
    fs::write(&path, script).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
}

fn run(taxel: &Path, path: &Path, args: &[&str]) -> Output {
    Command::new(taxel).args(args).env("PATH", path).output().unwrap()
}

fn built() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_taxel"))
}

#[test]
fn a_program_in_path_is_a_command_with_its_arguments_and_exit_code() {
    let dir = TempDir::new().unwrap();
    program(dir.path(), "taxel-hello");
    let output = run(built(), dir.path(), &["hello", "--help", "-x", "a b"]);
    let (out, err) = texts(&output);
    assert!(out.ends_with("/taxel-hello: --help -x a b\n"), "{out}{err}");
    assert_eq!(output.status.code(), Some(7), "{err}");
}

#[test]
fn a_program_beside_taxel_comes_before_one_in_path() {
    let (beside, path) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let taxel = beside.path().join("taxel");
    fs::hard_link(built(), &taxel)
        .or_else(|_| fs::copy(built(), &taxel).map(drop))
        .unwrap();
    for folder in [&beside, &path] {
        program(folder.path(), "taxel-hello");
    }
    let (out, err) = texts(&run(&taxel, path.path(), &["hello"]));
    let wanted = beside.path().display().to_string();
    assert!(out.starts_with(&wanted), "{out}{err}");
}

#[test]
fn a_built_in_command_is_not_replaced_by_a_program() {
    let dir = TempDir::new().unwrap();
    program(dir.path(), "taxel-sim");
    let output = run(built(), dir.path(), &["sim", "--list"]);
    assert!(output.status.success());
    assert!(texts(&output).0.contains("ball-grasp"));
}

#[test]
fn an_unknown_command_is_told_with_what_was_meant_and_what_there_is() {
    let dir = TempDir::new().unwrap();
    let err = fails(&dir, &["wach"], 2);
    for wanted in ["`wach`", "did you mean `watch`?", "compress", "taxel-NAME"] {
        assert!(err.contains(wanted), "{err}");
    }
    assert!(!fails(&dir, &["xyzzy"], 2).contains("did you mean"));
    fails(&dir, &["../../bin/sh"], 2);
    fails(&dir, &[""], 2);
}

#[test]
fn a_program_that_is_meant_is_proposed_too() {
    let dir = TempDir::new().unwrap();
    program(dir.path(), "taxel-hello");
    let (_, err) = texts(&run(built(), dir.path(), &["helo"]));
    assert!(err.contains("did you mean `hello`?"), "{err}");
}

#[test]
fn the_list_has_built_in_commands_and_programs_but_no_other_files() {
    let dir = TempDir::new().unwrap();
    program(dir.path(), "taxel-hello");
    fs::write(dir.path().join("taxel-notes"), "").unwrap();
    fs::create_dir(dir.path().join("taxel-folder")).unwrap();
    let (out, _) = texts(&run(built(), dir.path(), &["--list"]));
    let hello = dir.path().join("taxel-hello").display().to_string();
    assert!(out.contains(&hello), "{out}");
    assert!(out.lines().any(|line| line.starts_with("watch ")), "{out}");
    assert!(!out.contains("notes") && !out.contains("folder"), "{out}");
}

#[test]
fn a_misspelt_scene_layout_or_method_is_told_with_what_was_meant() {
    let dir = TempDir::new().unwrap();
    for (args, meant) in [
        (
            ["compress", "sim:bal-grasp", "--method", "paper"],
            "did you mean `ball-grasp`?",
        ),
        (
            ["compress", "sim:tap", "--layout", "uskn-module"],
            "did you mean `uskin-module`?",
        ),
        (
            ["compress", "sim:tap", "--method", "papper"],
            "did you mean `paper`?",
        ),
    ] {
        let mut command = Command::new(built());
        let output = command
            .args(args)
            .args(["--out", "a.npz"])
            .current_dir(dir.path())
            .output();
        let output = output.unwrap();
        assert!(!output.status.success());
        let (_, err) = texts(&output);
        assert!(err.contains(meant), "{args:?}: {err}");
    }
    let output = run(built(), dir.path(), &["sim", "tap", "--to", "udp:"]);
    let (_, err) = texts(&output);
    assert!(err.contains("such as udp::43113 and udp::43114"), "{err}");
}
