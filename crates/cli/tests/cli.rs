//! The `taxel` command as a user runs it.

use ndarray::{Array2, Array3};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use taxel_can::{CanSource, SourceAddress, UdpMulticast, UdpOptions};
use taxel_skin::Layout;
use taxel_wire::{Body, HEADER_LEN, ImageView, ReadError, Subscriber, decode};
use taxeld::{Config, Daemon};
use tempfile::TempDir;

fn taxel(dir: &TempDir, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_taxel"));
    command.args(args).current_dir(dir.path()).output().unwrap()
}

/// Runs and expects success; returns stdout and stderr.
fn succeeds(dir: &TempDir, args: &[&str]) -> (String, String) {
    let output = taxel(dir, args);
    let (out, err) = texts(&output);
    assert!(
        output.status.success(),
        "taxel {args:?}: {}\n{out}{err}",
        output.status
    );
    (out, err)
}

/// Runs and expects failure with this exit code; returns stderr.
fn fails(dir: &TempDir, args: &[&str], code: i32) -> String {
    let output = taxel(dir, args);
    let (out, err) = texts(&output);
    assert_eq!(output.status.code(), Some(code), "taxel {args:?}\n{out}{err}");
    err
}

fn texts(output: &Output) -> (String, String) {
    (
        String::from_utf8_lossy(&output.stdout).into(),
        String::from_utf8_lossy(&output.stderr).into(),
    )
}

fn config(dir: &Path, sources: [SourceAddress; 2]) -> Config {
    let mut config = Config::new(Layout::builtin("allegro-uskin-15").unwrap(), sources.into());
    config.socket.images = dir.join("images.sock");
    config.socket.control = dir.join("control.sock");
    config.realtime.priority = 0;
    config
}

fn simulated(dir: &Path, scene: &str) -> Daemon {
    let source = || SourceAddress::Sim { scene: scene.into() };
    Daemon::start(config(dir, [source(), source()])).unwrap()
}

#[test]
fn wrong_usage_is_told_from_failure_by_the_exit_code() {
    let dir = TempDir::new().unwrap();
    let (out, _) = succeeds(&dir, &["--help"]);
    for command in ["demo", "watch", "replay", "compress", "eval", "sim"] {
        assert!(out.contains(command), "{out}");
    }
    fails(&dir, &["wach"], 2);
    fails(&dir, &["watch", "--count", "0"], 2);
    fails(&dir, &["sim"], 2);
    let err = fails(&dir, &["replay", "a.log", "--to", "vcan0"], 2);
    assert!(err.contains("can:INTERFACE"), "{err}");
}

#[test]
fn without_a_daemon_watch_says_where_it_looked() {
    let dir = TempDir::new().unwrap();
    let err = fails(&dir, &["watch", "--socket", "nowhere.sock"], 1);
    assert!(
        err.contains("nowhere.sock") && err.contains("is taxeld running"),
        "{err}"
    );
}

#[test]
fn watch_prints_one_object_per_image_with_the_keys_of_the_contract() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "worst-case");
    let (out, _) = succeeds(
        &dir,
        &["watch", "--socket", "images.sock", "--json", "--count", "3"],
    );
    let lines: Vec<Value> = out
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 3);
    let mut keys: Vec<&str> = lines[0].as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    let mut contract = [
        "seq",
        "t_ns",
        "latency_us",
        "width",
        "height",
        "image",
        "levels",
        "actuators",
        "contacts",
        "faulty",
        "missing",
        "joints",
    ];
    contract.sort_unstable();
    assert_eq!(keys, contract);
    assert_eq!(lines[0]["image"].as_array().unwrap().len(), 256);
    assert!(lines[0]["latency_us"].as_f64().unwrap() > 0.0);
    assert!(lines[2]["seq"].as_u64() > lines[0]["seq"].as_u64());
}

