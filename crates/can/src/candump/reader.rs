//! candump's log format read, line by line.

use super::error::{LONGEST_LINE, LineProblem, LogError};
use super::line::{parse_line, without_mark};
use super::log_frame::{LogFrame, NumberedFrame};
use super::usual::{interface_of_usual, parse_usual};
use crate::CanFrame;
use std::io::{self, BufRead};
use std::sync::Arc;

/// Bytes without a frame after which a file is given up: it is something else, or has no end.
const MOST_WITHOUT_FRAME: u64 = 64 << 20;
const ESCAPE: u8 = 0x1B;
/// Differences of times have three digits of seconds, unless nothing came for longer.
const FIRST_SECONDS_NS: u64 = 1_000_000_000_000;
const DIFFERENCES: &str = "its times are small and fall again and again: `candump -td` shows what passed since the frame \
                           before, and no times; record with `candump -l`";
/// A bit of a bus of 1 Mbit/s.
const BIT_NS: u64 = 1000;
/// Interfaces that a [`LogReader`] numbers; no recording has more buses than this. All beyond have this number.
pub const MOST_INTERFACES: usize = 64;

/// Reads a candump log, line by line, without stopping at a bad one.
///
/// As an iterator it gives each frame, and an error for each line that holds none; empty lines are
/// skipped. After the error of a line it goes on with the next; after an [`LogError::Io`] it ends. 64 MiB
/// without a frame are such an error: what holds them, such as `/dev/zero`, is no log. Differences of times
/// (`has_differences`) are another.
/// It allocates only when a line is longer or an interface newer than all before. [`LogReader::next_frame`] is the same for who
/// reads millions: to hand out a name costs as much as a fifth of reading its line.
#[derive(Debug)]
pub struct LogReader<R> {
    input: R,
    pub(super) line: Vec<u8>,
    line_number: u64,
    /// The interfaces that are told apart, and behind them the last one that is not.
    interfaces: Vec<Arc<str>>,
    /// Bytes read since the last frame.
    without_frame: u64,
    /// Time of the last frame.
    last_ns: u64,
    without_time: u64,
    frames: u64,
    /// How often a time was less than half of the one before, where both are of the first seconds of a clock.
    falls: u64,
    ended: bool,
}

/// What was read of a log.
enum Read {
    /// A frame, off a line that needed no further look.
    Frame(NumberedFrame),
    /// A line, and whether it was short enough to be kept whole.
    Line {
        complete: bool,
    },
    End,
}

impl<R: BufRead> LogReader<R> {
    /// A reader from the input's present position, which is taken for the start of line 1.
    pub fn new(input: R) -> Self {
        Self {
            input,
            line: Vec::with_capacity(256),
            line_number: 0,
            interfaces: Vec::with_capacity(MOST_INTERFACES + 1),
            without_frame: 0,
            last_ns: 0,
            without_time: 0,
            frames: 0,
            falls: 0,
            ended: false,
        }
    }

    /// What it reads.
    pub fn input(&self) -> &R {
        &self.input
    }

    /// Lines read so far.
    pub fn line_number(&self) -> u64 {
        self.line_number
    }

    /// Frames so far that had no time; see [`LogFrame::t_ns`].
    pub fn without_time(&self) -> u64 {
        self.without_time
    }

    /// Whether its times seem to be what passed since the frame before (`candump -td`): they are small and fall again and
    /// again. Those since the first frame (`candump -tz`) rise.
    fn has_differences(&self) -> bool {
        self.falls >= 3 && self.falls >= self.frames / 200
    }

    /// The time of a frame; one that has none takes as long as its bits do.
    fn time_of(&mut self, t_ns: Option<u64>, frame: &CanFrame) -> u64 {
        self.frames += 1;
        match t_ns {
            Some(t_ns) => {
                self.falls += u64::from(self.last_ns < FIRST_SECONDS_NS && t_ns < self.last_ns / 2);
                self.last_ns = t_ns;
            }
            None => {
                self.without_time += 1;
                self.last_ns = self.last_ns.saturating_add(u64::from(frame.bits()) * BIT_NS);
            }
        }
        self.last_ns
    }

    /// The interface of this number, of a frame that was read last or before. Those beyond the first [`MOST_INTERFACES`] have
    /// one number, which is that of the last one.
    pub fn interface(&self, number: usize) -> &Arc<str> {
        &self.interfaces[number]
    }

