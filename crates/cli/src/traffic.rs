//! Recorded CAN traffic: a candump log, or the CAN frames of an MCAP recording.

use crate::progress::Progress;
use anyhow::{Context, bail};
use std::cell::Cell;
use std::fs::File;
use std::io::BufReader;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use taxel_can::{ClockJumps, LogClock, LogError, LogFrame, LogReader, Received};
use taxel_recorder::CanReader;

/// Frames of an MCAP recording that are looked at to find out whose they are: most of a minute of a large hand.
const SURVEYED: u64 = 1_000_000;
/// How far the frames of a file may be from the order of their times, nanoseconds: as far as a [`LogClock`] goes back.
const DISORDER_NS: u64 = 1_000_000_000;

/// A file of CAN traffic.
#[derive(Debug, Clone)]
pub(crate) struct Traffic {
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
    pub(crate) fn candump(path: &Path) -> Self {
        let (path, kind) = (path.into(), Kind::Candump);
        Self { path, kind }
    }

    /// A recording that `taxel record` made.
    pub(crate) fn mcap(path: &Path) -> Self {
        let (path, kind) = (path.into(), Kind::Mcap);
        Self { path, kind }
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it is a candump log.
    pub(crate) fn is_candump(&self) -> bool {
        self.kind == Kind::Candump
    }

    /// The names of its interfaces, in the order in which they appear.
    pub(crate) fn interfaces(&self) -> anyhow::Result<Vec<String>> {
        let mut names: Vec<String> = Vec::new();
        self.survey(|frame| {
            if !names.iter().any(|name| **name == *frame.interface) {
                names.push(frame.interface.to_string());
            }
        })?;
        Ok(names)
    }

    /// Shows its frames, or, of an MCAP recording, as many as tell whose they are. It is an error that there is none.
    pub(crate) fn survey(&self, mut take: impl FnMut(&LogFrame)) -> anyhow::Result<()> {
        match self.kind {
            Kind::Candump => survey_candump(&self.path, take),
            Kind::Mcap => {
                let mut reader = CanReader::open(&self.path)?;
                let mut surveyed = 0;
                while surveyed < SURVEYED
                    && let Some((bus, received)) = reader.next_frame()?
                {
                    surveyed += 1;
                    take(&LogFrame {
                        t_ns: received.t_ns,
                        interface: Arc::clone(&reader.names()[bus]),
                        frame: received.frame,
                        direction: None,
                    });
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
                let mut left_out = 0;
                let mut log = LogReader::new(BufReader::with_capacity(1 << 20, progress.reading(file)));
                for line in log.by_ref() {
                    match line {
                        Ok(LogFrame {
                            t_ns,
                            interface,
                            frame,
                            ..
                        }) => take(&interface, t_ns, &Received { t_ns, frame })?,
                        Err(LogError::Line { .. }) => left_out += 1,
                        Err(error) => return Err(error).with_context(|| path.display().to_string()),
                    }
                }
                if left_out > 0 {
                    eprintln!(
                        "taxel: {}: {left_out} lines are not classic CAN frames",
                        path.display()
                    );
                }
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
                tell_torn(path, &reader);
            }
        }
        Ok(())
    }

    /// One pass over it.
    pub(crate) fn pass<'a>(
        &'a self,
        names: &'a [String],
        jumps: &'a Cell<ClockJumps>,
    ) -> anyhow::Result<Pass<'a>> {
        let lines = match self.kind {
            Kind::Candump => {
                let file = File::open(&self.path).with_context(|| self.path.display().to_string())?;
                Lines::Candump(LogReader::new(BufReader::new(file)))
            }
            Kind::Mcap => Lines::Mcap {
                reader: Box::new(CanReader::open(&self.path)?),
                places: Vec::new(),
                frames: 0,
            },
        };
        Ok(Pass {
            path: &self.path,
            names,
            jumps,
            lines,
            clock: LogClock::default(),
            newest_ns: 0,
        })
    }
}

fn survey_candump(path: &Path, mut take: impl FnMut(&LogFrame)) -> anyhow::Result<()> {
    let file = File::open(path).with_context(|| path.display().to_string())?;
    let (mut any, mut problem) = (false, None);
    let mut log = LogReader::new(BufReader::new(file));
    for line in log.by_ref() {
        match line {
            Ok(frame) => {
                any = true;
                take(&frame);
            }
            Err(error @ LogError::Line { .. }) => problem = problem.or(Some(error)),
            Err(error) => return Err(error).with_context(|| path.display().to_string()),
        }
    }
    match (any, problem) {
        (false, Some(problem)) => Err(problem).context(format!("{}: no CAN frame in it", path.display())),
        (false, None) => bail!("{}: no CAN frame in it", path.display()),
        _ => {
            if log.without_time() > 0 {
                eprintln!(
                    "taxel: {}: {} frames have no time, and are taken to follow each other on a full bus; `candump -l` keeps times",
                    path.display(),
                    log.without_time()
                );
            }
            Ok(())
        }
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
/// there is noted.
pub(crate) struct Pass<'a> {
    path: &'a Path,
    names: &'a [String],
    jumps: &'a Cell<ClockJumps>,
    lines: Lines,
    clock: LogClock,
    newest_ns: u64,
}

enum Lines {
    Candump(LogReader<BufReader<File>>),
    Mcap {
        reader: Box<CanReader>,
        /// Where each of its names stands among those asked for.
        places: Vec<Option<usize>>,
        frames: u64,
    },
}

impl Pass<'_> {
    fn line(&mut self, number: u64, place: Option<usize>, received: Received) -> Line {
        self.newest_ns = self
            .clock
            .since_first_ns(received.t_ns, number)
            .max(self.newest_ns);
        self.jumps.set(self.clock.jumps());
        match place {
            Some(place) if !received.frame.is_error() => Line::Frame(
                place,
                Received {
                    t_ns: self.newest_ns,
                    ..received
                },
            ),
            _ => Line::Other,
        }
    }
}

