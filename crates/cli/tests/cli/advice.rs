//! What is said of a recording that is read otherwise than it was meant.

use crate::{fails, succeeds, words};
use ndarray::{Array1, Array2, Array3, Array4};
use ndarray_npy::write_npy;
use std::fs::File;
use taxel_recorder::{Entry, Preamble, RecordingWriter, Topic, text_message};
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
        let args = words("compress in.npy --layout grid:2x2 --idle 20 --threshold 15 --out o.npz");
        let (_, err) = succeeds(&dir, &args);
        let told = format!(
            "fall by up to {falls} below rest (--idle) and rise by up to {rises}; where touch lowers them"
        );
        assert_eq!(err.contains(&told), is_told, "{err}");
    }
}

#[test]
fn magnitudes_that_mostly_fall_under_touch_are_told_where_some_rise_as_far() {
    let dir = TempDir::new().unwrap();
    for (fall, is_told) in [(3, true), (1, false)] {
        let values = Array2::from_shape_fn((60, 4), |(t, n)| match (t < 40, n < fall) {
            (true, _) => 3500.0,
            (_, true) => 3000.0,
            (_, false) => 3990.0,
        });
        let err = said_of_four(&dir, &values, &["--idle", "20", "--threshold", "15"]);
        let told = "fall by up to 500 below rest (--idle) and rise by up to 490; where touch lowers them";
        assert_eq!(err.contains(told), is_told, "{err}");
        assert_eq!(err.contains("numpy.abs(value - rest)"), is_told, "{err}");
    }
}

#[test]
fn forces_on_three_axes_are_told_from_counts() {
    let dir = TempDir::new().unwrap();
    write_npy(dir.path().join("in.npy"), &Array4::from_elem((3, 2, 2, 3), -0.25)).unwrap();
    let err = fails(&dir, &["eval", "in.npy"], 1);
    assert!(
        err.contains("Of forces on three axes give the norms, numpy.linalg.norm(a, axis=-1)")
            && err.contains("magnetic fields, as whole numbers, numpy.round(10 * a) + 30000"),
        "{err}"
    );
}

/// What is said of `in.npy` of four taxels.
fn said_of_four(dir: &TempDir, values: &Array2<f64>, options: &[&str]) -> String {
    write_npy(dir.path().join("in.npy"), values).unwrap();
    let args = ["compress", "in.npy", "--layout", "grid:2x2", "--out", "o.npz"];
    succeeds(dir, &[&args, options].concat()).1
}

#[test]
fn taxels_that_rest_at_a_level_are_told() {
    let dir = TempDir::new().unwrap();
    let resting = |level: &[f64; 4]| {
        let level = Array1::from_iter(*level);
        Array2::from_shape_fn((30, 4), |(t, n)| {
            level[n] + if t > 20 && n == 1 { 50.0 } else { 0.0 }
        })
    };
    let told =
        "taxels are above the threshold of 0 in every frame; where taxels at rest are not 0, --idle 10";
    let err = said_of_four(&dir, &resting(&[130.0, 140.0, 0.0, 150.0]), &[]);
    assert!(err.contains(&format!("in.npy: 3 of 4 {told}")), "{err}");
    // A glove: most cells of the image have no sensor.
    let glove = Array3::from_shape_fn((30, 8, 8), |(t, row, column)| match row < 3 {
        true => 540.0 + ((t + column) % 3) as f64,
        false => 0.0,
    });
    write_npy(dir.path().join("in.npy"), &glove).unwrap();
    let compress = ["compress", "in.npy", "--layout", "grid:8x8", "--out", "o.npz"];
    let (_, err) = succeeds(&dir, &compress);
    assert!(err.contains(&format!("in.npy: 24 of 24 {told}")), "{err}");
    for (level, options) in [
        ([0.0; 4], &[][..]),
        ([2.0, 1.0, 0.0, 0.0], &[]),
        ([130.0; 4], &["--idle", "10"]),
        ([130.0; 4], &["--threshold", "140"]),
    ] {
        let err = said_of_four(&dir, &resting(&level), options);
        assert!(!err.contains("in every frame"), "{options:?}: {err}");
    }
}

