//! What is installed for systemd agrees with itself.

use std::path::Path;

fn unit(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../systemd")
        .join(name);
    std::fs::read_to_string(path).unwrap()
}

fn without_its_first_comment(name: &str) -> String {
    let text = unit(name);
    let (comment, rest) = text.split_once('\n').unwrap();
    assert!(comment.starts_with('#'));
    rest.into()
}

#[test]
fn the_unit_for_one_of_several_hands_is_the_other_with_names_of_its_own() {
    let one = unit("taxeld.service")
        .replace("from a robot hand's skin", "from the skin of the robot hand %i")
        .replace("/etc/taxeld/taxeld.toml", "/etc/taxeld/%i.toml")
        .replace("RuntimeDirectory=taxeld\n", "RuntimeDirectory=taxeld-%i\n");
    assert_eq!(without_its_first_comment("taxeld@.service"), one);
}

#[test]
fn a_reload_is_taxelds_before_it_is_checked_so_that_the_status_tells_of_a_file_that_cannot_be_read() {
    let text = unit("taxeld.service");
    let reloads: Vec<&str> = text
        .lines()
        .filter(|line| line.starts_with("ExecReload="))
        .collect();
    let expected = [
        "ExecReload=kill -HUP $MAINPID",
        "ExecReload=taxeld --config /etc/taxeld/taxeld.toml --check",
    ];
    assert_eq!(reloads, expected);
}

#[test]
fn the_units_beside_that_of_one_of_several_hands_are_the_others_with_its_names() {
    let one = unit("taxel-record.service")
        .replace("of what a robot hand", "of what the robot hand %i")
        .replace("After=taxeld.service", "After=taxeld@%i.service")
        .replace("=/run/taxeld\n", "=/run/taxeld-%i\n")
        .replace("taxel-record/taxeld.mcap", "taxel-record/%i.mcap")
        .replace("/etc/taxeld/taxeld.toml", "/etc/taxeld/%i.toml");
    assert_eq!(without_its_first_comment("taxel-record@.service"), one);
    let one = unit("taxel-metrics.service")
        .replace("of the tactile daemon", "of the robot hand %i")
        .replace("target taxeld.service", "target taxeld@%i.service")
        .replace("=/run/taxeld\n", "=/run/taxeld-%i\n");
    assert_eq!(without_its_first_comment("taxel-metrics@.service"), one);
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
