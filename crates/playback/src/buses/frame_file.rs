//! A file of CAN traffic while it is read, frame by frame.

use super::traffic::{BLOCK, Traffic};
use crate::mcap::daemon_changes::{DaemonChange, DaemonChanges};
use crate::mcap::recorded::rest;
use crate::progress::Progress;
use anyhow::{Context, anyhow, bail};
use std::fs::File;
use std::io::{BufReader, Seek};
use std::path::Path;
use std::sync::Arc;
use taxel_can::{LogError, LogReader, MOST_INTERFACES, NumberedFrame, Received};
use taxel_hand::plural;
use taxel_recorder::CanReader;

/// Frames between two looks at how far a file is read.
const SHOWN: u64 = 4096;

/// A file of traffic while it is read, one frame after the other.
pub(crate) struct FrameFile<'a> {
    path: &'a Path,
    lines: Lines,
    interfaces: Interfaces<'a>,
    frames: u64,
    /// How long it is.
    bytes: u64,
}

/// What stands at one place of a file.
pub(crate) enum Entry {
    /// An interface that was not met before, where every one is asked for. Its place is the number of those before it.
    Interface(Arc<str>),
    /// A frame, error frames too, and the place of its interface among those asked for.
    Frame(Option<usize>, Received),
    /// A line that is no classic CAN frame.
    NoFrame,
}

