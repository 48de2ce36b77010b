//! Which interface of a log is which bus of the hand.

use crate::{fails, succeeds};
use tempfile::TempDir;

/// A log of a few seconds of boards that play, with the interfaces renamed.
fn log_with(dir: &TempDir, file: &str, names: &[(&str, &str)]) -> String {
    let (log, _) = succeeds(dir, &["sim", "tap", "--to", "-", "--seconds", "2.5"]);
    let rename = |line: &str| {
        let mut words: Vec<&str> = line.split(' ').collect();
        words[1] = names
            .iter()
            .find(|(old, _)| *old == words[1])
            .map_or(words[1], |(_, new)| new);
        words.join(" ") + "\n"
    };
    let text: String = log.lines().map(rename).collect();
    std::fs::write(dir.path().join(file), &text).unwrap();
    text
}

#[test]
fn an_interface_that_is_no_bus_is_named_and_counted() {
    let dir = TempDir::new().unwrap();
    let text = log_with(&dir, "hand.log", &[]);
    let (_, err) = succeeds(&dir, &["compress", "hand.log", "--out", "a.bin"]);
    assert!(!err.contains("left out"), "{err}");
    let more: String = (0..7).map(|n| format!("(0.50000{n}) can5 123#0102\n")).collect();
    std::fs::write(dir.path().join("more.log"), text + &more).unwrap();
    let (_, err) = succeeds(&dir, &["compress", "more.log", "--out", "b.bin"]);
    assert!(
        err.contains("interface can5 is left out") && err.contains("--interface can5=BUS"),
        "{err}"
    );
    assert!(err.contains("left out: 7 frames of can5\n"), "{err}");
    let read = |file: &str| std::fs::read(dir.path().join(file)).unwrap();
    assert_eq!(read("a.bin"), read("b.bin"));
}

#[test]
fn an_interface_that_begins_when_the_buses_are_known_is_counted_too() {
    let dir = TempDir::new().unwrap();
    let words = ["sim", "tap", "--to", "-", "--seconds", "40"];
    let (text, _) = succeeds(&dir, &words);
    assert!(text.lines().count() > 60_000);
    let more: String = (0..7).map(|n| format!("(39.99999{n}) can5 123#0102\n")).collect();
    std::fs::write(dir.path().join("more.log"), text + &more).unwrap();
    let (_, err) = succeeds(&dir, &["compress", "more.log", "--out", "a.npz"]);
    assert!(err.contains("left out: 7 frames of can5\n"), "{err}");
}

#[test]
fn interfaces_that_were_renamed_on_the_way_are_told_by_their_boards_or_refused() {
    let dir = TempDir::new().unwrap();
    let read = |file: &str| std::fs::read(dir.path().join(file)).unwrap();
    log_with(&dir, "hand.log", &[]);
    succeeds(&dir, &["compress", "hand.log", "--out", "hand.bin"]);
    // The recording machine called them can1 and can2.
    let text = log_with(&dir, "shifted.log", &[("can0", "can1"), ("can1", "can2")]);
    let (_, err) = succeeds(&dir, &["compress", "shifted.log", "--out", "shifted.bin"]);
    assert!(
        err.contains("can1 is taken for bus can0, can2 is taken for bus can1, by the boards"),
        "{err}"
    );
    assert_eq!(read("shifted.bin"), read("hand.bin"));
    // Without board 7, which one bus alone has, nothing tells them apart.
    let of_7 = |line: &&str| !line.split(' ').nth(2).is_some_and(|frame| frame.starts_with('7'));
    let alike: String = text
        .lines()
        .filter(of_7)
        .map(|line| line.to_owned() + "\n")
        .collect();
    std::fs::write(dir.path().join("alike.log"), alike).unwrap();
    let err = fails(&dir, &["compress", "alike.log", "--out", "alike.bin"], 1);
    assert!(
        err.contains("do not tell which is which")
            && err.contains("--interface can1=can0 --interface can2=can1"),
        "{err}"
    );
    let named = ["--interface", "can1=can0", "--interface", "can2=can1"];
    succeeds(
        &dir,
        &[&["compress", "shifted.log", "--out", "named.bin"], &named[..]].concat(),
    );
    assert_eq!(read("named.bin"), read("hand.bin"));
}

