//! Recordings that are damaged, have no end or are none, and files that are written whole or not at all.

use crate::{HANGS_AFTER, command, fails, succeeds, texts};
use ndarray::{Array2, Array3};
use std::os::unix::fs::symlink;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Images and what is said about them, of a log.
fn compressed(dir: &TempDir, text: &str) -> (Vec<u8>, String) {
    std::fs::write(dir.path().join("in.log"), text).unwrap();
    let (_, err) = succeeds(dir, &["compress", "in.log", "--out", "out.bin"]);
    (std::fs::read(dir.path().join("out.bin")).unwrap(), err)
}

#[test]
fn a_damaged_time_costs_no_images_and_is_told_with_its_line() {
    let dir = TempDir::new().unwrap();
    let (log, _) = succeeds(&dir, &["sim", "tap", "--to", "-", "--seconds", "1"]);
    let (whole, err) = compressed(&dir, &log);
    assert!(!err.contains("jumps"), "{err}");
    // One flipped byte makes of 0.100125 s a hundred thousand.
    let mut lines: Vec<String> = log.lines().map(str::to_owned).collect();
    let damaged = lines
        .iter()
        .position(|line| line.starts_with("(0000000000.1"))
        .unwrap();
    lines[damaged].replace_range(11..12, "0");
    let (images, err) = compressed(&dir, &(lines.join("\n") + "\n"));
    assert!(err.contains(&format!("first at line {}", damaged + 1)), "{err}");
    assert!(err.contains("forward by more than 60 s once"), "{err}");
    // Its own instant is lost and no more.
    assert!(
        images.len() <= whole.len() && images.len() * 10 > whole.len() * 8,
        "{}",
        images.len()
    );
    let (_, err) = succeeds(&dir, &["replay", "in.log", "--to", "log:out.log"]);
    assert!(err.contains("in.log: its time jumps forward"), "{err}");
}

#[test]
fn lines_that_are_days_apart_make_no_images_of_the_days() {
    let dir = TempDir::new().unwrap();
    let log: String = (0..40)
        .map(|i| format!("({}.000000) can0 123#0080008000800000\n", i * 80_000))
        .collect();
    let (images, err) = compressed(&dir, &log);
    assert!(images.len() < 10_000, "{} bytes", images.len());
    assert!(
        err.contains("39 times (3120000.0 s left out), first at line 2"),
        "{err}"
    );
}

#[test]
fn files_without_an_end_are_refused() {
    let dir = TempDir::new().unwrap();
    for (name, wanted) in [
        ("zero.npy", "it does not begin with the npy signature"),
        ("zero.npz", "not a readable npz"),
        ("zero.csv", "longer than"),
        ("zero.log", "64 MiB without a CAN frame"),
    ] {
        symlink("/dev/zero", dir.path().join(name)).unwrap();
        for command in [
            vec!["compress", name, "--out", "out.npy"],
            vec!["replay", name, "--to", "-"],
            vec!["eval", name],
        ] {
            let err = fails(&dir, &command, 1);
            assert!(err.contains(wanted) && err.contains(name), "{command:?}: {err}");
        }
    }
}

#[test]
fn texts_that_nobody_wrote_are_refused() {
    let dir = TempDir::new().unwrap();
    symlink("/dev/zero", dir.path().join("zero.toml")).unwrap();
    std::fs::write(dir.path().join("in.log"), "(0.0) can0 001#\n").unwrap();
    for args in [
        &["compress", "in.log", "--out", "out.bin", "--layout", "zero.toml"][..],
        &["compress", "in.log", "--out", "out.bin", "--config", "zero.toml"],
        &["sim", "zero.toml", "--to", "-"],
    ] {
        let err = fails(&dir, args, 1);
        assert!(
            err.contains("zero.toml") && err.contains("longer than 4 MiB"),
            "{args:?}: {err}"
        );
    }
}

/// Runs on a disk on which no file can have more than 512 bytes; expects failure.
fn fails_on_a_full_disk(dir: &TempDir, args: &[&str]) -> String {
    let mut shell = Command::new("sh");
    shell.args([
        "-c",
        "ulimit -f 1; exec \"$@\"",
        "sh",
        env!("CARGO_BIN_EXE_taxel"),
    ]);
    let output = shell.args(args).current_dir(dir.path()).output().unwrap();
    let (out, err) = texts(&output);
    assert!(!output.status.success(), "taxel {args:?}\n{out}{err}");
    err
}

