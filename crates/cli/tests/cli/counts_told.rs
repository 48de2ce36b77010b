//! What is said of recorded counts: of their threshold, of taxels out of use, of their length and their numbers.

use crate::counts::{counts, times, write_npz};
use crate::{fails, succeeds};
use ndarray::{Array3, Axis, s};
use ndarray_npy::write_npy;
use std::fs::write;
use tempfile::TempDir;

#[test]
fn a_threshold_of_0_is_told_where_the_publications_two_frames_are_the_same() {
    let dir = TempDir::new().unwrap();
    let mut counts = counts();
    let args = [
        "compress",
        "a.npz",
        "--layout",
        "uskin-module",
        "--out",
        "o.npz",
        "--method",
    ];
    let told = |counts: &Array3<f32>, method: &str| {
        write_npz(&dir, "a.npz", counts, &times());
        succeeds(&dir, &[&args[..], &[method]].concat())
            .1
            .contains("the contact threshold is 0")
    };
    assert!(!told(&counts, "paper"));
    let first = counts.index_axis(Axis(0), 0).to_owned();
    counts.index_axis_mut(Axis(0), 1).assign(&first);
    assert!(told(&counts, "paper"));
    assert!(!told(&counts, "optimal"));
}

#[test]
fn taxels_that_are_out_of_use_are_told_with_the_reason() {
    let dir = TempDir::new().unwrap();
    let quiet = Array3::from_shape_fn((90, 4, 3), |(t, taxel, axis)| {
        let press = if taxel == 1 && axis == 2 {
            t.saturating_sub(60).min(10)
        } else {
            0
        };
        20_000 + 20 * press as u16
    });
    write_npy(dir.path().join("quiet.npy"), &quiet).unwrap();
    let quiet = ["quiet.npy", "--layout", "grid:2x2"];
    let told = |command: &[&str]| succeeds(&dir, &[&command[..1], &quiet, &command[1..]].concat()).1;
    let stuck = "4 stuck (not changed by one count; in use from the first change on)";
    for (command, wanted) in [
        (
            &["compress", "--out", "out.npz"][..],
            "taxel: taxels are out of use in ",
        ),
        (&["eval", "--passes", "1"], "taxel: taxels are out of use in "),
        (
            &["figures", "--out", "figures"],
            "taxel: quiet: taxels are out of use in ",
        ),
    ] {
        let err = told(command);
        let line = err.lines().find(|line| line.starts_with(wanted));
        assert!(
            line.is_some_and(|line| line.ends_with(stuck)),
            "{command:?}: {err}"
        );
    }
}

#[test]
fn counts_that_end_while_the_hand_is_calibrated_are_told_so_by_whatever_looks_for_contact() {
    let dir = TempDir::new().unwrap();
    write_npz(&dir, "short.npz", &counts(), &times());
    write_npz(
        &dir,
        "two.npz",
        &counts().slice_move(s![..2, .., ..]),
        &times().slice_move(s![..2]),
    );
    let ends = "the recording ends within the calibration of 1500 ms; shorten it with --calibration-ms";
    for command in [
        &["eval", "short.npz"][..],
        &["figures", "short.npz", "--out", "figures"],
    ] {
        let args = [command, &["--layout", "grid:4x4", "--method", "optimal"]].concat();
        let err = fails(&dir, &args, 1);
        assert!(
            err.contains("nothing is in contact in any of") && err.contains(ends),
            "{err}"
        );
    }
    let compress = ["compress", "short.npz", "--layout", "grid:4x4", "--out", "o.npz"];
    let (_, err) = succeeds(&dir, &compress);
    assert!(err.contains(ends), "{err}");
    // What the publication takes are two frames, however long.
    let paper = ["--layout", "grid:4x4", "--method", "paper"];
    let err = fails(&dir, &[&["eval", "two.npz"][..], &paper].concat(), 1);
    assert!(
        err.contains("ends with the two frames that calibration takes"),
        "{err}"
    );
}

/// An .npy of floats of 16 bits, `T x 16 x 3`, of whole numbers from 1024 on.
fn write_halves(dir: &TempDir, name: &str, counts: &Array3<f32>) {
    let (frames, taxels, axes) = counts.dim();
    let header =
        format!("{{'descr': '<f2', 'fortran_order': False, 'shape': ({frames}, {taxels}, {axes}), }}");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend(header.as_bytes());
    for count in counts {
        let exponent = count.log2().floor() as i32;
        let fraction = (count / 2f32.powi(exponent - 10)).round() as u16 - 1024;
        bytes.extend((((exponent + 15) as u16) << 10 | fraction).to_le_bytes());
    }
    write(dir.path().join(name), bytes).unwrap();
}

#[test]
fn counts_from_floats_of_16_bits_are_told_with_their_steps_and_what_helps() {
    let dir = TempDir::new().unwrap();
    let compress = |name: &str| {
        let args = [
            "compress", name, "--layout", "grid:4x4", "--rate", "30", "--out", "o.npz",
        ];
        succeeds(&dir, &args).1
    };
    let of_16_bits = "its counts stand in floats of 16 bits, which go in steps of";
    write_halves(&dir, "half.npy", &counts());
    let err = compress("half.npy");
    assert!(
        err.contains(&format!("{of_16_bits} 16 there: save them as uint16"))
            && err.contains("threshold_min_counts = 32 (1024 where forces are squared) in [conditioning]"),
        "{err}"
    );
    // Whose steps are within the least threshold, and what has none.
    write_halves(&dir, "low.npy", &counts().mapv(|count| count - 17_000.0));
    write_npy(dir.path().join("whole.npy"), &counts()).unwrap();
    for name in ["low.npy", "whole.npy"] {
        let err = compress(name);
        assert!(!err.contains(of_16_bits), "{err}");
    }
}