#[test]
fn interfaces_of_no_bus_of_the_hand_are_told_by_their_boards_too() {
    let dir = TempDir::new().unwrap();
    let read = |file: &str| std::fs::read(dir.path().join(file)).unwrap();
    log_with(&dir, "hand.log", &[]);
    succeeds(&dir, &["compress", "hand.log", "--out", "hand.bin"]);
    for [of_can0, of_can1] in [["slcan0", "slcan1"], ["right", "left"]] {
        log_with(&dir, "named.log", &[("can0", of_can0), ("can1", of_can1)]);
        let (_, err) = succeeds(&dir, &["compress", "named.log", "--out", "named.bin"]);
        for (name, bus) in [(of_can0, "can0"), (of_can1, "can1")] {
            assert!(err.contains(&format!("{name} is taken for bus {bus}")), "{err}");
        }
        assert!(read("named.bin") == read("hand.bin"), "{of_can0}");
    }
}

#[test]
fn an_option_that_speaks_against_the_boards_is_told_with_what_they_say() {
    let dir = TempDir::new().unwrap();
    log_with(&dir, "named.log", &[("can0", "vcan0"), ("can1", "vcan1")]);
    let compress = |options: &[&str]| {
        let (_, err) = succeeds(
            &dir,
            &[&["compress", "named.log", "--out", "o.bin"], options].concat(),
        );
        err
    };
    let said =
        "the boards that the interfaces carry speak for --interface vcan0=can0 --interface vcan1=can1\n";
    let swapped = ["--interface", "vcan1=can0", "--interface", "vcan0=can1"];
    let err = compress(&swapped[..2]);
    assert!(
        err.contains("vcan0 is taken for bus can1, which alone is left;") && err.contains(said),
        "{err}"
    );
    assert!(compress(&swapped).contains(said));
    let right = compress(&["--interface", "vcan1=can1", "--interface", "vcan0=can0"]);
    assert!(!right.contains("speak for"), "{right}");
    log_with(&dir, "named.log", &[("can0", "can1"), ("can1", "can0")]);
    let said = "the boards that the interfaces carry speak for --interface can0=can1 --interface can1=can0\n";
    assert!(compress(&[]).contains(said));
    log_with(&dir, "named.log", &[]);
    assert!(!compress(&[]).contains("speak for"));
    let log = std::fs::read_to_string(dir.path().join("named.log")).unwrap();
    let is_of_first = |line: &&str| line.contains(" can0 0");
    let few: Vec<&str> = log.lines().filter(is_of_first).collect();
    std::fs::write(dir.path().join("few.log"), few.join("\n")).unwrap();
    let (_, few) = succeeds(&dir, &["compress", "few.log", "--out", "o.bin"]);
    assert!(!few.contains("speak for"), "{few}");
    let said = "the boards that the interfaces carry speak for --interface can0=can0 --interface can1=can1\n";
    assert!(compress(&["--interface", "can0=can1"]).contains(said));
}

#[test]
fn two_buses_that_were_written_as_one_are_told() {
    let dir = TempDir::new().unwrap();
    log_with(&dir, "one.log", &[("can0", "vcan0"), ("can1", "vcan0")]);
    let (_, err) = succeeds(&dir, &["compress", "one.log", "--out", "o.bin"]);
    assert!(
        err.contains("one.log: on vcan0 two boards answer as each of "),
        "{err}"
    );
    log_with(&dir, "hand.log", &[]);
    let (_, err) = succeeds(&dir, &["compress", "hand.log", "--out", "o.bin"]);
    assert!(!err.contains("two boards"), "{err}");
}
