//! What is installed for systemd agrees with itself.

use std::path::Path;

fn unit(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../systemd")
        .join(name);
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn the_unit_for_one_of_several_hands_is_the_other_with_names_of_its_own() {
    let one = unit("taxeld.service")
        .replace("from a robot hand's skin", "from the skin of the robot hand %I")
        .replace("/etc/taxeld/taxeld.toml", "/etc/taxeld/%i.toml")
        .replace("RuntimeDirectory=taxeld\n", "RuntimeDirectory=taxeld-%i\n");
    let several = unit("taxeld@.service");
    let (comment, several) = several.split_once('\n').unwrap();
    assert!(comment.starts_with('#'));
    assert_eq!(several, one);
}

#[test]
fn the_rule_for_serial_adapters_is_for_those_that_are_plugged_in_already_too() {
    let rules = unit("60-taxeld-serial.rules");
    // What `udevadm trigger` has rules look at is a change.
    let is_of_changes = |rule: &str| !rule.contains("ACTION==") && rule.contains("ACTION!=\"remove\"");
    let rules: Vec<&str> = rules.lines().filter(|line| !line.starts_with('#')).collect();
    assert!(
        !rules.is_empty() && rules.iter().all(|rule| is_of_changes(rule)),
        "{rules:?}"
    );
}
