//! What a scan finds, and the layout it proposes.

use super::{bad, configure, doctor, eventually, hand, recorded, said, taxel};
use serde_json::Value;
use tempfile::TempDir;

#[test]
fn a_scan_of_a_recording_proposes_a_layout_that_the_daemon_takes() {
    let dir = TempDir::new().unwrap();
    recorded(&dir, "ball-grasp --to log:grasp.log --seconds 2");
    let output = taxel(
        &dir,
        &["doctor", "--scan", "log:grasp.log", "--out", "found.toml"],
    )
    .output()
    .unwrap();
    let text = said(&output);
    assert!(output.status.success(), "{text}");
    assert!(
        text.contains("8 boards of uskin-l2") && text.contains("7 boards of uskin-l2"),
        "{text}"
    );
    assert!(text.contains("built-in hand allegro-uskin-15"), "{text}");
    let sources =
        ["can0", "can1"].map(|bus| format!("log:{}/grasp.log?interface={bus}", dir.path().display()));
    configure(&dir, "found.toml", &sources, "");
    let config = taxeld::Config::load(&dir.path().join("hand.toml")).unwrap();
    assert_eq!((config.layout.modules.len(), config.layout.len()), (15, 240));
    let (_, checks) = doctor(&dir, &["--config", "hand.toml"]);
    assert!(
        [
            "board",
            "board-unheard",
            "board-silent",
            "bus-silent",
            "unknown ids"
        ]
        .iter()
        .all(|name| bad(&checks, name).is_empty()),
        "{checks:?}"
    );
}

#[test]
fn a_scan_starts_silent_boards_only_where_it_is_told_to() {
    let dir = TempDir::new().unwrap();
    let (_hand, sources) = hand(&dir, "idle", &["--layout", "uskin-module"], 1);
    let scan = |more: &[&str]| {
        let mut command = taxel(
            &dir,
            &["doctor", "--scan", "--json", "--seconds", "1", &sources[0]],
        );
        let output = command.args(more).output().unwrap();
        let found: Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)));
        (output.status.code(), found)
    };
    let (code, silent) = scan(&[]);
    assert_eq!((code, &silent["layout"]), (Some(1), &Value::Null));
    let found = eventually(|| {
        let (code, found) = scan(&["--start"]);
        let board = &found["buses"][0]["boards"][0];
        let whole = board["taxels"].as_array().is_some_and(|t| t.len() == 16);
        let is_it = (&board["protocol"], &board["board"]) == (&"uskin-l1".into(), &1.into());
        (code == Some(0) && whole && is_it)
            .then_some(found.clone())
            .ok_or(found.to_string())
    });
    let text = found["layout"].as_str().unwrap();
    assert_eq!(taxel_skin::Layout::parse(text, "found.toml").unwrap().len(), 16);
}

#[test]
fn a_scan_that_starts_boards_configures_those_of_an_icub_which_have_to_be() {
    let dir = TempDir::new().unwrap();
    let (_hand, sources) = hand(&dir, "idle", &["--layout", "icub-forearm"], 1);
    let wanted = taxel_skin::Layout::builtin("icub-forearm").unwrap();
    let found = eventually(|| {
        let mut command = taxel(&dir, &["doctor", "--scan", "--start", "--json", "--seconds", "1"]);
        let output = command.arg(&sources[0]).output().unwrap();
        let found: Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)));
        let is_whole = found["layout"]
            .as_str()
            .is_some_and(|text| taxel_skin::Layout::parse(text, "found.toml").unwrap().len() == wanted.len());
        is_whole.then_some(found.clone()).ok_or(found.to_string())
    });
    let boards = found["buses"][0]["boards"].as_array().unwrap();
    assert_eq!(boards.len(), wanted.wiring.len());
    assert!(
        boards.iter().all(|board| board["protocol"] == "icub-mtb3"),
        "{boards:?}"
    );
}
