//! `taxel view` without a terminal, and `taxel layouts`.

use crate::{fails, simulated, succeeds, words};
use ndarray::{Array1, Array3};
use serde_json::{Value, json};
use taxel_skin::Layout;
use tempfile::TempDir;

#[test]
fn without_a_terminal_a_daemon_is_summed_up() {
    let dir = TempDir::new().unwrap();
    let _daemon = simulated(dir.path(), "idle");
    let (out, _) = succeeds(&dir, &["view", "--socket", "images.sock", "--seconds", "1"]);
    for part in [
        "allegro-uskin-15, 240 taxels",
        "method optimal",
        "images",
        "latency",
        "Hz",
    ] {
        assert!(out.contains(part), "{part}: {out}");
    }
    let view = ["view", "--socket", "images.sock", "--seconds", "1", "--json"];
    let object: Value = serde_json::from_str(&succeeds(&dir, &view).0).unwrap();
    assert!(
        object["latency_p50_us"].is_f64() && object["problems"].is_array(),
        "{object}"
    );
    assert_eq!(
        (&object["max_rate_hz"], &object["skipped"]),
        (&json!(20.0), &Value::Null)
    );
}

#[test]
fn without_a_terminal_a_recording_is_read_to_its_end_and_summed_up() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["sim", "tap", "--to", "log:tap.log"]);
    let (out, _) = succeeds(&dir, &["view", "tap.log", "--actuators", "9"]);
    for part in [
        "tap.log: allegro-uskin-15, 240 taxels",
        "9 actuators",
        "contact    in",
    ] {
        assert!(out.contains(part), "{part}: {out}");
    }
    assert!(!out.contains("latency"), "a recording's clock tells none: {out}");
    // The same for programs.
    let (text, _) = succeeds(&dir, &["view", "tap.log", "--json"]);
    let object: Value = serde_json::from_str(&text).unwrap();
    for (key, wanted) in [
        ("name", json!("tap.log")),
        ("layout", json!("allegro-uskin-15")),
        ("taxels", json!(240)),
        ("method", json!("optimal")),
        ("skipped", json!(0)),
        ("latency_p50_us", Value::Null),
        ("missing", json!(0)),
        ("problems", Value::Null),
        ("out_of_use", json!([])),
    ] {
        assert_eq!(object[key], wanted, "{key}: {text}");
    }
    let images = format!(
        "images     {} in {:.1} s",
        object["images"],
        object["seconds"].as_f64().unwrap()
    );
    let calibrated = format!("calibrated {:.1} s", object["calibrated_s"].as_f64().unwrap());
    let contact = format!("in {:.0} % of", 100.0 * object["contact_ratio"].as_f64().unwrap());
    for part in [images, calibrated, contact] {
        assert!(out.contains(&part), "{part}: {out}");
    }
    fails(&dir, &["view", "tap.log", "--json", "--svg", "a.svg"], 2);
    for as_json in [&["--json"][..], &[]] {
        let short = [&["view", "tap.log", "--seconds", "0.001"], as_json].concat();
        let err = fails(&dir, &short, 1);
        assert!(err.contains("tap.log: no image came"), "{err}");
    }
}

