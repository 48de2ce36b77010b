//! `taxel figures`: the first publication's figures, with their numbers.

use crate::{fails, succeeds, words};
use ndarray::{Array2, Array3};
use ndarray_npy::write_npy;
use std::fs;
use tempfile::TempDir;

/// A csv file's lines that begin with this.
fn rows(dir: &TempDir, name: &str, begin: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(dir.path().join("out").join(name)).unwrap();
    let lines = text.lines().filter(|line| line.starts_with(begin));
    lines
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

fn files(dir: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(dir.path().join("out")).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_scene_becomes_the_publications_figures_with_their_numbers() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["figures", "sim:ball-grasp", "--out", "out"]);
    let stems = ["ball-grasp-frame", "ball-grasp-instants", "ball-grasp-time"];
    let wanted: Vec<String> = stems
        .iter()
        .flat_map(|s| [format!("{s}.csv"), format!("{s}.svg")])
        .collect();
    assert_eq!(files(&dir), wanted);
    for name in wanted.iter().filter(|name| name.ends_with(".svg")) {
        let svg = fs::read_to_string(dir.path().join("out").join(name)).unwrap();
        assert!(
            svg.starts_with("<svg") && svg.contains("prefers-color-scheme:dark"),
            "{name}"
        );
        assert!(svg.len() < 200_000, "{name}: {} bytes", svg.len());
    }
    // The index fingertip touches first, from 2.2 s to 4 s; its shape is one cell of three instants and four kinds.
    let instants = fs::read_to_string(dir.path().join("out/ball-grasp-instants.svg")).unwrap();
    for title in [
        "raw: index tip engages (2.",
        "felt: tightest (",
        "paper: index tip disengages (3.",
        "optimal: ",
    ] {
        assert!(instants.contains(title), "{title}");
    }
    let pixels = rows(&dir, "ball-grasp-instants.csv", "felt: tightest");
    assert_eq!(pixels.len(), 256);
    let forces: Vec<f64> = pixels.iter().filter_map(|row| row[7].parse().ok()).collect();
    let strongest = forces.iter().copied().fold(0.0, f64::max);
    assert_eq!(
        forces.len(),
        240,
        "a force for each taxel, none where there is none"
    );
    assert!(forces.contains(&0.0) && instants.contains(&format!("strongest {strongest:.0} counts")));
    // What colours stand for are counts, and changes of counts.
    let axis = |title: &str, axis: &str| -> Vec<f64> {
        let rows = rows(&dir, "ball-grasp-frame.csv", &format!("{title},cell,{axis},"));
        assert_eq!(rows.len(), 256);
        rows.iter().filter_map(|row| row[7].parse().ok()).collect()
    };
    let (counts, changes) = (axis("counts", "z"), axis("change from rest", "z"));
    assert!(counts.len() == 240 && counts.iter().all(|z| (0.0..=65_535.0).contains(z)));
    assert!(changes.iter().any(|z| *z < 0.0) && changes.iter().any(|z| z.abs() > 1_000.0));
    // What is shown under a constant codebook follows what is felt.
    let felt = rows(&dir, "ball-grasp-time.csv", "learned (constant),line,felt");
    let shown = rows(&dir, "ball-grasp-time.csv", "learned (constant),line,learned");
    assert!(felt.len() > 400 && shown.len() >= felt.len());
    // Every codebook has a row of its own, in which its full drive is seen.
    for method in ["optimal", "paper"] {
        let title = format!("each frame its own ({method})");
        let drive = rows(
            &dir,
            "ball-grasp-time.csv",
            &format!("{title}: drive of the display,line,{title}"),
        );
        assert!(drive.iter().any(|row| row[4] == "255"), "{title}");
    }
    // Units stand where they differ from row to row.
    for unit in [" counts\n", " counts²\n"] {
        assert!(instants.contains(unit), "{unit}");
    }
    let time = fs::read_to_string(dir.path().join("out/ball-grasp-time.svg")).unwrap();
    assert!(time.contains("actuator_force = &quot;max&quot;") && time.contains("force, counts\n"));
}