#[test]
fn watch_prints_words_and_raw_frames_on_request() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "idle");
    let (out, err) = succeeds(&dir, &["watch", "--socket", "images.sock", "--count", "2"]);
    assert_eq!(out.lines().count(), 2);
    assert!(out.contains("contacts") && out.contains("ms"), "{out}");
    assert!(err.contains("allegro-uskin-15, 240 taxels, 16x16"), "{err}");
    let (out, _) = succeeds(
        &dir,
        &[
            "watch",
            "--socket",
            "images.sock",
            "--raw",
            "--json",
            "--count",
            "1",
        ],
    );
    let raw: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(raw["taxels"].as_array().unwrap().len(), 240);
    assert_eq!(raw["taxels"][0]["counts"].as_array().unwrap().len(), 3);
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "idle");
    let mut child = Command::new(env!("CARGO_BIN_EXE_taxel"))
        .args(["watch", "--socket", "images.sock"])
        .current_dir(dir.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap())
        .read_line(&mut line)
        .unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}: {:?}", output.status, texts(&output));
    assert!(!texts(&output).1.contains("pipe"), "{:?}", texts(&output));
}

#[test]
fn the_same_scene_and_seed_give_the_same_log_and_another_seed_another() {
    let dir = TempDir::new().unwrap();
    let write = |file: &str, seed: &str| {
        let to = format!("log:{file}");
        succeeds(
            &dir,
            &["sim", "tap", "--to", &to, "--seconds", "0.5", "--seed", seed],
        );
        std::fs::read(dir.path().join(file)).unwrap()
    };
    let first = write("a.log", "7");
    assert!(first.len() > 10_000);
    assert_eq!(first, write("b.log", "7"));
    assert_ne!(first, write("c.log", "8"));
    let (out, _) = succeeds(
        &dir,
        &["sim", "tap", "--to", "-", "--seconds", "0.5", "--seed", "7"],
    );
    assert_eq!(out.as_bytes(), first);
}

#[test]
fn scenes_are_listed_and_shown_and_an_unknown_one_is_refused() {
    let dir = TempDir::new().unwrap();
    let (out, _) = succeeds(&dir, &["sim", "--list"]);
    assert!(out.contains("ball-grasp") && out.contains("faulty-hand"), "{out}");
    let (shown, _) = succeeds(&dir, &["sim", "tap", "--show"]);
    std::fs::write(dir.path().join("mine.toml"), shown).unwrap();
    succeeds(
        &dir,
        &["sim", "mine.toml", "--to", "log:mine.log", "--seconds", "0.1"],
    );
    let err = fails(&dir, &["sim", "football", "--to", "-"], 1);
    assert!(err.contains("ball-grasp"), "{err}");
}

#[test]
fn two_buses_with_the_same_ids_are_not_put_on_one() {
    let dir = TempDir::new().unwrap();
    let err = fails(&dir, &["sim", "tap", "--to", "udp:"], 1);
    assert!(err.contains("would both send id"), "{err}");
}

#[test]
fn compress_writes_every_format_and_the_same_bytes_each_time() {
    let dir = TempDir::new().unwrap();
    succeeds(
        &dir,
        &["sim", "ball-grasp", "--to", "log:grasp.log", "--seconds", "4"],
    );
    let mut images = 0;
    for out in ["a.npz", "a.npy", "a.csv", "a.jsonl", "a.bin"] {
        let (_, err) = succeeds(&dir, &["compress", "grasp.log", "--out", out, "--actuators", "6"]);
        assert!(
            err.contains("images of 16x16") && err.contains("while calibrating"),
            "{err}"
        );
    }
    let read = |file: &str| std::fs::read(dir.path().join(file)).unwrap();
    let stack: Array3<u8> = ndarray_npy::read_npy(dir.path().join("a.npy")).unwrap();
    let lines = String::from_utf8(read("a.jsonl")).unwrap();
    assert_eq!(lines.lines().count(), stack.dim().0);
    let bytes = read("a.bin");
    let mut rest = bytes.as_slice();
    for (index, line) in lines.lines().enumerate() {
        let line: Value = serde_json::from_str(line).unwrap();
        let (message, used) = decode(rest).unwrap();
        let Body::Image(image) = message.body else {
            panic!("not an image")
        };
        rest = &rest[used..];
        assert_eq!(
            image.pixels(),
            stack.index_axis(ndarray::Axis(0), index).as_slice().unwrap()
        );
        assert_eq!(line["seq"], message.header.seq);
        assert_eq!(line["latency_us"], Value::Null);
        assert!(image.actuators().len() <= 6);
        images += usize::from(image.contacts > 0);
    }
    assert!(rest.is_empty() && images > 0, "{images} images with contact");
    succeeds(
        &dir,
        &["compress", "grasp.log", "--out", "b.bin", "--actuators", "6"],
    );
    assert_eq!(read("b.bin"), bytes);
}

