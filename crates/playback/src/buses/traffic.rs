//! Recorded CAN traffic: a candump log, or the CAN frames of an MCAP recording.

use anyhow::{Context, bail};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use taxel_can::{LogError, LogFrame, LogReader};
use taxel_recorder::{CanReader, parts};

/// Frames of an MCAP recording that are looked at to find out whose they are: most of a minute of a large hand.
const SURVEYED: u64 = 1_000_000;
/// Bytes of a candump log that are read at once.
pub(crate) const BLOCK: usize = 256 << 10;

/// A file of CAN traffic.
#[derive(Debug, Clone)]
pub struct Traffic {
    path: PathBuf,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Candump,
    Mcap,
}

impl Traffic {
    /// A candump log.
    pub fn candump(path: &Path) -> Self {
        let (path, kind) = (path.into(), Kind::Candump);
        Self { path, kind }
    }

    /// A recording that `taxel record` made.
    pub fn mcap(path: &Path) -> Self {
        let (path, kind) = (path.into(), Kind::Mcap);
        Self { path, kind }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How long it is, with all of its parts.
    pub(crate) fn bytes(&self) -> u64 {
        let files = parts(&self.path)
            .into_iter()
            .filter_map(|part| part.metadata().ok());
        files.map(|file| file.len()).sum()
    }

    /// Whether it is a candump log.
    pub fn is_candump(&self) -> bool {
        self.kind == Kind::Candump
    }

    /// The names of its interfaces, in the order in which they appear.
    pub fn interfaces(&self) -> anyhow::Result<Vec<String>> {
        let mut names: Vec<String> = Vec::new();
        self.survey(|frame| {
            if !names.iter().any(|name| **name == *frame.interface) {
                names.push(frame.interface.to_string());
            }
            Wanted::Others
        })?;
        Ok(names)
    }

    /// Shows its frames until it is known whose they are: of a candump log those of every interface of which more is wanted,
    /// of an MCAP recording the first minute. It is an error that there is no frame.
    pub(crate) fn survey(&self, mut take: impl FnMut(&LogFrame) -> Wanted) -> anyhow::Result<()> {
        match self.kind {
            Kind::Candump => survey_candump(&self.path, take),
            Kind::Mcap => {
                let mut reader = CanReader::open(&self.path)?;
                let mut surveyed = 0;
                while surveyed < SURVEYED
                    && let Some((bus, received)) = reader.next_frame()?
                {
                    if reader.another_hand().is_some() {
                        break;
                    }
                    surveyed += 1;
                    let wanted = take(&LogFrame {
                        t_ns: received.t_ns,
                        interface: Arc::clone(&reader.names()[bus]),
                        frame: received.frame,
                        direction: None,
                    });
                    if wanted == Wanted::Nothing {
                        break;
                    }
                }
                match surveyed {
                    0 => bail!("{}: no CAN frame in it", self.path.display()),
                    _ => Ok(()),
                }
            }
        }
    }
}

/// What is to be shown after a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// More of its interface.
    More,
    /// Other interfaces.
    Others,
    Nothing,
}

fn survey_candump(path: &Path, mut take: impl FnMut(&LogFrame) -> Wanted) -> anyhow::Result<()> {
    let file = File::open(path).with_context(|| path.display().to_string())?;
    let (mut any, mut problem) = (false, None);
    let mut known = Vec::<Arc<str>>::new();
    let mut log = LogReader::new(BufReader::with_capacity(BLOCK, file));
    loop {
        if log.pass_over(&known).is_some() {
            continue;
        }
        match log.next() {
            None => break,
            Some(Ok(frame)) => {
                any = true;
                match take(&frame) {
                    Wanted::Others if !known.contains(&frame.interface) => known.push(frame.interface),
                    Wanted::Nothing => break,
                    _ => {}
                }
            }
            Some(Err(error @ LogError::Line { .. })) => problem = problem.or(Some(error)),
            Some(Err(error)) => return Err(error).with_context(|| path.display().to_string()),
        }
    }
    match (any, problem) {
        (false, Some(problem)) => Err(problem).context(format!("{}: no CAN frame in it", path.display())),
        (false, None) => bail!("{}: no CAN frame in it", path.display()),
        _ => Ok(()),
    }
}
