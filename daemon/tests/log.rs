//! That the log, wherever it goes, is in nobody's way.

use std::fs::OpenOptions;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use taxel_wire::{EventKind, Received, Subscriber};

const PATIENCE: Duration = Duration::from_secs(200);

/// A daemon as a process of its own, ended with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start(folder: &Path, stderr: Stdio) -> Running {
    start_with(folder, stderr, "")
}

/// The same, after a command of the shell.
fn start_with(folder: &Path, stderr: Stdio, before: &str) -> Running {
    let path = |name: &str| folder.join(name).display().to_string();
    let text = format!(
        "layout = 'allegro-uskin-15'\n\
         [[bus]]\nsource = 'sim:idle'\n[[bus]]\nsource = 'sim:idle'\n\
         [socket]\nimages = '{}'\ncontrol = '{}'\nstall_ms = 60000\n",
        path("images.sock"),
        path("control.sock")
    );
    std::fs::write(folder.join("taxeld.toml"), text).unwrap();
    let daemon = Command::new("sh")
        .arg("-c")
        .arg(format!("{before}\nexec \"$0\" --config \"$1\""))
        .args([env!("CARGO_BIN_EXE_taxeld"), &path("taxeld.toml")])
        .stderr(stderr)
        .spawn()
        .unwrap();
    Running(daemon)
}

/// Connects as soon as the daemon is there.
fn connect(daemon: &mut Running, folder: &Path) -> Subscriber {
    let deadline = Instant::now() + PATIENCE;
    loop {
        if let Ok(subscriber) = Subscriber::connect(folder.join("images.sock")) {
            return subscriber;
        }
        if let Some(status) = daemon.0.try_wait().unwrap() {
            panic!("taxeld has ended: {status}");
        }
        assert!(Instant::now() < deadline, "nobody listens");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Connects, and waits until the daemon has said what hand it is.
fn served(daemon: &mut Running, folder: &Path) -> Subscriber {
    let mut subscriber = connect(daemon, folder);
    match subscriber.next_timeout(PATIENCE) {
        Ok(Some(Received::Hello(_))) => {}
        other => panic!("a subscriber was sent {other:?}"),
    }
    subscriber
}

#[test]
fn a_log_on_a_full_disk_does_not_end_the_daemon() {
    let folder = tempfile::tempdir().unwrap();
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut daemon = start(folder.path(), full.into());
    let mut subscriber = connect(&mut daemon, folder.path());
    for _ in 0..5 {
        subscriber.next_image().unwrap();
    }
}

#[test]
fn a_log_that_nobody_reads_holds_up_no_subscriber() {
    let folder = tempfile::tempdir().unwrap();
    let (unread, stderr) = std::io::pipe().unwrap();
    let mut daemon = start(folder.path(), stderr.into());
    let mut stays = connect(&mut daemon, folder.path());
    // Two lines each: far more than a pipe holds.
    for _ in 0..1500 {
        served(&mut daemon, folder.path());
    }
    for _ in 0..5 {
        assert!(stays.next_timeout(PATIENCE).unwrap().is_some());
    }
    drop(unread);
}

#[test]
fn a_client_that_is_turned_away_again_and_again_does_not_fill_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log");
    let log = std::fs::File::create(&path).unwrap();
    let mut daemon = start(folder.path(), log.into());
    let _full: Vec<_> = (0..128).map(|_| served(&mut daemon, folder.path())).collect();
    let begun = Instant::now();
    for _ in 0..200 {
        let mut late = connect(&mut daemon, folder.path());
        match late.next_timeout(PATIENCE) {
            Ok(Some(Received::Event(_, event))) => assert_eq!(event.event, EventKind::Disconnect),
            other => panic!("{other:?}"),
        }
    }
    let lines = || {
        let log = std::fs::read_to_string(&path).unwrap();
        log.matches("turned away").count() as u64
    };
    // A thread of its own writes it.
    while lines() == 0 {
        assert!(begun.elapsed() < PATIENCE, "nobody says so");
        std::thread::sleep(Duration::from_millis(10));
    }
    let lines = lines();
    let most = 1 + begun.elapsed().as_secs() / 10;
    assert!(lines <= most, "{lines} lines, at most {most}");
}

#[test]
fn a_daemon_out_of_file_descriptors_says_so_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log");
    let log = std::fs::File::create(&path).unwrap();
    let mut daemon = start(folder.path(), log.into());
    let mut stays = served(&mut daemon, folder.path());
    let lines = |of: &str| std::fs::read_to_string(&path).unwrap().matches(of).count();
    let wait_for = |line: &str| {
        let deadline = Instant::now() + PATIENCE;
        while lines(line) == 0 {
            assert!(Instant::now() < deadline, "it does not say {line:?}");
            std::thread::sleep(Duration::from_millis(10));
        }
    };
    // Until it is ready it raises its limit.
    wait_for("ready");
    // It lets in only as many as there are descriptors for, so some are taken from it.
    let limit_files = |pid: u32, soft: &str| {
        let pid = pid.to_string();
        let prlimit = Command::new("prlimit")
            .args(["--pid", &pid, &format!("--nofile={soft}:")])
            .status();
        assert!(prlimit.unwrap().success());
    };
    let pid = daemon.0.id();
    let before = std::fs::read_to_string(format!("/proc/{pid}/limits")).unwrap();
    let before = before
        .lines()
        .find_map(|line| line.strip_prefix("Max open files"))
        .unwrap();
    limit_files(pid, "8");
    let connected: Vec<_> = (0..40).map(|_| connect(&mut daemon, folder.path())).collect();
    let complaint = "cannot accept a subscriber";
    wait_for(complaint);
    // It tries again ten times a second; these take two.
    for _ in 0..60 {
        stays.next_image().unwrap();
    }
    assert_eq!(lines(complaint), 1);
    drop(connected);
    // And it goes on when there are some.
    limit_files(pid, before.split_whitespace().next().unwrap());
    served(&mut daemon, folder.path());
}

#[test]
fn lines_for_the_journal_bear_their_priority_and_others_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let started = |is_journal: bool| {
        std::fs::write(&log, "").unwrap();
        let file = OpenOptions::new().append(true).open(&log).unwrap();
        let found = file.metadata().unwrap();
        // A terminal that a service has opened inherits the variable, with another file in it.
        let stream = format!("{}:{}", found.dev(), found.ino() + u64::from(!is_journal));
        let mut daemon = start_with(
            folder.path(),
            file.try_clone().unwrap().into(),
            &format!("export JOURNAL_STREAM={stream}"),
        );
        served(&mut daemon, folder.path());
        // Images come before it says that it is ready.
        let deadline = Instant::now() + PATIENCE;
        while !std::fs::read_to_string(&log).unwrap().contains("ready") {
            assert!(Instant::now() < deadline, "it does not say that it is ready");
            std::thread::sleep(Duration::from_millis(10));
        }
        let refused = Command::new(env!("CARGO_BIN_EXE_taxeld"))
            .args(["--config", "/no-such.toml"])
            .env("JOURNAL_STREAM", stream)
            .stderr(file)
            .status();
        assert!(!refused.unwrap().success());
        std::fs::read_to_string(&log).unwrap()
    };
    let (journal, other) = (started(true), started(false));
    assert!(journal.lines().all(|line| line.starts_with('<')), "{journal}");
    assert!(
        journal.contains("<6> INFO ready") && journal.contains("<3>Error: cannot read /no-such.toml"),
        "{journal}"
    );
    assert!(other.contains("ready") && !other.contains('<'), "{other}");
}
