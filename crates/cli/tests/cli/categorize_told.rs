//! What `taxel categorize` says of touches that are none, or are there twice, and of manifests of which it takes a part.

use crate::categorize::recorded;
use crate::{fails, succeeds, words};
use serde_json::Value;
use tempfile::TempDir;

#[test]
fn contact_leaves_out_touches_that_the_recording_begins_or_ends_in() {
    let dir = recorded();
    let frames = std::fs::read_to_string(dir.path().join("frames.csv")).unwrap();
    let lines: Vec<&str> = frames.lines().collect();
    let args = words("categorize cut.csv --contact 5 --classes 2 --json");
    let first = "the touch that is in contact in the first frame is left out (7 frames)";
    let last = "the touch that is in contact in the last frame is left out (7 frames)";
    let short = "1 contact shorter than 5 frames is left out; --least N";
    let brushed = "0,0\n".repeat(5) + "9,9\n9,9\n" + &"0,0\n".repeat(5);
    // Each touch is 13 frames behind five still ones.
    for (kept, behind, touches, wanted) in [
        (0..113, "", 6, &[][..]),
        (11..113, "", 5, &[first]),
        (0..102, "", 5, &[last]),
        (11..102, "", 4, &[first, last]),
        (0..113, &*brushed, 6, &[short]),
    ] {
        let text = lines[kept.clone()].join("\n") + "\n" + behind;
        std::fs::write(dir.path().join("cut.csv"), text).unwrap();
        let (out, err) = succeeds(&dir, &args);
        let report: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(report["touches"], touches, "{kept:?}: {err}");
        // Those that are left are whole.
        assert_eq!(report["features"], 26, "{kept:?}: {err}");
        for said in [first, last, short] {
            assert_eq!(err.contains(said), wanted.contains(&said), "{kept:?}: {err}");
        }
    }
    std::fs::write(dir.path().join("cut.csv"), lines[11..16].join("\n")).unwrap();
    let err = fails(&dir, &args, 1);
    assert!(
        err.contains("from the first frame to the last") && err.contains("there is no touch"),
        "{err}"
    );
}

#[test]
fn labels_that_are_spelt_in_two_ways_are_said() {
    let dir = recorded();
    for (file, input) in [
        ("manifest.csv", &["own.csv"][..]),
        ("marks.csv", &["frames.csv", "--marks", "own.csv"]),
    ] {
        let text = std::fs::read_to_string(dir.path().join(file)).unwrap();
        let args = [&["categorize", "--classes", "2"], input].concat();
        for (text, is_said) in [(text.replacen("soft", "Soft", 1), true), (text, false)] {
            std::fs::write(dir.path().join("own.csv"), text).unwrap();
            let (_, err) = succeeds(&dir, &args);
            let said = r#"the labels "Soft" and "soft" differ in case or blanks alone"#;
            assert_eq!(
                err.matches(said).count(),
                usize::from(is_said),
                "{input:?}: {err}"
            );
        }
    }
}

#[test]
fn touches_that_are_the_same_frames_are_said() {
    let dir = recorded();
    let said = "touches 0 and 2 (from 0) are the same frames of frames.csv";
    for (rows, told) in [
        ("frames.csv,a,\nframes.csv,b,1\nframes.csv,b,\n", Some(said)),
        ("frames.csv,a,1\nframes.csv,b,2\nframes.csv,b,1\n", Some(said)),
        ("frames.csv,a,\nframes.csv,b,1\nframes.csv,b,2\n", None),
    ] {
        std::fs::write(dir.path().join("own.csv"), format!("file,label,time\n{rows}")).unwrap();
        let (_, err) = succeeds(&dir, &["categorize", "own.csv", "--classes", "2"]);
        assert_eq!(err.contains("the same frames"), told.is_some(), "{rows}: {err}");
        assert!(told.is_none_or(|told| err.contains(told)), "{rows}: {err}");
    }
}

#[test]
fn a_touch_by_time_ends_where_the_next_of_its_file_begins() {
    let dir = recorded();
    // Every 18 frames at 30 Hz a touch of 13; the fourth is not named.
    let rows: String = [5, 23, 41, 77, 95]
        .map(|frame| format!("frames.csv,{}\n", f64::from(frame) / 30.0))
        .concat();
    std::fs::write(dir.path().join("own.csv"), format!("file,time\n{rows}")).unwrap();
    let (out, err) = succeeds(&dir, &["categorize", "own.csv", "--classes", "2", "--json"]);
    let report: Value = serde_json::from_str(&out).unwrap();
    // Of the third, what is behind the others' ends: each frame once at most.
    assert_eq!(
        (&report["features"], &report["frames_left_out"]),
        (&36.into(), &18.into()),
        "{err}"
    );
}

