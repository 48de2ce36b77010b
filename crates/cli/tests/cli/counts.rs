//! Counts of three axes, from whatever skin and in whatever file.

use crate::succeeds;
use ndarray::{Array1, Array3};
use ndarray_npy::{NpzReader, NpzWriter};
use std::fs::File;
use tempfile::TempDir;

/// When the recording begins, and how long a frame takes, nanoseconds.
const BEGINS_NS: u64 = 266_594_555;
const PERIOD_NS: u64 = 33_333_333;
/// Time of a frame on a bus.
const FRAME_NS: u64 = 125_000;

/// A module of 4 x 4 that is still and is pressed from the third frame on, one taxel after the other.
fn counts() -> Array3<f32> {
    Array3::from_shape_fn((20, 16, 3), |(t, taxel, axis)| {
        let press = if t > 1 && axis == 2 && taxel <= t {
            300 * taxel
        } else {
            0
        };
        (20_000 + (t * 7 + taxel * 5) % 4 + press) as f32
    })
}

fn times() -> Array1<u64> {
    (0..20).map(|t| BEGINS_NS + t * PERIOD_NS).collect()
}

fn write_npz(dir: &TempDir, name: &str, counts: &Array3<f32>, times: &Array1<u64>) {
    let mut npz = NpzWriter::new(File::create(dir.path().join(name)).unwrap());
    npz.add_array("counts", counts).unwrap();
    npz.add_array("t_ns", times).unwrap();
    npz.finish().unwrap();
}

/// What `taxel compress` makes by the publication's method: images, their times, and taxels missing.
fn compressed(dir: &TempDir, input: &str, layout: &str, more: &[&str]) -> (Array3<u8>, Vec<u64>, Vec<u16>) {
    let args = [
        "compress", input, "--layout", layout, "--method", "paper", "--out", "out.npz",
    ];
    succeeds(dir, &[&args[..], more].concat());
    let mut npz = NpzReader::new(File::open(dir.path().join("out.npz")).unwrap()).unwrap();
    let times: Array1<u64> = npz.by_name("t_ns").unwrap();
    let missing: Array1<u16> = npz.by_name("missing").unwrap();
    (npz.by_name("images").unwrap(), times.to_vec(), missing.to_vec())
}

#[test]
fn images_of_counts_have_the_recorded_times_and_none_before_a_sweep_could_end() {
    let dir = TempDir::new().unwrap();
    let first_sweep_ns = 15 * FRAME_NS;
    for (begins_ns, first_ns) in [
        (BEGINS_NS, BEGINS_NS),
        (1_700_000_000_123_456_789, 1_700_000_000_123_456_789),
        (first_sweep_ns, first_sweep_ns),
        (0, first_sweep_ns),
    ] {
        let times = times().mapv(|t| t - BEGINS_NS + begins_ns);
        write_npz(&dir, "module.npz", &counts(), &times);
        let frames = ["--frames", "again.csv"];
        let (images, made, _) = compressed(&dir, "module.npz", "uskin-module", &frames);
        let shifted = times.mapv(|t| t - begins_ns + first_ns).to_vec();
        assert_eq!(made, shifted, "{begins_ns}");
        let (again, made, _) = compressed(&dir, "again.csv", "uskin-module", &[]);
        assert_eq!((again, made), (images, shifted), "{begins_ns}");
    }
}
