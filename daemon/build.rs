//! What `--version` says, of `taxeld` and of `taxel`: the version, and the commit where this is a git checkout.
//!
//! Debug programs do without, so that a commit alone does not have everything that is tested built again.

use std::path::Path;
use std::process::Command;

fn main() {
    let version = std::env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let commit = commit().map_or(String::new(), |commit| format!(" ({commit})"));
    println!("cargo::rerun-if-changed=Cargo.toml");
    println!("cargo::rustc-env=TAXEL_VERSION={version}{commit}");
}

fn commit() -> Option<String> {
    if std::env::var("PROFILE").is_ok_and(|profile| profile == "debug") {
        return None;
    }
    let package = std::env::current_dir().ok()?;
    let root = package
        .ancestors()
        .find(|folder| folder.join("Cargo.lock").exists())?;
    // The sources may lie in a repository of somebody else's.
    if !root.join(".git").exists() {
        return None;
    }
    // What is written with every commit and with every checkout; HEAD where no such journal is kept.
    let written = ["logs/HEAD", "HEAD"].map(|file| git(root, &["rev-parse", "--git-path", file]));
    let mut written = written.into_iter().flatten().map(|file| root.join(file));
    if let Some(file) = written.find(|file| file.exists()) {
        println!("cargo::rerun-if-changed={}", file.display());
    }
    git(root, &["rev-parse", "--short=9", "HEAD"])
}

/// What git says in one line, where it is there and content with the repository.
fn git(root: &Path, words: &[&str]) -> Option<String> {
    let said = Command::new("git").current_dir(root).args(words).output().ok()?;
    let line = said.status.success().then(|| String::from_utf8(said.stdout).ok());
    line.flatten().map(|line| line.trim().to_owned())
}
