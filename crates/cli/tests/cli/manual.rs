//! Completions and manual pages.

use crate::{fails, succeeds};
use std::fs;
use tempfile::TempDir;

#[test]
fn every_command_has_a_manual_page_and_so_has_the_daemon() {
    let dir = TempDir::new().unwrap();
    succeeds(&dir, &["man", "pages"]);
    let page = |name: &str| fs::read_to_string(dir.path().join("pages").join(name)).unwrap();
    let (commands, _) = succeeds(&dir, &["--help"]);
    let commands = commands
        .split("Commands:")
        .nth(1)
        .unwrap()
        .split("Options:")
        .next()
        .unwrap();
    let names = commands
        .lines()
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next());
    for name in names.filter(|name| !name.is_empty() && *name != "help") {
        let text = page(&format!("taxel-{name}.1"));
        assert!(text.contains(&format!(".TH taxel-{name} 1")), "{text}");
    }
    assert!(page("taxel.1").contains("taxel\\-watch(1)"));
    let daemon = page("taxeld.8");
    assert!(daemon.contains("\\fB\\-\\-config\\fR \\fIFILE\\fR"), "{daemon}");
    assert!(daemon.contains("/usr/share/doc/taxeld/guide.md"), "{daemon}");
    // Every page that one refers to is there.
    let pages = fs::read_dir(dir.path().join("pages")).unwrap();
    let mut referred = 0;
    for entry in pages {
        let text = fs::read_to_string(entry.unwrap().path()).unwrap();
        assert!(!text.contains(".SH EXTRA"), "{text}");
        for name in text.lines().filter_map(|line| line.strip_suffix("(1)")) {
            page(&format!("{}.1", name.replace('\\', "")));
            referred += 1;
        }
    }
    assert!(referred > 20);
    let examples = page("taxel-config.1");
    assert!(
        examples.contains("Examples:\n.nf\n  taxel config init >"),
        "{examples}"
    );
}

#[test]
fn completions_know_the_commands_and_an_unknown_shell_is_refused_with_those_there_are() {
    let dir = TempDir::new().unwrap();
    for shell in ["bash", "zsh", "fish"] {
        let (script, _) = succeeds(&dir, &["completions", shell]);
        assert!(
            script.contains("watch") && script.contains("categorize"),
            "{shell}"
        );
    }
    let (script, _) = succeeds(&dir, &["completions", "bash"]);
    for offered in [
        "compgen -W \"paper optimal\"",
        "compgen -W \"robust paper\"",
        "--json --help allegro-uskin-15 ",
        "ball-grasp",
    ] {
        assert!(script.contains(offered), "{offered}");
    }
    assert!(fails(&dir, &["completions", "dos"], 2).contains("bash"));
}