#[test]
fn values_below_0_that_may_be_touch_are_told() {
    let dir = TempDir::new().unwrap();
    for (below, above, options, is_told) in [
        (-1.5, 0.2, &["--threshold", "0.05"][..], true),
        (-11.7, 9.2, &[], true),
        (-0.5, 0.0, &[], true),
        (-0.2, 1.5, &[], false),
        (-0.2, 0.0, &["--threshold", "0.3"], false),
    ] {
        let values = Array2::from_shape_fn((30, 4), |(t, n)| match (t, n) {
            (20.., 1) => below,
            (20.., 2) => above,
            _ => 0.0,
        });
        let err = said_of_four(&dir, &values, options);
        let told = format!("values below 0, down to {below}, are no contact; where they are touch");
        assert_eq!(err.contains(&told), is_told, "{below} {above}: {err}");
    }
}

#[test]
fn time_that_is_the_last_axis_is_told() {
    let dir = TempDir::new().unwrap();
    let write = |shape| write_npy(dir.path().join("in.npy"), &Array3::<f64>::zeros(shape)).unwrap();
    let compress = ["compress", "in.npy", "--out", "o.npz"];
    write((5, 7, 300));
    let (_, err) = succeeds(&dir, &compress);
    assert!(
        err.contains("read as 5 frames of 7 x 300; time is the first axis: numpy.moveaxis(a, -1, 0)"),
        "{err}"
    );
    let err = fails(&dir, &[&compress[..], &["--layout", "grid:5x7"]].concat(), 1);
    assert!(err.contains("time is the first axis: numpy.moveaxis"), "{err}");
    for shape in [(5, 7, 200), (100, 7, 300), (5, 1, 300)] {
        write(shape);
        let (_, err) = succeeds(&dir, &compress);
        assert!(!err.contains("time is"), "{err}");
    }
    write_npy(dir.path().join("in.npy"), &Array2::<f64>::zeros((16, 300))).unwrap();
    let err = fails(&dir, &[&compress[..], &["--layout", "grid:4x4"]].concat(), 1);
    assert!(
        err.contains("has 300 taxels, and 4 x 4 are 16, as many as there are frames; time is the first axis"),
        "{err}"
    );
    assert!(
        err.contains("names rows and columns whose product is 300"),
        "{err}"
    );
    // As many frames as the default hand has taxels.
    write_npy(dir.path().join("in.npy"), &Array2::<f64>::zeros((240, 16))).unwrap();
    let err = fails(&dir, &compress, 1);
    assert!(
        err.contains("has 240; place them with --layout grid:HxW"),
        "{err}"
    );
}

#[test]
fn angles_that_are_no_radians_are_told() {
    let dir = TempDir::new().unwrap();
    for (angle, is_told) in [("1921", true), ("-90", true), ("3.2", false), ("", false)] {
        std::fs::write(
            dir.path().join("in.csv"),
            format!("a,J0,b,J1\n0,0,0,{angle}\n0,0,0,{angle}\n"),
        )
        .unwrap();
        let args = ["compress", "in.csv", "--layout", "grid:1x2", "--out", "o.npz"];
        let (_, err) = succeeds(&dir, &args);
        let told = format!("the angle of joint 1 is {angle}; angles are radians");
        assert_eq!(err.contains(&told), is_told, "{err}");
    }
}

#[test]
fn what_columns_of_a_list_are_taken_for_is_told_of_the_first() {
    let dir = tempfile::tempdir().unwrap();
    for (name, force) in [("a", 1), ("b", 2), ("c", 9), ("d", 10)] {
        let lines: String = (0..12)
            .map(|t| format!("{t},{t},{},{}\n", force * t, force))
            .collect();
        std::fs::write(
            dir.path().join(format!("{name}.csv")),
            format!("index,time,u,v\n{lines}"),
        )
        .unwrap();
    }
    std::fs::write(dir.path().join("in.csv"), "file\na.csv\nb.csv\nc.csv\nd.csv\n").unwrap();
    let (_, err) = succeeds(&dir, &["categorize", "in.csv", "--classes", "2"]);
    for told in [
        "a.csv: left out, since no taxels: column \"index\"\n",
        "a.csv: the column \"time\" is taken for seconds; where it is not, call it t_ms, t_us or t_ns\n",
    ] {
        assert!(err.contains(told), "{err}");
    }
    assert_eq!(err.lines().count(), 2, "{err}");
}

