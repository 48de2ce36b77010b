//! Configurations that no daemon starts with: `taxeld` itself says why, in one line, and ends with a status.

use std::fs::{OpenOptions, Permissions};
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

#[test]
fn what_is_wrong_is_one_line_though_the_environment_asks_for_backtraces() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("taxeld.toml");
    let images = folder.path().join("images.sock");
    let group = format!(
        "[[bus]]\nsource = 'sim:idle'\n[[bus]]\nsource = 'sim:idle'\n[socket]\nimages = '{}'\ngroup = 'no-such-group'\n",
        images.display()
    );
    // Of what is read, of what is begun, and of a file that is not there.
    let wrong = [Some("layout = 3\n"), Some(group.as_str()), None];
    for (text, wants) in wrong
        .iter()
        .flat_map(|text| ["1", "full"].map(|wants| (text, wants)))
    {
        match text {
            Some(text) => std::fs::write(&path, text).unwrap(),
            None => std::fs::remove_file(&path).unwrap_or_default(),
        }
        for check in [true, false] {
            let mut taxeld = Command::new(env!("CARGO_BIN_EXE_taxeld"));
            taxeld.arg("--config").arg(&path).args(check.then_some("--check"));
            taxeld
                .env("RUST_BACKTRACE", wants)
                .env("RUST_LIB_BACKTRACE", wants);
            let output = taxeld.env("RUST_LOG", "off").output().unwrap();
            let said = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(78), "{said}");
            assert!(said.starts_with("Error: ") && said.lines().count() == 1, "{said}");
        }
    }
}

#[test]
fn a_recording_that_is_not_there_is_told_with_the_folder_in_which_it_was_looked_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("elsewhere")).unwrap();
    // Beside the configuration it is.
    std::fs::write(at("c.log"), "(0.000000) can0 201#0700\n").unwrap();
    let text = "layout = 'uskin-module'\n[[bus]]\nsource = 'log:c.log'\n";
    std::fs::write(at("taxeld.toml"), text).unwrap();
    for check in [true, false] {
        let mut taxeld = Command::new(env!("CARGO_BIN_EXE_taxeld"));
        taxeld
            .arg("--config")
            .arg(at("taxeld.toml"))
            .args(check.then_some("--check"));
        let output = taxeld
            .current_dir(at("elsewhere"))
            .env("RUNTIME_DIRECTORY", at("run"))
            .output()
            .unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(78), "{said}");
        let elsewhere = at("elsewhere").canonicalize().unwrap();
        let place = format!("there is no c.log in {}", elsewhere.display());
        assert!(said.contains(&place) && said.contains("whole path"), "{said}");
    }
}

#[test]
fn a_hand_without_any_board_is_refused_since_nothing_of_it_comes_live() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("taxeld.toml");
    let sockets = format!(
        "[socket]\nimages = '{0}/i.sock'\ncontrol = '{0}/c.sock'\n",
        folder.path().display()
    );
    std::fs::write(
        &path,
        format!("# a hand in recordings\nlayout = 'schunk-sdh'\n{sockets}"),
    )
    .unwrap();
    for (check, place) in [(true, "taxeld.toml:2: "), (false, "Error: ")] {
        let mut taxeld = Command::new(env!("CARGO_BIN_EXE_taxeld"));
        taxeld.arg("--config").arg(&path).args(check.then_some("--check"));
        let output = taxeld.output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(78), "{said}");
        assert!(
            said.contains(&format!("{place}no module of schunk-sdh has a board")),
            "{said}"
        );
    }
}

/// A stderr or stdout that takes nothing: a full disk, and a pipe whose reader has gone.
fn taking_nothing() -> [Stdio; 2] {
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    let (_, gone) = std::io::pipe().unwrap();
    [full.into(), gone.into()]
}

