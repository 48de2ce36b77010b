//! Recordings on stdin and stdout, and answers for scripts.

use crate::{HANGS_AFTER, command, fails, succeeds, texts};
use serde_json::Value;
use std::fs::{self, File};
use std::io::Write;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Runs with a file of the folder on stdin.
fn reading(dir: &TempDir, file: &str, args: &[&str]) -> Output {
    let stdin = File::open(dir.path().join(file)).unwrap();
    let mut command = command(dir, args);
    command.stdin(stdin).env("TMPDIR", dir.path()).output().unwrap()
}

fn object(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

#[test]
fn a_recording_of_any_kind_is_read_from_stdin_and_leaves_no_file() {
    let dir = TempDir::new().unwrap();
    let seconds = ["--seconds", "3"];
    succeeds(
        &dir,
        &[&["sim", "tap", "--to", "log:tap.log"][..], &seconds].concat(),
    );
    for name in ["tap.mcap", "tap.npz", "tap.csv"] {
        succeeds(&dir, &["convert", "tap.log", name]);
    }
    for name in ["tap.log", "tap.mcap", "tap.npz", "tap.csv"] {
        succeeds(&dir, &["compress", name, "--out", "named.npy"]);
        let before = fs::read_dir(dir.path()).unwrap().count();
        let output = reading(&dir, name, &["compress", "-", "--out", "stdin.npy"]);
        assert!(output.status.success(), "{name}: {}", texts(&output).1);
        let [named, stdin] = ["named.npy", "stdin.npy"].map(|file| fs::read(dir.path().join(file)).unwrap());
        assert!(named == stdin, "{name}: other images from stdin");
        fs::remove_file(dir.path().join("stdin.npy")).unwrap();
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), before, "{name}");
    }
    let missing = reading(&dir, "tap.log", &["figures", "-", "-", "--out", "figures"]);
    assert!(!missing.status.success());
}

#[test]
fn what_is_packed_is_told_with_what_unpacks_it() {
    let dir = TempDir::new().unwrap();
    fs::write(dir.path().join("packed"), b"\x1f\x8b\x08\0\xff\xff").unwrap();
    let output = reading(&dir, "packed", &["compress", "-", "--out", "images.npy"]);
    let said = texts(&output).1;
    assert!(
        said.contains("stdin: it is packed; `zcat FILE | taxel COMMAND -`"),
        "{said}"
    );
}

#[test]
fn what_came_through_stdin_is_called_so() {
    let dir = crate::categorize::recorded();
    let args = ["categorize", "-", "--marks", "marks.csv", "--classes", "2"];
    let (out, err) = texts(&reading(&dir, "frames.csv", &args));
    assert!(out.starts_with("stdin: 6 touches"), "{out}{err}");
}

#[test]
fn a_configuration_and_a_layout_are_read_from_stdin_and_pipes_as_from_files() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "3"]);
    let (layout, _) = succeeds(&dir, &["layouts", "allegro-uskin-15", "--file"]);
    fs::write(
        dir.path().join("hand.toml"),
        layout.replace("allegro-uskin-15", "mine"),
    )
    .unwrap();
    let buses = "[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"can:can1\"\n";
    let config = format!("layout = \"hand.toml\"\n{buses}[profile]\nlevels = 3\n");
    fs::write(dir.path().join("taxeld.toml"), config).unwrap();
    for (option, file) in [("--config", "taxeld.toml"), ("--layout", "hand.toml")] {
        succeeds(
            &dir,
            &["compress", "tap.log", option, file, "--out", "named.jsonl"],
        );
        let named = fs::read_to_string(dir.path().join("named.jsonl")).unwrap();
        let output = reading(&dir, file, &["compress", "tap.log", option, "-", "--out", "-"]);
        assert_eq!(texts(&output).0, named, "{option}: {}", texts(&output).1);
        let pipe = format!(
            "cat {file} | {} compress tap.log {option} /dev/stdin --out -",
            env!("CARGO_BIN_EXE_taxel")
        );
        let output = Command::new("sh")
            .args(["-c", &pipe])
            .current_dir(dir.path())
            .output()
            .unwrap();
        assert_eq!(texts(&output).0, named, "{option}: {}", texts(&output).1);
    }
    let (drawn, _) = succeeds(&dir, &["layouts", "hand.toml"]);
    assert_eq!(texts(&reading(&dir, "hand.toml", &["layouts", "-"])).0, drawn);
    // What is wrong is said of stdin.
    fs::write(dir.path().join("wrong.toml"), "layuot = 3\n").unwrap();
    for option in ["--config", "--layout"] {
        let args = ["compress", "tap.log", option, "-", "--out", "a.npy"];
        let (_, err) = texts(&reading(&dir, "wrong.toml", &args));
        assert!(err.contains("stdin:1"), "{option}: {err}");
    }
    let args = ["compress", "-", "--config", "-", "--out", "a.npy"];
    let (_, err) = texts(&reading(&dir, "tap.log", &args));
    assert!(err.contains("named twice"), "{err}");
}