/// The interfaces of a file.
struct Interfaces<'a> {
    /// Those that are asked for; every one where nothing is said.
    names: Option<&'a [String]>,
    /// What was met, by the numbers that the reader gives.
    met: Vec<Option<Interface>>,
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
    /// A frame of the interface of this number and name; before it its interface, where that is new and every one is asked for.
    fn entry(&mut self, number: usize, name: &Arc<str>, received: Received) -> anyhow::Result<Entry> {
        let place = match self.met.get_mut(number) {
            Some(Some(known)) => {
                known.frames += 1;
                known.place
            }
            _ => return self.first_entry(number, name, received),
        };
        Ok(Entry::Frame(place, received))
    }

    /// The first frame of an interface.
    fn first_entry(&mut self, number: usize, name: &Arc<str>, received: Received) -> anyhow::Result<Entry> {
        let place = match self.names {
            Some(names) => names.iter().position(|wanted| **wanted == **name),
            None => Some(self.met.iter().flatten().count()),
        };
        if number < MOST_INTERFACES {
            self.met.resize_with(self.met.len().max(number + 1), || None);
            let (name, frames) = (Arc::clone(name), 1);
            self.met[number] = Some(Interface { name, place, frames });
        } else if self.names.is_none() {
            bail!("more than {MOST_INTERFACES} interfaces; no hand has as many buses");
        }
        let frame = Entry::Frame(place, received);
        if self.names.is_some() {
            return Ok(frame);
        }
        self.held = Some(frame);
        Ok(Entry::Interface(Arc::clone(name)))
    }

    /// What was met of those that were not asked for, in words.
    fn left_out(&self) -> Vec<String> {
        let met = self.met.iter().flatten();
        let left_out = met.filter(|interface| interface.place.is_none());
        left_out
            .map(|interface| format!("{} of {}", plural(interface.frames, "frame"), interface.name))
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
            remark!(
                "taxel: {}: {} without a classic CAN frame; the first: {first}",
                path.display(),
                plural(self.lines, "line")
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
    Mcap(Box<CanReader>, Option<DaemonChanges>),
}

impl<'a> FrameFile<'a> {
    /// From the beginning, of these interfaces, or of all.
    pub(crate) fn open(traffic: &'a Traffic, names: Option<&'a [String]>) -> anyhow::Result<Self> {
        Self::open_with(traffic, names, None)
    }

    /// The same, and of an MCAP recording what its daemon did meanwhile.
    pub(crate) fn open_with(
        traffic: &'a Traffic,
        names: Option<&'a [String]>,
        changes: Option<DaemonChanges>,
    ) -> anyhow::Result<Self> {
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
            false => {
                let others = changes.as_ref().map_or(&[][..], |_| &DaemonChanges::TOPICS);
                Lines::Mcap(Box::new(CanReader::open_with(path, others)?), changes)
            }
        };
        Ok(Self {
            path,
            lines,
            interfaces: Interfaces {
                names,
                met: Vec::new(),
                held: None,
            },
            frames: 0,
            bytes: traffic.bytes(),
        })
    }

    /// What comes next, or nothing at the end. It is an error that no frame came until then.
    #[inline]
    pub(crate) fn next_entry(&mut self) -> anyhow::Result<Option<Entry>> {
        if self.interfaces.held.is_some() {
            return Ok(self.interfaces.held.take());
        }
        let entry = match &mut self.lines {
            Lines::Candump { log, left_out, .. } => match log.next_frame() {
                None => return self.end(),
                Some(Ok(NumberedFrame {
                    t_ns,
                    interface,
                    frame,
                    ..
                })) => {
                    let name = log.interface(interface);
                    self.interfaces.entry(interface, name, Received { t_ns, frame })
                }
                Some(Err(error @ LogError::Line { .. })) => {
                    left_out.add(error);
                    Ok(Entry::NoFrame)
                }
                Some(Err(error)) => Err(error.into()),
            },
            Lines::Mcap(reader, changes) => match reader.next_frame_with(&mut |topic, wall_ns, data| {
                if let Some(changes) = changes {
                    changes.take(topic, wall_ns, data);
                }
            })? {
                None => return self.end(),
                Some((bus, received)) => {
                    self.frames += 1;
                    self.interfaces.entry(bus, &reader.names()[bus], received)
                }
            },
        };
        match entry {
            Ok(entry) => Ok(Some(entry)),
            Err(error) => Err(error).with_context(|| self.path.display().to_string()),
        }
    }

    /// Shows every frame as it stands there, error frames too: the name of its bus, its time on the clock that the recording
    /// has times of, which for an MCAP recording is the wall clock, and the frame. Nothing stands between frame and file: an
    /// entry for each would be a tenth of a conversion's time.
    pub(crate) fn copy(
        mut self,
        take: &mut dyn FnMut(&str, u64, &Received) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let progress = Progress::bytes(self.bytes);
        match &mut self.lines {
            Lines::Candump { log, left_out, file } => {
                while let Some(line) = log.next_frame() {
                    match line {
                        Ok(NumberedFrame {
                            t_ns,
                            interface,
                            frame,
                            ..
                        }) => {
                            take(log.interface(interface), t_ns, &Received { t_ns, frame })?;
                            self.frames += 1;
                        }
                        Err(error @ LogError::Line { .. }) => left_out.add(error),
                        Err(error) => return Err(error).with_context(|| self.path.display().to_string()),
                    }
                    if self.frames.is_multiple_of(SHOWN)
                        && let Some(position) = file.as_mut().and_then(|file| file.stream_position().ok())
                    {
                        progress.advance_to(position);
                    }
                }
            }
            Lines::Mcap(reader, _) => {
                while let Some((bus, received)) = reader.next_frame()? {
                    let wall_ns = reader.wall_ns(received.t_ns);
                    take(&reader.names()[bus], wall_ns, &received)?;
                    self.frames += 1;
                    if self.frames.is_multiple_of(SHOWN) {
                        progress.advance_to(reader.position());
                    }
                }
            }
        }
        if self.frames == 0 {
            return Err(self.nothing());
        }
        self.tell();
        self.tell_left_out_lines();
        Ok(())
    }

    fn end(&mut self) -> anyhow::Result<Option<Entry>> {
        match self.interfaces.met.is_empty() {
            true => Err(self.nothing()),
            false => Ok(None),
        }
    }

    /// That there is no frame in it, and why the first line is none.
    fn nothing(&mut self) -> anyhow::Error {
        let problem = match &mut self.lines {
            Lines::Candump { left_out, .. } => left_out.first.take(),
            Lines::Mcap(..) => None,
        };
        let nothing = format!("{}: no CAN frame in it", self.path.display());
        match problem {
            Some(problem) => anyhow!(problem).context(nothing),
            None => anyhow!(nothing),
        }
    }

    /// What the daemon did next, of what stands before the entry that was given last; its time is on the clock of the frames.
    pub(crate) fn next_change(&mut self) -> Option<DaemonChange> {
        match &mut self.lines {
            Lines::Mcap(_, Some(changes)) => changes.next(),
            _ => None,
        }
    }

    /// The number of the line, or of the frame, that was given last.
    pub(crate) fn number(&self) -> u64 {
        match &self.lines {
            Lines::Candump { log, .. } => log.line_number(),
            Lines::Mcap(..) => self.frames,
        }
    }

    /// Bytes read so far, where that is known.
    pub(crate) fn position(&mut self) -> Option<u64> {
        match &mut self.lines {
            Lines::Candump { file, log, .. } => {
                let position = file.as_mut()?.stream_position().ok()?;
                Some(position.saturating_sub(log.input().buffer().len() as u64))
            }
            Lines::Mcap(reader, _) => Some(reader.position()),
        }
    }

    /// Where the frame that was given last is of another hand than the first ones: what is to be said where only those are
    /// wanted.
    pub(crate) fn another_hand(&self) -> Option<String> {
        let Lines::Mcap(reader, _) = &self.lines else {
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
            Lines::Candump { log, .. } if log.without_time() > 0 => remark!(
                "taxel: {path}: {} frames have no time, and are taken to follow each other on a full bus; `candump -l` keeps times",
                log.without_time()
            ),
            Lines::Candump { .. } => {}
            Lines::Mcap(reader, _) => tell_left_out(self.path, reader),
        }
        let left_out = self.interfaces.left_out();
        if !left_out.is_empty() {
            remark!("taxel: {path}: left out: {}", left_out.join(", "));
        }
    }
}

/// Says what of a recording is not there.
fn tell_left_out(path: &Path, reader: &CanReader) {
    let path = path.display();
    for sentence in reader.left_out() {
        remark!("taxel: {path}: {sentence}");
    }
    if reader.lost() > 0 {
        remark!(
            "taxel: {path}: the recorder lost {}",
            plural(reader.lost(), "frame")
        );
    }
    if reader.undecodable() > 0 {
        remark!(
            "taxel: {path}: {} messages of {} are not what they should be, and left out",
            reader.undecodable(),
            taxel_recorder::Topic::Can.name()
        );
    }
}