#[test]
fn a_wrong_configuration_ends_with_its_status_though_nobody_can_be_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("taxeld.toml");
    let two = "[[bus]]\nsource = 'sim:idle'\n[[bus]]\nsource = 'sim:idle'\n";
    let socket = |name: &str| format!("{}/{name}.sock", folder.path().display());
    let sockets = format!(
        "[socket]\nimages = '{}'\ncontrol = '{}'\n",
        socket("images"),
        socket("control")
    );
    let wrong = [
        "layout = 3\n".to_owned(),
        // Known only at the start.
        format!("{two}{sockets}group = 'no-such-group'\n"),
    ];
    for text in wrong {
        std::fs::write(&path, &text).unwrap();
        for stderr in taking_nothing() {
            let mut taxeld = Command::new(env!("CARGO_BIN_EXE_taxeld"));
            let status = taxeld.arg("--config").arg(&path).stderr(stderr).status().unwrap();
            assert_eq!(status.code(), Some(78), "{text}");
        }
    }
    // Its answer cannot be told either; that its reader has seen enough is no failure.
    std::fs::write(&path, two).unwrap();
    for (stdout, code) in taking_nothing().into_iter().zip([1, 0]) {
        let mut taxeld = Command::new(env!("CARGO_BIN_EXE_taxeld"));
        taxeld.arg("--check").arg("--config").arg(&path);
        let status = taxeld.stdout(stdout).stderr(Stdio::null()).status().unwrap();
        assert_eq!(status.code(), Some(code));
    }
}

#[test]
fn a_wrong_configuration_ends_with_its_status_though_its_stderr_is_a_full_pipe_that_nobody_reads() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("taxeld.toml");
    std::fs::write(&path, "layout = 3\n").unwrap();
    let (_unread, mut full) = std::io::pipe().unwrap();
    let room = nix::fcntl::fcntl(&full, nix::fcntl::FcntlArg::F_GETPIPE_SZ).unwrap();
    full.write_all(&vec![b'x'; room as usize]).unwrap();
    let mut taxeld = Command::new(env!("CARGO_BIN_EXE_taxeld"));
    let mut taxeld = taxeld.arg("--config").arg(&path).stderr(full).spawn().unwrap();
    let deadline = Instant::now() + Duration::from_secs(200);
    let status = loop {
        if let Some(status) = taxeld.try_wait().unwrap() {
            break status;
        }
        if Instant::now() > deadline {
            taxeld.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    assert_eq!(status.code(), Some(78), "{status}");
}

#[test]
fn what_would_not_start_is_refused_by_check_as_by_the_start_and_for_good() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("taxeld.toml");
    let buses = |source: &str| {
        let bus = |n| format!("[[bus]]\nsource = '{}'\n", source.replace("{n}", n));
        [bus("0"), bus("1")].concat()
    };
    let sockets = format!(
        "[socket]\nimages = '{0}/images.sock'\ncontrol = '{0}/control.sock'\n",
        folder.path().display()
    );
    let scenes = buses("sim:idle");
    let mixed = folder.path().join("mixed.log");
    std::fs::write(&mixed, "(1.000000) slcan0 001#01\n(1.000001) slcan1 001#02\n").unwrap();
    let mixed = mixed.display();
    let recording = folder.path().join("two.log");
    std::fs::write(&recording, "(1.0) vcan1 135#01\nno frame\n(2.0) can0 135#02\n").unwrap();
    let cases = [
        (buses("log:no-such-{n}.log") + &sockets, 2, "no-such-0.log"),
        (
            format!("[[bus]]\nsource = 'log:{mixed}'\n[[bus]]\nsource = 'udp:'\n{sockets}"),
            2,
            "mixed.log?interface=slcan0",
        ),
        (
            buses(&format!("log:{}?interface=can{{n}}", recording.display())) + &sockets,
            4,
            "two.log has no frame on interface can1; it has can0, vcan1",
        ),
        (buses("sim:no-such-scene") + &sockets, 2, "no-such-scene"),
        (
            format!("{scenes}{sockets}group = 'no-such-group'\n"),
            8,
            "no-such-group",
        ),
        (
            format!("{scenes}{sockets}[control]\ngroup = 'no-such-operators'\n"),
            9,
            "no-such-operators",
        ),
        (
            format!("{scenes}{sockets}[profile]\nbudgets = {{ index = 3, no-such-part = 1 }}\n"),
            9,
            "no-such-part",
        ),
        (
            format!("{scenes}{sockets}[profile]\nactuators = 2\nfixed = [[1, 1], [99, 1]]\n"),
            10,
            "place 1 of fixed, [99, 1], is outside the 16x16 image",
        ),
    ];
    for (text, line, about) in cases {
        std::fs::write(&path, &text).unwrap();
        for check in [&["--check"][..], &[]] {
            let mut taxeld = Command::new(env!("CARGO_BIN_EXE_taxeld"));
            let ended = taxeld.args(check).arg("--config").arg(&path).output().unwrap();
            let said = String::from_utf8_lossy(&ended.stderr);
            assert_eq!(ended.status.code(), Some(78), "{check:?} {text}\n{said}");
            assert!(said.contains(about), "{check:?} {text}\n{said}");
            let place = format!("taxeld.toml:{line}: ");
            assert_eq!(
                said.contains(&place),
                !check.is_empty(),
                "{check:?} {text}\n{said}"
            );
        }
    }
}