#[test]
fn a_hand_of_a_recording_that_moves_while_it_is_calibrated_has_that_among_its_problems() {
    let dir = TempDir::new().unwrap();
    for (file, moves) in [("still.npy", false), ("moved.npy", true)] {
        let counts = Array3::from_shape_fn((120, 16, 3), |(t, n, axis)| {
            let moved = if moves { 3 * t.clamp(20, 70) } else { 0 };
            (20_000 + (7 * t + 5 * n + 3 * axis) % 4 + moved) as u16
        });
        ndarray_npy::write_npy(dir.path().join(file), &counts).unwrap();
        let view = ["view", file, "--layout", "grid:4x4", "--rate", "60"];
        let object = |more: &[&str]| -> Value {
            serde_json::from_str(&succeeds(&dir, &[&view[..], &["--json"], more].concat()).0).unwrap()
        };
        let problems = object(&[])["problems"].clone();
        // While it is calibrated nothing is known.
        assert_eq!(object(&["--seconds", "1"])["problems"], Value::Null);
        let svg = succeeds(&dir, &[&view[..], &["--svg", "-", "--size", "200x60"]].concat()).0;
        let text = succeeds(&dir, &view).0;
        if !moves {
            assert_eq!(problems, Value::Null);
            assert!(svg.contains("not looked for in a recording"), "{svg}");
            continue;
        }
        let (problem, told) = (&problems[0], "the hand moved in both halves of the time");
        assert_eq!(
            (&problem["kind"], &problem["severe"]),
            (&json!("baseline-moved"), &json!(false))
        );
        let sentence = problem["sentence"].as_str().unwrap();
        assert!(
            sentence.starts_with(told) && sentence.contains("its contact threshold, "),
            "{sentence}"
        );
        // Since the calibration ended.
        let since_s = problem["since_s"].as_f64().unwrap();
        assert!((0.1..0.5).contains(&since_s), "{since_s}");
        assert!(
            svg.contains("problems: 1") && svg.contains("the hand moved in both"),
            "{svg}"
        );
        assert!(text.contains(&format!("problem    {sentence}\n")), "{text}");
    }
}

#[test]
fn a_picture_is_of_the_second_that_was_asked_for() {
    let dir = TempDir::new().unwrap();
    let picture = |name: &str, seconds: &str| {
        let svg = ["--svg", name, "--size", "100x30", "--seconds", seconds];
        succeeds(&dir, &[&["view", "sim:tap"], &svg[..]].concat());
        std::fs::read_to_string(dir.path().join(name)).unwrap()
    };
    let (early, late) = (picture("early.svg", "0.5"), picture("late.svg", "4"));
    for (svg, time) in [(&early, "0.5 s"), (&late, "4.0 s")] {
        assert!(
            svg.contains("viewBox=\"0 0 800 480\"") && svg.contains("raw: 240 taxels"),
            "{svg}"
        );
        assert!(svg.contains(time), "{svg}");
    }
    assert!(
        early.contains("hands off") && !late.contains("hands off"),
        "{early}"
    );
    let err = fails(&dir, &["view", "sim:tap", "--svg", "a.svg", "--size", "9x9"], 2);
    assert!(err.contains("120x40"), "{err}");
}

#[test]
fn a_recording_has_the_arrows_and_joints_that_a_live_hand_has() {
    let dir = TempDir::new().unwrap();
    succeeds(
        &dir,
        &words("view sim:slip --svg slip.svg --size 100x30 --seconds 4"),
    );
    let svg = std::fs::read_to_string(dir.path().join("slip.svg")).unwrap();
    assert!(svg.contains('→'), "the skin is pulled aside: {svg}");
    assert!(svg.contains('▅') && svg.contains('▁'), "fingers are bent: {svg}");
}

#[test]
fn what_is_said_of_a_recording_needs_one() {
    let dir = TempDir::new().unwrap();
    let err = fails(&dir, &["view", "--levels", "4"], 2);
    assert!(err.contains("--levels is for a recording; name one"), "{err}");
    let err = fails(&dir, &["view", "tap.log", "--socket", "images.sock"], 2);
    assert!(err.contains("--socket"), "{err}");
    let err = fails(&dir, &["view", "tap.log"], 1);
    assert!(err.contains("tap.log"), "{err}");
    let err = fails(&dir, &["view", "--socket", "nowhere.sock"], 1);
    assert!(
        err.contains("nowhere.sock") && err.contains("is taxeld running"),
        "{err}"
    );
}

