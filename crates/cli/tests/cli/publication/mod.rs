//! The first publication's file: 240 readings x y z and 16 joint angles a row.

use crate::{fails, succeeds};
use ndarray::{Array2, Array3};
use ndarray_npy::NpzReader;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

fn here(name: &str) -> String {
    let place = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/cli/publication");
    place.join(name).to_str().unwrap().to_owned()
}

/// Images and joint angles.
fn read(dir: &TempDir, name: &str) -> (Array3<u8>, Array2<f32>) {
    let mut npz = NpzReader::new(fs::File::open(dir.path().join(name)).unwrap()).unwrap();
    (npz.by_name("images").unwrap(), npz.by_name("joints").unwrap())
}

fn compress(dir: &TempDir, input: &str, out: &str, more: &[&str]) {
    let display = here("display.toml");
    let args = ["compress", input, "--config", &display, "--out", out];
    succeeds(dir, &[&args[..], more].concat());
}

#[test]
fn a_scene_makes_the_publications_file_byte_for_byte_and_the_file_makes_the_scenes_images() {
    let dir = TempDir::new().unwrap();
    let scene = format!("sim:{}", here("press.toml"));
    compress(&dir, &scene, "scene.npz", &["--frames", "press.csv"]);
    let (made, kept) = (dir.path().join("press.csv"), here("press.csv"));
    assert!(
        fs::read(&made).unwrap() == fs::read(&kept).unwrap(),
        "{}",
        made.display()
    );

    compress(&dir, &kept, "file.npz", &[]);
    let wanted = read(&dir, "scene.npz");
    assert_eq!(wanted.1.dim(), (19, 16));
    assert!(wanted.0.iter().any(|pixel| *pixel > 0) && wanted.1.iter().any(|angle| *angle > 0.5));
    assert!(read(&dir, "file.npz") == wanted);

    // As it was published: without names and times, in the order of the hand.
    let order = [
        "--columns",
        "xyz-interleaved",
        "--joint-columns",
        "16",
        "--rate",
        "20",
    ];
    for (name, separator) in [("a.csv", ","), ("b.csv", ";"), ("c.csv", "  "), ("d.csv", "\t")] {
        let text = fs::read_to_string(&kept).unwrap();
        let rows = text
            .lines()
            .skip(1)
            .map(|row| row.split_once(',').unwrap().1.replace(',', separator) + "\n");
        fs::write(dir.path().join(name), rows.collect::<String>()).unwrap();
        compress(&dir, name, "plain.npz", &order);
        assert!(read(&dir, "plain.npz") == wanted, "{separator:?}");
    }
}

#[test]
fn images_as_csv_carry_the_joint_angles() {
    let dir = TempDir::new().unwrap();
    compress(&dir, &here("press.csv"), "images.csv", &[]);
    let text = fs::read_to_string(dir.path().join("images.csv")).unwrap();
    assert!(
        text.lines()
            .next()
            .unwrap()
            .ends_with(",y15x15,J0,J1,J2,J3,J4,J5,J6,J7,J8,J9,J10,J11,J12,J13,J14,J15")
    );
    assert_eq!(text.lines().last().unwrap().split(',').count(), 1 + 256 + 16);
}

#[test]
fn the_publications_file_is_judged_and_played_as_other_counts_are() {
    let dir = TempDir::new().unwrap();
    let (file, display) = (here("press.csv"), here("display.toml"));
    let small = ["--restarts", "2", "--passes", "1", "--method", "paper"];
    let (out, _) = succeeds(
        &dir,
        &[&["eval", &file, "--config", &display][..], &small].concat(),
    );
    assert!(out.contains("paper"), "{out}");
    let (_, err) = succeeds(&dir, &["replay", &file, "--to", "log:press.log"]);
    assert!(
        err.contains("16 joint angles are left out") && err.contains("4560 frames sent"),
        "{err}"
    );
}

#[test]
fn what_the_columns_may_be_is_said() {
    let dir = TempDir::new().unwrap();
    let row = vec!["1"; 736].join(",") + "\n";
    fs::write(dir.path().join("plain.csv"), row.repeat(2)).unwrap();
    let err = fails(&dir, &["compress", "plain.csv", "--out", "a.npz"], 1);
    assert!(
        err.contains("--columns xyz-interleaved --joint-columns 16"),
        "{err}"
    );
    // A silent taxel has empty cells, which are known for what they are by the number of columns.
    let silent = [vec!["1"; 336], vec![""; 3], vec!["1"; 397]].concat().join(",") + "\n";
    fs::write(dir.path().join("silent.csv"), silent.repeat(2)).unwrap();
    fs::write(dir.path().join("times.csv"), format!("0,{silent}1,{silent}")).unwrap();
    let said = |file: &str, more: &[&str]| {
        let args = ["compress", file, "--out", "a.npz"];
        fails(&dir, &[&args[..], more].concat(), 1)
    };
    let of_counts = "--columns xyz-interleaved --joint-columns 16 that they are x y z counts";
    let out = "leave --void out";
    for (more, is_void) in [(&[][..], false), (&["--void", "nan"], true)] {
        let err = said("silent.csv", more);
        assert!(err.contains(of_counts) && err.contains(out) == is_void, "{err}");
    }
    let err = said("silent.csv", &["--columns", "xyz-interleaved"]);
    assert!(
        err.contains("--joint-columns M") && err.contains("--time-column"),
        "{err}"
    );
    let order = ["--columns", "xyz-interleaved", "--joint-columns", "16"];
    let err = said("silent.csv", &[&order[..], &["--void", "nan"]].concat());
    assert!(err.contains(out), "{err}");
    let plain = ["compress", "silent.csv", "--out", "a.npz"];
    succeeds(&dir, &[&plain[..], &order].concat());
    // 737 columns may be 17 joint angles, or a time and 16.
    let err = said("times.csv", &[]);
    assert!(
        err.contains("--joint-columns 17") && err.contains("--time-column"),
        "{err}"
    );
    // An array has no joint angles beside its counts.
    ndarray_npy::write_npy(dir.path().join("plain.npy"), &Array2::from_elem((2, 736), 1.0)).unwrap();
    let array = ["compress", "plain.npy", "--out", "a.npz"];
    let err = fails(&dir, &array, 1);
    assert!(
        err.contains("--layout grid:HxW") && !err.contains("joint"),
        "{err}"
    );
    for option in [["--joint-columns", "16"], ["--time-column", "ms"]] {
        let err = fails(&dir, &[&array[..], &option].concat(), 1);
        assert!(
            err.contains(&format!("plain.npy: {} is of the columns of a .csv", option[0])),
            "{err}"
        );
    }
    let err = fails(
        &dir,
        &[
            "compress",
            "plain.csv",
            "--out",
            "a.npz",
            "--frames",
            "f.csv",
            "--layout",
            "grid:32x23",
        ],
        1,
    );
    assert!(err.contains("plain.csv holds magnitudes"), "{err}");
    let err = fails(&dir, &["replay", "sim:tap", "--to", "-"], 1);
    assert!(err.contains("taxel sim tap --to SOURCE"), "{err}");
}
