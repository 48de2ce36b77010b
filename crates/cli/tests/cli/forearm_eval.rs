//! `taxel forearm eval` and `figures` on a simulated forearm.

use crate::{succeeds, words};
use serde_json::{Value, json};
use std::fs;
use taxel_forearm::{Session, TACTELS};
use tempfile::TempDir;

#[test]
fn the_protocol_is_one_object_with_what_there_is() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &words("forearm simulate --out session.npz --repetitions 3"));
    let (out, _) = succeeds(
        &dir,
        &["forearm", "eval", "session.npz", "--repetitions", "1", "--json"],
    );
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(
        (&report["repetitions"], &report["simulated"]),
        (&json!(1), &json!(true))
    );
    // All that people are told, too.
    for (rows, count) in [("disturbed", 16), ("gains", 6), ("early", 12), ("procedures", 5)] {
        let rows = report[rows].as_array().unwrap();
        assert_eq!(rows.len(), count, "{out}");
        assert!(
            rows.iter()
                .all(|row| row["macro_rmse"].is_f64() && row["refused"].is_u64())
        );
    }
    assert_eq!(report["places_left_out"]["places"].as_array().unwrap().len(), 13);
    assert_eq!(report["chosen"][0]["times"], 1);
    for place in report["kinesthetic"]["places"].as_array().unwrap() {
        for key in [
            "location_percent",
            "rmse",
            "mae",
            "min",
            "q1",
            "median",
            "q3",
            "max",
            "range",
            "coverage_90",
        ] {
            assert!(place[key].is_f64(), "{key}: {place}");
        }
    }
    let brief = [
        "forearm",
        "eval",
        "session.npz",
        "--repetitions",
        "1",
        "--json",
        "--brief",
    ];
    let (brief, _) = succeeds(&dir, &brief);
    let brief: Value = serde_json::from_str(&brief).unwrap();
    assert!(brief["kinesthetic"]["places"].is_array() && brief["disturbed"].is_null());
    // Three squeezes a place: two are trained on. What fuses was trained on some of every place that it is judged at.
    for (source, at_new) in [
        ("kinesthetic", true),
        ("tactile", true),
        ("fused", false),
        ("fused_unseen", true),
    ] {
        assert!(report[source]["coverage_90_trained"].is_f64(), "{source}: {out}");
        assert_eq!(
            report[source]["coverage_90_new"].is_f64(),
            at_new,
            "{source}: {out}"
        );
    }
    for source in ["kinesthetic", "tactile", "fused", "fused_unseen"] {
        for key in [
            "macro_rmse",
            "macro_mae",
            "pooled_rmse",
            "pooled_mae",
            "coverage_90",
            "train_s",
            "estimate_us",
        ] {
            assert!(
                report[source][key].as_f64().is_some_and(f64::is_finite),
                "{source} {key}: {out}"
            );
        }
    }
}

