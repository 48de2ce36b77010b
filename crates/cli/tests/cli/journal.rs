//! What services say to systemd's journal: each line with its priority, and nothing of that to others.

use std::fs::File;
use std::os::unix::fs::MetadataExt;
use std::process::Command;
use tempfile::TempDir;

/// What a command says on a stderr that is the journal, or is not, though another process of the same service has it.
fn said(dir: &TempDir, args: &[&str], is_journal: bool) -> Vec<String> {
    let path = dir.path().join("journal");
    let journal = File::create(&path).unwrap();
    let found = journal.metadata().unwrap();
    let stream = format!("{}:{}", found.dev(), found.ino() + u64::from(!is_journal));
    let command = Command::new(env!("CARGO_BIN_EXE_taxel"))
        .args(args)
        .env("JOURNAL_STREAM", stream)
        .current_dir(dir.path())
        .stderr(journal)
        .output();
    drop(command.unwrap());
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().map(str::to_owned).collect()
}

const RECORD: [&str; 7] = [
    "record",
    "a.mcap",
    "--no-can",
    "--socket",
    "nobody.sock",
    "--seconds",
    "0.5",
];

#[test]
fn what_is_missing_is_a_warning_in_the_journal_and_why_a_service_ends_an_error() {
    let dir = TempDir::new().unwrap();
    std::fs::write(dir.path().join("bad.toml"), "layout = 7\n").unwrap();
    let config = [&RECORD[..], &["--config", "bad.toml"]].concat();
    let can = [&RECORD[..2], &RECORD[3..], &["--config", "scene.toml"]].concat();
    let scene = "layout = 'uskin-module'\n[[bus]]\nsource = 'log:a.log'\n";
    std::fs::write(dir.path().join("scene.toml"), scene).unwrap();
    for (args, wanted) in [
        (
            &RECORD[..],
            &[
                ("<4>", "; waiting for it"),
                (
                    "<4>",
                    "nothing came of a daemon or of a bus, and no file was made",
                ),
                ("<3>", "nothing came of a daemon at nobody.sock"),
            ][..],
        ),
        (
            &can[..],
            &[("<4>", "no raw CAN: scene.toml reads neither can: nor udp:")],
        ),
        (&config[..], &[("<3>", "bad.toml:1")]),
        // What clap says, in several lines.
        (
            &["record", "a.mcap", "--seconds", "soon"],
            &[("<3>error:", "'soon'"), ("<3>", "--help")],
        ),
        (
            &["metrics", "--socket", "nobody.sock"],
            &[("<4>", "so taxeld_up is 0")],
        ),
    ] {
        let journal = said(&dir, args, true);
        for (mark, words) in wanted {
            let is_there = |line: &String| line.starts_with(mark) && line.contains(words);
            assert!(
                journal.iter().any(is_there),
                "{args:?}: {mark} {words}: {journal:#?}"
            );
        }
        assert!(journal.iter().all(|line| line.starts_with('<')), "{journal:#?}");
        let other = said(&dir, args, false);
        assert!(!other.iter().any(|line| line.starts_with('<')), "{other:#?}");
        assert_eq!(other.len(), journal.len());
    }
}
