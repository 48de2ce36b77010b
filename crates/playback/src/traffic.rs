//! Recorded CAN traffic: a candump log, or the CAN frames of an MCAP recording.

use crate::progress::Progress;
use crate::recorded::rest;
use anyhow::{Context, bail};
use std::fs::File;
use std::io::{BufRead, BufReader, Seek};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use taxel_can::{ClockJumps, LogClock, LogError, LogFrame, LogReader, Received};
use taxel_recorder::CanReader;

/// Frames of an MCAP recording that are looked at to find out whose they are: most of a minute of a large hand.
const SURVEYED: u64 = 1_000_000;
/// Bytes of a candump log that are read at once.
const BLOCK: usize = 256 << 10;
/// Interfaces that are told apart; no recording has more buses than this.
const MOST_MET: usize = 64;

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

    /// Shows every frame as it stands there, error frames too: the name of its bus, its time on the clock that the recording
    /// has times of, which for an MCAP recording is the wall clock, and the frame.
    pub(crate) fn copy(
        &self,
        take: &mut dyn FnMut(&str, u64, &Received) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let path = &self.path;
        let progress = Progress::bytes(std::fs::metadata(path).map_or(0, |metadata| metadata.len()));
        match self.kind {
            Kind::Candump => {
                let file = File::open(path).with_context(|| path.display().to_string())?;
                let mut left_out = LeftOut::default();
                let mut log = LogReader::new(BufReader::with_capacity(1 << 20, progress.reading(file)));
                for line in log.by_ref() {
                    match line {
                        Ok(LogFrame {
                            t_ns,
                            interface,
                            frame,
                            ..
                        }) => take(&interface, t_ns, &Received { t_ns, frame })?,
                        Err(error @ LogError::Line { .. }) => left_out.add(error),
                        Err(error) => return Err(error).with_context(|| path.display().to_string()),
                    }
                }
                tell_differences(path, &log);
                left_out.tell(path);
            }
            Kind::Mcap => {
                let (mut reader, mut told) = (CanReader::open(path)?, 0);
                while let Some((bus, received)) = reader.next_frame()? {
                    let wall_ns = reader.wall_ns(received.t_ns);
                    take(&reader.names()[bus], wall_ns, &received)?;
                    if reader.position() > told {
                        progress.advance(reader.position() - told);
                        told = reader.position();
                    }
                }
                tell_left_out(path, &reader);
            }
        }
        Ok(())
    }

    /// One pass over it.
    pub(crate) fn pass<'a>(
        &'a self,
        names: &'a [String],
        jumps: &'a Mutex<ClockJumps>,
    ) -> anyhow::Result<Pass<'a>> {
        Ok(Pass {
            file: FrameFile::open(self, names)?,
            jumps,
            clock: LogClock::default(),
            newest_ns: 0,
        })
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

/// What a recording holds at one place.
pub(crate) enum Line {
    /// A frame, the index of its interface or bus, and its time from the beginning.
    Frame(usize, Received),
    /// Nothing that can be sent.
    Other,
}

/// The frames of a file as they stand there; times start at zero and never fall. Where they were not taken as they stand
/// there is noted in the end.
pub(crate) struct Pass<'a> {
    file: FrameFile<'a>,
    jumps: &'a Mutex<ClockJumps>,
    clock: LogClock,
    newest_ns: u64,
}

impl Drop for Pass<'_> {
    fn drop(&mut self) {
        *self.jumps.lock().unwrap_or_else(PoisonError::into_inner) = self.clock.jumps();
    }
}

impl Iterator for Pass<'_> {
    type Item = anyhow::Result<Line>;

    fn next(&mut self) -> Option<Self::Item> {
        let (place, received) = match self.file.next_entry() {
            Ok(Some(Entry::Frame(place, received))) => (place, received),
            Ok(Some(Entry::NoFrame)) => return Some(Ok(Line::Other)),
            Ok(None) => {
                self.file.tell();
                return None;
            }
            Err(error) => return Some(Err(error)),
        };
        let since_ns = self.clock.since_first_ns(received.t_ns, self.file.number());
        self.newest_ns = since_ns.max(self.newest_ns);
        Some(Ok(match place {
            Some(place) if !received.frame.is_error() => {
                let t_ns = self.newest_ns;
                Line::Frame(place, Received { t_ns, ..received })
            }
            _ => Line::Other,
        }))
    }
}

/// A file of traffic while it is read, one frame after the other.
pub(crate) struct FrameFile<'a> {
    path: &'a Path,
    /// The interfaces that are asked for.
    names: &'a [String],
    lines: Lines,
    met: Interfaces,
    frames: u64,
}

/// The interfaces of a file that were met, with as many frames.
#[derive(Default)]
struct Interfaces(Vec<Interface>);

struct Interface {
    name: Arc<str>,
    /// Where it stands among those asked for.
    place: Option<usize>,
    frames: u64,
}

impl Interfaces {
    /// Where the interface of a frame stands among those asked for. Its reader gives every frame of an interface the same
    /// name.
    fn place(&mut self, name: &Arc<str>, names: &[String]) -> Option<usize> {
        if let Some(known) = self.0.iter_mut().find(|known| Arc::ptr_eq(&known.name, name)) {
            known.frames += 1;
            return known.place;
        }
        let place = names.iter().position(|wanted| **wanted == **name);
        if self.0.len() < MOST_MET {
            let (name, frames) = (Arc::clone(name), 1);
            self.0.push(Interface { name, place, frames });
        }
        place
    }

    /// What was met of those that were not asked for, in words.
    fn left_out(&self) -> Vec<String> {
        let left_out = self.0.iter().filter(|interface| interface.place.is_none());
        left_out
            .map(|interface| format!("{} frames of {}", interface.frames, interface.name))
            .collect()
    }
}

