//! Times of recordings that are no CAN traffic: pauses of more than a minute, and times that no skin has.

use crate::succeeds;
use ndarray::{Array1, Array3};
use ndarray_npy::{NpzReader, NpzWriter};
use serde_json::Value;
use std::fs::File;
use tempfile::TempDir;

/// Frames before the pause, and in all.
const BEFORE: usize = 150;
const FRAMES: usize = 300;
const PERIOD_NS: u64 = 10_000_000;

#[test]
fn pauses_of_counts_and_magnitudes_are_left_out_and_told_on_every_skin() {
    let dir = TempDir::new().unwrap();
    let times: Array1<u64> = (0..FRAMES as u64)
        .map(|n| 7_000_000_000 + n * PERIOD_NS + 300_000_000_000 * u64::from(n >= BEFORE as u64))
        .collect();
    let write = |name: &str, values: &Array3<u16>| {
        let mut npz = NpzWriter::new(File::create(dir.path().join(name)).unwrap());
        npz.add_array("values", values).unwrap();
        npz.add_array("t_ns", &times).unwrap();
        npz.finish().unwrap();
    };
    write("forces.npz", &Array3::from_elem((FRAMES, 4, 4), 5));
    write("counts.npz", &Array3::from_elem((FRAMES, 16, 3), 20_000));
    for (file, layout) in [
        ("forces.npz", "grid:4x4"),
        ("counts.npz", "grid:4x4"),
        ("counts.npz", "uskin-module"),
    ] {
        let (_, err) = succeeds(&dir, &["compress", file, "--layout", layout, "--out", "out.npz"]);
        let told = format!(
            "{file} [values]: 1 pause of more than 60 s is left out (300.0 s), before frame {BEFORE}\n"
        );
        assert!(err.contains(&told), "{file} {layout}: {err}");
        let mut npz = NpzReader::new(File::open(dir.path().join("out.npz")).unwrap()).unwrap();
        let shown: Array1<u64> = npz.by_name("t_ns").unwrap();
        let wanted: Array1<u64> = (0..FRAMES as u64)
            .map(|n| 7_000_000_000 + n * PERIOD_NS)
            .collect();
        assert_eq!(shown, wanted, "{file} {layout}");
        let (object, _) = succeeds(&dir, &["view", file, "--layout", layout, "--json"]);
        let object: Value = serde_json::from_str(&object).unwrap();
        assert_eq!(object["longest_gap_s"], 0.01, "{file} {layout}");
    }
}

#[test]
fn times_in_another_unit_or_kept_as_float32_are_told() {
    let dir = TempDir::new().unwrap();
    let values = Array3::from_elem((FRAMES, 4, 4), 5u16);
    let seconds = |began_s: f64, step_s: f64| -> Array1<f64> {
        (0..FRAMES).map(|n| began_s + n as f64 * step_s).collect()
    };
    let told = |name: &str, times: &Array1<f64>, is_single: bool| {
        let mut npz = NpzWriter::new(File::create(dir.path().join("a.npz")).unwrap());
        npz.add_array("values", &values).unwrap();
        match (name, is_single) {
            ("t_ns", _) => npz.add_array(name, &times.mapv(|t| t as u64)),
            (_, true) => npz.add_array(name, &times.mapv(|t| t as f32)),
            (_, false) => npz.add_array(name, times),
        }
        .unwrap();
        npz.finish().unwrap();
        let compress = ["compress", "a.npz", "--layout", "grid:4x4", "--out", "out.npz"];
        succeeds(&dir, &compress).1
    };
    let unix_s = 1.7e9;
    for (name, times, is_single, words) in [
        (
            "t_us",
            seconds(5.0, 0.01),
            false,
            "by its times its frames come 100000000 times a second",
        ),
        (
            "t_s",
            seconds(5.0, 10_000.0),
            false,
            "by its times it has a frame every 10000 s",
        ),
        (
            "t_ns",
            seconds(5.0, 0.0),
            false,
            "299 of its 300 frames have the time of the frame before; --rate HZ",
        ),
        (
            "t_s",
            seconds(unix_s, 0.01),
            true,
            "frames have the time of the frame before; float32 keeps times as great as these to 128 s: save",
        ),
        (
            "t_ms",
            seconds(1e3 * unix_s, 10.0),
            true,
            "float32 keeps times as great as these to 131.072 s: save",
        ),
    ] {
        let err = told(name, &times, is_single);
        assert!(err.contains(words), "{name} {words}: {err}");
        assert!(!err.contains("a line for each taxel"), "{name}: {err}");
    }
    for (name, times, is_single) in [
        ("t_s", seconds(unix_s, 0.01), false),
        ("t_s", seconds(0.0, 0.01), true),
        ("t_s", seconds(0.0, 1.0), false),
    ] {
        let err = told(name, &times, is_single);
        let is_told = ["by its times", "the time of the frame before"].map(|words| err.contains(words));
        assert_eq!(is_told, [false; 2], "{name} {is_single}: {err}");
    }
}
