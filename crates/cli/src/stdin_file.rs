//! `-` where a recording is named: stdin, as a file of the kind that its first bytes tell.

use anyhow::{Context, bail};
use clap::builder::{PathBufValueParser, TypedValueParser};
use std::fs::File;
use std::io::{IsTerminal, Read, Write};
use std::path::PathBuf;
use std::sync::Mutex;
use tempfile::TempDir;

/// How many bytes tell the kind.
const HEAD: usize = 4096;

/// The folder of what was read, until the program ends.
static FOLDER: Mutex<Option<TempDir>> = Mutex::new(None);

/// Reads the path of a recording; `-` is a file with what is on stdin, which is read to its end.
pub(crate) fn recording_parser() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| match path.as_os_str() == "-" {
        true => spool().map_err(|error| format!("{error:#}")),
        false => Ok(path),
    })
}

/// Removes what was read from stdin.
pub(crate) fn remove() {
    drop(FOLDER.lock().unwrap_or_else(|e| e.into_inner()).take());
}

fn spool() -> anyhow::Result<PathBuf> {
    let mut folder = FOLDER.lock().unwrap_or_else(|e| e.into_inner());
    if folder.is_some() {
        bail!("stdin is one recording, and was named twice");
    }
    let mut stdin = std::io::stdin();
    if stdin.is_terminal() {
        bail!("- is a recording on stdin, which is a terminal; write `taxel ... - < FILE`");
    }
    let mut head = Vec::new();
    let read = stdin.by_ref().take(HEAD as u64).read_to_end(&mut head);
    read.context("stdin")?;
    let made = tempfile::Builder::new().prefix("taxel-").tempdir();
    let made = folder.insert(made.context("a folder for what is on stdin")?);
    let path = made.path().join(format!("stdin.{}", kind(&head)));
    let mut file = File::create(&path).with_context(|| path.display().to_string())?;
    let copied = file
        .write_all(&head)
        .and_then(|()| std::io::copy(&mut stdin, &mut file));
    copied.with_context(|| path.display().to_string())?;
    Ok(path)
}

/// The ending of a file that begins so.
fn kind(head: &[u8]) -> &'static str {
    const MAGIC: [(&[u8], &str); 3] = [
        (b"\x89MCAP", "mcap"),
        (b"\x93NUMPY", "npy"),
        (b"PK\x03\x04", "npz"),
    ];
    if let Some((_, ending)) = MAGIC.iter().find(|(magic, _)| head.starts_with(magic)) {
        return ending;
    }
    let text = String::from_utf8_lossy(head);
    let line = text
        .lines()
        .find(|line| !line.trim().is_empty())
        .unwrap_or_default();
    // `(1.5) can0 123#00`, or candump's own `  can0  123   [1]  00`.
    let is_candump = line.starts_with('(')
        || line
            .split_whitespace()
            .nth(2)
            .is_some_and(|word| word.starts_with('['));
    if is_candump { "log" } else { "csv" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_bytes_tell_the_kind_of_a_recording() {
        for (head, ending) in [
            (&b"\x89MCAP0\r\n"[..], "mcap"),
            (b"\x93NUMPY\x01\x00", "npy"),
            (b"PK\x03\x04....", "npz"),
            (b"(1436509052.249713) vcan0 044#2A366C2BBA\n", "log"),
            (b"\n  vcan0  044   [5]  2A 36 6C 2B BA\n", "log"),
            (b"t,a,b\n0,1,2\n", "csv"),
            (b"1;2;3\n", "csv"),
            (b"", "csv"),
        ] {
            assert_eq!(kind(head), ending, "{}", String::from_utf8_lossy(head));
        }
    }
}