/// Lines that are no classic CAN frames.
#[derive(Default)]
struct LeftOut {
    lines: u64,
    first: Option<LogError>,
}

impl LeftOut {
    fn add(&mut self, error: LogError) {
        self.lines += 1;
        self.first.get_or_insert(error);
    }

    fn tell(&self, path: &Path) {
        if let Some(first) = &self.first {
            eprintln!(
                "taxel: {}: {} lines are not classic CAN frames; the first: {first}",
                path.display(),
                self.lines
            );
        }
    }
}

enum Lines {
    Candump {
        log: Box<LogReader<BufReader<File>>>,
        left_out: LeftOut,
        /// The same open file, which knows how far it was read.
        file: Option<File>,
    },
    Mcap(Box<CanReader>),
}

/// What stands at one place of a file.
pub(crate) enum Entry {
    /// A frame, error frames too, and the place of its interface among those asked for.
    Frame(Option<usize>, Received),
    /// A line that is no classic CAN frame.
    NoFrame,
}

impl<'a> FrameFile<'a> {
    pub(crate) fn open(traffic: &'a Traffic, names: &'a [String]) -> anyhow::Result<Self> {
        let path = traffic.path();
        let lines = match traffic.kind {
            Kind::Candump => {
                let file = File::open(path).with_context(|| path.display().to_string())?;
                Lines::Candump {
                    left_out: LeftOut::default(),
                    file: file.try_clone().ok(),
                    log: Box::new(LogReader::new(BufReader::with_capacity(BLOCK, file))),
                }
            }
            Kind::Mcap => Lines::Mcap(Box::new(CanReader::open(path)?)),
        };
        Ok(Self {
            path,
            names,
            lines,
            met: Interfaces::default(),
            frames: 0,
        })
    }

    /// The next frame, or none at the end.
    pub(crate) fn next_entry(&mut self) -> anyhow::Result<Option<Entry>> {
        Ok(match &mut self.lines {
            Lines::Candump { log, left_out, .. } => match log.next() {
                None => None,
                Some(Ok(frame)) => {
                    let place = self.met.place(&frame.interface, self.names);
                    let (t_ns, frame) = (frame.t_ns, frame.frame);
                    Some(Entry::Frame(place, Received { t_ns, frame }))
                }
                Some(Err(error @ LogError::Line { .. })) => {
                    left_out.add(error);
                    Some(Entry::NoFrame)
                }
                Some(Err(error)) => return Err(error).with_context(|| self.path.display().to_string()),
            },
            Lines::Mcap(reader) => match reader.next_frame()? {
                None => None,
                Some((bus, received)) => {
                    self.frames += 1;
                    let place = self.met.place(&reader.names()[bus], self.names);
                    Some(Entry::Frame(place, received))
                }
            },
        })
    }

    /// The number of the line, or of the frame, that was given last.
    pub(crate) fn number(&self) -> u64 {
        match &self.lines {
            Lines::Candump { log, .. } => log.line_number(),
            Lines::Mcap(_) => self.frames,
        }
    }

    /// Bytes read so far, where that is known.
    pub(crate) fn position(&mut self) -> Option<u64> {
        match &mut self.lines {
            Lines::Candump { file, .. } => file.as_mut()?.stream_position().ok(),
            Lines::Mcap(reader) => Some(reader.position()),
        }
    }

    /// Where the frame that was given last is of another hand than the first ones: what is to be said where only those are
    /// wanted.
    pub(crate) fn another_hand(&self) -> Option<String> {
        let Lines::Mcap(reader) = &self.lines else {
            return None;
        };
        let (layout, began_ns) = reader.another_hand()?;
        let path = self.path.display().to_string();
        Some(format!(
            "{path}: the daemon began anew with another hand, {layout}; read up to there{}",
            rest(&path, began_ns)
        ))
    }

    /// Says how many lines were no classic CAN frame.
    pub(crate) fn tell_left_out_lines(&self) {
        if let Lines::Candump { left_out, .. } = &self.lines {
            left_out.tell(self.path);
        }
    }

    /// Says at the end what of it was not taken as it stands there.
    pub(crate) fn tell(&self) {
        let path = self.path.display();
        match &self.lines {
            Lines::Candump { log, .. } if log.without_time() > 0 => eprintln!(
                "taxel: {path}: {} frames have no time, and are taken to follow each other on a full bus; `candump -l` keeps times",
                log.without_time()
            ),
            Lines::Candump { log, .. } => tell_differences(self.path, log),
            Lines::Mcap(reader) => tell_left_out(self.path, reader),
        }
        let left_out = self.met.left_out();
        if !left_out.is_empty() {
            eprintln!("taxel: {path}: left out: {}", left_out.join(", "));
        }
    }
}

/// Says that times are none where `candump -td` wrote them.
fn tell_differences(path: &Path, log: &LogReader<impl BufRead>) {
    if log.has_differences() {
        eprintln!(
            "taxel: {}: its times are small and fall again and again, as the differences of `candump -td` do; \
             taken for times they make no sense; `candump -l` keeps times",
            path.display()
        );
    }
}

/// Says what of a recording is not there.
fn tell_left_out(path: &Path, reader: &CanReader) {
    let path = path.display();
    for sentence in reader.left_out() {
        eprintln!("taxel: {path}: {sentence}");
    }
    if reader.lost() > 0 {
        eprintln!("taxel: {path}: the recorder lost {} frames", reader.lost());
    }
    if reader.undecodable() > 0 {
        eprintln!(
            "taxel: {path}: {} messages of {} are not what they should be, and left out",
            reader.undecodable(),
            taxel_recorder::Topic::Can.name()
        );
    }
}
