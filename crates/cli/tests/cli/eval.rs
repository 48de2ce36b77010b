//! `taxel eval`: speed and error of every method on the same frames.

use crate::eval_task::objects;
use crate::{fails, succeeds};
use ndarray::{Array2, Array3};
use serde_json::Value;
use tempfile::TempDir;

/// Counts of a module: at rest, then pressed here and there.
fn pressed_counts(frames: usize, taxels: usize) -> Array3<u16> {
    Array3::from_shape_fn((frames, taxels, 3), |(t, n, axis)| {
        let idle = [31_000, 32_000, 9_000][axis] + ((t * 7 + n * 3 + axis) % 5) as u16;
        let pressed = t > 60 && (n + t / 4) % 3 != 0;
        idle + if pressed && axis == 2 {
            (300 + n * n * 37 % 900 + t) as u16
        } else {
            0
        }
    })
}

/// Some frames of forces of 4 x 4 taxels, as `forces.npy`.
fn write_forces(dir: &TempDir, frames: usize) {
    let force = |(t, y, x)| (1 + (4 * y + x) * (t + 1) % 11) as f64;
    let forces = Array3::from_shape_fn((frames, 4, 4), force);
    ndarray_npy::write_npy(dir.path().join("forces.npy"), &forces).unwrap();
}

/// Judged with as few runs as there can be.
const QUICK: [&str; 4] = ["--restarts", "1", "--passes", "1"];

fn quickly(dir: &TempDir, args: &[&str]) -> (String, String) {
    succeeds(dir, &[&["eval"], args, &QUICK].concat())
}

#[test]
fn eval_prints_the_object_of_the_contract() {
    let dir = TempDir::new().unwrap();
    ndarray_npy::write_npy(dir.path().join("module.npy"), &pressed_counts(120, 16)).unwrap();
    let small = ["--restarts", "4", "--passes", "1", "--tile"];
    let args = [
        "eval",
        "module.npy",
        "--levels",
        "4",
        "--actuators",
        "8",
        "--json",
        "--export",
        "frames.npz",
    ];
    let (out, _) = succeeds(&dir, &[&args[..], &small].concat());
    let report: Value = serde_json::from_str(&out).unwrap();
    for (key, want) in [("frames", 120), ("taxels", 240), ("levels", 4), ("actuators", 8)] {
        assert_eq!(report[key], want, "{key}");
    }
    let contact_frames = report["contact_frames"].as_u64().unwrap();
    assert!((40..80).contains(&contact_frames), "{contact_frames}");
    let methods = report["methods"].as_array().unwrap();
    let names: Vec<&str> = methods.iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(names[..2], ["paper", "optimal"]);
    assert!(names.contains(&"paper force_fit=exact") && names.contains(&"optimal history=0.5"));
    for method in methods {
        for key in [
            "force_sse_ratio_mean",
            "force_sse_ratio_p95",
            "force_optimal_fraction",
            "position_sse_ratio_mean",
            "position_sse_ratio_p95",
            "jump_fraction",
            "tick_us_p50",
            "tick_us_p99",
            "tick_us_p999",
            "allocations_per_tick",
        ] {
            assert!(
                method[key].as_f64().is_some_and(f64::is_finite),
                "{key} of {method}"
            );
        }
        assert!(method["tick_us_p50"].as_f64().unwrap() > 0.0);
        assert_eq!(method["allocations_per_tick"], 0.0, "{}", method["name"]);
    }
    assert_eq!(methods[1]["force_optimal_fraction"], 1.0);
    assert!(methods[0]["force_sse_ratio_mean"].as_f64() >= methods[1]["force_sse_ratio_mean"].as_f64());
    let mut frames =
        ndarray_npy::NpzReader::new(std::fs::File::open(dir.path().join("frames.npz")).unwrap()).unwrap();
    let contact: Array2<u8> = frames.by_name("contact").unwrap();
    let in_contact = contact
        .rows()
        .into_iter()
        .filter(|frame| frame.iter().any(|c| *c > 0))
        .count();
    assert_eq!((contact.dim(), in_contact as u64), ((120, 240), contact_frames));
}