#[test]
fn a_constant_codebook_of_ones_own_has_a_row_beside_the_others() {
    let dir = TempDir::new().unwrap();
    fs::write(dir.path().join("grid.csv"), "0,1,9,3\n0,7,0,4\n").unwrap();
    for (profile, is_constant) in [
        ("codebook = [2.0, 8.0]", true),
        ("level_steps = \"equal\"\nforce_min = 1.0\nforce_max = 9.0", true),
        ("levels = 4", false),
        ("codebook_learning = { forgetting = 0.001 }", false),
    ] {
        fs::write(
            dir.path().join("taxeld.toml"),
            format!("layout = \"uskin-module\"\n[[bus]]\nsource = \"can:can0\"\n[profile]\n{profile}\n"),
        )
        .unwrap();
        let args = words("figures grid.csv --config taxeld.toml --layout grid:2x2 --out out");
        succeeds(&dir, &args);
        let shown = rows(&dir, "grid-time.csv", "configured (constant),line,configured");
        assert_eq!(!shown.is_empty(), is_constant, "{profile}");
        if profile.starts_with("codebook =") {
            assert!(
                shown.iter().all(|row| ["2", "8"].contains(&&*row[4])),
                "{shown:?}"
            );
        }
    }
}

#[test]
fn a_recording_of_magnitudes_has_all_but_colours_and_instants_can_be_chosen() {
    let dir = TempDir::new().unwrap();
    let text: String = (0..40)
        .map(|t| format!("{},0,{},1\n", t % 7, (t * t) % 11))
        .collect();
    fs::write(dir.path().join("grid.csv"), text).unwrap();
    succeeds(
        &dir,
        &[
            "figures", "grid.csv", "--layout", "grid:2x2", "--out", "out", "--at", "0.5", "--at", "1",
        ],
    );
    assert_eq!(
        files(&dir),
        [
            "grid-instants.csv",
            "grid-instants.svg",
            "grid-time.csv",
            "grid-time.svg"
        ]
    );
    let svg = fs::read_to_string(dir.path().join("out/grid-instants.svg")).unwrap();
    assert!(svg.contains("felt: at 0.5 s (0.50 s)") && svg.contains("optimal: at 1 s (1.00 s)"));
}

#[test]
fn several_recordings_become_one_table_and_one_sheet() {
    let dir = TempDir::new().unwrap();
    let (out, _) = succeeds(
        &dir,
        &["figures", "sim:golf-ball", "sim:soup-can", "--out", "out"],
    );
    assert!(out.lines().count() == 3 && out.contains("golf-ball"), "{out}");
    assert_eq!(
        files(&dir),
        ["recordings-table.csv", "recordings.csv", "recordings.svg"]
    );
    let (out, _) = succeeds(
        &dir,
        &words("figures sim:golf-ball sim:soup-can --out out --json"),
    );
    let named: Vec<serde_json::Value> = out
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let written = ["recordings.svg", "recordings.csv", "recordings-table.csv"];
    assert_eq!(
        named,
        written.map(|file| serde_json::json!({ "file": format!("out/{file}") }))
    );
    let touched = |name: &str| {
        rows(&dir, "recordings-table.csv", name)[0][5]
            .parse::<u32>()
            .unwrap()
    };
    assert!(touched("soup-can") > touched("golf-ball"));
}

#[test]
fn forces_of_the_sheet_and_of_the_table_have_their_unit() {
    let dir = TempDir::new().unwrap();
    for (method, unit, in_table) in [("optimal", "counts", "counts"), ("paper", "counts²", "counts^2")] {
        let args = [
            "figures",
            "sim:golf-ball",
            "sim:soup-can",
            "--out",
            "out",
            "--method",
            method,
        ];
        succeeds(&dir, &args);
        let table = rows(&dir, "recordings-table.csv", "");
        assert_eq!(table[0][6..9], ["strongest", "total", "unit"]);
        let units = table[1..].iter().map(|row| row[8].as_str());
        assert!(units.eq([in_table; 2]), "{table:?}");
        // Each picture has a grey of its own: forces felt, and shown.
        let svg = fs::read_to_string(dir.path().join("out/recordings.svg")).unwrap();
        let captions = svg
            .lines()
            .filter(|line| line.starts_with("strongest ") && line.ends_with(unit));
        assert_eq!(captions.count(), 4, "{svg}");
    }
}

