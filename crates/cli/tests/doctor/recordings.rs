//! What the doctor says of recordings.

use super::{bad, configure, doctor, recorded, said, taxel};
use tempfile::TempDir;

#[test]
fn a_recording_is_examined_in_its_own_time() {
    let dir = TempDir::new().unwrap();
    recorded(&dir, "idle --layout uskin-module --to log:idle.log --seconds 30");
    let (_, checks) = doctor(&dir, &["--layout", "uskin-module", "log:idle.log"]);
    let of = |name: &str| {
        checks
            .iter()
            .find(|c| c["name"] == name && c["area"] == "hand")
            .unwrap()
    };
    assert_eq!(of("board")["found"], "50.0 Hz");
    assert_eq!(of("taxels")["found"], "16 healthy");
}

#[test]
fn a_recording_beside_a_configuration_is_one_of_its_hand_and_neither_its_bus_nor_its_joints_are_looked_at() {
    let dir = TempDir::new().unwrap();
    recorded(&dir, "idle --layout uskin-module --to log:idle.log --seconds 4");
    let joints = "[joints]\nsource = \"dynamixel:/dev/none\"\n[[joints.servo]]\nid = 1\nname = \"wrist\"\n";
    configure(&dir, "uskin-module", &["can:none0".into()], joints);
    let (_, checks) = doctor(&dir, &["--config", "hand.toml", "log:idle.log"]);
    let hand = checks.iter().find(|c| c["name"] == "taxels").unwrap();
    assert_eq!(hand["found"], "16 healthy");
    assert!(!format!("{checks:?}").contains("none"), "{checks:?}");
}

#[test]
fn of_a_recording_of_two_buses_the_one_of_the_hands_bus_is_examined() {
    let dir = TempDir::new().unwrap();
    recorded(&dir, "idle --layout uskin-module --to log:idle.log --seconds 4");
    let log = std::fs::read_to_string(dir.path().join("idle.log")).unwrap();
    let twice = |names: [&str; 2]| -> String {
        let lines = log
            .lines()
            .flat_map(|line| names.map(|name| line.replace(" can0 ", name) + "\n"));
        lines.collect()
    };
    std::fs::write(dir.path().join("two.log"), twice([" can0 ", " can1 "])).unwrap();
    let (_, checks) = doctor(&dir, &["--layout", "uskin-module", "log:two.log"]);
    let of = |name: &str| {
        checks
            .iter()
            .find(|c| c["name"] == name && c["area"] == "hand")
            .unwrap()
    };
    assert_eq!(of("board")["found"], "50.0 Hz");
    let left_out = of("source")["found"].as_str().unwrap();
    assert!(
        left_out.contains("frames of can1") && left_out.contains("log:two.log?interface=can1"),
        "{left_out}"
    );

    std::fs::write(dir.path().join("named.log"), twice([" slcan0 ", " slcan1 "])).unwrap();
    let (code, checks) = doctor(&dir, &["--layout", "uskin-module", "log:named.log"]);
    let told = bad(&checks, "source");
    let [[_, "error", refused, _]] = told[..] else {
        panic!("{checks:?}");
    };
    assert!(refused.contains("log:named.log?interface=slcan0"), "{refused}");
    assert_eq!(code, Some(1));
}

#[test]
fn a_recording_without_times_is_said_to_have_made_up_ones() {
    let dir = TempDir::new().unwrap();
    recorded(&dir, "idle --layout uskin-module --to log:idle.log --seconds 4");
    let log = std::fs::read_to_string(dir.path().join("idle.log")).unwrap();
    // As candump shows frames on the screen: `  can0  600   [8]  83 80 39 80 06 32 86 01`.
    let lines = log.lines().map(|line| {
        let (id, data) = line.rsplit(' ').next().unwrap().split_once('#').unwrap();
        let bytes: Vec<&str> = (0..data.len()).step_by(2).map(|n| &data[n..n + 2]).collect();
        format!("  can0  {id}   [{}]  {}\n", bytes.len(), bytes.join(" "))
    });
    std::fs::write(dir.path().join("screen.log"), lines.collect::<String>()).unwrap();
    let of = |file: &str| {
        let (_, checks) = doctor(&dir, &["--layout", "uskin-module", &format!("log:{file}")]);
        bad(&checks, "source")
            .iter()
            .any(|check| check[2].contains("no times"))
    };
    assert_eq!([of("idle.log"), of("screen.log")], [false, true]);
}

#[test]
fn contacts_of_drift_in_a_recording_are_told() {
    let dir = TempDir::new().unwrap();
    let scene = r#"
        name = "drift"
        layout = "uskin-module"
        seconds = 220.0
        [boards]
        rate_hz = 10
        [[fault]]
        kind = "drift"
        on = ["all"]
        counts_per_s = 3.0
        from = 3.0
    "#;
    std::fs::write(dir.path().join("drift.toml"), scene).unwrap();
    recorded(&dir, "drift.toml --to log:drift.log");
    let (code, checks) = doctor(&dir, &["--layout", "uskin-module", "log:drift.log"]);
    let told = bad(&checks, "contact-unchanging");
    let [[_, "warning", found, mend]] = told[..] else {
        panic!("{checks:?}");
    };
    assert!(found.contains("of 16"), "{found}");
    assert!(mend.contains("taxel rezero"), "{mend}");
    assert_eq!(code, Some(0));
}

#[test]
fn one_recording_or_scene_is_all_buses_of_its_hand() {
    let dir = TempDir::new().unwrap();
    recorded(&dir, "idle --to log:idle.log --seconds 3");
    let log = std::fs::read_to_string(dir.path().join("idle.log")).unwrap();
    std::fs::write(dir.path().join("renamed.log"), log.replace(" can", " vcan")).unwrap();
    for sources in [
        &["log:idle.log"][..],
        &["log:idle.log", "log:idle.log"],
        &["sim:idle"],
        &[
            "log:renamed.log?interface=vcan0",
            "log:renamed.log?interface=vcan1",
        ],
    ] {
        let (_, checks) = doctor(&dir, sources);
        let heard = checks
            .iter()
            .filter(|c| c["name"] == "board" && c["state"] == "ok");
        assert_eq!(heard.count(), 15, "{sources:?}: {checks:?}");
    }
    for (sources, words) in [
        (
            &["log:renamed.log"][..],
            "such as log:renamed.log?interface=vcan0 log:renamed.log?interface=vcan1",
        ),
        (
            &["log:idle.log", "log:idle.log?interface=can0"],
            "log:idle.log?interface=can0 is given twice",
        ),
    ] {
        let output = taxel(&dir, &["doctor"]).args(sources).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{sources:?}");
        assert!(said(&output).contains(words), "{sources:?}: {}", said(&output));
    }
}
