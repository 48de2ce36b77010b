//! `taxel categorize` on recordings whose clock does not begin at 0.

use crate::categorize::recorded;
use crate::{fails, succeeds};
use serde_json::{Value, json};
use std::fmt::Write as _;
use tempfile::TempDir;

/// Seconds with so many decimals as a robot writes them.
fn stamp(began_s: u64, seconds: f64) -> String {
    format!("{:.4}", began_s as f64 + seconds)
}

/// The six touches of [`recorded`] on a clock that showed this at the first frame; marks and manifest are on that clock, and
/// beside them are those that are counted from the first frame.
fn recorded_at(began_s: u64) -> TempDir {
    let dir = recorded();
    let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    let mut frames = "t_s,a,b\n".to_owned();
    for (n, line) in read("frames.csv").lines().enumerate() {
        let _ = writeln!(frames, "{},{line}", stamp(began_s, n as f64 / 30.0));
    }
    write("frames.csv", &frames);
    let (mut counted, mut marks) = (String::new(), String::new());
    for line in read("marks.csv").lines() {
        let (at, text) = line.split_once(',').unwrap();
        let at: f64 = at.parse().unwrap();
        let _ = writeln!(counted, "{},{text}", stamp(0, at));
        let _ = writeln!(marks, "{},{text}", stamp(began_s, at));
    }
    write("counted.csv", &counted);
    write("marks.csv", &marks);
    let manifest = read("manifest.csv");
    write("counted-manifest.csv", &manifest);
    let shifted: String = (manifest.lines())
        .map(|line| match line.rsplit_once("frames.csv,") {
            Some((row, at)) => format!("{row}frames.csv,{}\n", stamp(began_s, at.parse().unwrap())),
            None => format!("{line}\n"),
        })
        .collect();
    write("manifest.csv", &shifted);
    dir
}

#[test]
fn recordings_on_any_clock_are_cut_by_marks_and_times_on_the_same_one() {
    let begin = ["categorize", "--classes", "2", "--json"];
    for began_s in [0, 20, 1_700_000_000] {
        let dir = recorded_at(began_s);
        for input in [
            &["frames.csv", "--marks", "marks.csv"][..],
            &["frames.csv", "--marks", "counted.csv"],
            &["manifest.csv"],
        ] {
            let (out, err) = succeeds(&dir, &[&begin, input].concat());
            let report: Value = serde_json::from_str(&out).unwrap();
            assert_eq!(report["labels"], json!([0, 1, 0, 1, 0, 1]), "{began_s} {input:?}");
            assert_eq!(report["features"], 26, "{began_s} {input:?}");
            let told = format!(
                "frames.csv: its frames begin at {began_s} s and its marks before that; they are taken as counted from its"
            );
            let is_told = began_s > 0 && input.contains(&"counted.csv");
            assert_eq!(err.contains(&told), is_told, "{began_s} {input:?}: {err}");
        }
    }
}

#[test]
fn a_touch_before_the_first_frame_is_none_and_it_is_said_when_the_recording_begins() {
    let dir = recorded_at(20);
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("mixed.csv", "1,touch 0 soft\n2,away\n21,touch 1 hard\n");
    let begin = ["categorize", "--classes", "2"];
    for (input, words) in [
        (
            &["counted-manifest.csv"][..],
            "s: frames.csv goes from 20 s to 23.7333 s",
        ),
        (
            &["frames.csv", "--marks", "mixed.csv"],
            "the mark \"touch 0 soft\" at 1 s and the next; the frames are from 20 s to 23.7333 s",
        ),
    ] {
        let err = fails(&dir, &[&begin, input].concat(), 1);
        assert!(err.contains(words), "{input:?}: {err}");
    }
}