#[test]
fn eval_takes_magnitudes_and_scenes_and_methods_and_writes_tables() {
    let dir = TempDir::new().unwrap();
    let forces = Array2::from_shape_fn((6, 40), |(t, n)| (n * n * 31 % 97 + t) as f64);
    ndarray_npy::write_npy(dir.path().join("forces.npy"), &forces).unwrap();
    let args = [
        "eval",
        "forces.npy",
        "--layout",
        "grid:5x8",
        "--threshold",
        "20",
        "--restarts",
        "4",
        "--passes",
        "1",
    ];
    let methods = [
        "--method",
        "optimal",
        "--method",
        "optimal history=0.3",
        "--csv",
        "all.csv",
        "--sweep-k",
    ];
    let (out, _) = succeeds(&dir, &[&args[..], &methods].concat());
    assert!(
        out.contains("6 frames of 40 taxels") && out.contains("optimal history=0.3"),
        "{out}"
    );
    let csv = std::fs::read_to_string(dir.path().join("all.csv")).unwrap();
    // Two methods, at the size asked for and at five more.
    assert_eq!(csv.lines().count(), 1 + 2 * 6, "{csv}");
    let columns = csv.lines().next().unwrap().split(',').count();
    assert!(
        csv.lines().all(|line| line.split(',').count() == columns),
        "{csv}"
    );

    let (out, _) = quickly(&dir, &["sim:tap", "--method", "optimal", "--json"]);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert!(
        report["contact_truth"]["precision"].as_f64().unwrap() > 0.9,
        "{out}"
    );
}

#[test]
fn eval_refuses_what_it_cannot_judge() {
    let dir = TempDir::new().unwrap();
    ndarray_npy::write_npy(dir.path().join("forces.npy"), &Array2::from_elem((2, 16), 1.0)).unwrap();
    for (args, wanted) in [
        (&["eval", "forces.npz", "--task"][..], "forces.npz"),
        (
            &["eval", "forces.npz", "--task", "--idle", "3"],
            "--idle says nothing",
        ),
        (&["eval", "sim:nowhere"], "nowhere"),
        (&["eval", "sim:tap", "--tile"], "--tile"),
    ] {
        let err = fails(&dir, args, 1);
        assert!(err.contains(wanted), "{args:?}: {err}");
    }
    for (methods, wanted) in [
        (&["--method", "best"][..], "best"),
        (&["--method", "paper", "--method", "optimal levels=3"], "--levels"),
    ] {
        let args = [&["eval", "forces.npy", "--layout", "grid:4x4"], methods].concat();
        let err = fails(&dir, &args, 2);
        assert!(err.contains(wanted), "{args:?}: {err}");
    }
}

#[test]
fn one_frame_has_no_rate() {
    let dir = TempDir::new().unwrap();
    let frame = Array3::from_shape_fn((1, 4, 4), |(_, y, x)| (4 * y + x) as f64);
    ndarray_npy::write_npy(dir.path().join("one.npy"), &frame).unwrap();
    for every in [&[][..], &["--all"]] {
        let (out, _) = quickly(&dir, &[&["one.npy"], every].concat());
        assert!(
            out.contains("one.npy: 1 frame of 16 taxels, 1 with contact"),
            "{out}"
        );
    }
}

#[test]
fn the_main_table_fits_a_terminal_and_begins_with_a_verdict() {
    let dir = TempDir::new().unwrap();
    let (out, _) = quickly(&dir, &["sim:ball-grasp"]);
    let first = out.lines().next().unwrap();
    assert!(
        first.starts_with("`optimal` shows forces with an error of") && out.contains("times that of `paper`"),
        "{out}"
    );
    assert!(out.lines().all(|line| line.chars().count() <= 100), "{out}");
    assert!(
        out.contains("optimal codebook=learned") && !out.contains("history="),
        "{out}"
    );
    let (all, _) = quickly(&dir, &["sim:tap", "--all"]);
    assert!(all.contains("optimal history=0.5"), "{all}");
    // Each column of both tables is explained below them.
    let (tables, words) = all.split_at(all.rfind("\n\nerrors,").unwrap());
    let words = words.replace('\n', " ");
    let heads = (tables.lines()).filter(|line| line.starts_with("errors") || line.starts_with("cost, us"));
    for column in heads.flat_map(|head| head.split("  ")) {
        let name = column.trim().split(" p").next().unwrap().trim_end_matches(" max");
        let is_quantile = name.starts_with("p9") || name.starts_with("p5");
        assert!(is_quantile || words.contains(name), "{name}: {words}");
    }
}

