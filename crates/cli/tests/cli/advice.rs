//! What is said of a recording that is read otherwise than it was meant.

use crate::{fails, succeeds};
use ndarray::{Array2, Array3, Array4};
use ndarray_npy::write_npy;
use tempfile::TempDir;

#[test]
fn contact_that_lasts_for_a_minute_to_the_end_is_told_of_counts() {
    let dir = TempDir::new().unwrap();
    // A module at 10 Hz: so many taxels are pressed from 30 s on, until the end or 5 s before it.
    let pressed = |name: &str, seconds: usize, until: usize| {
        let counts = Array3::from_shape_fn((10 * seconds, 16, 3), |(t, taxel, axis)| {
            let is_pressed = taxel < 5 && axis == 2 && (300 + taxel..10 * until).contains(&t);
            (20_000 + (t * 7 + taxel * 5) % 4 + if is_pressed { 3000 + 40 * (t % 9) } else { 0 }) as u16
        });
        write_npy(dir.path().join(name), &counts).unwrap();
    };
    pressed("held.npy", 100, 100);
    pressed("short.npy", 80, 80);
    pressed("let-go.npy", 100, 95);
    let said = |name| {
        let args = [
            "compress",
            name,
            "--layout",
            "uskin-module",
            "--rate",
            "10",
            "--out",
            "o.npz",
        ];
        succeeds(&dir, &args).1
    };
    let told = "5 of 16 taxels are in contact from 30 s at the latest to the end, above a threshold of";
    let err = said("held.npy");
    assert!(
        err.contains(told) && err.contains("drift_time_constant_ms"),
        "{err}"
    );
    for name in ["short.npy", "let-go.npy"] {
        let err = said(name);
        assert!(!err.contains("to the end"), "{name}: {err}");
    }
}

#[test]
fn magnitudes_that_fall_under_touch_are_told() {
    let dir = TempDir::new().unwrap();
    for (falls, rises, is_told) in [
        (700.0, 8.0, true),
        (8.0, 7.0, false),
        (300.0, 200.0, false),
        (12.0, 2.0, false),
    ] {
        let values = Array2::from_shape_fn((60, 4), |(t, n)| match (t, n) {
            (40.., 1) => 3500.0 - falls,
            (40.., 2) => 3500.0 + rises,
            _ => 3500.0,
        });
        write_npy(dir.path().join("in.npy"), &values).unwrap();
        let args = [
            "compress",
            "in.npy",
            "--layout",
            "grid:2x2",
            "--idle",
            "20",
            "--threshold",
            "15",
            "--out",
            "o.npz",
        ];
        let (_, err) = succeeds(&dir, &args);
        let told = format!(
            "fall by up to {falls} below rest (--idle) and rise by up to {rises}; where touch lowers them"
        );
        assert_eq!(err.contains(&told), is_told, "{err}");
    }
}

#[test]
fn forces_on_three_axes_are_told_from_counts() {
    let dir = TempDir::new().unwrap();
    write_npy(dir.path().join("in.npy"), &Array4::from_elem((3, 2, 2, 3), -0.25)).unwrap();
    let err = fails(&dir, &["eval", "in.npy"], 1);
    assert!(
        err.contains("Of forces on three axes give the norms, numpy.linalg.norm(a, axis=-1)"),
        "{err}"
    );
}
