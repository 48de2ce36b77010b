//! `taxel eval --task`.

use crate::{fails, succeeds};
use ndarray::{Array1, Array2, Array3, Array4};
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

/// An .npz of labelled frames, 4 x 4: pressed in the corner of their class, idling elsewhere.
pub(crate) fn objects(path: &Path) {
    objects_of(path, 1.0);
}

/// The same with other forces, in the ratio of these.
fn objects_of(path: &Path, scale: f64) {
    let frames = Array3::from_shape_fn((16, 4, 4), |(n, y, x)| {
        let corner = [x / 2, y / 2] == [n % 2, n % 2];
        scale
            * match corner {
                true => 50.0 + f64::from((n * 7 + x * 5 + y) as u16 % 20),
                false => 1.0,
            }
    });
    let mut npz = ndarray_npy::NpzWriter::new(std::fs::File::create(path).unwrap());
    npz.add_array("frames", &frames).unwrap();
    npz.add_array("labels", &Array1::from_iter((0..16).map(|n| 3 + n % 2)))
        .unwrap();
    npz.finish().unwrap();
}

#[test]
fn eval_says_what_can_be_told_from_one_image() {
    let dir = TempDir::new().unwrap();
    objects(&dir.path().join("objects.npz"));
    let args = [
        "eval",
        "objects.npz",
        "--task",
        "--actuators",
        "4",
        "--csv",
        "curves.csv",
        "--figure",
        "curves.svg",
    ];
    let (out, _) = succeeds(&dir, &[&args[..], &["--json"]].concat());
    let report: Value = serde_json::from_str(&out).unwrap();
    for (key, want) in [
        ("frames", 16),
        ("classes", 2),
        ("taxels", 16),
        ("levels", 8),
        ("actuators", 4),
    ] {
        assert_eq!(report[key], want, "{key}");
    }
    let rows = report["rows"].as_array().unwrap();
    for (name, share) in [
        ("raw", 1.0),
        ("optimal force_weighted=true actuator_force=max", 1.0),
        ("fixed places in a grid, actuator_force=max", 1.0),
    ] {
        let row = rows.iter().find(|row| row["name"] == name).unwrap();
        assert_eq!(
            (row["nearest"].as_f64(), row["logistic"].as_f64()),
            (Some(share), Some(share)),
            "{name}"
        );
    }
    assert_eq!(rows[0]["bits"], 256.0);
    let text_of = |more: &[&str]| succeeds(&dir, &[&["eval", "objects.npz", "--task"], more].concat()).0;
    let text = text_of(&["--method", "paper"]);
    assert!(
        text.contains("2 classes") && text.contains("paper") && !text.contains("weighted"),
        "{text}"
    );
    // Half of the eight frames of a class.
    assert!(text.contains("by up to 3 pixels, 4 examples."), "{text}");
    // What remembers has a second row, of a compressor that runs on.
    let names: Vec<&str> = rows.iter().map(|row| row["name"].as_str().unwrap()).collect();
    let after = |name: &str| names[names.iter().position(|other| *other == name).unwrap() + 1];
    let weighted = "optimal force_weighted=true";
    assert_eq!(after(weighted), format!("{weighted}, running"), "{names:?}");
    assert_eq!(after("paper"), "optimal", "{names:?}");
    assert!(!text.contains("  running "), "{text}");
    let text_of_all = text_of(&["--actuators", "4"]);
    let lines: Vec<&str> = text_of_all.lines().collect();
    let at = lines
        .iter()
        .position(|line| line.starts_with(&format!("{weighted}  ")));
    assert!(lines[at.unwrap() + 1].starts_with("  running  "), "{text_of_all}");
    for text in [text, text_of_all] {
        assert!(text.lines().all(|line| line.len() <= 100), "{text}");
    }
    let curves = std::fs::read_to_string(dir.path().join("curves.csv")).unwrap();
    assert!(
        curves.starts_with("name,levels,actuators,nearest,bits\n") && curves.contains("\"paper\",8,2,"),
        "{curves}"
    );
    // Against actuators, levels and bits, each curve with its own marker wherever others lie over it.
    let svg = std::fs::read_to_string(dir.path().join("curves.svg")).unwrap();
    for axis in [
        "actuators (8 levels)",
        "levels (4 actuators)",
        "bits a frame (8 levels)",
    ] {
        assert!(svg.lines().any(|line| line == axis), "{axis}");
    }
}

