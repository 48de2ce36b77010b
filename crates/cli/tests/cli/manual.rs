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

#[test]
fn a_manual_page_has_its_version_and_its_date_and_no_json_outside_a_block() {
    let dir = TempDir::new().unwrap();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_taxel"));
    let command = command
        .args(["man", "pages"])
        .env("SOURCE_DATE_EPOCH", "1700000000");
    assert!(command.current_dir(dir.path()).status().unwrap().success());
    let page = fs::read_to_string(dir.path().join("pages/taxel-watch.1")).unwrap();
    let version = env!("CARGO_PKG_VERSION");
    let head = format!(".TH taxel-watch 1 2023-11-14 \"taxeld {version}\"");
    assert!(page.contains(&head), "{page}");
    let mut is_block = false;
    for line in page.lines() {
        is_block = (is_block || line == ".nf") && line != ".fi";
        assert!(is_block || !line.contains("{\"hz\""), "{line}");
    }
}

#[test]
fn bash_offers_files_where_none_is_begun_and_hands_for_a_layout() {
    let dir = TempDir::new().unwrap();
    fs::write(dir.path().join("grasp.log"), "").unwrap();
    let (script, _) = succeeds(&dir, &["completions", "bash"]);
    fs::write(dir.path().join("taxel.bash"), script).unwrap();
    let complete = |words: &str, at: usize| {
        let line = format!(
            "source ./taxel.bash; COMP_WORDS=({words}); COMP_CWORD={at}; \
             _taxel taxel \"${{COMP_WORDS[{at}]}}\" \"${{COMP_WORDS[{}]}}\"; echo ${{COMPREPLY[@]}}",
            at - 1
        );
        let bash = std::process::Command::new("bash")
            .args(["-c", &line])
            .current_dir(dir.path())
            .output();
        String::from_utf8(bash.unwrap().stdout).unwrap()
    };
    // Nothing of ours: then bash offers files.
    assert_eq!(complete("taxel compress ''", 2), "\n");
    assert!(complete("taxel compress --", 2).contains("--layout"));
    let hands = complete("taxel compress --layout ''", 3);
    assert!(
        hands.contains("allegro-uskin-15") && hands.contains("grasp.log"),
        "{hands}"
    );
    assert!(complete("taxel layouts ''", 2).contains("allegro-uskin-15"));
    assert!(complete("taxel ''", 1).contains("compress"));
}
