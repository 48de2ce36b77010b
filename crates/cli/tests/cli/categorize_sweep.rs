//! `taxel categorize --sweep`: every motion judged, and its figures.

use crate::{succeeds, words};

#[test]
fn a_sweep_judges_every_motion_and_draws_what_it_can() {
    let dir = tempfile::tempdir().unwrap();
    let rows = ["Ph-2,vertical,6.5,0", "Ph-2,vertical,7.5,0", "Ph-2,rotary,6.5,16"];
    let rows = rows.map(|row| format!("{row},,,sim:phantom-2,\n")).concat();
    let manifest = format!("phantom,motion,depth,radius,area,label,file,time\n{rows}");
    std::fs::write(dir.path().join("sweep.csv"), manifest).unwrap();
    let (out, _) = succeeds(&dir, &["categorize", "--sweep", "sweep.csv", "--figures", "out"]);
    assert!(
        out.starts_with("3 motions; 9 of 9 divisions into categories are proved to be the best\n"),
        "{out}"
    );
    assert!(out.contains("rank-1"), "{out}");
    for figure in 6..=17 {
        for ending in ["svg", "csv"] {
            let path = dir.path().join(format!("out/figure-{figure:02}.{ending}"));
            // Figure 17 needs an order that holds, which so shallow touches may not have.
            assert!(path.exists() || figure == 17, "{}", path.display());
        }
    }
    let numbers = std::fs::read_to_string(dir.path().join("out/sweep.csv")).unwrap();
    assert_eq!(numbers.lines().count(), 1 + 3 * 3, "{numbers}");
}

/// Eight places of two classes, touched down to 6 mm in files of `frames` frames; the classes differ in the last ones alone.
fn touched(dir: &tempfile::TempDir, frames: usize) {
    let mut rows = String::new();
    for n in 0..8 {
        let frame = |step: usize| {
            let way = if step < 8 { n * 29 % 8 } else { 20 * (n % 2) };
            format!("{},{}\n", 100 * step + 9 * way, 50 * step + way)
        };
        let text: String = (1..=frames).map(frame).collect();
        std::fs::write(dir.path().join(format!("t{n}.csv")), text).unwrap();
        for depth in [4, 6] {
            rows += &format!("wood,vertical,{depth},0,{n},class {},t{n}.csv\n", n % 2);
        }
    }
    let manifest = format!("phantom,motion,depth,radius,area,label,file\n{rows}");
    std::fs::write(dir.path().join("own.csv"), manifest).unwrap();
}

#[test]
fn a_window_leaves_what_is_above_it_out_of_motions_down() {
    let dir = tempfile::tempdir().unwrap();
    touched(&dir, 12);
    let row = |options: &[&str]| {
        let args = [&["categorize", "--sweep", "own.csv", "--json"][..], options].concat();
        let (out, told) = succeeds(&dir, &args);
        assert!(!told.contains("left out"), "{told}");
        let rows: serde_json::Value = serde_json::from_str(&out).unwrap();
        assert_eq!(rows[1]["depth_mm"], 6.0, "{rows}");
        let of = |key: &str| rows[1][key].as_f64().unwrap();
        (of("features"), of("silhouette_classes"), of("accuracy"))
    };
    // The last four steps are where classes differ.
    let (all, window) = (row(&[]), row(&["--window", "2"]));
    assert_eq!((all.0, window.0), (24.0, 8.0));
    assert!(window.1 > 0.99 && window.2 == 1.0, "{window:?}");
    assert!(all.1 < 0.9, "{all:?}");
    let one = [
        "categorize",
        "own.csv",
        "--depth",
        "6",
        "--window",
        "2",
        "--classes",
        "2",
        "--json",
    ];
    let one: serde_json::Value = serde_json::from_str(&succeeds(&dir, &one).0).unwrap();
    assert_eq!((&one["first"], &one["steps"]), (&4.5.into(), &4.into()), "{one}");
    assert_eq!(one["silhouette"]["classes"], window.1, "{one}");
}

#[test]
fn frames_behind_the_longest_motion_of_a_file_are_told_and_counted() {
    let dir = tempfile::tempdir().unwrap();
    touched(&dir, 13);
    let args = words("categorize own.csv --depth 6 --classes 2 --json");
    let (out, told) = succeeds(&dir, &args);
    let out: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(out["frames_left_out"], 8, "{out}");
    let sentence = "t0.csv has 13 frames, and the longest motion that is cut out of it 12 steps, a frame each, the first of them \
                    at 0.5 mm";
    assert!(told.contains(sentence), "{told}");
    // Each motion of a sweep leaves some out, and one sentence says so.
    let (_, told) = succeeds(&dir, &["categorize", "--sweep", "own.csv"]);
    assert_eq!(told.matches("has 13 frames").count(), 1, "{told}");
}

#[test]
fn figures_of_other_classes_have_their_names_and_nothing_of_the_publications() {
    let dir = tempfile::tempdir().unwrap();
    let touch = |n: usize, class: usize| {
        let shape = |step: usize, taxel: usize| step * (1 + (taxel + class) % 3) * 10 + (n * 7 + taxel) % 5;
        let line = |step| {
            (0..4)
                .map(|t| shape(step, t).to_string())
                .collect::<Vec<_>>()
                .join(",")
                + "\n"
        };
        let text: String = (1..=12).map(line).collect();
        std::fs::write(dir.path().join(format!("t{n}.csv")), text).unwrap();
        format!("wood,vertical,6,0,{n},class {class},t{n}.csv\n")
    };
    let rows: String = (0..12).map(|n| touch(n, n % 3)).collect();
    let manifest = format!("phantom,motion,depth,radius,area,label,file\n{rows}");
    std::fs::write(dir.path().join("own.csv"), manifest).unwrap();
    let (out, _) = succeeds(&dir, &["categorize", "--sweep", "own.csv", "--figures", "own"]);
    assert!(out.contains("K = 3") && !out.contains("rank"), "{out}");
    let series = |figure: &str| {
        let text = std::fs::read_to_string(dir.path().join("own").join(figure)).unwrap();
        let names = text
            .lines()
            .skip(1)
            .map(|line| line.rsplit(',').nth(5).unwrap().to_owned());
        let mut names: Vec<String> = names.collect();
        names.dedup();
        names
    };
    assert_eq!(series("figure-07.csv"), ["12 areas", "3 areas"]);
    assert_eq!(series("figure-14.csv"), ["class 0", "class 1", "class 2"]);
    for figure in ["06", "09", "10", "12", "16", "17"] {
        let path = dir.path().join(format!("own/figure-{figure}.svg"));
        assert!(!path.exists(), "{figure}");
    }
}
