//! Pauses of more than a minute in recordings that are no CAN traffic.

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
