//! `taxel sim`: scenes onto buses and into logs.

use crate::{fails, succeeds, words};
use tempfile::TempDir;

#[test]
fn the_same_scene_and_seed_give_the_same_log_and_another_seed_another() {
    let dir = TempDir::new().unwrap();
    let write = |file: &str, seed: &str| {
        let to = format!("log:{file}");
        succeeds(
            &dir,
            &["sim", "tap", "--to", &to, "--seconds", "0.5", "--seed", seed],
        );
        std::fs::read(dir.path().join(file)).unwrap()
    };
    let first = write("a.log", "7");
    assert!(first.len() > 10_000);
    assert_eq!(first, write("b.log", "7"));
    assert_ne!(first, write("c.log", "8"));
    let (out, _) = succeeds(
        &dir,
        &["sim", "tap", "--to", "-", "--seconds", "0.5", "--seed", "7"],
    );
    assert_eq!(out.as_bytes(), first);
}

#[test]
fn scenes_are_listed_and_shown_and_an_unknown_one_is_refused() {
    let dir = TempDir::new().unwrap();
    let (out, _) = succeeds(&dir, &["sim", "--list"]);
    assert!(out.contains("ball-grasp") && out.contains("faulty-hand"), "{out}");
    let (json, _) = succeeds(&dir, &["sim", "--list", "--json"]);
    let scenes: Vec<serde_json::Value> = serde_json::from_str(&json).unwrap();
    assert_eq!(scenes.len(), out.lines().count());
    assert!(
        scenes
            .iter()
            .any(|scene| scene["name"] == "forearm" && scene["seconds"].is_null())
    );
    for scene in ["tap", "soup-can"] {
        let (shown, _) = succeeds(&dir, &["sim", scene, "--show"]);
        std::fs::write(dir.path().join("mine.toml"), shown).unwrap();
        succeeds(
            &dir,
            &["sim", "mine.toml", "--to", "log:mine.log", "--seconds", "0.1"],
        );
    }
    let err = fails(&dir, &["sim", "cannonball", "--to", "-"], 1);
    assert!(err.contains("ball-grasp"), "{err}");
}

#[test]
fn a_patch_of_skin_has_no_servos_to_offer() {
    let dir = TempDir::new().unwrap();
    let err = fails(
        &dir,
        &words("sim idle --layout uskin-module --to udp::43995?hops=0 --servos servos"),
        1,
    );
    assert!(err.contains("layout uskin-module has no fingers"), "{err}");
}

#[test]
fn two_buses_with_the_same_ids_are_not_put_on_one() {
    let dir = TempDir::new().unwrap();
    let err = fails(&dir, &["sim", "tap", "--to", "udp:"], 1);
    assert!(err.contains("would both send id"), "{err}");
}

#[test]
fn marks_are_made_of_a_phantom_in_real_time_only() {
    let dir = tempfile::tempdir().unwrap();
    for (args, (code, words)) in [
        (
            &["tap", "--to", "udp::43990?hops=0", "--to", "udp::43991?hops=0"][..],
            (1, "the scene tap has no marks; phantom-1 and phantom-2 have"),
        ),
        (
            &["phantom-1", "--to", "log:a.log"],
            (2, "a log is written at once and has none"),
        ),
    ] {
        let args = [&["sim"], args, &["--control", "control.sock"]].concat();
        let err = fails(&dir, &args, code);
        assert!(err.contains(words), "{args:?}: {err}");
    }
}

#[test]
fn every_scene_is_a_recording_of_the_hand_that_it_is_for() {
    let dir = TempDir::new().unwrap();
    let scene = "name = \"poke\"\nseconds = 3.0\nlayout = \"cyskin-triangle\"\n";
    std::fs::write(dir.path().join("poke.toml"), scene).unwrap();
    for args in [&["sim:poke.toml"][..], &["sim:idle", "--layout", "grid:4x4"]] {
        let (_, err) = succeeds(&dir, &[&["compress"], args, &["--out", "a.npy"]].concat());
        assert!(err.contains(" images of "), "{args:?}: {err}");
    }
}

#[test]
fn a_scene_is_named_with_sim_or_without() {
    let dir = TempDir::new().unwrap();
    let quick = ["--restarts", "1", "--passes", "1", "--method", "paper", "--json"];
    for name in ["tap", "sim:tap"] {
        let (out, _) = succeeds(
            &dir,
            &[&["eval", "sim:tap", "--scene", name], &quick[..]].concat(),
        );
        let report: serde_json::Value = serde_json::from_str(&out).unwrap();
        assert_eq!(report["scenes"][0]["input"], "sim:tap");
    }
    succeeds(
        &dir,
        &["sim", "sim:tap", "--to", "log:tap.log", "--seconds", "0.1"],
    );
}