#[test]
fn a_method_named_alone_has_its_own_conditioning_and_methods_together_have_one() {
    let dir = TempDir::new().unwrap();
    let conditioning = |methods: &[&str]| {
        let (out, _) = quickly(&dir, &[&["sim:tap", "--json"], methods].concat());
        let report: Value = serde_json::from_str(&out).unwrap();
        report["conditioning"].as_str().unwrap().to_string()
    };
    assert_eq!(conditioning(&["--method", "paper"]), "paper");
    assert_eq!(
        conditioning(&["--method", "paper", "--method", "optimal"]),
        "robust"
    );
    assert_eq!(
        conditioning(&["--method", "paper", "--conditioning", "robust"]),
        "robust"
    );
    assert_eq!(
        conditioning(&["--method", "optimal", "--conditioning", "paper"]),
        "paper"
    );
}

#[test]
fn a_configuration_that_excludes_usual_methods_is_judged_by_the_others() {
    let dir = TempDir::new().unwrap();
    write_forces(&dir, 6);
    objects(&dir.path().join("objects.npz"));
    let steps = "level_steps = \"weber\"\nforce_min = 1.0\nforce_max = 80.0\n";
    let codebook = "codebook = [1.0, 2.0, 5.0, 9.0]\n";
    let fixed = "levels = 4\nactuators = 2\nfixed = [[0.0, 0.0], [3.0, 3.0]]\n";
    let budgets = "budgets = { grid = 4 }\n";
    for (profile, excluded, excluded_of_task) in [
        (steps, &["optimal codebook=learned"][..], &[][..]),
        (codebook, &[], &[]),
        (fixed, &["paper placement=follow"], &[]),
        (
            budgets,
            &["paper", "paper force_fit=exact"],
            &["paper", "fixed places in a grid, actuator_force=max"],
        ),
    ] {
        let buses = "[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"can:can1\"\n";
        std::fs::write(
            dir.path().join("own.toml"),
            format!("{buses}[profile]\n{profile}"),
        )
        .unwrap();
        let args = ["forces.npy", "--config", "own.toml", "--layout", "grid:4x4"];
        let (out, err) = quickly(&dir, &args);
        assert!(
            out.starts_with("`optimal` shows forces with an error of"),
            "{profile}: {out}"
        );
        let args = ["eval", "objects.npz", "--task", "--config", "own.toml"];
        let (task_out, task_err) = succeeds(&dir, &args);
        for (excluded, out, err) in [(excluded, out, err), (excluded_of_task, task_out, task_err)] {
            let told = err.lines().filter(|line| line.contains("left out")).count();
            assert_eq!(told, excluded.len(), "{profile}: {err}");
            for name in excluded {
                assert!(
                    err.contains(&format!("excludes it: `{name}`: profile: ")),
                    "{err}"
                );
                let row = |line: &str| line == *name || line.starts_with(&format!("{name}  "));
                assert!(!out.lines().any(row), "{out}");
            }
            assert!(out.lines().any(|line| line.starts_with("optimal ")), "{out}");
        }
    }
}

#[test]
fn places_are_judged_in_the_coordinates_in_which_they_are_chosen() {
    let dir = TempDir::new().unwrap();
    write_forces(&dir, 4);
    let quick = [
        &[
            "eval",
            "forces.npy",
            "--layout",
            "uskin-module",
            "--actuators",
            "4",
        ],
        &QUICK[..],
    ]
    .concat();
    let hand = ["--method", "optimal coordinates=hand"];
    let report: Value =
        serde_json::from_str(&succeeds(&dir, &[&quick[..], &hand, &["--json"]].concat()).0).unwrap();
    assert_eq!(report["place_unit"], "mm");
    let jump = report["jump_distance"].as_f64().unwrap();
    let (out, _) = succeeds(&dir, &[&quick[..], &hand].concat());
    let said = format!("jumps are moves of more than {jump:.1} mm");
    assert!(jump > 4.0 && out.replace('\n', " ").contains(&said), "{out}");
    let err = fails(&dir, &[&quick[..], &hand, &["--scaling"]].concat(), 1);
    assert!(
        err.contains("--scaling: `optimal coordinates=hand` on a made-up skin of 4 x 4: profile: "),
        "{err}"
    );
    let err = fails(&dir, &[&quick[..], &hand, &["--method", "paper"]].concat(), 2);
    assert!(
        err.contains("`paper`: every method places actuators in the same coordinates here"),
        "{err}"
    );
}

