//! `taxel compress`: recordings into images, the same bytes as the daemon's.

use crate::{config, fails, succeeds, words};
use ndarray::{Array2, Array3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use taxel_can::SourceAddress;
use taxel_wire::{Body, HEADER_LEN, ImageView, ReadError, Subscriber, decode};
use taxeld::Daemon;
use tempfile::TempDir;

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
        &words("compress module.log --config taxeld.toml --out traffic.npy"),
    );
    let read = |file: &str| -> Array3<u8> { ndarray_npy::read_npy(dir.path().join(file)).unwrap() };
    let (direct, traffic) = (read("direct.npy"), read("traffic.npy"));
    assert_eq!(direct, traffic);
    assert!(direct.iter().any(|pixel| *pixel > 0));
}

#[test]
fn a_configuration_without_a_bus_does_for_what_is_recorded() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("display.toml"), "[profile]\nlevels = 4\n").unwrap();
    let grid = Array3::from_shape_fn((4, 4, 4), |(t, y, x)| (t * (4 * y + x)) as f64);
    ndarray_npy::write_npy(dir.path().join("press.npy"), &grid).unwrap();
    module_counts(&dir.path().join("module.npy"));
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "1"]);
    let counts = ["module.npy", "--columns", "xyz-interleaved", "--tile"];
    for input in [&["press.npy"][..], &counts, &["tap.log"], &["sim:tap"]] {
        let args = ["--config", "display.toml", "--out", "images.npz"];
        succeeds(&dir, &[&["compress"], input, &args].concat());
        let images = std::fs::File::open(dir.path().join("images.npz")).unwrap();
        let levels: Array2<f64> = ndarray_npy::NpzReader::new(images)
            .unwrap()
            .by_name("levels")
            .unwrap();
        assert_eq!(levels.ncols(), 4, "{input:?}");
    }
    // One that is named is checked all the same.
    std::fs::write(dir.path().join("one.toml"), "[[bus]]\nsource = \"can:can0\"\n").unwrap();
    let err = fails(
        &dir,
        &["compress", "press.npy", "--config", "one.toml", "--out", "a.npy"],
        1,
    );
    assert!(
        err.contains("as many [[bus]] tables with a source, not 1"),
        "{err}"
    );
}

#[test]
fn frames_are_written_in_the_format_their_file_s_name_tells() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "1"]);
    let compress = ["compress", "tap.log", "--out", "tap.npy", "--frames"];
    for name in ["tap.csv", "tap.npz"] {
        succeeds(&dir, &[&compress[..], &[name]].concat());
    }
    let mut npz =
        ndarray_npy::NpzReader::new(std::fs::File::open(dir.path().join("tap.npz")).unwrap()).unwrap();
    let times: ndarray::Array1<u64> = npz.by_name("t_ns").unwrap();
    let counts: Array3<u16> = npz.by_name("counts").unwrap();
    let text = std::fs::read_to_string(dir.path().join("tap.csv")).unwrap();
    assert_eq!(text.lines().count(), 1 + times.len());
    let last: Vec<&str> = text.lines().last().unwrap().split(',').collect();
    assert_eq!(last[0], times.last().unwrap().to_string());
    let [z, of_csv] = [counts[[times.len() - 1, 239, 2]].to_string(), last[720].into()];
    assert_eq!(z, of_csv);
    for name in ["tap.log.txt", "tap.mcap", "frames"] {
        let err = fails(&dir, &[&compress[..], &[name]].concat(), 2);
        let wanted = format!("--frames {name}: frames are written as .csv, .npz or .parquet");
        assert!(err.contains(&wanted), "{err}");
        assert!(!dir.path().join(name).exists());
    }
}