#[test]
fn a_full_disk_leaves_the_file_from_before_and_no_half_of_a_new_one() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log"]);
    for (file, args) in [
        ("a.log", vec!["sim", "tap", "--to", "log:a.log"]),
        ("b.log", vec!["replay", "tap.log", "--to", "log:b.log"]),
        ("c.npz", vec!["compress", "tap.log", "--out", "c.npz"]),
        ("d.jsonl", vec!["compress", "tap.log", "--out", "d.jsonl"]),
        (
            "e.npz",
            vec![
                "eval",
                "tap.log",
                "--passes",
                "1",
                "--restarts",
                "1",
                "--export",
                "e.npz",
            ],
        ),
        (
            "f.toml",
            vec!["doctor", "--scan", "log:tap.log", "--out", "f.toml", "--force"],
        ),
    ] {
        std::fs::write(path(file), "before").unwrap();
        let names = || std::fs::read_dir(dir.path()).unwrap().count();
        let before = names();
        let err = fails_on_a_full_disk(&dir, &args);
        assert!(err.contains("too large") && err.contains(file), "{args:?}: {err}");
        assert!(!err.contains(".part"), "{args:?}: {err}");
        assert_eq!(
            (std::fs::read(path(file)).unwrap(), names()),
            (b"before".to_vec(), before),
            "{args:?}"
        );
    }
}

#[test]
fn what_is_odd_about_frames_is_told() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    let write = |name: &str, text: String| std::fs::write(path(name), text).unwrap();
    let told = |args: &[&str]| succeeds(&dir, &[&["compress", "--out", "out.npy"], args].concat()).1;
    let grid = ["--layout", "grid:1x2"];
    let magnitudes = |name: &str, head: &str, value: f64| {
        let lines: String = (0..4).map(|t| format!("{t},{value},{value}\n")).collect();
        write(name, head.to_owned() + &lines);
    };
    magnitudes("unit.csv", "Time,a,b\n", 1.0);
    magnitudes("t_ms.csv", "t_ms,a,b\n", 1.0);
    magnitudes("below.csv", "t_s,a,b\n", -0.5);
    let of = |name| told(&[&[name], &grid[..]].concat());
    assert!(of("unit.csv").contains("unit.csv: the column \"Time\" is taken for seconds; --time-column"));
    let unit = told(&[&["unit.csv", "--time-column", "ms"], &grid[..]].concat());
    assert!(!unit.contains("seconds") && !of("t_ms.csv").contains("seconds"));
    assert!(of("below.csv").contains("below.csv: every magnitude is below 0, the greatest is -0.5"));
    // Counts of which two frames have one time.
    let counts = |t: usize| (0..48).map(move |n| format!(",{}", 1000 + n + t % 3));
    let line = |t: usize| format!("{}{}\n", t.max(1), counts(t).collect::<String>());
    let names = (0..16).flat_map(|taxel| ["X", "Y", "Z"].map(|axis| format!(",0B{taxel}{axis}")));
    let head = format!("t_ms{}\n", names.collect::<String>());
    write("counts.csv", (0..40).fold(head, |text, t| text + &line(t)));
    let counts = told(&["counts.csv", "--layout", "uskin-module"]);
    assert!(
        counts.contains("counts.csv: no image of their own for 1 of 40 frames")
            && counts.contains("39 images"),
        "{counts}"
    );
}

#[test]
fn forces_that_no_image_can_carry_are_out_of_use_and_told() {
    let dir = TempDir::new().unwrap();
    let forces = Array2::from_shape_vec((2, 2), vec![3.0, 1e38, 3.0, 1e39]).unwrap();
    ndarray_npy::write_npy(dir.path().join("in.npy"), &forces).unwrap();
    let args = ["compress", "in.npy", "--layout", "grid:1x2", "--out", "out.jsonl"];
    let (_, err) = succeeds(&dir, &args);
    assert!(
        err.contains("out of use in 1 image:") && err.contains("1e38"),
        "{err}"
    );
    let lines = std::fs::read_to_string(dir.path().join("out.jsonl")).unwrap();
    let faulty: Vec<bool> = lines.lines().map(|line| line.contains("\"faulty\":1,")).collect();
    assert_eq!(faulty, [false, true]);
}

