//! `taxel NAME` where NAME is not built in: the program `taxel-NAME`, as git and cargo do.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use taxel_hand::did_you_mean;
use taxeld::stdout;

const PREFIX: &str = "taxel-";
/// The exit code of wrong usage.
const USAGE: u8 = 2;

/// Becomes the program `taxel-NAME` with the words behind NAME; it has the terminal, signals and exit code to itself.
/// Returns only where there is none.
pub(crate) fn run(words: &[OsString], built_in: &clap::Command) -> ExitCode {
    let (name, arguments) = words
        .split_first()
        .map_or((OsStr::new(""), words), |(n, a)| (n, a));
    let folders = folders();
    if let Some(program) = find(name, &folders) {
        let error = Command::new(&program).args(arguments).exec();
        say!("taxel: {}: {error}", program.display());
        return ExitCode::FAILURE;
    }
    let name = name.to_string_lossy();
    let commands = commands(built_in, &folders);
    let known: Vec<&str> = commands.keys().map(String::as_str).collect();
    let meant = did_you_mean(&name, known.iter().copied());
    say!(
        "taxel: there is no command `{name}`{meant}\nThere is {}, and what a program taxel-NAME beside taxel or in PATH \
         adds.\n`taxel --list` says what each does.",
        known.join(", ")
    );
    ExitCode::from(USAGE)
}

/// Prints every command with what it does, or the file of the program that it is.
pub(crate) fn list(built_in: &clap::Command) -> anyhow::Result<()> {
    let mut text = String::new();
    for (name, what) in commands(built_in, &folders()) {
        text += &format!("{name:12} {what}\n");
    }
    stdout::print(&text)
}

/// Every command, built in or a program, and what is said of it; a built-in one hides a program of its name.
fn commands(built_in: &clap::Command, folders: &[PathBuf]) -> BTreeMap<String, String> {
    let mut commands = BTreeMap::new();
    for folder in folders.iter().rev() {
        for entry in folder.read_dir().into_iter().flatten().flatten() {
            let path = entry.path();
            let name = path.file_name().and_then(OsStr::to_str);
            if let Some(name) = name.and_then(|name| name.strip_prefix(PREFIX))
                && is_program(&path)
            {
                commands.insert(name.to_owned(), path.display().to_string());
            }
        }
    }
    for command in built_in.get_subcommands().filter(|c| !c.is_hide_set()) {
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        commands.insert(command.get_name().to_owned(), about);
    }
    commands
}

/// Where programs are looked for: beside this one, then along PATH.
fn folders() -> Vec<PathBuf> {
    let own = std::env::current_exe().ok();
    let beside = own.and_then(|own| Some(own.parent()?.to_owned()));
    let path = std::env::var_os("PATH").unwrap_or_default();
    beside
        .into_iter()
        .chain(std::env::split_paths(&path).filter(|folder| folder.is_absolute()))
        .collect()
}

/// The first program of this name in these folders.
fn find(name: &OsStr, folders: &[PathBuf]) -> Option<PathBuf> {
    if name.is_empty() || name.as_bytes().contains(&b'/') {
        return None;
    }
    let mut file = OsString::from(PREFIX);
    file.push(name);
    let mut paths = folders.iter().map(|folder| folder.join(&file));
    paths.find(|path| is_program(path))
}

fn is_program(path: &Path) -> bool {
    let found = path.metadata();
    found.is_ok_and(|found| found.is_file() && found.permissions().mode() & 0o111 != 0)
}
