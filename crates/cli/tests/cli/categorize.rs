//! `taxel categorize` on recordings, manifests and phantoms.

use crate::begun_in_a_touch::record_frames;
use crate::{command, fails, simulated, succeeds};
use serde_json::Value;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader};
use std::process::Stdio;
use tempfile::TempDir;

/// Frames a second of a recording without times.
const RATE: f64 = 30.0;

/// A recording of six touches of 13 steps each on two taxels, five still frames before each and behind the last, and the
/// manifest and marks of it: two classes, the second pressing twice as hard.
pub(crate) fn recorded() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    let (mut frames, mut manifest, mut marks) = (String::new(), String::new(), String::new());
    let mut count = 0;
    for touch in 0..6 {
        for _ in 0..5 {
            frames += "0,0\n";
            count += 1;
        }
        let label = ["soft", "hard"][touch % 2];
        let from = f64::from(count) / RATE;
        let _ = writeln!(manifest, "Ph,vertical,6.5,0,{touch},{label},frames.csv,{from}");
        let _ = writeln!(marks, "{from},touch {touch} {label}");
        for step in 1..=13 {
            let force = step * (10 + 10 * (touch % 2)) + touch;
            let _ = writeln!(frames, "{force},{}", -(force as i64) / 2);
            count += 1;
        }
        let _ = writeln!(marks, "{},away", f64::from(count) / RATE);
    }
    frames += &"0,0\n".repeat(5);
    let manifest = format!("# six touches\nphantom,motion,depth,radius,area,label,file,time\n{manifest}");
    for (name, text) in [
        ("frames.csv", frames),
        // As a spreadsheet writes it where decimals have commas, filled in by hand.
        (
            "semicolons.csv",
            manifest
                .replace(',', ";")
                .replace(";6.5;", ";6,5;")
                .replace("vertical", "Vertical "),
        ),
        (
            "quoted.csv",
            manifest
                .replace("phantom,motion", "\"phantom\",\"motion\"")
                .replace(",file,", ",\"file\","),
        ),
        ("manifest.csv", manifest),
        ("marks.csv", marks),
    ] {
        std::fs::write(dir.path().join(name), text).unwrap();
    }
    dir
}

#[test]
fn columns_that_are_raw_counts_are_three_a_taxel_and_taken_from_before_the_touch() {
    let dir = recorded();
    let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
    let raw: String = (read("frames.csv").lines())
        .map(|frame| {
            let (a, b) = frame.split_once(',').unwrap();
            let z = [a, b].map(|force| 2000 + force.parse::<i64>().unwrap());
            format!("30,40,{},50,60,{}\n", z[0], z[1])
        })
        .collect();
    std::fs::write(dir.path().join("raw.csv"), raw).unwrap();
    let manifest = read("manifest.csv").replace("frames.csv", "raw.csv");
    std::fs::write(dir.path().join("manifest.csv"), manifest).unwrap();
    let columns = [
        "categorize",
        "--classes",
        "2",
        "--json",
        "--columns",
        "xyz-interleaved",
    ];
    for input in [&["raw.csv", "--marks", "marks.csv"][..], &["manifest.csv"]] {
        let report: Value = serde_json::from_str(&succeeds(&dir, &[&columns, input].concat()).0).unwrap();
        assert_eq!(report["features"], 3 * 26, "{input:?}");
        assert_eq!(
            report["labels"],
            serde_json::json!([0, 1, 0, 1, 0, 1]),
            "{input:?}"
        );
    }
    let err = fails(&dir, &[&columns[..], &["sim:phantom-1"]].concat(), 1);
    assert!(err.contains("--columns says nothing about it"), "{err}");
}