impl Iterator for Pass<'_> {
    type Item = anyhow::Result<Line>;

    fn next(&mut self) -> Option<Self::Item> {
        match &mut self.lines {
            Lines::Candump(reader) => {
                let line = reader.next()?;
                let number = reader.line_number();
                Some(match line {
                    Ok(LogFrame {
                        t_ns,
                        interface,
                        frame,
                        ..
                    }) => {
                        let place = self.names.iter().position(|name| **name == *interface);
                        Ok(self.line(number, place, Received { t_ns, frame }))
                    }
                    Err(LogError::Line { .. }) => Ok(Line::Other),
                    Err(error) => Err(error).with_context(|| self.path.display().to_string()),
                })
            }
            Lines::Mcap {
                reader,
                places,
                frames,
            } => match reader.next_frame() {
                Err(error) => Some(Err(error.into())),
                Ok(None) => {
                    tell_torn(self.path, reader);
                    None
                }
                Ok(Some((bus, received))) => {
                    *frames += 1;
                    place_names(reader, self.names, places);
                    let (number, place) = (*frames, places[bus]);
                    Some(Ok(self.line(number, place, received)))
                }
            },
        }
    }
}

fn place_names(reader: &CanReader, wanted: &[String], places: &mut Vec<Option<usize>>) {
    for name in &reader.names()[places.len()..] {
        places.push(wanted.iter().position(|wanted| **wanted == **name));
    }
}

/// Says what of a recording is not there.
fn tell_torn(path: &Path, reader: &CanReader) {
    let path = path.display();
    if let Some(why) = reader.torn() {
        eprintln!("taxel: {path}: torn off ({why}); read to its last whole chunk");
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

/// The frames of several buses of an MCAP recording, as a daemon takes them: in the order of their times, and of their
/// buses where these are equal.
pub(crate) struct RecordedBuses<'a> {
    path: &'a Path,
    reader: CanReader,
    /// Name of each bus.
    names: &'a [String],
    places: Vec<Option<usize>>,
    clock: LogClock,
    frames: u64,
    newest_ns: Vec<u64>,
    /// Frames in the order of their times, and how many of them were given.
    waiting: Vec<(u8, Received)>,
    given: usize,
    /// How many of them nothing can come before any more.
    ready: usize,
    ended: bool,
    failure: Option<anyhow::Error>,
    progress: Progress,
    told: u64,
}

impl<'a> RecordedBuses<'a> {
    /// The frames of the buses that have these names in the recording.
    pub(crate) fn open(traffic: &'a Traffic, names: &'a [String]) -> anyhow::Result<Self> {
        let path = traffic.path();
        let size = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
        Ok(Self {
            path,
            reader: CanReader::open(path)?,
            names,
            places: Vec::new(),
            clock: LogClock::default(),
            frames: 0,
            newest_ns: vec![0; names.len()],
            waiting: Vec::new(),
            given: 0,
            ready: 0,
            ended: false,
            failure: None,
            progress: Progress::bytes(size),
            told: 0,
        })
    }

    /// Whether it came to its end; says what of the recording was not taken as it stands there.
    pub(crate) fn check(self) -> anyhow::Result<()> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        drop(self.progress);
        tell_torn(self.path, &self.reader);
        if self.clock.jumps().count() > 0 {
            eprintln!("taxel: {}: {}", self.path.display(), self.clock.jumps());
        }
        Ok(())
    }

    /// Reads on until frames can be given, or the end.
    fn read_on(&mut self) -> ControlFlow<()> {
        self.waiting.drain(..self.given);
        self.given = 0;
        let mut newest_ns = self.waiting.last().map_or(0, |(_, received)| received.t_ns);
        let enough_ns = newest_ns + 2 * DISORDER_NS;
        while newest_ns < enough_ns && !self.ended {
            match self.reader.next_frame() {
                Ok(Some((bus, received))) => {
                    self.frames += 1;
                    if bus >= self.places.len() {
                        place_names(&self.reader, self.names, &mut self.places);
                    }
                    let since_ns = self.clock.since_first_ns(received.t_ns, self.frames);
                    if let Some(place) = self.places[bus] {
                        let newest = &mut self.newest_ns[place];
                        *newest = since_ns.max(*newest);
                        newest_ns = newest_ns.max(*newest);
                        let t_ns = *newest;
                        self.waiting.push((place as u8, Received { t_ns, ..received }));
                    }
                }
                Ok(None) => self.ended = true,
                Err(error) => {
                    self.failure = Some(error.into());
                    self.ended = true;
                }
            }
        }
        let position = self.reader.position();
        self.progress.advance(position - self.told);
        self.told = position;
        // Of equal ones the first stays the first.
        self.waiting.sort_by_key(|(bus, received)| (received.t_ns, *bus));
        let safe_ns = if self.ended {
            u64::MAX
        } else {
            newest_ns.saturating_sub(DISORDER_NS)
        };
        self.ready = self
            .waiting
            .partition_point(|(_, received)| received.t_ns < safe_ns);
        if self.ready == 0 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

impl Iterator for RecordedBuses<'_> {
    type Item = (u8, Received);

    fn next(&mut self) -> Option<Self::Item> {
        while self.given == self.ready {
            if self.read_on().is_break() && self.ended {
                return None;
            }
        }
        let frame = self.waiting[self.given];
        self.given += 1;
        Some(frame)
    }
}