#[test]
fn a_row_without_an_estimate_says_why_and_hides_no_other() {
    let dir = TempDir::new().unwrap();
    let simulate = ["forearm", "simulate", "--out", "all.npz", "--repetitions", "3"];
    succeeds(&dir, &simulate);
    // So few samples that after a twentieth of a squeeze there is only its first.
    let mut session = Session::open(&dir.path().join("all.npz")).unwrap();
    for trial in &mut session.trials {
        trial.squeeze = trial.squeeze.filtered(|row| row % 5 == 0);
        trial.squeeze.tactile = None;
    }
    session.write_npz(&dir.path().join("few.npz")).unwrap();
    let eval = ["forearm", "eval", "few.npz", "--repetitions", "1"];
    let (told, _) = succeeds(&dir, &eval);
    let (json, _) = succeeds(&dir, &[&eval[..], &["--json"]].concat());
    let report: Value = serde_json::from_str(&json).unwrap();
    let early = report["early"].as_array().unwrap();
    let (first, last) = (&early[0], &early[early.len() - 1]);
    let why = first["why"].as_str().unwrap();
    let judged = report["kinesthetic"]["places"].as_array().unwrap();
    assert!(why.contains("1 samples are no squeeze"), "{why}");
    assert!(
        first["macro_rmse"].is_null() && last["macro_rmse"].is_f64(),
        "{json}"
    );
    assert!(
        first["refused"].as_u64().unwrap() >= judged.len() as u64,
        "{json}"
    );
    let line = told
        .lines()
        .find(|line| line.contains("after 5 % of its time"))
        .unwrap();
    assert!(line.ends_with(&format!("refused: all, because {why}")), "{line}");
    let figures = [
        "forearm",
        "figures",
        "few.npz",
        "--out",
        "figures",
        "--repetitions",
        "1",
    ];
    succeeds(&dir, &figures);
    let drawn = |folder: &str, file: &str| fs::read_to_string(dir.path().join(folder).join(file)).unwrap();
    let title = |folder: &str| {
        assert!(
            drawn(folder, "forearm-07.svg")
                .contains("Estimates at each place, all repetitions (simulated forearm)")
        );
        drawn(folder, "forearm-early.svg").contains("from the angles alone")
    };
    assert!(!title("figures"), "there is no touch in it");
    let figures = figures.map(|word| match word {
        "few.npz" => "all.npz",
        "figures" => "touched",
        word => word,
    });
    let (out, _) = succeeds(&dir, &[&["forearm", "figures", "--json"], &figures[2..]].concat());
    let files: Vec<Value> = out
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert!(
        files.len() == 8 && files[0] == json!({ "file": "touched/forearm-05.svg" }),
        "{out}"
    );
    assert!(title("touched"));
    // Images of five moments of three squeezes: strongest at the peak, and from nought to the same colour in all of one.
    let numbers = drawn("touched", "forearm-05.csv");
    let images: Vec<_> = numbers.lines().filter(|line| line.contains(",cell,")).collect();
    let totals: Vec<f64> = (images.chunks(TACTELS))
        .map(|image| {
            image
                .iter()
                .filter_map(|line| line.rsplit(',').next()?.parse::<f64>().ok())
                .sum()
        })
        .collect();
    assert_eq!(totals.len(), 15);
    for place in 0..3 {
        let over_time: Vec<f64> = totals.iter().skip(place).step_by(3).copied().collect();
        assert!(
            over_time[0] < over_time[1] && over_time[1] < over_time[2] && over_time[4] < over_time[2],
            "{over_time:?}"
        );
    }
    for file in ["forearm-07.csv", "forearm-08.csv"] {
        for (folder, sources) in [
            ("figures", &["kinesthetic"][..]),
            ("touched", &["kinesthetic", "tactile", "fused"]),
        ] {
            let numbers = drawn(folder, file);
            for source in ["kinesthetic", "tactile", "fused"] {
                let is_there = numbers.contains(&format!(",{source},"));
                assert_eq!(is_there, sources.contains(&source), "{folder}/{file}: {source}");
            }
        }
    }
    for file in ["forearm-05.svg", "forearm-08.svg", "forearm-early.svg"] {
        assert!(drawn("touched", file).contains("(simulated forearm)"), "{file}");
    }
    let numbers = fs::read_to_string(dir.path().join("figures/forearm-early.csv")).unwrap();
    assert!(
        numbers.contains("squeezes without an estimate,5,100"),
        "{numbers}"
    );
}

#[test]
fn touch_that_is_refused_in_a_squeeze_is_counted_and_ends_no_judgement() {
    let dir = TempDir::new().unwrap();
    succeeds(
        &dir,
        &["forearm", "simulate", "--out", "all.npz", "--repetitions", "3"],
    );
    let mut session = Session::open(&dir.path().join("all.npz")).unwrap();
    // At the second place, which single estimators are judged at and fusion learns from.
    let odd = session
        .trials
        .iter_mut()
        .find(|trial| trial.location_percent > 0.0);
    odd.unwrap()
        .squeeze
        .tactile
        .iter_mut()
        .for_each(|counts| counts.fill(255));
    session.write_npz(&dir.path().join("odd.npz")).unwrap();
    let args = ["forearm", "eval", "odd.npz", "--repetitions", "1", "--brief"];
    let (out, _) = succeeds(&dir, &args);
    assert!(out.contains("1 refused: the tactile images are "), "{out}");
    let (out, _) = succeeds(&dir, &[&args[..], &["--json"]].concat());
    let report: Value = serde_json::from_str(&out).unwrap();
    let refused = ["kinesthetic", "tactile", "fused"].map(|of| report[of]["refused"].as_u64());
    assert_eq!(refused, [Some(0), Some(1), Some(0)]);
}