#[test]
fn a_folder_stands_for_its_recordings_in_the_order_of_their_names() {
    let dir = TempDir::new().unwrap();
    let folder = dir.path().join("grasps");
    fs::create_dir(&folder).unwrap();
    for (name, text) in [
        ("b.csv", "0,0,9,0\n"),
        ("a.csv", "0,1,2,3\n0,0,0,1\n"),
        ("notes.txt", "none\n"),
        ("idle.csv", "0,0,0,0\n"),
        ("no.mcap", "none\n"),
    ] {
        fs::write(folder.join(name), text).unwrap();
    }
    let args = ["figures", "grasps", "--layout", "grid:2x2", "--out", "out"];
    // What is none of them, or nothing to draw, is named, and the others are drawn.
    let (_, err) = succeeds(&dir, &args);
    assert!(
        err.contains("left out: grasps/idle.csv: nothing is in contact"),
        "{err}"
    );
    assert!(err.contains("left out: grasps/no.mcap: "), "{err}");
    let table = rows(&dir, "recordings-table.csv", "");
    let told: Vec<(&str, &str)> = table
        .iter()
        .map(|row| (row[0].as_str(), row[7].as_str()))
        .collect();
    assert_eq!(told, [("recording", "total"), ("a", "6"), ("b", "9")]);
}

#[test]
fn the_table_of_recordings_has_forces_however_small() {
    let dir = TempDir::new().unwrap();
    let folder = dir.path().join("grasps");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("a.csv"), "0,0,0,0.0625\n0,0,0.03125,0.125\n").unwrap();
    fs::write(folder.join("b.csv"), "0,0,0,1234.5\n").unwrap();
    let args = ["figures", "grasps", "--layout", "grid:2x2", "--out", "out"];
    let (out, _) = succeeds(&dir, &args);
    let table = rows(&dir, "recordings-table.csv", "");
    let forces: Vec<_> = table[1..].iter().map(|row| [row[6].as_str(), &row[7]]).collect();
    assert_eq!(forces, [["0.125", "0.15625"], ["1234.5", "1234.5"]]);
    let printed: Vec<Vec<&str>> = out
        .lines()
        .map(|line| line.split_whitespace().collect())
        .collect();
    let told = |name| {
        printed
            .iter()
            .find(|row| row.first() == Some(&name))
            .map(|row| [row[6], row[7]])
    };
    assert_eq!(
        (told("a"), told("b")),
        (Some(["0.12", "0.16"]), Some(["1234", "1234"])),
        "{out}"
    );
}

#[test]
fn what_cannot_be_drawn_is_refused_by_name() {
    let dir = TempDir::new().unwrap();
    fs::create_dir(dir.path().join("empty")).unwrap();
    let idle = dir.path().join("idle");
    fs::create_dir(&idle).unwrap();
    for name in ["a.csv", "b.csv"] {
        fs::write(idle.join(name), "0,0,0,0\n").unwrap();
    }
    for (args, wanted) in [
        (
            &["figures", "sim:idle", "--out", "out"][..],
            "sim:idle: nothing is in contact",
        ),
        (
            &["figures", "empty", "--out", "out"],
            "empty: no .log, .mcap, .csv, .npy or .npz",
        ),
        (
            &["figures", "idle", "--layout", "grid:2x2", "--out", "out"],
            "nothing to draw in any of these 2 recordings",
        ),
        (
            &["figures", "sim:tap", "--out", "out", "--module", "toe"],
            "--module toe: layout allegro-uskin-15 has",
        ),
        (
            &["figures", "sim:tap", "--out", "out", "--at", "99"],
            "--at 99 is no time of tap, whose frames are from 0.0",
        ),
        (&["figures", "sim:tap", "none.csv", "--out", "out"], "none.csv"),
    ] {
        let err = fails(&dir, args, 1);
        assert!(err.contains(wanted), "{err}");
        assert!(!dir.path().join("out").exists(), "{args:?} leaves a folder");
    }
    for (args, wanted) in [
        (&["sim:tap", "--at=-1"][..], "-1 is no time"),
        (
            &["sim:tap", "sim:slip", "--at", "1"],
            "--at is for one recording, and these are 2",
        ),
        (
            &["idle", "--layout", "grid:2x2", "--module", "grid"],
            "--module is for one recording, and these are 2",
        ),
    ] {
        let err = fails(&dir, &[&["figures", "--out", "out"], args].concat(), 2);
        assert!(err.contains(wanted), "{err}");
    }
}

