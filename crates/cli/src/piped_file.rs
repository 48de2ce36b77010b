//! What comes through a pipe, stdin or one with a name, as a file that can be read more than once; a recording as one of
//! the kind that its first bytes tell.

use anyhow::{Context, anyhow, bail};
use clap::builder::{PathBufValueParser, StringValueParser, TypedValueParser};
use std::fs::File;
use std::io::{IsTerminal, Read, Write};
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use taxel_can::SourceAddress;
use taxel_playback::interrupt::before_the_end;
use taxel_playback::stand_in;
use taxel_record::FileKind;
use tempfile::TempDir;

/// How many bytes tell the kind.
const HEAD: usize = 4096;

/// What was read, until the program ends.
static PIPED: Mutex<Piped> = Mutex::new(Piped {
    folder: None,
    names: Vec::new(),
});

struct Piped {
    folder: Option<TempDir>,
    /// Where each came from.
    names: Vec<String>,
}

/// Reads the path of a recording; `-`, and a pipe, is a file with what comes through it, which is read to its end. A
/// recording may be named as the source that it can be, `log:FILE`.
pub(crate) fn recording_parser() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| recording(path).map_err(|error| format!("{error:#}")))
}

/// Reads the path of a configuration or another text; `-`, and a pipe, is a file with what comes through it.
pub(crate) fn text_parser() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| spooled(path).map_err(|error| format!("{error:#}")))
}

/// Reads the name of a layout; `-`, and a pipe, is the layout file that comes through it.
pub(crate) fn layout_parser() -> impl TypedValueParser<Value = String> {
    StringValueParser::new().try_map(|name| {
        let path = spooled(name.into()).map_err(|error| format!("{error:#}"))?;
        Ok::<_, String>(path.display().to_string())
    })
}

/// Reads a source; a recording of it may come through a pipe, and `-` is one.
pub(crate) fn source_parser() -> impl TypedValueParser<Value = SourceAddress> {
    StringValueParser::new().try_map(|text| source(&text).map_err(|error| format!("{error:#}")))
}

fn source(text: &str) -> anyhow::Result<SourceAddress> {
    let text = if text == "-" { "log:-" } else { text };
    Ok(match text.parse()? {
        SourceAddress::Log { path, interface } => SourceAddress::Log {
            path: spooled(path)?,
            interface,
        },
        other => other,
    })
}

/// A file, or what comes through stdin or another pipe as a file.
fn spooled(path: PathBuf) -> anyhow::Result<PathBuf> {
    if path.as_os_str() == "-" {
        let stdin = std::io::stdin();
        if stdin.is_terminal() {
            bail!("- is stdin, which is a terminal; write `taxel ... - < FILE`");
        }
        return spool(stdin, "stdin");
    }
    match std::fs::metadata(&path) {
        Ok(file) if file.file_type().is_fifo() => {
            let name = path.display().to_string();
            spool(File::open(&path).context(name.clone())?, &name)
        }
        _ => Ok(path),
    }
}

fn recording(path: PathBuf) -> anyhow::Result<PathBuf> {
    let path = spooled(path)?;
    let address = path.to_str().and_then(|text| text.parse().ok());
    match std::fs::metadata(&path).map(|file| file.file_type()) {
        Err(_) if address.is_some() => match address {
            Some(SourceAddress::Log {
                path,
                interface: None,
            }) => recording(path),
            Some(SourceAddress::Log { path, .. }) => {
                bail!(
                    "a recording is read with all its interfaces here; name {}",
                    path.display()
                )
            }
            Some(SourceAddress::Sim { .. }) | None => Ok(path),
            Some(_) => bail!(
                "a bus is no recording; where taxeld reads it, `taxel view` shows it and `taxel record` makes a recording"
            ),
        },
        Ok(kind) if !kind.is_file() && !kind.is_dir() && path.extension().is_none() => {
            bail!("no regular file and no pipe; `-` reads stdin")
        }
        _ => Ok(path),
    }
}

/// Removes what was read.
pub(crate) fn remove() {
    drop(piped().folder.take());
}

fn piped() -> MutexGuard<'static, Piped> {
    PIPED.lock().unwrap_or_else(PoisonError::into_inner)
}

fn spool(mut pipe: impl Read, name: &str) -> anyhow::Result<PathBuf> {
    let path = place(name)?;
    let mut head = Vec::new();
    let read = pipe.by_ref().take(HEAD as u64).read_to_end(&mut head);
    read.with_context(|| name.to_owned())?;
    let kind = FileKind::of_bytes(&head)
        .map_err(|packed| anyhow!("{name}: it is packed; {}", packed.is_read_by("FILE")))?;
    let path = path.with_extension(kind.ending());
    copy(&head, &mut pipe, &path).with_context(|| path.display().to_string())?;
    stand_in::call(&path, name);
    Ok(path)
}

/// Where what is called so is to be, but for its ending. Nobody waits for what comes through the pipe.
fn place(name: &str) -> anyhow::Result<PathBuf> {
    let mut piped = piped();
    if piped.names.iter().any(|known| known == name) {
        bail!("{name} is read once, and was named twice");
    }
    piped.names.push(name.to_owned());
    let number = piped.names.len();
    if piped.folder.is_none() {
        // A signal ends the program without any destructor.
        before_the_end(remove).context("cannot handle signals")?;
        let folder = tempfile::Builder::new().prefix("taxel-").tempdir();
        piped.folder = Some(folder.context("a folder for what comes through a pipe")?);
    }
    let folder = piped.folder.as_ref().map(TempDir::path).unwrap_or(Path::new(""));
    Ok(folder.join(number.to_string()))
}

fn copy(head: &[u8], rest: &mut impl Read, path: &Path) -> std::io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(head)?;
    std::io::copy(rest, &mut file).map(drop)
}