#[test]
fn numpys_own_types_are_read_and_a_shape_is_never_bent_to_a_layout() {
    let dir = TempDir::new().unwrap();
    let write = |name: &str, shape: (usize, usize, usize)| {
        let whole = Array3::<i64>::from_shape_fn(shape, |(t, y, x)| (t + 10 * y + x + 1) as i64);
        ndarray_npy::write_npy(dir.path().join(name), &whole).unwrap();
    };
    write("square.npy", (2, 8, 8));
    write("narrow.npy", (2, 4, 3));
    let compress = |file, layout| ["compress", file, "--layout", layout, "--out", "out.npy"];
    let images = || -> Array3<u8> { ndarray_npy::read_npy(dir.path().join("out.npy")).unwrap() };
    succeeds(&dir, &compress("square.npy", "grid:8x8"));
    assert_eq!(images().dim(), (2, 8, 8));
    let err = fails(&dir, &compress("square.npy", "grid:4x16"), 1);
    assert!(err.contains("2 x 8 x 8; expected T x 4 x 16"), "{err}");
    succeeds(&dir, &compress("narrow.npy", "grid:4x3"));
    assert_eq!(images().dim(), (2, 4, 3));
    let err = fails(&dir, &["compress", "narrow.npy", "--out", "out.npy"], 1);
    assert!(err.contains("--layout grid:Hx3"), "{err}");
}

#[test]
fn forces_are_above_what_a_taxel_has_at_rest() {
    let dir = TempDir::new().unwrap();
    let frames = Array3::from_shape_vec((3, 1, 2), vec![40, 900, 42, 904, 41, 990]).unwrap();
    ndarray_npy::write_npy(dir.path().join("in.npy"), &frames).unwrap();
    let out = ["compress", "in.npy", "--threshold", "20", "--out", "out.npy"];
    let images = || ndarray_npy::read_npy::<_, Array3<u8>>(dir.path().join("out.npy")).unwrap();
    succeeds(&dir, &out);
    assert!(images().iter().all(|grey| *grey > 0));
    succeeds(&dir, &[&out[..], &["--idle", "2"]].concat());
    assert_eq!(images().into_raw_vec_and_offset().0, [0, 0, 0, 0, 0, 255]);
    let err = fails(&dir, &[&out[..], &["--idle", "4"]].concat(), 1);
    assert!(err.contains("has 3 frames"), "{err}");
}

#[test]
fn cells_that_are_no_taxels_stay_empty_and_one_without_a_value_is_missing() {
    let dir = TempDir::new().unwrap();
    let nan = f32::NAN;
    let frames = Array3::from_shape_vec((2, 2, 2), vec![1.0, nan, 2.0, 3.0, nan, nan, 2.0, 3.0]).unwrap();
    ndarray_npy::write_npy(dir.path().join("in.npy"), &frames).unwrap();
    let err = fails(&dir, &["compress", "in.npy", "--out", "out.jsonl"], 1);
    let advice = "with --void nan the taxel is missing in that frame, and cells that are NaN in all frames are no taxels";
    assert!(err.contains(advice), "{err}");
    for layout in [&[][..], &["--layout", "grid:2x2"]] {
        let args = [
            &["compress", "in.npy", "--void", "nan", "--out", "out.jsonl"],
            layout,
        ]
        .concat();
        let (_, err) = succeeds(&dir, &args);
        assert!(
            err.contains("taxels are missing in 1 image\n") && !err.contains("board_period"),
            "{err}"
        );
        let lines = std::fs::read_to_string(dir.path().join("out.jsonl")).unwrap();
        let images: Vec<serde_json::Value> = lines
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        let of = |key: &str| {
            images
                .iter()
                .map(|image| image[key].as_u64().unwrap())
                .collect::<Vec<_>>()
        };
        assert_eq!(
            (of("contacts"), of("missing"), of("faulty")),
            (vec![3, 2], vec![0, 1], vec![0, 0])
        );
        assert!(
            images
                .iter()
                .all(|image| image["image"][1] == 0 && image["image"][3] != 0),
            "{lines}"
        );
    }
}

