//! A file of CAN traffic while it is read, frame by frame.

use crate::recorded::rest;
use crate::traffic::Traffic;
use anyhow::{Context, anyhow, bail};
use std::fs::File;
use std::io::{BufRead, BufReader, Seek};
use std::path::Path;
use std::sync::Arc;
use taxel_can::{LogError, LogReader, Received};
use taxel_recorder::CanReader;

/// Bytes of a candump log that are read at once.
pub(crate) const BLOCK: usize = 256 << 10;
/// Interfaces that are told apart; no recording has more buses than this.
const MOST_MET: usize = 64;

/// A file of traffic while it is read, one frame after the other.
pub(crate) struct FrameFile<'a> {
    path: &'a Path,
    lines: Lines,
    interfaces: Interfaces<'a>,
    frames: u64,
}

/// What stands at one place of a file.
pub(crate) enum Entry {
    /// An interface that was not met before, where every one is asked for. Its place is the number of those before it.
    Interface(Arc<str>),
    /// A frame, error frames too.
    Frame {
        /// The place of its interface among those asked for.
        place: Option<usize>,
        /// When it came: by the clock of a candump log, or the wall clock of an MCAP recording.
        wall_ns: u64,
        received: Received,
    },
    /// A line that is no classic CAN frame.
    NoFrame,
}

/// The interfaces of a file.
struct Interfaces<'a> {
    /// Those that are asked for; every one where nothing is said.
    names: Option<&'a [String]>,
    met: Vec<Interface>,
    /// The first frame of an interface of which was just told.
    held: Option<Entry>,
}

struct Interface {
    name: Arc<str>,
    /// Where it stands among those asked for.
    place: Option<usize>,
    frames: u64,
}

impl Interfaces<'_> {
    /// A frame; before it its interface, where that is new and every one is asked for.
    #[inline]
    fn entry(&mut self, name: &Arc<str>, wall_ns: u64, received: Received) -> anyhow::Result<Entry> {
        // The reader gives every frame of an interface the same name.
        let known = self.met.iter_mut().find(|known| Arc::ptr_eq(&known.name, name));
        let place = match known {
            Some(known) => {
                known.frames += 1;
                known.place
            }
            None => return self.first_entry(name, wall_ns, received),
        };
        Ok(Entry::Frame {
            place,
            wall_ns,
            received,
        })
    }

    /// The first frame of an interface.
    fn first_entry(&mut self, name: &Arc<str>, wall_ns: u64, received: Received) -> anyhow::Result<Entry> {
        let place = match self.names {
            Some(names) => names.iter().position(|wanted| **wanted == **name),
            None => Some(self.met.len()),
        };
        if self.met.len() < MOST_MET {
            let (name, frames) = (Arc::clone(name), 1);
            self.met.push(Interface { name, place, frames });
        } else if self.names.is_none() {
            bail!("more than {MOST_MET} interfaces; no hand has as many buses");
        }
        let frame = Entry::Frame {
            place,
            wall_ns,
            received,
        };
        if self.names.is_some() {
            return Ok(frame);
        }
        self.held = Some(frame);
        Ok(Entry::Interface(Arc::clone(name)))
    }

    /// What was met of those that were not asked for, in words.
    fn left_out(&self) -> Vec<String> {
        let left_out = self.met.iter().filter(|interface| interface.place.is_none());
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

impl<'a> FrameFile<'a> {
    /// From the beginning, of these interfaces, or of all.
    pub(crate) fn open(traffic: &'a Traffic, names: Option<&'a [String]>) -> anyhow::Result<Self> {
        let path = traffic.path();
        let lines = match traffic.is_candump() {
            true => {
                let file = File::open(path).with_context(|| path.display().to_string())?;
                Lines::Candump {
                    left_out: LeftOut::default(),
                    file: file.try_clone().ok(),
                    log: Box::new(LogReader::new(BufReader::with_capacity(BLOCK, file))),
                }
            }
            false => Lines::Mcap(Box::new(CanReader::open(path)?)),
        };
        let (met, held) = (Vec::new(), None);
        Ok(Self {
            path,
            lines,
            interfaces: Interfaces { names, met, held },
            frames: 0,
        })
    }

    /// What comes next, or nothing at the end. It is an error that no frame came until then.
    #[inline]
    pub(crate) fn next_entry(&mut self) -> anyhow::Result<Option<Entry>> {
        if self.interfaces.held.is_some() {
            return Ok(self.interfaces.held.take());
        }
        let entry = match &mut self.lines {
            Lines::Candump { log, left_out, .. } => match log.next() {
                None => return self.end(),
                Some(Ok(line)) => {
                    let (t_ns, frame) = (line.t_ns, line.frame);
                    self.interfaces
                        .entry(&line.interface, t_ns, Received { t_ns, frame })
                }
                Some(Err(error @ LogError::Line { .. })) => {
                    left_out.add(error);
                    Ok(Entry::NoFrame)
                }
                Some(Err(error)) => Err(error.into()),
            },
            Lines::Mcap(reader) => match reader.next_frame()? {
                None => return self.end(),
                Some((bus, received)) => {
                    self.frames += 1;
                    let (name, wall_ns) = (&reader.names()[bus], reader.wall_ns(received.t_ns));
                    self.interfaces.entry(name, wall_ns, received)
                }
            },
        };
        match entry {
            Ok(entry) => Ok(Some(entry)),
            Err(error) => Err(error).with_context(|| self.path.display().to_string()),
        }
    }

    fn end(&mut self) -> anyhow::Result<Option<Entry>> {
        if !self.interfaces.met.is_empty() {
            return Ok(None);
        }
        let problem = match &mut self.lines {
            Lines::Candump { left_out, .. } => left_out.first.take(),
            Lines::Mcap(_) => None,
        };
        let nothing = format!("{}: no CAN frame in it", self.path.display());
        Err(match problem {
            Some(problem) => anyhow!(problem).context(nothing),
            None => anyhow!(nothing),
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
        let left_out = self.interfaces.left_out();
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