#[test]
fn a_recording_without_times_is_said_to_be_taken_for_30_frames_a_second_and_has_the_rate_that_is_given() {
    let dir = recorded();
    let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
    // The same at 100 Hz.
    let marks: String = (read("marks.csv").lines())
        .map(|line| {
            let (at, text) = line.split_once(',').unwrap();
            format!("{},{text}\n", at.parse::<f64>().unwrap() * RATE / 100.0)
        })
        .collect();
    std::fs::write(dir.path().join("fast.csv"), marks).unwrap();
    let manifest: String = (read("manifest.csv").lines())
        .map(|line| match line.rsplit_once("frames.csv,") {
            Some((row, at)) => format!("{row}frames.csv,{}\n", at.parse::<f64>().unwrap() * RATE / 100.0),
            None => format!("{line}\n"),
        })
        .collect();
    std::fs::write(dir.path().join("fast-manifest.csv"), manifest).unwrap();
    for input in [&["frames.csv", "--marks", "fast.csv"][..], &["fast-manifest.csv"]] {
        let args = [
            &["categorize", "--classes", "2", "--json"],
            input,
            &["--rate", "100"],
        ]
        .concat();
        let (out, err) = succeeds(&dir, &args);
        let report: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(
            report["labels"],
            serde_json::json!([0, 1, 0, 1, 0, 1]),
            "{input:?}"
        );
        assert_eq!(report["accuracy"], 1.0, "{input:?}");
        assert_eq!(err.matches("frames a second").count(), 0, "{err}");
    }
    for (input, is_timed) in [
        (&["frames.csv", "--marks", "marks.csv"][..], true),
        (&["manifest.csv"], true),
        (&["frames.csv", "--contact", "5"], true),
    ] {
        let (_, err) = succeeds(&dir, &[&["categorize", "--classes", "2"], input].concat());
        let said = "frames.csv: it has no times (of an .npz: nanoseconds, the array t_ns), and is taken for 30 frames a second; --rate HZ";
        assert_eq!(
            err.matches(said).count(),
            usize::from(is_timed),
            "{input:?}: {err}"
        );
    }
}

#[test]
fn magnitudes_that_are_three_wide_are_told_by_the_grid() {
    let dir = tempfile::tempdir().unwrap();
    let mut frames = Vec::new();
    let mut marks = String::new();
    for touch in 0..6 {
        let _ = writeln!(marks, "{},{touch} {}", touch * 5, ["soft", "hard"][touch % 2]);
        for step in 0..5 {
            frames.extend((0..12).map(|cell| 0.5 + (cell * step * (1 + touch % 2) + touch) as f64));
        }
    }
    let frames = ndarray::Array::from_shape_vec((30, 4, 3), frames).unwrap();
    ndarray_npy::write_npy(dir.path().join("grid.npy"), &frames).unwrap();
    std::fs::write(dir.path().join("marks.csv"), marks).unwrap();
    let args = [
        "categorize",
        "grid.npy",
        "--marks",
        "marks.csv",
        "--classes",
        "2",
        "--rate",
        "1",
        "--json",
    ];
    let err = fails(&dir, &args, 1);
    assert!(err.contains("--layout grid:4x3"), "{err}");
    let (out, _) = succeeds(&dir, &[&args[..], &["--layout", "grid:4x3"]].concat());
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(
        (&report["features"], &report["accuracy"]),
        (&60.into(), &1.0.into())
    );
}

#[test]
fn a_manifest_marks_and_contact_cut_the_same_touches() {
    let dir = recorded();
    for (args, along) in [
        (&["manifest.csv"][..], "depth"),
        (&["semicolons.csv"], "depth"),
        (&["quoted.csv"], "depth"),
        (&["frames.csv", "--marks", "marks.csv", "--depth", "6.5"], "depth"),
        (&["frames.csv", "--marks", "marks.csv"], "time"),
        (&["frames.csv", "--contact", "5"], "time"),
    ] {
        let args = [&["categorize", "--classes", "2", "--json"], args].concat();
        let report: Value = serde_json::from_str(&succeeds(&dir, &args).0).unwrap();
        assert_eq!(report["touches"], 6, "{args:?}");
        assert_eq!(report["features"], 26, "{args:?}");
        assert_eq!(report["aligned_by"], along, "{args:?}");
        assert_eq!(
            report["labels"],
            serde_json::json!([0, 1, 0, 1, 0, 1]),
            "{args:?}"
        );
        assert!(report["explained_variance"][0].as_f64().unwrap() > 0.99);
        assert!(report["silhouette"]["standard"].as_f64().unwrap() > 0.9);
        assert!(report["silhouette"]["cluster"].is_f64() && report["silhouette"]["macro"].is_f64());
        let known = !args.contains(&"--contact");
        assert_eq!(
            report["accuracy"],
            if known {
                serde_json::json!(1.0)
            } else {
                Value::Null
            },
            "{args:?}"
        );
        assert_eq!(report["ari"], report["accuracy"]);
    }
}

