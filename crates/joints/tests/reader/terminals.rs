//! Pseudo terminals that are another program's by now.

use crate::{HANGS_AFTER, all_read, config, eventually, potentiometers, pty};
use std::path::Path;
use std::time::{Duration, Instant};
use taxel_joints::{AnalogueReader, PortState, PortStatus, ServoReader};
use taxel_sim::servo::ServoPty;

#[test]
fn a_terminal_that_is_younger_than_the_link_to_it_is_anothers_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let [left, name] = ["left", "name"].map(|name| folder.path().join(name));
    let link = |target: &Path, link: &Path| std::os::unix::fs::symlink(target, link).unwrap();
    let long_ago = |link: &Path| {
        let touched = std::process::Command::new("touch")
            .args(["-h", "-d", "2001-01-01"])
            .arg(link)
            .status();
        assert!(touched.unwrap().success());
    };
    let pty = pty(1);
    link(pty.path(), &left);
    link(Path::new("left"), &name);
    long_ago(&left);
    let reader = ServoReader::start(&config(&name, 1)).unwrap();
    let end = Instant::now() + HANGS_AFTER;
    let reason = loop {
        assert!(Instant::now() < end && reader.snapshot().counters.cycles == 0);
        if let PortState::Away { reason, .. } = reader.port().state {
            break reason;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let from = format!("{} leads to {}", left.display(), pty.path().display());
    assert!(
        reason.contains(&from) && reason.contains("start the simulator"),
        "{reason}"
    );
    // Made anew. A name that leads to a link is as old as it likes.
    std::fs::remove_file(&left).unwrap();
    link(pty.path(), &left);
    long_ago(&name);
    eventually(&reader, "read", all_read);
}

/// Another terminal with the number of one that was closed; `None` where another program has it.
fn with_the_number_of(path: &Path) -> Option<ServoPty> {
    let mut others = Vec::new();
    for _ in 0..100 {
        // The reader may have it open for a moment more.
        for _ in 0..20 {
            let another = pty(1);
            if another.path() == path {
                return Some(another);
            }
            others.push(another);
        }
        others.clear();
        std::thread::sleep(Duration::from_millis(10));
    }
    None
}

/// Where a terminal without a link is lost, another with its number is left alone, and this is said.
fn another_is_left_alone<R>(start: impl Fn(&Path) -> R, port: impl Fn(&R) -> PortStatus) {
    let end = Instant::now() + HANGS_AFTER;
    loop {
        let first = pty(1);
        let path = first.path().to_path_buf();
        let reader = start(&path);
        let wait = |done: &dyn Fn(&PortState) -> bool| {
            while !done(&port(&reader).state) {
                assert!(Instant::now() < end, "{:?}", port(&reader));
                std::thread::sleep(Duration::from_millis(2));
            }
        };
        wait(&|state| *state == PortState::Open);
        // Two that are made within one tick of the kernel's clock, 10 ms at most, differ in nothing.
        std::thread::sleep(Duration::from_millis(20));
        drop(first);
        wait(&|state| matches!(state, PortState::Away { .. }));
        let Some(another) = with_the_number_of(&path) else {
            continue;
        };
        wait(&|state| {
            assert_ne!(*state, PortState::Open);
            matches!(state, PortState::Away { reason, .. } if reason.contains("is another terminal"))
        });
        assert_eq!(
            (port(&reader).opened, another.bus().traffic().heard_bytes),
            (1, 0)
        );
        return;
    }
}

#[test]
fn a_terminal_that_has_the_number_of_the_one_that_was_lost_is_anothers_and_left_alone() {
    let servos = |path: &Path| ServoReader::start(&config(path, 1)).unwrap();
    another_is_left_alone(servos, ServoReader::port);
    let lines = |path: &Path| AnalogueReader::start(&potentiometers(path), || ()).unwrap();
    another_is_left_alone(lines, |reader| reader.snapshot().port);
}