#[test]
fn a_method_that_a_configuration_makes_the_same_as_another_is_judged_once() {
    let dir = TempDir::new().unwrap();
    write_forces(&dir, 6);
    for (profile, same) in [("levels = 4", false), ("codebook = [1.0, 2.0, 5.0, 9.0]", true)] {
        std::fs::write(
            dir.path().join("own.toml"),
            format!("layout = \"uskin-module\"\n[[bus]]\nsource = \"can:can0\"\n[profile]\n{profile}\n"),
        )
        .unwrap();
        let args = ["forces.npy", "--config", "own.toml", "--layout", "grid:4x4"];
        let (out, err) = quickly(&dir, &args);
        let has_row = |name: &str| out.lines().any(|line| line.starts_with(name));
        assert!(
            has_row("paper placement=follow ") && has_row("optimal codebook=learned "),
            "{out}"
        );
        assert_eq!(has_row("paper force_fit=exact "), !same, "{out}");
        let said =
            "`paper force_fit=exact` is judged as `paper`, which this configuration makes it the same as";
        assert_eq!(err.contains(said), same, "{err}");
        assert_eq!(out.contains("levels are optimal in"), !same, "{out}");
    }
}

#[test]
fn the_tables_of_every_figure_are_no_wider_than_their_help_says() {
    let dir = TempDir::new().unwrap();
    let (help, _) = succeeds(&dir, &["eval", "--help"]);
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    let width = help.split("in tables of up to ").nth(1).unwrap();
    let width: usize = width.split(' ').next().unwrap().parse().unwrap();
    let (all, _) = quickly(&dir, &["sim:tap", "--all"]);
    let widest = all.lines().map(|line| line.chars().count()).max().unwrap();
    assert_eq!(widest, width, "{all}");
}

#[test]
fn forces_that_no_image_can_carry_are_named_where_nothing_is_in_contact() {
    let dir = TempDir::new().unwrap();
    for (force, threshold, wanted) in [
        (1e100, "0", "frame 0 has 1e100; give them in another unit"),
        (1e-310, "0", "numbers from 1e-38 to 1e38, and frame 0 has 1e-310"),
        (
            4.0,
            "5",
            "the greatest force is 4, and --threshold 5 is not below it",
        ),
        (0.0, "0", "no force is above 0"),
    ] {
        let forces = Array2::from_elem((3, 16), force);
        ndarray_npy::write_npy(dir.path().join("forces.npy"), &forces).unwrap();
        let args = [
            "eval",
            "forces.npy",
            "--layout",
            "grid:4x4",
            "--threshold",
            threshold,
        ];
        let err = fails(&dir, &args, 1);
        assert!(
            err.contains("nothing is in contact in any of 3 frames") && err.contains(wanted),
            "{err}"
        );
    }
}

#[test]
fn frames_without_contact_are_said_and_fail() {
    let dir = TempDir::new().unwrap();
    ndarray_npy::write_npy(dir.path().join("forces.npy"), &Array2::from_elem((3, 16), 1.0)).unwrap();
    let args = [
        "eval",
        "forces.npy",
        "--layout",
        "grid:4x4",
        "--threshold",
        "5",
        "--csv",
        "all.csv",
    ];
    for more in [&[][..], &["--json"]] {
        let err = fails(&dir, &[&args[..], more].concat(), 1);
        assert!(
            err.contains("nothing is in contact in any of 3 frames") && err.contains("--threshold"),
            "{err}"
        );
        assert!(!dir.path().join("all.csv").exists());
    }
}