#[test]
fn a_recording_of_others_is_told_by_its_topics_also_where_ours_have_their_names() {
    let dir = TempDir::new().unwrap();
    let file = File::create(dir.path().join("bag.mcap")).unwrap();
    let mut writer = RecordingWriter::begin(file, &Preamble::default(), 0).unwrap();
    let (topic, data) = (Topic::Images, text_message("another image"));
    let wall_ns = 1_000_000_000;
    writer.put(&Entry { topic, wall_ns, data }).unwrap();
    writer.finish().unwrap();
    for args in [
        &["compress", "bag.mcap", "--out", "images.npz"][..],
        &["convert", "bag.mcap", "bag.npz"],
        &["categorize", "bag.mcap", "--classes", "2"],
    ] {
        let err = fails(&dir, args, 1);
        let told = format!(
            "bag.mcap: no frames and no CAN traffic of `taxel record` in it; there is {}. In Python",
            Topic::Images.name()
        );
        assert!(err.contains(&told), "{err}");
    }
}

#[test]
fn what_has_nothing_in_it_is_not_advised_to_be_converted() {
    let dir = TempDir::new().unwrap();
    // Head, end of the data and foot, without a summary.
    let magic = b"\x89MCAP0\r\n";
    let head = [&[1, 8, 0, 0, 0, 0, 0, 0, 0], &[0; 8][..]].concat();
    let end = [&[15, 4, 0, 0, 0, 0, 0, 0, 0], &[0; 4][..]].concat();
    let foot = [&[2, 20, 0, 0, 0, 0, 0, 0, 0], &[0; 20][..]].concat();
    let file = [&magic[..], &head, &end, &foot, magic].concat();
    std::fs::write(dir.path().join("empty.mcap"), file).unwrap();
    for args in [
        &["convert", "empty.mcap", "empty.npz"][..],
        &["compress", "empty.mcap", "--out", "images.npz"],
    ] {
        let err = fails(&dir, args, 1);
        let told = "empty.mcap: no tactile frames of a daemon and no CAN traffic in it\n";
        assert!(err.ends_with(told), "{err}");
    }
}

#[test]
fn the_shortest_touch_is_named_where_others_lose_frames() {
    let dir = tempfile::tempdir().unwrap();
    for (name, frames, force) in [("a", 12, 1.0), ("b", 12, 1.5), ("brief", 5, 9.0), ("d", 12, 9.5)] {
        let touch = Array2::from_shape_fn((frames, 2), |(t, n)| force * (t * (n + 1)) as f64);
        write_npy(dir.path().join(format!("{name}.npy")), &touch).unwrap();
    }
    std::fs::write(
        dir.path().join("in.csv"),
        "file\na.npy\nb.npy\nbrief.npy\nd.npy\n",
    )
    .unwrap();
    let (out, _) = succeeds(&dir, &["categorize", "in.csv", "--classes", "2"]);
    assert!(
        out.contains(
            "21 frames outside the steps that all touches have are left out; the shortest, brief.npy, has 5 frames in \
             0.133 s"
        ),
        "{out}"
    );
    // The first frames of all are alike.
    write_npy(dir.path().join("brief.npy"), &Array2::<f64>::zeros((1, 2))).unwrap();
    let err = fails(&dir, &["categorize", "in.csv", "--classes", "2"], 1);
    assert!(
        err.contains("the shortest, brief.npy, has 1 frame in 0 s: all 4 touches are the same"),
        "{err}"
    );
}

#[test]
fn the_shortest_touch_is_the_one_that_lasts_least_however_many_frames_it_has() {
    let dir = TempDir::new().unwrap();
    for (name, frames, period_ms, force) in [
        ("a", 12, 30, 1),
        ("b", 12, 30, 2),
        ("quick", 60, 2, 9),
        ("d", 12, 30, 10),
    ] {
        let lines: String = (0..frames)
            .map(|t| format!("{},{},{force}\n", t * period_ms, force * t * period_ms))
            .collect();
        std::fs::write(
            dir.path().join(format!("{name}.csv")),
            format!("t_ms,u,v\n{lines}"),
        )
        .unwrap();
    }
    std::fs::write(
        dir.path().join("in.csv"),
        "file\na.csv\nb.csv\nquick.csv\nd.csv\n",
    )
    .unwrap();
    let (out, _) = succeeds(&dir, &["categorize", "in.csv", "--classes", "2"]);
    assert!(
        out.contains("the shortest, quick.csv, has 60 frames in 0.118 s"),
        "{out}"
    );
}