#[test]
fn what_the_configuration_excludes_is_left_out_and_the_rest_is_drawn() {
    let dir = TempDir::new().unwrap();
    let buses = "[[bus]]\nsource = \"can:can0\"\n[[bus]]\nsource = \"can:can1\"\n";
    for profile in ["coordinates = \"hand\"", "budgets = { index = 4, thumb = 4 }"] {
        fs::write(
            dir.path().join("c.toml"),
            format!("{buses}[profile]\n{profile}\n"),
        )
        .unwrap();
        let args = ["figures", "sim:tap", "--config", "c.toml", "--out", "out"];
        let (_, err) = succeeds(&dir, &args);
        assert!(
            err.contains("taxel: left out, since the configuration excludes it: paper: "),
            "{err}"
        );
        assert!(rows(&dir, "tap-instants.csv", "paper: ").is_empty(), "{profile}");
        assert_eq!(
            rows(&dir, "tap-instants.csv", "optimal: tightest").len(),
            256,
            "{profile}"
        );
        assert!(rows(&dir, "tap-time.csv", "each frame its own (paper)").is_empty());
        assert!(!rows(&dir, "tap-time.csv", "each frame its own (optimal),line").is_empty());
    }
}

#[test]
fn a_taxel_without_a_value_has_no_counts_no_force_and_no_colour() {
    let dir = TempDir::new().unwrap();
    let counts = Array3::from_shape_fn((90, 4, 3), |(t, taxel, axis)| {
        let press = if taxel == 1 && axis == 2 {
            20 * t.saturating_sub(60)
        } else {
            0
        };
        let noise = (t * 7 + taxel * 5) % 4;
        if taxel == 3 {
            f64::NAN
        } else {
            (20_000 + press + noise) as f64
        }
    });
    ndarray_npy::write_npy(dir.path().join("in.npy"), &counts).unwrap();
    succeeds(
        &dir,
        &["figures", "in.npy", "--layout", "grid:2x2", "--out", "out"],
    );
    for title in ["counts", "change from rest"] {
        for axis in ["x", "y", "z"] {
            let values = rows(&dir, "in-frame.csv", &format!("{title},cell,{axis},"));
            let empty: Vec<bool> = values.iter().map(|row| row[7].is_empty()).collect();
            assert_eq!(empty, [false, false, false, true], "{title}, {axis}");
        }
    }
    let felt = rows(&dir, "in-instants.csv", "felt: tightest");
    let empty: Vec<bool> = felt.iter().map(|row| row[7].is_empty()).collect();
    assert_eq!(empty, [false, false, false, true]);
    let svg = fs::read_to_string(dir.path().join("out/in-frame.svg")).unwrap();
    assert!(!svg.contains("\"#000000\"") && !svg.contains("\"#000\""), "{svg}");
    // Of three instants of what is felt, each has two cells in a row above, and one beside the empty one, which is
    // hatched; what a display is given is black where it is given nothing.
    let svg = fs::read_to_string(dir.path().join("out/in-instants.svg")).unwrap();
    let felt = svg.split("felt: ").nth(1).unwrap();
    let felt = felt.split("taxels in contact").next().unwrap();
    let is_ground = |line: &&str| line.contains("fill=\"#E2D2B0\"");
    let (grounds, cells): (Vec<_>, Vec<_>) = (felt.lines())
        .filter(|line| line.starts_with("<rect"))
        .partition(is_ground);
    assert_eq!(grounds.len(), 1, "beneath the hatch: {felt}");
    let area = |line: &str| -> f64 {
        let side = |name: &str| -> f64 {
            let value = line.split(&format!(" {name}=\"")).nth(1).unwrap();
            value.split('"').next().unwrap().parse().unwrap()
        };
        side("width") * side("height")
    };
    let areas: Vec<f64> = cells.into_iter().map(area).collect();
    let least = areas.iter().copied().fold(f64::INFINITY, f64::min);
    let painted = areas.iter().sum::<f64>() / least;
    assert!(
        (painted - 3.0).abs() < 0.01,
        "{painted} of four cells are painted: {felt}"
    );
    assert_eq!(
        felt.matches("<polyline").count(),
        2,
        "its frame and its hatch: {felt}"
    );
}