#[test]
fn the_daemon_playing_a_recording_publishes_the_bytes_that_compress_writes() {
    let dir = TempDir::new().unwrap();
    succeeds(
        &dir,
        &["sim", "ball-grasp", "--to", "log:grasp.log", "--seconds", "4"],
    );
    succeeds(&dir, &["compress", "grasp.log", "--out", "offline.bin"]);
    let bytes = std::fs::read(dir.path().join("offline.bin")).unwrap();
    let mut rest = bytes.as_slice();
    let mut offline = std::collections::HashMap::new();
    while !rest.is_empty() {
        let (message, used) = decode(rest).unwrap();
        offline.insert(message.header.seq, &rest[HEADER_LEN..used]);
        rest = &rest[used..];
    }
    let log = |bus: &str| SourceAddress::Log {
        path: dir.path().join("grasp.log"),
        interface: Some(bus.into()),
    };
    let daemon = Daemon::start(config(dir.path(), [log("can0"), log("can1")])).unwrap();
    let mut subscriber = Subscriber::connect(dir.path().join("images.sock")).unwrap();
    let mut with_contact = 0;
    loop {
        let (header, image) = match subscriber.next_image() {
            Ok(message) => message,
            // The recording has ended.
            Err(ReadError::Closed) => break,
            Err(error) => panic!("{error}"),
        };
        with_contact += usize::from(image.contacts > 0);
        let expected = ImageView::decode(offline[&header.seq]).unwrap();
        assert_eq!(image, expected, "image {}", header.seq);
    }
    assert!(with_contact > 0);
    daemon.stop().unwrap();
}

/// Counts of one module that is still for 2 s and then pressed.
fn module_counts(path: &Path) {
    let counts = Array2::from_shape_fn((90, 48), |(t, column)| {
        let (taxel, axis) = (column / 3, column % 3);
        let noise = (t * 7 + column * 5) % 4;
        let press = if t > 60 && axis == 2 { 40 * taxel } else { 0 };
        (20_000 + noise + press) as u16
    });
    ndarray_npy::write_npy(path, &counts).unwrap();
}

#[test]
fn counts_compress_alike_from_the_array_and_from_the_traffic_they_become() {
    let dir = TempDir::new().unwrap();
    module_counts(&dir.path().join("module.npy"));
    let tiled = ["module.npy", "--columns", "xyz-interleaved", "--tile"];
    let (_, err) = succeeds(
        &dir,
        &[&["compress"], &tiled[..], &["--out", "direct.npy"]].concat(),
    );
    assert!(err.contains("90 images"), "{err}");
    let (_, err) = succeeds(
        &dir,
        &[&["replay"], &tiled[..], &["--to", "log:module.log"]].concat(),
    );
    assert!(err.contains("21600 frames sent"), "{err}");
    let settings = "[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"can:can1\"\n[tick]\nmode = \"sweep\"\n\
                    [sweep]\nboard_period_ms = 33.333333\nsettle_ms = 0.0\n";
    std::fs::write(dir.path().join("taxeld.toml"), settings).unwrap();
    succeeds(
        &dir,
        &[
            "compress",
            "module.log",
            "--config",
            "taxeld.toml",
            "--out",
            "traffic.npy",
        ],
    );
    let read = |file: &str| -> Array3<u8> { ndarray_npy::read_npy(dir.path().join(file)).unwrap() };
    let (direct, traffic) = (read("direct.npy"), read("traffic.npy"));
    assert_eq!(direct, traffic);
    assert!(direct.iter().any(|pixel| *pixel > 0));
}