#[test]
fn a_manifest_of_several_phantoms_is_told_what_chooses_one() {
    let dir = recorded();
    let by_hand = "keep the lines of one phantom in a manifest of its own";
    let by_depth = "--depth and --radius choose a motion";
    for (rows, given, words) in [
        (
            "A,,0\nB,,1\n",
            &["--classes", "2"][..],
            &["touches of 2 phantoms; ", by_hand][..],
        ),
        (
            "A,,0\nB,,1\n",
            &["--classes", "2", "--depth", "5"],
            &["none has a depth; leave --depth out"],
        ),
        ("A,,0\nB,,1\n", &["--sweep"], &["judged without --sweep", by_hand]),
        (
            "A,6.5,0\nB,6.5,1\n",
            &["--classes", "2", "--depth", "6.5"],
            &["touches of 2 phantoms; ", by_hand, "--sweep judges all"],
        ),
        (
            "A,6.5,0\nB,5,1\n",
            &["--classes", "2"],
            &[
                "touches of 2 phantoms and 2 motions; ",
                by_hand,
                by_depth,
                "--sweep judges all",
            ],
        ),
        (
            "A,6.5,0\nA,5,1\n",
            &["--classes", "2"],
            &["touches of 2 motions; ", by_depth],
        ),
        (
            "A,6.5,0\nA,,1\n",
            &["--classes", "2"],
            &["touches of lines without a depth; keep those without a depth in a manifest of their own"],
        ),
    ] {
        let row = |row: &str| format!("frames.csv,x,{row}\n");
        let text: String = rows.lines().map(row).collect();
        std::fs::write(
            dir.path().join("own.csv"),
            format!("file,label,phantom,depth,time\n{text}"),
        )
        .unwrap();
        let err = fails(&dir, &[&["categorize"], given, &["own.csv"]].concat(), 1);
        for words in words {
            assert!(err.contains(words), "{rows} {given:?}: {err}");
        }
    }
}

/// What is reported of six touches of two taxels whose counts rest at `rest`, and rise by 60,000 in the second class; some
/// `readings` are given instead of what the taxel showed.
fn of_counts(dir: &TempDir, rest: u32, readings: &[(usize, &str)]) -> (Value, String) {
    let (mut frames, mut marks) = ("t_s,a_x,a_y,a_z,b_x,b_y,b_z\n".to_owned(), String::new());
    let mut line = 0;
    for touch in 0..6u32 {
        let most = [20_000, 60_000][touch as usize % 2] + touch;
        for step in 0..20u32 {
            if step == 5 {
                let label = ["soft", "hard"][touch as usize % 2];
                marks += &format!("{},{touch} {label}\n", f64::from(line) / 30.0);
            }
            // Up and down again, each height for two frames.
            let height = step.saturating_sub(5).min(20 - step) / 2;
            let z = (rest + most * height / 4) % 65_536;
            let shown = format!("100,200,{z}");
            let reading = readings.iter().find(|(at, _)| *at == line as usize);
            let reading = reading.map_or(&*shown, |(_, reading)| reading);
            frames += &format!("{},{reading},100,200,300\n", f64::from(line) / 30.0);
            line += 1;
        }
        marks += &format!("{},away\n", f64::from(line) / 30.0);
    }
    std::fs::write(dir.path().join("counts.csv"), frames).unwrap();
    std::fs::write(dir.path().join("counts-marks.csv"), marks).unwrap();
    let args = ["categorize", "counts.csv", "--marks", "counts-marks.csv"];
    let (out, err) = succeeds(dir, &[&args[..], &["--classes", "2", "--json"]].concat());
    (serde_json::from_str(&out).unwrap(), err)
}

#[test]
fn counts_that_turn_over_are_followed_and_chips_that_do_not_answer_are_told() {
    let dir = TempDir::new().unwrap();
    let told = "of taxels are 0 or 65535 on every axis, as of a chip that does not answer";
    let (wanted, err) = of_counts(&dir, 5_000, &[]);
    assert!(wanted["accuracy"] == 1.0 && !err.contains(told), "{wanted} {err}");
    let (turning, err) = of_counts(&dir, 13_000, &[]);
    assert_eq!(turning, wanted, "{err}");
    // Where the reading before is the same.
    let (silent, err) = of_counts(&dir, 13_000, &[(8, "0,0,0"), (30, "65535,65535,65535")]);
    assert_eq!(silent, wanted, "{err}");
    assert!(err.contains(&format!("2 readings {told}")), "{err}");
}

#[test]
fn a_value_that_is_no_number_is_told_with_what_can_be_done() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("bad.csv"), "file\nbad.npy\n").unwrap();
    for value in [f32::NAN, f32::INFINITY] {
        let frames = ndarray::Array2::<f32>::from_elem((9, 4), value);
        ndarray_npy::write_npy(dir.path().join("bad.npy"), &frames).unwrap();
        let err = fails(&dir, &["categorize", "bad.csv", "--classes", "2"], 1);
        assert!(
            err.contains("a magnitude is a finite number")
                && err.contains("out of every file")
                && !err.contains("--void"),
            "{err}"
        );
    }
}