#[test]
fn what_changed_is_measured_from_where_the_baseline_is_and_a_touch_ends_while_it_is_read() {
    let dir = TempDir::new().unwrap();
    // The middle of 6 x 6 taxels is pressed by 500 counts from frame 60 to 119.
    let counts = Array3::from_shape_fn((200, 36, 3), |(t, taxel, axis)| {
        let is_pressed = (2..4).contains(&(taxel / 6)) && (2..4).contains(&(taxel % 6));
        let press = if is_pressed && axis == 2 && (60..120).contains(&t) {
            500.0
        } else {
            0.0
        };
        20_000.0 + press + ((t * 7 + taxel * 5) % 3) as f64 - 1.0
    });
    ndarray_npy::write_npy(dir.path().join("in.npy"), &counts).unwrap();
    succeeds(
        &dir,
        &["figures", "in.npy", "--layout", "grid:6x6", "--out", "out"],
    );
    for instant in ["grid engages", "tightest", "grid disengages"] {
        for (title, is_force) in [("raw", false), ("felt", true)] {
            let rows = rows(&dir, "in-instants.csv", &format!("{title}: {instant}"));
            let values = rows.iter().filter(|row| is_force || row[2] == "z");
            let values: Vec<f64> = values.map(|row| row[7].parse().unwrap()).collect();
            assert_eq!(values.len(), 36, "{title}: {instant}");
            for (n, value) in values.into_iter().enumerate() {
                let wanted = if [14, 15, 20, 21].contains(&n) { 500.0 } else { 0.0 };
                assert!(
                    (value - wanted).abs() < 3.0,
                    "{title}: {instant}, taxel {n}: {value}"
                );
            }
        }
    }
}

#[test]
fn a_named_recording_that_cannot_be_drawn_hides_no_other() {
    let dir = TempDir::new().unwrap();
    for (name, text) in [
        ("a.csv", "0,1,2,3\n"),
        ("idle.csv", "0,0,0,0\n"),
        ("b.csv", "0,0,9,0\n"),
    ] {
        fs::write(dir.path().join(name), text).unwrap();
    }
    let args = [
        "figures", "a.csv", "idle.csv", "b.csv", "--layout", "grid:2x2", "--out", "out",
    ];
    let err = fails(&dir, &args, 1);
    assert!(err.contains("left out: idle.csv: nothing is in contact"), "{err}");
    assert!(
        err.ends_with("of the recordings that were named, 1 could not be drawn\n"),
        "{err}"
    );
    let table = rows(&dir, "recordings-table.csv", "");
    let told: Vec<(&str, &str)> = table
        .iter()
        .map(|row| (row[0].as_str(), row[2].as_str()))
        .collect();
    assert_eq!(told, [("recording", "contact_s"), ("a", "0.00"), ("b", "0.00")]);
    assert_eq!(rows(&dir, "recordings.csv", "shown: b").len(), 4);
}

#[test]
fn a_force_that_no_image_can_carry_is_out_of_use_in_figures_too() {
    let dir = TempDir::new().unwrap();
    for garbage in [1e39, 1e-42] {
        let values = Array2::from_shape_fn((30, 4), |(t, n)| match (t, n) {
            (7, 3) => garbage,
            (10..20, 1) => 40.0 + t as f64,
            _ => 0.0,
        });
        write_npy(dir.path().join("grasp.npy"), &values).unwrap();
        let args = ["figures", "grasp.npy", "--layout", "grid:2x2", "--out", "out"];
        let (_, err) = succeeds(&dir, &args);
        assert!(
            err.contains("taxels are out of use in 1 frame: 1 with a force"),
            "{err}"
        );
        let strongest = rows(&dir, "grasp-time.csv", "each frame its own (optimal)");
        let forces = strongest.iter().filter_map(|row| row.get(4)?.parse::<f64>().ok());
        let most = forces.fold(0.0, f64::max);
        assert!((1.0..1000.0).contains(&most), "{garbage}: {most}");
    }
}