#[test]
fn the_threshold_of_counts_is_named_and_a_hand_that_moves_while_it_is_measured() {
    let dir = TempDir::new().unwrap();
    for (file, moves) in [("still.npy", false), ("moved.npy", true)] {
        let counts = Array3::from_shape_fn((120, 16, 3), |(t, n, axis)| {
            let moved = if moves { 3 * t.clamp(50, 90) - 150 } else { 0 };
            let noise = (7 * t + 5 * n + 3 * axis) % 4;
            (20_000 + noise + moved) as u16
        });
        ndarray_npy::write_npy(dir.path().join(file), &counts).unwrap();
        let args = [
            "compress", file, "--layout", "grid:4x4", "--rate", "60", "--out", "o.npz", "--json",
        ];
        let (out, err) = succeeds(&dir, &args);
        assert!(
            err.contains(" while calibrating, contact above 10 counts\n"),
            "{err}"
        );
        assert_eq!(
            err.contains("moved.npy: the hand moved while it was calibrated, or was touched"),
            moves,
            "{err}"
        );
        let object: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(
            (object["threshold"].as_f64(), &object["moved"]),
            (Some(10.0), &json!(moves)),
            "{out}"
        );
    }
    // Both halves of the time, or of a part of the taxels.
    for (file, taxels, told) in [
        (
            "both.npy",
            16,
            "both.npy: the hand moved in both halves of the time in which it was calibrated",
        ),
        (
            "few.npy",
            7,
            "few.npy: 7 taxels moved while the hand was calibrated",
        ),
    ] {
        let counts = Array3::from_shape_fn((120, 16, 3), |(t, n, axis)| {
            let moved = if n < taxels { 3 * t.clamp(20, 70) } else { 0 };
            (20_000 + (7 * t + 5 * n + 3 * axis) % 4 + moved) as u16
        });
        ndarray_npy::write_npy(dir.path().join(file), &counts).unwrap();
        let args = [
            "compress", file, "--layout", "grid:4x4", "--rate", "60", "--out", "o.npz", "--json",
        ];
        let (out, err) = succeeds(&dir, &args);
        assert!(err.contains(told) && err.contains("--calibration-ms"), "{err}");
        let object: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(object["moved"], json!(true), "{out}");
        let of_movement = format!(
            ", {:.0} counts, is of that movement",
            object["threshold"].as_f64().unwrap()
        );
        assert_eq!(err.contains(&of_movement), taxels == 16, "{err}");
    }
    // It moves from 0.83 s on.
    let briefly = [
        "compress",
        "moved.npy",
        "--layout",
        "grid:4x4",
        "--rate",
        "60",
        "--out",
        "o.npz",
    ];
    let briefly = [&briefly[..], &["--calibration-ms", "700"]].concat();
    let (_, err) = succeeds(&dir, &briefly);
    assert!(
        err.contains(", 46 while calibrating, contact above") && !err.contains("moved while"),
        "{err}"
    );
    let magnitudes = Array3::<f32>::zeros((2, 4, 4));
    ndarray_npy::write_npy(dir.path().join("forces.npy"), &magnitudes).unwrap();
    let (out, _) = succeeds(&dir, &["compress", "forces.npy", "--out", "o.npz", "--json"]);
    let object: Value = serde_json::from_str(&out).unwrap();
    assert!(
        object["threshold"].is_null() && object["moved"].is_null(),
        "{out}"
    );
    let err = fails(
        &dir,
        &words("compress forces.npy --out o.npz --calibration-ms 700"),
        1,
    );
    assert!(
        err.contains("--calibration-ms is for counts; forces.npy holds magnitudes"),
        "{err}"
    );
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
    assert!(err.contains("2 images of 4x5, 1 with contact"), "{err}");
    let text = std::fs::read_to_string(dir.path().join("grid.jsonl")).unwrap();
    let last: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert_eq!(last["levels"], json!(vec![50.0; 8]));
    assert_eq!(
        (
            last["actuators"][0]["x"].as_u64(),
            last["actuators"][0]["y"].as_u64()
        ),
        (Some(3), Some(2))
    );
    let err = fails(&dir, &["compress", "grid.npy", "--out", "grid.npy"], 1);
    assert!(err.contains("overwrite"), "{err}");
    for (layout, wanted) in [
        ("uskin-module", ["20 taxels", "grid:HxW"]),
        ("grid:3x3", ["2 x 4 x 5", "grid:3x3"]),
    ] {
        let err = fails(
            &dir,
            &["compress", "grid.npy", "--layout", layout, "--out", "a.npy"],
            1,
        );
        assert!(wanted.iter().all(|wanted| err.contains(wanted)), "{err}");
    }
    let err = fails(
        &dir,
        &["compress", "grid.npy", "--levels", "0", "--out", "a.npy"],
        2,
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
    let err = fails(&dir, &[&compress[..], &["--release", "30"]].concat(), 2);
    assert!(err.contains("--release 30"), "{err}");
}

#[test]
fn input_that_cannot_be_read_says_what_to_do() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| -> PathBuf { dir.path().join(name) };
    std::fs::write(path("empty.log"), "").unwrap();
    std::fs::write(path("words.log"), "hello\n").unwrap();
    std::fs::write(path("other.log"), "(1.0) vcan7 123#00\n").unwrap();
    std::fs::write(path("bad.npy"), "hello").unwrap();
    std::fs::write(path("grasp.mcap"), "hello").unwrap();
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
fn no_output_overwrites_what_it_is_made_of() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log", "--seconds", "2"]);
    ndarray_npy::write_npy(dir.path().join("press.npy"), &Array3::<f32>::ones((5, 4, 4))).unwrap();
    std::os::unix::fs::symlink("press.npy", dir.path().join("link.npy")).unwrap();
    let read = |file: &str| std::fs::read(dir.path().join(file)).unwrap();
    let (log, frames) = (read("tap.log"), read("press.npy"));
    for args in [
        &["compress", "press.npy", "--out", "./press.npy"][..],
        &["compress", "press.npy", "--out", "link.npy"],
        &[
            "compress",
            "press.npy",
            "--out",
            "o.npz",
            "--learn-codebook",
            "press.npy",
        ],
        &[
            "compress",
            "press.npy",
            "--out",
            "o.npz",
            "--learn-codebook",
            "o.npz",
        ],
        &["eval", "press.npy", "--csv", "press.npy"],
        &["eval", "press.npy", "--export", "new.npz", "--times", "./new.npz"],
        &["replay", "tap.log", "--to", "log:tap.log"],
        &[
            "replay",
            "tap.log",
            "--interface",
            "can0=log:a.log",
            "--interface",
            "can1=log:./a.log",
        ],
    ] {
        let err = fails(&dir, args, 1);
        assert!(
            err.contains("overwrite the input") || err.contains("the same file"),
            "{err}"
        );
    }
    assert_eq!((read("tap.log"), read("press.npy")), (log, frames));
}