#[test]
fn a_manifest_may_name_recordings_of_the_daemon() {
    let dir = tempfile::tempdir().unwrap();
    record_frames(&dir, "hand.mcap", 0..20, true);
    let manifest = |file: &str| format!("file,label,time\n{file},a,0\n{file},b,0.05\n");
    std::fs::write(dir.path().join("hand.csv"), manifest("hand.mcap")).unwrap();
    let (out, _) = succeeds(&dir, &["categorize", "hand.csv", "--classes", "2", "--json"]);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(report["touches"], 2);
    succeeds(&dir, &["sim", "tap", "--to", "log:can.log", "--seconds", "1"]);
    succeeds(&dir, &["convert", "can.log", "can.mcap"]);
    std::fs::write(dir.path().join("can.csv"), manifest("can.mcap")).unwrap();
    let err = fails(&dir, &["categorize", "can.csv", "--classes", "2"], 1);
    assert!(
        err.contains("can.csv:2: can.mcap: no tactile frames of a daemon in it; of CAN traffic `taxel convert can.mcap can.npz`"),
        "{err}"
    );
}

#[test]
fn late_frames_widen_the_step_and_a_hole_is_refused_with_the_step_that_is_wide_enough() {
    let dir = recorded();
    let frames = std::fs::read_to_string(dir.path().join("frames.csv")).unwrap();
    let marks = ["--marks", "marks.csv"];
    // The ninth frame of the first touch comes late, or the eight before it are lost.
    for (ms, lost) in [(26, 0), (0, 8)] {
        let timed: String = (frames.lines().enumerate())
            .filter(|(n, _)| !(14 - lost..14).contains(n))
            .map(|(n, frame)| {
                let late = if n == 14 { f64::from(ms) / 1e3 } else { 0.0 };
                format!("{:.6},{frame}\n", n as f64 / RATE + late)
            })
            .collect();
        std::fs::write(dir.path().join("timed.csv"), format!("t_s,a,b\n{timed}")).unwrap();
        let args = |step: &[&'static str]| {
            let begin = ["categorize", "timed.csv", "--classes", "2", "--json"];
            [&begin[..], &marks, step].concat()
        };
        let wide = if lost == 0 {
            let (out, err) = succeeds(&dir, &args(&[]));
            let report: Value = serde_json::from_str(&out).unwrap();
            assert_eq!(report["labels"], serde_json::json!([0, 1, 0, 1, 0, 1]));
            let said = "timed.csv: frames came late, so touches are put side by side in steps of 0.066666 s, not in those of 0.033333 s";
            assert!(err.contains(said), "{err}");
            assert_eq!(report["step"], 0.066666);
            "0.066666"
        } else {
            "0.299997"
        };
        let step = if lost == 0 { &["--step", "0.03"][..] } else { &[] };
        let err = fails(&dir, &args(step), 1);
        assert!(err.contains("touch 0 (touch 0 soft): no frame at time"), "{err}");
        assert!(err.contains(&format!("--step {wide} is wide enough")), "{err}");
        let (_, err) = succeeds(&dir, &[&args(&["--step"])[..], &[wide]].concat());
        assert!(!err.contains("late"), "{err}");
    }
}

#[test]
fn can_traffic_is_told_how_frames_are_made_of_it() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("hand.log"), "(1.5) can0 123#00\n").unwrap();
    for input in ["hand.log", "log:hand.log"] {
        let err = fails(
            &dir,
            &["categorize", input, "--contact", "9", "--classes", "2"],
            1,
        );
        let wanted =
            "`taxel convert hand.log hand.npz` makes frames of it, with --config FILE those of your hand";
        assert!(err.contains(wanted), "{err}");
    }
}

