//! `taxel replay`: recordings back onto a bus.

use crate::{fails, succeeds};
use taxel_can::{CanSource, UdpMulticast, UdpOptions};
use tempfile::TempDir;

#[test]
fn replay_cuts_a_piece_out_and_tells_what_it_leaves_out() {
    let dir = TempDir::new().unwrap();
    let log = "(10.000000) can0 001#01\n(10.500000) can1 002#02\n(11.000000) can0 20000080#0000000000000000\n\
               nonsense\n(11.250000) can0 003#03\n(12.000000) can1 004#04\n";
    std::fs::write(dir.path().join("in.log"), log).unwrap();
    let (out, err) = succeeds(
        &dir,
        &["replay", "in.log", "--to", "-", "--start", "0.5", "--end", "2"],
    );
    assert_eq!(
        out,
        "(0000000000.500000) can1 002#02\n(0000000001.250000) can0 003#03\n"
    );
    assert!(
        err.contains("2 frames sent") && err.contains("2 left out"),
        "{err}"
    );
    let err = fails(&dir, &["replay", "in.log", "--to", "-", "--start", "5"], 1);
    assert!(err.contains("no frame between"), "{err}");
    let err = fails(&dir, &["replay", "in.log", "--interface", "can0=-"], 1);
    assert!(err.contains("nowhere to send can1"), "{err}");
    let err = fails(
        &dir,
        &["replay", "in.log", "--to", "-", "--interface", "can7=-"],
        1,
    );
    assert!(err.contains("can0, can1"), "{err}");
}

#[test]
fn interfaces_are_met_while_a_log_is_played_or_converted() {
    let dir = TempDir::new().unwrap();
    let lines = |interfaces: u32| -> String {
        (0..interfaces)
            .chain([0])
            .map(|n| format!("({:010}.000000) can{n} {n:03X}#\n", n + 7))
            .collect()
    };
    let write = |text: &str| std::fs::write(dir.path().join("in.log"), text).unwrap();
    // As many as are told apart, and the first once more.
    write(&lines(64));
    let (all, err) = succeeds(&dir, &["replay", "in.log", "--to", "-", "--speed", "inf"]);
    assert_eq!(all.lines().count(), 65, "{err}");
    assert_eq!(all.lines().nth(63), Some("(0000000063.000000) can63 03F#"));
    assert!(all.ends_with(" can0 000#\n"), "{all}");
    let (out, _) = succeeds(&dir, &["convert", "in.log", "-"]);
    assert_eq!(out, lines(64));
    let (out, _) = succeeds(&dir, &["replay", "in.log", "--to", "log:played.log", "--json"]);
    let played: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(
        (&played["frames"], &played["left_out"]),
        (&65.into(), &0.into()),
        "{played}"
    );
    let err = fails(&dir, &["replay", "in.log", "--to", "-", "--json"], 2);
    assert!(err.contains("put them elsewhere"), "{err}");
    // No recording of a hand, and no list without an end.
    write(&lines(65));
    let err = fails(&dir, &["replay", "in.log", "--to", "log:out.log"], 1);
    assert!(err.contains("in.log: more than 64 interfaces"), "{err}");
    write("nothing here\n");
    for command in [
        ["replay", "in.log", "--to", "log:out.log"].as_slice(),
        &["convert", "in.log", "out.log"],
    ] {
        let err = fails(&dir, command, 1);
        assert!(err.contains("in.log: no CAN frame in it: line 1"), "{err}");
    }
    assert!(!dir.path().join("out.log").exists());
}

#[test]
fn replay_puts_frames_on_a_bus_in_their_order() {
    let dir = TempDir::new().unwrap();
    let port = 20_000 + (std::process::id() % 20_000) as u16;
    let options = UdpOptions {
        port,
        hop_limit: 0,
        ..UdpOptions::default()
    };
    let mut bus = match UdpMulticast::with_options(&options) {
        Ok(bus) => bus,
        Err(error) => {
            return eprintln!("SKIPPED: replay onto a bus: no UDP multicast on this machine: {error}");
        }
    };
    let lines: String = (0..20)
        .map(|i| format!("({:.6}) can0 {i:03X}#{i:02X}\n", 5.0 + 0.01 * i as f64))
        .collect();
    std::fs::write(dir.path().join("in.log"), lines).unwrap();
    let to = format!("udp:{}:{port}?hops=0", options.group);
    let (_, err) = succeeds(&dir, &["replay", "in.log", "--to", &to, "--speed", "2"]);
    assert!(err.contains("20 frames sent"), "{err}");
    let mut received = Vec::with_capacity(64);
    bus.receive(taxel_can::monotonic_ns(), &mut received);
    let ids: Vec<u32> = received.iter().map(|r| r.frame.id()).collect();
    assert_eq!(ids, (0..20).collect::<Vec<_>>());
    // Two buses are joined, and that is told.
    std::fs::write(
        dir.path().join("two.log"),
        "(1.0) can0 001#01\n(1.0) can1 002#02\n(1.0) can1 003#\n",
    )
    .unwrap();
    let (_, err) = succeeds(&dir, &["replay", "two.log", "--to", &to]);
    assert_eq!(err.matches("can1 goes to udp:").count(), 1, "{err}");
    assert!(err.contains("--interface can1=SOURCE"), "{err}");
}

#[test]
fn what_a_pressure_array_would_have_sent_is_converted_as_it_is_played() {
    let dir = TempDir::new().unwrap();
    let counts = ndarray::Array3::from_shape_fn((5, 28, 50), |(t, row, column)| (t * row + column) as u16);
    ndarray_npy::write_npy(dir.path().join("in.npy"), &counts).unwrap();
    let layout = ["--layout", "tekscan-6077"];
    let play = ["replay", "in.npy", "--to", "log:played.log", "--speed", "inf"];
    succeeds(&dir, &[&play[..], &layout].concat());
    for made in ["made.log", "made.mcap"] {
        let (_, err) = succeeds(&dir, &[&["convert", "in.npy", made], &layout[..]].concat());
        let told = "its 5 frames go as what arrays send; who makes frames of that again samples it anew";
        assert!(err.contains(told), "{err}");
    }
    let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
    assert_eq!(read("made.log"), read("played.log"));
    let (lines, _) = succeeds(&dir, &["convert", "made.mcap", "-"]);
    assert_eq!(lines.lines().count(), read("played.log").lines().count());
    let err = fails(
        &dir,
        &[&["convert", "in.npy", "x.log", "--tile"], &layout[..]].concat(),
        1,
    );
    assert!(err.contains("--tile repeats a module of boards"), "{err}");
}
