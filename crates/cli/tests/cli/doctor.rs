//! `taxel doctor` on recordings.

use super::{succeeds, taxel};
use std::fs;
use tempfile::TempDir;

#[test]
fn joints_on_a_bus_of_the_skin_are_no_strangers_there() {
    let dir = TempDir::new().unwrap();
    let sim = [
        "sim",
        "idle",
        "--layout",
        "uskin-module",
        "--to",
        "log:skin.log",
        "--seconds",
        "4",
    ];
    succeeds(&dir, &sim);
    // An Allegro hand of version 4, whose four fingers speak behind each frame of the skin.
    let mut both = String::new();
    for line in fs::read_to_string(dir.path().join("skin.log")).unwrap().lines() {
        both += &format!("{line}\n");
        let (head, _) = line.rsplit_once(' ').unwrap();
        for finger in 0..4 {
            both += &format!("{head} {:03X}#0000000000000000\n", 0x080 + 4 * finger);
        }
    }
    fs::write(dir.path().join("both.log"), both).unwrap();
    let skin = "layout = \"uskin-module\"\nbus = [{ source = \"log:both.log\" }]\n";
    let joints = "[joints]\nsource = \"allegro:log:both.log\"\nallegro.version = 4\n";
    fs::write(dir.path().join("both.toml"), format!("{skin}{joints}")).unwrap();
    fs::write(dir.path().join("skin.toml"), skin).unwrap();
    let (told, _) = succeeds(&dir, &["doctor", "--config", "both.toml"]);
    assert!(
        told.contains("all fingers report") && !told.contains("an Allegro hand (version"),
        "{told}"
    );
    // Of a configuration that has no joints it is nobody's.
    let output = taxel(&dir, &["doctor", "--config", "skin.toml"]);
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.contains("an Allegro hand (version 4 or 5) speaks"), "{told}");
}