/// Runs taxeld as a user who is not root and in no group of root's.
fn run_without_rights(taxeld: &Path, args: &[&str], config: &Path) -> Output {
    let mut taxeld = Command::new(taxeld);
    if nix::unistd::geteuid().is_root() {
        taxeld.uid(65534).gid(65534);
    }
    taxeld.args(args).arg("--config").arg(config).output().unwrap()
}

#[test]
fn a_place_or_group_that_the_daemons_user_cannot_have_is_refused_by_check_as_by_the_start_and_for_good() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    // Whoever runs it there can read and run what is in it, wherever the workspace is.
    let open = |path: &Path, mode| std::fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
    open(folder.path(), 0o755);
    let taxeld = at("taxeld");
    // By another process: while a test beside this one forks, nobody can run what is open here to be written.
    let copied = Command::new("cp")
        .arg(env!("CARGO_BIN_EXE_taxeld"))
        .arg(&taxeld)
        .status();
    assert!(copied.unwrap().success());
    for (name, mode) in [("closed", 0o555), ("open", 0o777)] {
        std::fs::create_dir(at(name)).unwrap();
        open(&at(name), mode);
    }
    std::fs::write(at("open/notes"), "precious").unwrap();
    let path = at("taxeld.toml");
    let socket = |name: &str| at(name).display().to_string();
    let free = socket("open/control.sock");
    let cases = [
        (
            socket("closed/images.sock"),
            free.clone(),
            "",
            "closed/images.sock",
        ),
        (
            socket("closed/deep/er/images.sock"),
            free.clone(),
            "",
            "closed/deep",
        ),
        (
            socket("open/notes/images.sock"),
            free.clone(),
            "",
            "notes/images.sock",
        ),
        (
            socket("open/notes"),
            free.clone(),
            "",
            "notes exists and is not a socket",
        ),
        (
            socket("open/images.sock"),
            socket("closed/control.sock"),
            "",
            "closed/control.sock",
        ),
        (
            socket("open/images.sock"),
            free,
            "group = 'root'\n",
            "to group root: the daemon's user is not in it",
        ),
    ];
    for (images, control, group, about) in cases {
        let bus = "[[bus]]\nsource = 'sim:idle'\n";
        let text = format!("{bus}{bus}[socket]\nimages = '{images}'\ncontrol = '{control}'\n{group}");
        std::fs::write(&path, &text).unwrap();
        open(&path, 0o644);
        for check in [&["--check"][..], &[]] {
            let ended = run_without_rights(&taxeld, check, &path);
            let said = String::from_utf8_lossy(&ended.stderr);
            assert_eq!(ended.status.code(), Some(78), "{check:?} {text}\n{said}");
            assert!(said.contains(about), "{check:?} {text}\n{said}");
        }
        let left = std::fs::read_dir(at("open")).unwrap().count();
        assert_eq!(left, 1, "files are left behind: {text}");
    }
    // What systemd makes for the service is not judged by whoever checks.
    let service = "[socket]\nimages = '/run/taxeld/images.sock'\ncontrol = '/run/taxeld-left/control.sock'\n";
    std::fs::write(
        &path,
        format!("[[bus]]\nsource = 'sim:idle'\n[[bus]]\nsource = 'sim:idle'\n{service}"),
    )
    .unwrap();
    let checked = run_without_rights(&taxeld, &["--check"], &path);
    assert!(
        checked.status.success(),
        "{}",
        String::from_utf8_lossy(&checked.stderr)
    );
}