#[test]
fn magnitudes_are_contacts_above_the_threshold() {
    let dir = TempDir::new().unwrap();
    let mut frames = Array3::<f32>::from_elem((2, 4, 5), 10.0);
    frames[[1, 2, 3]] = 50.0;
    ndarray_npy::write_npy(dir.path().join("grid.npy"), &frames).unwrap();
    let (_, err) = succeeds(
        &dir,
        &["compress", "grid.npy", "--threshold", "20", "--out", "grid.jsonl"],
    );
    assert!(err.contains("2 images of 5x4, 1 with contact"), "{err}");
    let text = std::fs::read_to_string(dir.path().join("grid.jsonl")).unwrap();
    let last: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert_eq!(last["levels"], serde_json::json!([50.0]));
    assert_eq!(
        (
            last["actuators"][0]["x"].as_u64(),
            last["actuators"][0]["y"].as_u64()
        ),
        (Some(3), Some(2))
    );
    let err = fails(&dir, &["compress", "grid.npy", "--out", "grid.npy"], 1);
    assert!(err.contains("overwrite"), "{err}");
    let err = fails(
        &dir,
        &["compress", "grid.npy", "--layout", "grid:3x3", "--out", "a.npy"],
        1,
    );
    assert!(err.contains("20 taxels") && err.contains("grid:HxW"), "{err}");
    let err = fails(
        &dir,
        &["compress", "grid.npy", "--levels", "0", "--out", "a.npy"],
        1,
    );
    assert!(err.contains("levels"), "{err}");
}

#[test]
fn a_magnitude_in_contact_stays_so_down_to_the_release() {
    let dir = TempDir::new().unwrap();
    let mut frames = Array3::<f32>::zeros((5, 2, 2));
    for (t, force) in [21.0, 15.0, 10.0, 15.0, 21.0].into_iter().enumerate() {
        frames[[t, 0, 0]] = force;
    }
    ndarray_npy::write_npy(dir.path().join("grid.npy"), &frames).unwrap();
    let compress = ["compress", "grid.npy", "--threshold", "20", "--out", "grid.jsonl"];
    for (release, want) in [
        (None, [1, 0, 0, 0, 1]),
        (Some("10"), [1, 1, 0, 0, 1]),
        (Some("20"), [1, 0, 0, 0, 1]),
    ] {
        let more: Vec<&str> = release.into_iter().flat_map(|r| ["--release", r]).collect();
        succeeds(&dir, &[&compress[..], &more].concat());
        let text = std::fs::read_to_string(dir.path().join("grid.jsonl")).unwrap();
        let contacts = |line: &str| {
            serde_json::from_str::<Value>(line).unwrap()["contacts"]
                .as_u64()
                .unwrap()
        };
        assert_eq!(
            text.lines().map(contacts).collect::<Vec<_>>(),
            want,
            "{release:?}"
        );
    }
    let err = fails(&dir, &[&compress[..], &["--release", "30"]].concat(), 1);
    assert!(err.contains("--release 30"), "{err}");
}