#[test]
fn the_doctor_looks_at_a_log_on_stdin() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "3"]);
    for args in [&["doctor", "--json"][..], &["doctor", "--scan", "--json"]] {
        let named = crate::taxel(&dir, &[args, &["log:tap.log"]].concat());
        let output = reading(&dir, "tap.log", &[args, &["-"]].concat());
        assert_eq!(output.status, named.status, "{args:?}: {}", texts(&output).1);
        let without_its_name = |output: &Output, name: &str| texts(output).0.replace(name, "");
        assert_eq!(
            without_its_name(&output, "stdin"),
            without_its_name(&named, "tap.log"),
            "{args:?}"
        );
    }
}

#[test]
fn a_signal_leaves_nothing_of_what_came_through_a_pipe() {
    let dir = TempDir::new().unwrap();
    let temporary = dir.path().join("tmp");
    fs::create_dir(&temporary).unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "3"]);
    let log = fs::read(dir.path().join("tap.log")).unwrap();
    let count = |folder: &Path, start: &str| {
        let names = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name());
        names
            .filter(|name| name.to_string_lossy().starts_with(start))
            .count()
    };
    let long = ["eval", "-", "--restarts", "100000", "--csv", "out.csv"];
    // While it is read, by a command that looks at signals and one that does not, and while one works with it.
    for (args, is_read, code, by) in [
        (&["compress", "-", "--out", "a.npy"][..], false, None, Some(15)),
        (&["categorize", "-", "--classes", "2"], false, None, Some(15)),
        (&long, true, Some(128 + 15), None),
    ] {
        let mut command = command(&dir, args);
        command.env("TMPDIR", &temporary);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
        let mut stdin = child.stdin.take();
        stdin.as_mut().unwrap().write_all(&log).unwrap();
        let deadline = Instant::now() + HANGS_AFTER;
        let begun = || match is_read {
            false => count(&temporary, "taxel-") > 0,
            true => count(dir.path(), "out.") > 0,
        };
        if is_read {
            stdin = None;
        }
        while !begun() {
            assert!(Instant::now() < deadline, "{args:?}: it does not begin");
            std::thread::sleep(Duration::from_millis(1));
        }
        let pid = nix::unistd::Pid::from_raw(child.id() as i32);
        nix::sys::signal::kill(pid, nix::sys::signal::SIGTERM).unwrap();
        let status = child.wait().unwrap();
        drop(stdin);
        assert_eq!((status.code(), status.signal()), (code, by), "{args:?}");
        assert_eq!(
            (count(&temporary, ""), count(dir.path(), "out.")),
            (0, 0),
            "{args:?}"
        );
    }
}