#[test]
fn what_cannot_be_written_whole_is_not_there() {
    let dir = TempDir::new().unwrap();
    ndarray_npy::write_npy(dir.path().join("press.npy"), &Array3::<f32>::ones((5, 4, 4))).unwrap();
    for out in ["o.npz", "o.npy", "o.csv", "o.jsonl", "o.bin"] {
        let err = fails(
            &dir,
            &["compress", "press.npy", "--out", &format!("none/{out}")],
            1,
        );
        assert!(err.contains("No such file"), "{err}");
        std::os::unix::fs::symlink("/dev/full", dir.path().join(out)).unwrap();
        let err = fails(&dir, &["compress", "press.npy", "--out", out], 1);
        assert!(
            err.starts_with("taxel: ") && err.contains("No space left"),
            "{err}"
        );
    }
    // The process dies of the limit on the size of files as it would of Ctrl-C twice, or of the
    // lack of memory.
    std::fs::write(dir.path().join("images.jsonl"), "before").unwrap();
    ndarray_npy::write_npy(dir.path().join("long.npy"), &Array3::<f32>::ones((900, 8, 8))).unwrap();
    let killed = std::process::Command::new("sh")
        .args([
            "-c",
            "ulimit -f 64; exec \"$0\" compress long.npy --out images.jsonl",
        ])
        .arg(env!("CARGO_BIN_EXE_taxel"))
        .current_dir(dir.path())
        .output()
        .unwrap();
    assert!(!killed.status.success());
    assert_eq!(std::fs::read(dir.path().join("images.jsonl")).unwrap(), b"before");
}

#[test]
fn the_method_paper_has_the_publications_conditioning_unless_told_otherwise() {
    let dir = TempDir::new().unwrap();
    succeeds(
        &dir,
        &["sim", "ball-grasp", "--to", "log:grasp.log", "--seconds", "4"],
    );
    let bytes = |more: &[&str]| {
        succeeds(
            &dir,
            &[&["compress", "grasp.log", "--out", "a.bin"], more].concat(),
        );
        std::fs::read(dir.path().join("a.bin")).unwrap()
    };
    let paper = bytes(&["--method", "paper"]);
    assert_eq!(bytes(&["--method", "paper", "--conditioning", "paper"]), paper);
    let robust = bytes(&["--method", "paper", "--conditioning", "robust"]);
    assert_ne!(robust, paper);
    assert_ne!(bytes(&["--conditioning", "paper"]), bytes(&[]));
    let err = fails(
        &dir,
        &words("compress grasp.log --out a.bin --conditioning best"),
        2,
    );
    assert!(err.contains("robust or paper"), "{err}");
}