#[test]
fn a_learned_codebook_is_a_configuration() {
    let dir = TempDir::new().unwrap();
    succeeds(
        &dir,
        &["sim", "ball-grasp", "--to", "log:grasp.log", "--seconds", "4"],
    );
    let learn = [
        "compress",
        "grasp.log",
        "--out",
        "a.npy",
        "--levels",
        "4",
        "--learn-codebook",
        "book.toml",
    ];
    succeeds(&dir, &learn);
    let book = std::fs::read_to_string(dir.path().join("book.toml")).unwrap();
    let settings = format!("[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"can:can1\"\n{book}");
    std::fs::write(dir.path().join("taxeld.toml"), settings).unwrap();
    succeeds(
        &dir,
        &[
            "compress",
            "grasp.log",
            "--config",
            "taxeld.toml",
            "--out",
            "b.jsonl",
        ],
    );
    let text = std::fs::read_to_string(dir.path().join("b.jsonl")).unwrap();
    let levels = |line: &str| serde_json::from_str::<Value>(line).unwrap()["levels"].clone();
    let constant: Vec<Value> = text
        .lines()
        .map(levels)
        .filter(|l| *l != serde_json::json!([]))
        .collect();
    assert!(constant.len() > 1);
    assert!(constant.iter().all(|l| *l == constant[0]), "{constant:?}");
}

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
}

#[test]
fn input_that_cannot_be_read_says_what_to_do() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| -> PathBuf { dir.path().join(name) };
    std::fs::write(path("empty.log"), "").unwrap();
    std::fs::write(path("words.log"), "hello\n").unwrap();
    std::fs::write(path("other.log"), "(1.0) vcan7 123#00\n").unwrap();
    std::fs::write(path("bad.npy"), "hello").unwrap();
    for (input, wanted) in [
        ("absent.npz", "absent.npz"),
        ("empty.log", "no CAN frame"),
        ("words.log", "line 1"),
        ("other.log", "--interface vcan7=can0"),
        ("bad.npy", "signature"),
        ("grasp.mcap", "MCAP"),
        ("grasp.h5", ".npz"),
    ] {
        let err = fails(&dir, &["compress", input, "--out", "out.npz"], 1);
        assert!(err.contains(wanted), "{input}: {err}");
    }
}

#[test]
fn the_demo_without_a_terminal_prints_a_summary() {
    let dir = TempDir::new().unwrap();
    let (out, _) = succeeds(
        &dir,
        &[
            "demo",
            "--scene",
            "worst-case",
            "--seconds",
            "4",
            "--actuators",
            "9",
        ],
    );
    for part in [
        "worst-case: allegro-uskin-15, 240 taxels",
        "9 actuators",
        "images",
        "latency",
        "240 taxels",
    ] {
        assert!(out.contains(part), "{part}: {out}");
    }
}

/// Counts of a module: at rest, then pressed here and there.
fn pressed_counts(frames: usize, taxels: usize) -> Array3<u16> {
    Array3::from_shape_fn((frames, taxels, 3), |(t, n, axis)| {
        let idle = [31_000, 32_000, 9_000][axis] + ((t * 7 + n * 3 + axis) % 5) as u16;
        let pressed = t > 60 && (n + t / 4) % 3 != 0;
        idle + if pressed && axis == 2 {
            (300 + n * n * 37 % 900 + t) as u16
        } else {
            0
        }
    })
}