#[test]
fn the_built_in_layouts_are_listed_and_each_is_drawn() {
    let dir = TempDir::new().unwrap();
    let (list, _) = succeeds(&dir, &["layouts"]);
    for name in Layout::builtin_names() {
        let hand = Layout::builtin(name).unwrap();
        assert!(list.lines().any(|line| line.starts_with(name)), "{name}: {list}");
        let (drawing, _) = succeeds(&dir, &["layouts", name]);
        for module in &hand.modules {
            assert!(drawing.contains(&format!("{:20}", module.name)), "{drawing}");
        }
        let (file, _) = succeeds(&dir, &["layouts", name, "--file"]);
        assert_eq!(file, Layout::builtin_text(name).unwrap());
    }
    let (json, _) = succeeds(&dir, &["layouts", "uskin-module", "--json"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (&json["taxels"], &json["modules"][0]["protocol"]),
        (&16.into(), &"uskin-l1".into())
    );
    let mixed = "name = \"mixed\"\nbuses = [\"can0\"]\nimage = { width = 8, height = 4 }\n[[module]]\nname = \"pad\"\n\
        part = \"p\"\nbus = \"can0\"\nboard = 0\nprotocol = \"uskin-l2\"\nat = [0, 0]\n[[module]]\nname = \"array\"\n\
        part = \"q\"\nprotocol = \"offline\"\nat = [4, 0]\norder = [[0, 1], [2, 3]]\n";
    std::fs::write(dir.path().join("mixed.toml"), mixed).unwrap();
    let (out, _) = succeeds(&dir, &["layouts", "mixed.toml"]);
    let array = out.lines().find(|line| line.contains("array")).unwrap();
    assert!(out.contains("can0, board 0") && !array.contains("board"), "{out}");
    let err = fails(&dir, &["layouts", "nobodys-hand"], 1);
    assert!(
        err.contains("nobodys-hand") && err.contains("uskin-module"),
        "{err}"
    );
}

#[test]
fn of_magnitudes_no_counts_are_told_nor_a_unit_and_no_more_data_than_there_is() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("grid.csv"), "0,0,0,0\n0,9,0,3\n".repeat(20)).unwrap();
    let args = ["view", "grid.csv", "--layout", "grid:2x2"];
    let (told, _) = succeeds(&dir, &args);
    // 16 bits a taxel, 30 times a second.
    assert!(told.contains("data       1.9 kbit/s raw"), "{told}");
    assert!(
        told.contains("taxels     0 missing and 0 faulty") && !told.contains("calibrat"),
        "{told}"
    );
    let picture = ["--svg", "v.svg", "--size", "120x40", "--seconds", "0.51"];
    succeeds(&dir, &[&args[..], &picture].concat());
    let svg = std::fs::read_to_string(dir.path().join("v.svg")).unwrap();
    assert!(
        svg.contains("grid 1: force 9, in contact") && !svg.contains("counts"),
        "{svg}"
    );
}

#[test]
fn the_seconds_of_an_array_are_from_its_first_image_whatever_its_clock_says() {
    let dir = TempDir::new().unwrap();
    let seen = |counts: &Array3<u16>, began_ns: u64, args: &[&str]| {
        let file = std::fs::File::create(dir.path().join("press.npz")).unwrap();
        let mut npz = ndarray_npy::NpzWriter::new(file);
        npz.add_array("counts", counts).unwrap();
        let times: Vec<u64> = (0..300).map(|n| began_ns + n * 10_000_000).collect();
        npz.add_array("t_ns", &Array1::from(times)).unwrap();
        npz.finish().unwrap();
        succeeds(&dir, &[&["view", "press.npz"], args].concat()).0
    };
    let values = Array3::from_shape_fn((300, 4, 4), |(t, row, column)| (t * (row + column) % 90) as u16);
    let press = Array3::from_shape_fn((300, 16, 3), |(t, n, axis)| {
        let noise = (7 * t + 5 * n + 3 * axis) % 4;
        (20_000 + noise + 900 * usize::from(t > 180 && axis == 2)) as u16
    });
    // A hand at its start, with its sweeps as they would come on CAN, and a robot's clock.
    for (frames, layout) in [(&values, "grid:4x4"), (&press, "uskin-module")] {
        for more in [
            &["--seconds", "2", "--svg", "-"][..],
            &["--seconds", "2.3", "--json"],
            &["--json"],
            &[],
        ] {
            let args = [&["--layout", layout], more].concat();
            let of_a_robot = seen(frames, 1_700_000_000_000_000_000, &args);
            assert_eq!(of_a_robot, seen(frames, 0, &args), "{args:?}");
            let is_drawn = more.contains(&"--svg");
            assert!(!is_drawn || of_a_robot.contains("2.0 s"), "{of_a_robot}");
        }
    }
}