#[test]
fn work_that_is_told_to_stop_leaves_no_half_of_a_file() {
    let dir = TempDir::new().unwrap();
    // Pauses that are just played: hours of images at a tick of 1 kHz.
    let log: String = (0..400)
        .map(|i| format!("({}.000000) can0 710#8380008000300001\n", i * 60))
        .collect();
    std::fs::write(dir.path().join("in.log"), log).unwrap();
    let config = "layout = \"uskin-module\"\ntick = { mode = \"timer\", rate_hz = 1000.0 }\n[[bus]]\nsource = \"log:in.log\"\n";
    std::fs::write(dir.path().join("hand.toml"), config).unwrap();
    for (args, code) in [
        (
            &["compress", "in.log", "--config", "hand.toml", "--out", "out.bin"][..],
            1,
        ),
        (
            &["eval", "in.log", "--config", "hand.toml", "--export", "out.npz"],
            128 + 15,
        ),
    ] {
        let child = command(&dir, args)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let parts = || {
            let names = std::fs::read_dir(dir.path())
                .unwrap()
                .map(|entry| entry.unwrap().file_name());
            names
                .filter(|name| name.to_string_lossy().starts_with("out."))
                .count()
        };
        let deadline = Instant::now() + HANGS_AFTER;
        while parts() == 0 {
            assert!(Instant::now() < deadline, "{args:?}: no file is begun");
            std::thread::sleep(Duration::from_millis(1));
        }
        let pid = nix::unistd::Pid::from_raw(child.id() as i32);
        nix::sys::signal::kill(pid, nix::sys::signal::SIGTERM).unwrap();
        let output = child.wait_with_output().unwrap();
        let (out, err) = texts(&output);
        assert_eq!(
            (output.status.code(), parts()),
            (Some(code), 0),
            "{args:?}: {out}{err}"
        );
    }
}

#[test]
fn a_grid_of_another_size_than_flat_frames_is_refused_by_its_product() {
    let dir = TempDir::new().unwrap();
    let flat = ndarray::Array2::<f32>::ones((3, 384));
    ndarray_npy::write_npy(dir.path().join("flat.npy"), &flat).unwrap();
    let compress = |layout| ["compress", "flat.npy", "--layout", layout, "--out", "o.npz"];
    succeeds(&dir, &compress("grid:16x24"));
    let err = fails(&dir, &compress("grid:16x25"), 1);
    assert!(
        err.contains("flat.npy") && err.contains("16 x 25 are 400"),
        "{err}"
    );
}

#[test]
fn what_candump_showed_and_cannot_be_read_is_refused_by_its_option() {
    let dir = TempDir::new().unwrap();
    std::fs::write(
        dir.path().join("bits.log"),
        "  can0  621   [2]  10000011 10000000\n",
    )
    .unwrap();
    let err = fails(&dir, &["convert", "bits.log", "-"], 1);
    assert!(
        err.contains("`candump -i` shows bits; record with `candump -l`"),
        "{err}"
    );
    let (log, _) = succeeds(&dir, &["sim", "tap", "--to", "-", "--seconds", "0.3"]);
    let mut last = 0.0;
    let mut differences = String::new();
    for line in log.lines() {
        let (time, rest) = line[1..].split_once(')').unwrap();
        let time: f64 = time.parse().unwrap();
        differences += &format!(" ({:010.6}) {rest}\n", time - last);
        last = time;
    }
    std::fs::write(dir.path().join("differences.log"), differences).unwrap();
    for args in [
        &["compress", "differences.log", "--out", "out.npz"][..],
        &["convert", "differences.log", "out.csv"],
        &["convert", "differences.log", "-"],
        &[
            "replay",
            "differences.log",
            "--to",
            "log:out.log",
            "--speed",
            "100",
        ],
    ] {
        let err = fails(&dir, args, 1);
        assert_eq!(err.matches("`candump -td` shows").count(), 1, "{args:?}: {err}");
    }
}