#[test]
fn the_number_of_categories_can_be_left_to_the_silhouette() {
    let dir = recorded();
    let (out, _) = succeeds(&dir, &["categorize", "manifest.csv", "--classes", "2-5"]);
    assert!(
        out.contains("categories             2, proved to be the optimum"),
        "{out}"
    );
    assert!(
        out.contains("category 0 (soft): 0 (soft), 2 (soft), 4 (soft)"),
        "{out}"
    );
    let (out, _) = succeeds(
        &dir,
        &["categorize", "manifest.csv", "--classes", "2", "--rule", "paper"],
    );
    assert!(out.contains("three starts agreed at attempt"), "{out}");
}

#[test]
fn what_cannot_be_categorised_is_named() {
    let dir = recorded();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    let head = "phantom,motion,depth,radius,area,label,file,time\n";
    write("one.csv", &format!("{head}Ph,,6.5,0,0,a,frames.csv,0.2\n"));
    write(
        "short.csv",
        &format!("{head}Ph,,6.5,0,0,a,frames.csv,0\nPh,,6.5,0,1,b,frames.csv,3.4\n"),
    );
    write("late.csv", &format!("{head}Ph,,6.5,0,0,a,frames.csv,99\n"));
    write("turned.csv", &format!("{head}Ph,rotary,6.5,0,0,a,frames.csv,0\n"));
    write("wide.csv", "1,2,3\n1,2,4\n1,2,5\n");
    write("mixed.csv", "file,time\nframes.csv,0\nwide.csv,0\n");
    write("same.csv", "file,time\nwide.csv,0\nwide.csv,0\n");
    write("unknown.csv", "file,colour\nframes.csv,red\n");
    write("class.csv", "file,class\nframes.csv,a\n");
    write("unnamed.csv", "recording,label\nframes.csv,a\n");
    write("deep.csv", "file,depth\nframes.csv,deep\n");
    write("bad-marks.csv", "0.5 touch\n");
    write("nan.csv", "file,time\nframes.csv,nan\nframes.csv,1\n");
    write("before.csv", "file,time\nframes.csv,1\nframes.csv,-1\n");
    write("headless.csv", "frames.csv,a\nframes.csv,b\n");
    let cut = ["frames.csv", "--marks"];
    for (args, words) in [
        (&["one.csv"][..], "categories need at least 2 touches; there is 1"),
        (&["short.csv"], "touch 1 (b) has"),
        (&["late.csv"], "no frame at 99 s"),
        (&["turned.csv"], "turned.csv:2: a rotary motion of radius 0 mm"),
        (&["mixed.csv"], "they are of different probes"),
        (&["same.csv"], "all 2 touches are the same"),
        (
            &["unknown.csv"],
            "unknown.csv: unknown column `colour`; a manifest may have the columns file, label, ",
        ),
        (
            &["class.csv"],
            "class.csv: unknown column `class`; did you mean `label`? A manifest may have",
        ),
        (
            &["unnamed.csv"],
            "unnamed.csv: it names the recording \"frames.csv\" in a column that is not called file",
        ),
        (&["deep.csv"], "deep.csv:2: depth \"deep\" is not a number"),
        (&["nan.csv"], "nan.csv:2: time NaN; a touch begins at"),
        (&["before.csv"], "before.csv:3: time -1; a touch begins at"),
        (
            &["headless.csv"],
            "headless.csv: its first line names the recording \"frames.csv\"; a manifest begins with the names",
        ),
        (&["frames.csv"], "where does a touch begin? --marks"),
        (
            &[cut[0], cut[1], "bad-marks.csv"],
            "bad-marks.csv:1: \"0.5 touch\" is no mark",
        ),
        (
            &["frames.csv", "--contact", "1e9"],
            "frames.csv: there is no touch",
        ),
        (&["sim:tap"], "the scene tap has no [palpation]"),
        (
            &["manifest.csv", "--depth", "7.5"],
            "no touch of the motion that --depth and --radius name",
        ),
        (
            &["manifest.csv", "--basis", "0,6"],
            "--basis 6: there are touches 0 to 5",
        ),
    ] {
        let err = fails(&dir, &[&["categorize", "--classes", "2"], args].concat(), 1);
        assert!(err.contains(words), "{args:?}: {err}");
    }
    let alone = ["categorize", "--classes", "2", "manifest.csv", "--radius", "10"];
    assert!(fails(&dir, &alone, 2).contains("--radius 10 needs --depth"));
    let manifest = std::fs::read_to_string(dir.path().join("manifest.csv")).unwrap();
    write("some.csv", &manifest.replacen(",soft,", ",,", 2));
    let (out, _) = succeeds(&dir, &["categorize", "some.csv", "--classes", "2"]);
    assert!(out.contains("not known: 2 of 6 touches have no class"), "{out}");
    let err = fails(&dir, &["categorize", "manifest.csv", "--classes", "7"], 1);
    assert!(
        err.contains("7 categories of 6 different touches; ask for 2 to 6"),
        "{err}"
    );
    fails(&dir, &["categorize", "manifest.csv", "--classes", "1"], 2);
}