    /// The next frame, or why there is none in the next line, as the iterator gives it.
    pub fn next_frame(&mut self) -> Option<Result<NumberedFrame, LogError>> {
        while !self.ended {
            let complete = match self.read_line() {
                Ok(Read::Frame(frame)) => {
                    self.line_number += 1;
                    self.without_frame = 0;
                    return Some(Ok(frame));
                }
                Ok(Read::Line { complete }) => complete,
                Ok(Read::End) => {
                    self.ended = true;
                    return None;
                }
                Err(source) => {
                    self.ended = true;
                    return Some(Err(LogError::Io {
                        line: self.line_number,
                        source,
                    }));
                }
            };
            self.line_number += 1;
            if self.line.contains(&ESCAPE) {
                remove_colours(&mut self.line);
            }
            let parsed = if complete {
                parse_line(without_mark(&self.line, self.line_number))
            } else {
                Err((LONGEST_LINE + 1, LineProblem::LineTooLong))
            };
            match parsed {
                Ok(None) => {}
                Ok(Some(line)) => {
                    self.without_frame = 0;
                    let (t_ns, frame, direction) = (line.t_ns, line.frame, line.direction);
                    let interface = number(&mut self.interfaces, line.interface);
                    let t_ns = self.time_of(t_ns, &frame);
                    if self.has_differences() {
                        self.ended = true;
                        return Some(Err(LogError::Io {
                            line: self.line_number,
                            source: io::Error::new(io::ErrorKind::InvalidData, DIFFERENCES),
                        }));
                    }
                    return Some(Ok(NumberedFrame {
                        t_ns,
                        interface,
                        frame,
                        direction,
                    }));
                }
                Err((column, problem)) => {
                    return Some(Err(LogError::Line {
                        line: self.line_number,
                        column,
                        problem,
                    }));
                }
            }
        }
        None
    }

    /// Passes over the next line if it is one of an interface of which nothing more is wanted, and says which that is. It may
    /// be no frame. Lines that `candump -l` does not write are never passed over.
    ///
    /// To know which interfaces a recording has takes a third of the time of reading it.
    pub fn pass_over<'n>(&mut self, unwanted: &'n [Arc<str>]) -> Option<&'n Arc<str>> {
        let bytes = self.input.fill_buf().ok().filter(|_| !self.ended)?;
        let len = memchr::memchr(b'\n', bytes)?;
        let interface = interface_of_usual(&bytes[..len])?;
        let name = unwanted.iter().find(|name| name.as_bytes() == interface)?;
        self.input.consume(len + 1);
        self.line_number += 1;
        Some(name)
    }

    /// Reads one line without its end into `self.line`; what is over the limit is dropped.
    fn read_line(&mut self) -> io::Result<Read> {
        self.line.clear();
        let mut any = false;
        let mut complete = true;
        loop {
            let bytes = match self.input.fill_buf() {
                Ok(bytes) => bytes,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(e),
            };
            if bytes.is_empty() {
                return Ok(if any { Read::Line { complete } } else { Read::End });
            }
            let end = memchr::memchr(b'\n', bytes);
            if let Some(end) = end.filter(|_| !any)
                && let Some(line) = parse_usual(&bytes[..end])
            {
                self.last_ns = line.t_ns.unwrap_or(self.last_ns);
                let frame = NumberedFrame {
                    t_ns: self.last_ns,
                    interface: number(&mut self.interfaces, line.interface),
                    frame: line.frame,
                    direction: line.direction,
                };
                self.input.consume(end + 1);
                return Ok(Read::Frame(frame));
            }
            any = true;
            let part = &bytes[..end.unwrap_or(bytes.len())];
            let room = LONGEST_LINE - self.line.len();
            complete &= part.len() <= room;
            self.line.extend_from_slice(&part[..part.len().min(room)]);
            let used = part.len() + usize::from(end.is_some());
            self.input.consume(used);
            self.without_frame += used as u64;
            if self.without_frame > MOST_WITHOUT_FRAME {
                let mib = MOST_WITHOUT_FRAME >> 20;
                return Err(io::Error::other(format!(
                    "{mib} MiB without a CAN frame; this is no candump log"
                )));
            }
            if end.is_some() {
                return Ok(Read::Line { complete });
            }
        }
    }
}

impl<R: BufRead> Iterator for LogReader<R> {
    type Item = Result<LogFrame, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        let read = self.next_frame()?;
        Some(read.map(|frame| LogFrame {
            t_ns: frame.t_ns,
            interface: Arc::clone(self.interface(frame.interface)),
            frame: frame.frame,
            direction: frame.direction,
        }))
    }
}

/// Takes out what `candump -c` colours a line with: `ESC [ NUMBER m`.
fn remove_colours(line: &mut Vec<u8>) {
    let mut inside = false;
    line.retain(|byte| {
        inside |= *byte == ESCAPE;
        let keep = !inside;
        inside &= *byte != b'm';
        keep
    });
}

/// The number of an interface among the known ones, which it joins.
fn number(known: &mut Vec<Arc<str>>, name: &[u8]) -> usize {
    if let Some(number) = known.iter().position(|known| known.as_bytes() == name) {
        return number;
    }
    known.truncate(MOST_INTERFACES);
    known.push(String::from_utf8_lossy(name).into());
    known.len() - 1
}