#[test]
fn eval_prints_the_object_of_the_contract() {
    let dir = TempDir::new().unwrap();
    ndarray_npy::write_npy(dir.path().join("module.npy"), &pressed_counts(120, 16)).unwrap();
    let small = ["--restarts", "4", "--passes", "1", "--tile"];
    let args = [
        "eval",
        "module.npy",
        "--levels",
        "4",
        "--actuators",
        "8",
        "--json",
        "--export",
        "frames.npz",
    ];
    let (out, _) = succeeds(&dir, &[&args[..], &small].concat());
    let report: Value = serde_json::from_str(&out).unwrap();
    for (key, want) in [("frames", 120), ("taxels", 240), ("levels", 4), ("actuators", 8)] {
        assert_eq!(report[key], want, "{key}");
    }
    let contact_frames = report["contact_frames"].as_u64().unwrap();
    assert!((40..80).contains(&contact_frames), "{contact_frames}");
    let methods = report["methods"].as_array().unwrap();
    let names: Vec<&str> = methods.iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(names[..2], ["paper", "optimal"]);
    assert!(names.contains(&"paper force_fit=exact") && names.contains(&"optimal history=0.5"));
    for method in methods {
        for key in [
            "force_sse_ratio_mean",
            "force_sse_ratio_p95",
            "force_optimal_fraction",
            "position_sse_ratio_mean",
            "position_sse_ratio_p95",
            "jump_fraction",
            "tick_us_p50",
            "tick_us_p99",
            "tick_us_p999",
            "allocations_per_tick",
        ] {
            assert!(
                method[key].as_f64().is_some_and(f64::is_finite),
                "{key} of {method}"
            );
        }
        assert!(method["tick_us_p50"].as_f64().unwrap() > 0.0);
        assert_eq!(method["allocations_per_tick"], 0.0, "{}", method["name"]);
    }
    assert_eq!(methods[1]["force_optimal_fraction"], 1.0);
    assert!(methods[0]["force_sse_ratio_mean"].as_f64() >= methods[1]["force_sse_ratio_mean"].as_f64());
    let mut frames =
        ndarray_npy::NpzReader::new(std::fs::File::open(dir.path().join("frames.npz")).unwrap()).unwrap();
    let contact: Array2<u8> = frames.by_name("contact").unwrap();
    let in_contact = contact
        .rows()
        .into_iter()
        .filter(|frame| frame.iter().any(|c| *c > 0))
        .count();
    assert_eq!((contact.dim(), in_contact as u64), ((120, 240), contact_frames));
}

#[test]
fn eval_takes_magnitudes_and_scenes_and_methods_and_writes_tables() {
    let dir = TempDir::new().unwrap();
    let forces = Array2::from_shape_fn((6, 40), |(t, n)| (n * n * 31 % 97 + t) as f64);
    ndarray_npy::write_npy(dir.path().join("forces.npy"), &forces).unwrap();
    let args = [
        "eval",
        "forces.npy",
        "--layout",
        "grid:5x8",
        "--threshold",
        "20",
        "--restarts",
        "4",
        "--passes",
        "1",
    ];
    let methods = [
        "--method",
        "optimal",
        "--method",
        "optimal history=0.3",
        "--csv",
        "all.csv",
        "--sweep-k",
    ];
    let (out, _) = succeeds(&dir, &[&args[..], &methods].concat());
    assert!(
        out.contains("6 frames of 40 taxels") && out.contains("optimal history=0.3"),
        "{out}"
    );
    let csv = std::fs::read_to_string(dir.path().join("all.csv")).unwrap();
    // Two methods, at the size asked for and at five more.
    assert_eq!(csv.lines().count(), 1 + 2 * 6, "{csv}");
    let columns = csv.lines().next().unwrap().split(',').count();
    assert!(
        csv.lines().all(|line| line.split(',').count() == columns),
        "{csv}"
    );

    let scene = [
        "eval",
        "sim:tap",
        "--method",
        "optimal",
        "--json",
        "--restarts",
        "1",
        "--passes",
        "1",
    ];
    let (out, _) = succeeds(&dir, &scene);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert!(
        report["contact_truth"]["precision"].as_f64().unwrap() > 0.9,
        "{out}"
    );
}

#[test]
fn eval_refuses_what_it_cannot_judge() {
    let dir = TempDir::new().unwrap();
    ndarray_npy::write_npy(dir.path().join("forces.npy"), &Array2::from_elem((2, 16), 1.0)).unwrap();
    for (args, wanted) in [
        (
            &["eval", "forces.npy", "--layout", "grid:4x4", "--method", "best"][..],
            "best",
        ),
        (
            &[
                "eval",
                "forces.npy",
                "--layout",
                "grid:4x4",
                "--method",
                "paper",
                "--method",
                "optimal levels=3",
            ],
            "--levels",
        ),
        (&["eval", "sim:nowhere"], "nowhere"),
        (&["eval", "sim:tap", "--tile"], "--tile"),
    ] {
        let err = fails(&dir, args, 1);
        assert!(err.contains(wanted), "{args:?}: {err}");
    }
}