#[test]
fn a_phantom_is_palpated_through_the_engine() {
    let dir = tempfile::tempdir().unwrap();
    let args = [
        "categorize",
        "sim:phantom-2",
        "--depth",
        "6.5",
        "--classes",
        "5",
        "--json",
    ];
    let report: Value = serde_json::from_str(&succeeds(&dir, &args).0).unwrap();
    assert_eq!(
        (&report["touches"], &report["features"]),
        (&16.into(), &91.into())
    );
    assert_eq!(
        (&report["aligned_by"], &report["frames_left_out"]),
        (&"depth".into(), &0.into())
    );
    assert_eq!(report["proved"], true);
    assert_eq!(report["classes"].as_array().unwrap().len(), 5);
}

#[test]
fn live_categories_wait_for_a_daemon_that_is_not_there_and_for_one_that_ended() {
    let dir = recorded();
    // The same touches on a hand of 240 taxels, with their sign.
    let frames = std::fs::read_to_string(dir.path().join("frames.csv")).unwrap();
    let wide: String = (frames.lines())
        .map(|frame| format!("{}\n", vec![frame; 120].join(",")))
        .collect();
    std::fs::write(dir.path().join("wide.csv"), wide).unwrap();
    let args = [
        "categorize",
        "wide.csv",
        "--marks",
        "marks.csv",
        "--classes",
        "2",
        "--save",
        "map.json",
    ];
    succeeds(&dir, &args);
    let live = ["categorize", "--live", "map.json", "--socket", "images.sock"];
    let mut child = command(&dir, &live)
        .args(["--reconnect", "--publish", "touches.sock"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
    let mut waits = || said.any(|line| line.is_ok_and(|line| line.contains("waiting for it")));
    assert!(waits());
    let daemon = simulated(dir.path(), "idle");
    let published = dir.path().join("touches.sock");
    while !published.exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let second = [&live[..], &["--publish", "touches.sock"]].concat();
    let error = fails(&dir, &second, 1);
    assert!(
        error.contains("touches.sock is in use") && error.contains("--publish takes another"),
        "{error}"
    );
    // Its taxels have three axes, and a norm is none of them.
    let norms = std::fs::read_to_string(dir.path().join("wide.csv")).unwrap();
    std::fs::write(dir.path().join("norms.csv"), norms.replace('-', "")).unwrap();
    succeeds(
        &dir,
        &args.map(|arg| match arg {
            "wide.csv" => "norms.csv",
            "map.json" => "norms.json",
            arg => arg,
        }),
    );
    let error = fails(
        &dir,
        &["categorize", "--live", "norms.json", "--socket", "images.sock"],
        1,
    );
    assert!(
        error.contains("the map of norms.csv is of magnitudes") && error.contains("of the counts x y z"),
        "{error}"
    );
    daemon.stop().unwrap();
    assert!(waits());
    assert!(published.exists() && child.try_wait().unwrap().is_none());
    child.kill().unwrap();
    child.wait().unwrap();
}