#[test]
fn a_pipe_with_a_name_is_read_as_stdin_is_and_no_other_kind_of_file() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "3"]);
    succeeds(&dir, &["compress", "tap.log", "--out", "named.npy"]);
    let piped = |command: &str| {
        let mut shell = Command::new("sh");
        let taxel = env!("CARGO_BIN_EXE_taxel");
        let shell = shell.args(["-c", command, "sh", taxel]).current_dir(dir.path());
        shell.env("TMPDIR", dir.path()).output().unwrap()
    };
    for command in [
        "mkfifo p.log; cat tap.log > p.log & exec \"$1\" compress p.log --out piped.npy",
        // As a shell's <(cat tap.log) is called.
        "cat tap.log | \"$1\" compress /dev/fd/3 --out piped.npy 3<&0 < /dev/null",
    ] {
        let output = piped(command);
        assert!(output.status.success(), "{command}: {}", texts(&output).1);
        let [named, piped] = ["named.npy", "piped.npy"].map(|file| fs::read(dir.path().join(file)).unwrap());
        assert!(named == piped, "{command}: other images");
    }
    let (_, err) = texts(&piped(
        "printf '1,2\\n3\\n' > p.log & exec \"$1\" compress p.log --out piped.npy",
    ));
    assert!(err.contains("p.log:2: 1 column,"), "{err}");
    let err = fails(&dir, &["compress", "/dev/null", "--out", "a.npy"], 2);
    assert!(
        err.contains("no regular file") && err.contains("`-` reads stdin"),
        "{err}"
    );
}

#[test]
fn what_is_wrong_with_stdin_is_told_of_stdin() {
    let dir = TempDir::new().unwrap();
    fs::write(dir.path().join("bad.csv"), "1,2\n3\n4,5\n").unwrap();
    let output = reading(&dir, "bad.csv", &["compress", "-", "--out", "a.npy"]);
    assert_eq!(
        texts(&output).1,
        "taxel: stdin:2: 1 column, where the lines before have 2\n"
    );
}

#[test]
fn images_and_traffic_go_to_stdout_as_they_go_into_files() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "3"]);
    succeeds(&dir, &["compress", "tap.log", "--out", "images.jsonl"]);
    // A recording has the same name as where it is a source.
    let (images, _) = succeeds(&dir, &["compress", "log:tap.log", "--out", "-"]);
    assert_eq!(
        images,
        fs::read_to_string(dir.path().join("images.jsonl")).unwrap()
    );
    succeeds(&dir, &["convert", "tap.log", "tap.mcap"]);
    succeeds(&dir, &["convert", "tap.mcap", "again.log"]);
    let (traffic, _) = succeeds(&dir, &["convert", "tap.mcap", "-"]);
    assert_eq!(traffic, fs::read_to_string(dir.path().join("again.log")).unwrap());
    assert!(!dir.path().join("-").exists());
    for arguments in [
        ["compress", "tap.log", "--out", "-", "--json"],
        ["convert", "tap.mcap", "-", "--json", "--tile"],
    ] {
        assert!(
            fails(&dir, &arguments, 2).contains("stdout already"),
            "{arguments:?}"
        );
    }
}

#[test]
fn what_was_made_is_told_to_scripts() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "3"]);
    let (images, _) = succeeds(&dir, &["compress", "tap.log", "--out", "a.npy", "--json"]);
    let images = object(&images);
    assert_eq!((&images["out"], &images["width"]), (&"a.npy".into(), &16.into()));
    assert!(images["images"].as_u64().unwrap() > images["calibrating"].as_u64().unwrap());
    let (frames, _) = succeeds(&dir, &["convert", "tap.log", "tap.mcap", "--json"]);
    assert!(object(&frames)["can_frames"].as_u64().unwrap() > 1000, "{frames}");
    let (frames, _) = succeeds(&dir, &["convert", "tap.log", "tap.npz", "--json"]);
    assert!(object(&frames)["frames"].as_u64().unwrap() > 50, "{frames}");

    let source = ["--source", "sim:tap", "--source", "sim:tap"];
    succeeds(
        &dir,
        &[&["config", "init", "--out", "a.toml"][..], &source].concat(),
    );
    let (checked, _) = succeeds(&dir, &["config", "check", "a.toml", "--json"]);
    assert_eq!(object(&checked)["valid"], true);
    fs::write(dir.path().join("b.toml"), "layuot = 1\n").unwrap();
    let output = crate::taxel(&dir, &["config", "check", "b.toml", "--json"]);
    let wrong = object(&texts(&output).0);
    assert_eq!((output.status.code(), &wrong["valid"]), (Some(1), &false.into()));
    assert!(wrong["error"].as_str().unwrap().contains("b.toml:1"), "{wrong}");
}