#[test]
fn a_task_without_a_force_to_show_says_what_to_do() {
    let dir = TempDir::new().unwrap();
    for (scale, threshold, wanted) in [
        (1e39, "0", "numbers from 1e-38 to 1e38, and frame 0 has"),
        (0.0, "0", "no force is above 0"),
        (
            1.0,
            "1000",
            "the greatest force is 69, and --threshold 1000 is not below it",
        ),
    ] {
        objects_of(&dir.path().join("objects.npz"), scale);
        let err = fails(
            &dir,
            &["eval", "objects.npz", "--task", "--threshold", threshold],
            1,
        );
        assert!(
            err.contains("nothing is in contact in any of 16 frames") && err.contains(wanted),
            "{err}"
        );
    }
}

#[test]
fn taxels_without_an_image_are_placed_by_the_configuration() {
    let dir = TempDir::new().unwrap();
    let pressed = |(n, taxel): (usize, usize)| if taxel % 2 == n % 2 { 50.0 + n as f64 } else { 1.0 };
    let mut npz = ndarray_npy::NpzWriter::new(std::fs::File::create(dir.path().join("flat.npz")).unwrap());
    npz.add_array("frames", &Array2::from_shape_fn((16, 6), pressed))
        .unwrap();
    npz.add_array("labels", &Array1::from_iter((0..16).map(|n| n % 2)))
        .unwrap();
    npz.finish().unwrap();
    let layout = |columns: usize| {
        let row: Vec<String> = (0..columns).map(|n| n.to_string()).collect();
        format!(
            "name = \"strip\"\nimage = {{ width = {columns}, height = 1 }}\nbuses = []\n[[module]]\nname = \"a\"\n\
             part = \"a\"\nprotocol = \"offline\"\nat = [0, 0]\norder = [[{}]]\n",
            row.join(", ")
        )
    };
    std::fs::write(dir.path().join("strip.toml"), layout(6)).unwrap();
    std::fs::write(dir.path().join("longer.toml"), layout(7)).unwrap();
    for name in ["strip", "longer"] {
        std::fs::write(
            dir.path().join(format!("{name}-config.toml")),
            format!("layout = \"{name}.toml\"\n"),
        )
        .unwrap();
    }
    let eval = ["eval", "flat.npz", "--task", "--method", "optimal"];
    succeeds(&dir, &[&eval[..], &["--config", "strip-config.toml"]].concat());
    for more in [&[][..], &["--config", "longer-config.toml"]] {
        let err = fails(&dir, &[&eval[..], more].concat(), 1);
        assert!(err.contains("say with --layout where the 6 taxels are"), "{err}");
    }
}

#[test]
fn counts_are_no_trials_and_it_is_said_what_a_file_is_taken_for() {
    let dir = TempDir::new().unwrap();
    let write = |name: &str, frames: &Array4<f64>| {
        let mut npz = ndarray_npy::NpzWriter::new(std::fs::File::create(dir.path().join(name)).unwrap());
        npz.add_array("frames", &frames.mapv(|count| count as u16))
            .unwrap();
        npz.finish().unwrap();
    };
    write("counts.npz", &Array4::from_elem((200, 8, 8, 3), 9.0));
    let err = fails(&dir, &["eval", "counts.npz", "--task"], 1);
    assert!(
        err.contains("[200, 8, 8, 3] whole numbers are x y z counts") && !err.contains("taken for"),
        "{err}"
    );
    let pressed = |(class, trial, y, x): (usize, usize, usize, usize)| match (y, x) == (class, class) {
        true => 50.0 + trial as f64,
        false => 1.0,
    };
    write("trials.npz", &Array4::from_shape_fn((2, 4, 4, 4), pressed));
    write("narrow.npz", &Array4::from_shape_fn((2, 4, 8, 3), pressed));
    let task = ["--task", "--method", "paper"];
    let narrow = ["eval", "narrow.npz", "--layout", "grid:8x3"];
    let (_, err) = succeeds(&dir, &[&narrow[..], &task[..]].concat());
    assert!(err.contains("taken for 2 classes of 4 trials"), "{err}");
    let (_, err) = succeeds(&dir, &[&["eval", "trials.npz"], &task[..]].concat());
    assert!(err.contains("taken for 2 classes of 4 trials"), "{err}");
    objects(&dir.path().join("objects.npz"));
    let (_, err) = succeeds(&dir, &[&["eval", "objects.npz"], &task[..]].concat());
    assert!(
        err.contains("taken for 2 classes of 16 frames with labels"),
        "{err}"
    );
}
