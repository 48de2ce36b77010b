//! `taxel doctor` on recordings.

use super::{succeeds, taxel, texts, words};
use std::fs;
use tempfile::TempDir;

#[test]
fn joints_on_a_bus_of_the_skin_are_no_strangers_there() {
    let dir = TempDir::new().unwrap();
    let sim = words("sim idle --layout uskin-module --to log:skin.log --seconds 4");
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
    assert!(told.contains("\"allegro:log:both.log\""), "{told}");
}

#[test]
fn the_pressure_of_an_allegro_hand_is_told_for_its_own() {
    let dir = TempDir::new().unwrap();
    let line = |n: usize| {
        let ids = [0x080, 0x084, 0x088, 0x08C, 0x150, 0x154, 0x158, 0x15C];
        let line = |id: &u16| {
            format!(
                "({}.{:06}) can0 {id:03X}#0000000000000000\n",
                n / 100,
                n % 100 * 10_000
            )
        };
        ids.iter().map(line).collect::<String>()
    };
    let log: String = (0..200).map(line).collect();
    fs::write(dir.path().join("in.log"), log).unwrap();
    let (_, told) = texts(&taxel(&dir, &["doctor", "--scan", "log:in.log"]));
    assert!(
        told.contains("an Allegro hand of version 4 or 5") && !told.contains("of nobody known"),
        "{told}"
    );
}
