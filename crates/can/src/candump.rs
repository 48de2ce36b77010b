//! candump's log format, every dialect of it, read and written.
//!
//! One frame per line: `(SECONDS.FRACTION) INTERFACE ID#DATA [R|T]`, as `candump -l`, `candump -L`, python-can and
//! canplayer write and read it.

use crate::{CanFrame, ERROR_FLAG, EXTENDED_FLAG};
use std::fmt;
use std::io::{self, BufRead, Write};
use std::sync::Arc;

/// The longest line that is looked at; the longest that can be meant, CAN XL with 2048 bytes, has about 4200.
const LONGEST_LINE: usize = 16 * 1024;
/// Interface names that are kept for reuse; no recording has more buses than this.
const KNOWN_INTERFACES: usize = 64;

/// One frame of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogFrame {
    /// The recorded time in nanoseconds of the log's own clock, often the wall clock.
    pub t_ns: u64,
    /// The interface it was recorded on. Bytes that are not UTF-8 are replaced.
    pub interface: Arc<str>,
    /// The frame.
    pub frame: CanFrame,
    /// The direction column, where the log has one.
    pub direction: Option<Direction>,
}

/// Whether a recorded frame came to the recording machine or from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// `R`: received.
    Received,
    /// `T`: sent by the machine that recorded it.
    Transmitted,
}

/// Why a line of a log gives no frame.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The line is not a classic CAN frame in candump's notation.
    #[error("line {line}, column {column}: {problem}")]
    Line {
        /// Line number, from 1.
        line: u64,
        /// Byte of the line, from 1.
        column: usize,
        /// What is wrong there.
        problem: LineProblem,
    },
    /// The file cannot be read any further.
    #[error("after line {line}: {source}")]
    Io {
        /// Lines read so far.
        line: u64,
        /// What the system said.
        source: io::Error,
    },
}

/// What is wrong with a line of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineProblem {
    /// Something else was expected.
    Expected {
        /// What should be there.
        expected: &'static str,
        /// The byte that is there; `None` at the end of the line.
        found: Option<u8>,
    },
    /// The time does not fit into 64 bits of nanoseconds.
    TimeTooLarge,
    /// A three digit identifier over 7FF, or an eight digit one over 1FFFFFFF without being an error frame.
    IdTooLarge {
        /// The identifier.
        id: u32,
    },
    /// A CAN FD frame. Well formed, perhaps, but no classic frame.
    CanFd,
    /// A CAN XL frame. Well formed, perhaps, but no classic frame.
    CanXl,
    /// The line is longer than any frame can be; the file is probably no candump log at all.
    LineTooLong,
}

impl LineProblem {
    /// Whether the line holds a frame of a kind that is recognised but not handled, rather than nonsense.
    pub fn is_unsupported_frame(&self) -> bool {
        matches!(self, LineProblem::CanFd | LineProblem::CanXl)
    }
}

impl fmt::Display for LineProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LineProblem::Expected { expected, found } => {
                write!(f, "expected {expected}, found ")?;
                match found {
                    None => f.write_str("the end of the line"),
                    Some(byte) => write!(f, "`{}`", byte.escape_ascii()),
                }
            }
            LineProblem::TimeTooLarge => f.write_str("the time does not fit into 64 bits of nanoseconds"),
            LineProblem::IdTooLarge { id } => write!(
                f,
                "CAN id {id:X} is too large (3 digits: at most 7FF; 8 digits: at most 1FFFFFFF, \
                 or with bit 20000000 for an error frame)"
            ),
            LineProblem::CanFd => f.write_str("a CAN FD frame; only classic CAN is supported"),
            LineProblem::CanXl => f.write_str("a CAN XL frame; only classic CAN is supported"),
            LineProblem::LineTooLong => {
                write!(
                    f,
                    "longer than {LONGEST_LINE} bytes; is this a candump log at all?"
                )
            }
        }
    }
}

/// Reads a candump log, line by line, without ever stopping at a bad one.
///
/// As an iterator it gives each frame, and an error for each line that holds none; empty lines are skipped. After
/// the error of a line it goes on with the next; after an [`LogError::Io`] it ends. It allocates only when a line
/// is longer or an interface newer than all before.
#[derive(Debug)]
pub struct LogReader<R> {
    input: R,
    line: Vec<u8>,
    line_number: u64,
    interfaces: Vec<Arc<str>>,
    ended: bool,
}

impl<R: BufRead> LogReader<R> {
    /// A reader from the input's present position, which is taken for the start of line 1.
    pub fn new(input: R) -> Self {
        Self {
            input,
            line: Vec::with_capacity(256),
            line_number: 0,
            interfaces: Vec::with_capacity(KNOWN_INTERFACES),
            ended: false,
        }
    }

    /// Lines read so far.
    pub fn line_number(&self) -> u64 {
        self.line_number
    }

    /// Reads one line without its end into `self.line`; what is over the limit is dropped. `None` at the end of
    /// the input, else whether the line was complete.
    fn read_line(&mut self) -> io::Result<Option<bool>> {
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
                return Ok(any.then_some(complete));
            }
            any = true;
            let end = bytes.iter().position(|b| *b == b'\n');
            let part = &bytes[..end.unwrap_or(bytes.len())];
            let room = LONGEST_LINE - self.line.len();
            complete &= part.len() <= room;
            self.line.extend_from_slice(&part[..part.len().min(room)]);
            let used = part.len() + usize::from(end.is_some());
            self.input.consume(used);
            if end.is_some() {
                return Ok(Some(complete));
            }
        }
    }
}

impl<R: BufRead> Iterator for LogReader<R> {
    type Item = Result<LogFrame, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.ended {
            let complete = match self.read_line() {
                Ok(Some(complete)) => complete,
                Ok(None) => {
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
            let parsed = if complete {
                parse_line(&self.line)
            } else {
                Err((LONGEST_LINE + 1, LineProblem::LineTooLong))
            };
            match parsed {
                Ok(None) => {}
                Ok(Some(line)) => {
                    return Some(Ok(LogFrame {
                        t_ns: line.t_ns,
                        interface: interned(&mut self.interfaces, line.interface),
                        frame: line.frame,
                        direction: line.direction,
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
}

fn interned(known: &mut Vec<Arc<str>>, name: &[u8]) -> Arc<str> {
    if let Some(name) = known.iter().find(|k| k.as_bytes() == name) {
        return Arc::clone(name);
    }
    let name: Arc<str> = String::from_utf8_lossy(name).into();
    if known.len() < KNOWN_INTERFACES {
        known.push(Arc::clone(&name));
    }
    name
}

struct Line<'a> {
    t_ns: u64,
    interface: &'a [u8],
    frame: CanFrame,
    direction: Option<Direction>,
}

/// A column (from 1) and what is wrong there.
type Problem = (usize, LineProblem);

fn parse_line(bytes: &[u8]) -> Result<Option<Line<'_>>, Problem> {
    let mut cursor = Cursor { bytes, at: 0 };
    cursor.skip_blanks();
    if cursor.peek().is_none() {
        return Ok(None);
    }
    let t_ns = cursor.time()?;
    cursor.blanks("a blank after the time")?;
    let interface = cursor.word();
    if interface.is_empty() {
        return Err(cursor.expected("an interface name"));
    }
    cursor.blanks("a blank after the interface name")?;
    let frame = cursor.frame()?;
    let direction = cursor.direction()?;
    Ok(Some(Line {
        t_ns,
        interface,
        frame,
        direction,
    }))
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn eat(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    fn expected(&self, expected: &'static str) -> Problem {
        let found = self.peek();
        (self.at + 1, LineProblem::Expected { expected, found })
    }

    fn skip_blanks(&mut self) -> bool {
        let start = self.at;
        while self.peek().is_some_and(|b| b.is_ascii_whitespace()) {
            self.at += 1;
        }
        self.at > start
    }

    fn blanks(&mut self, expected: &'static str) -> Result<(), Problem> {
        if self.skip_blanks() {
            Ok(())
        } else {
            Err(self.expected(expected))
        }
    }

    fn word(&mut self) -> &'a [u8] {
        let start = self.at;
        while self.peek().is_some_and(|b| !b.is_ascii_whitespace()) {
            self.at += 1;
        }
        &self.bytes[start..self.at]
    }

    fn decimal_digit(&mut self) -> Option<u64> {
        let digit = self.peek().filter(u8::is_ascii_digit)?;
        self.at += 1;
        Some(u64::from(digit - b'0'))
    }

    fn hex_digit(&mut self) -> Option<u32> {
        let digit = char::from(self.peek()?).to_digit(16)?;
        self.at += 1;
        Some(digit)
    }

    /// `(SECONDS.FRACTION)` with any number of digits; those after the ninth are cut off.
    fn time(&mut self) -> Result<u64, Problem> {
        if !self.eat(b'(') {
            return Err(self.expected("`(` before the time"));
        }
        self.skip_blanks();
        let start = self.at + 1;
        let too_large = (start, LineProblem::TimeTooLarge);
        let mut seconds = self
            .decimal_digit()
            .ok_or_else(|| self.expected("the seconds of the time"))?;
        while let Some(digit) = self.decimal_digit() {
            seconds = seconds
                .checked_mul(10)
                .and_then(|s| s.checked_add(digit))
                .ok_or(too_large)?;
        }
        let mut nanoseconds = 0;
        if self.eat(b'.') {
            let mut unit = 100_000_000;
            let mut digits = 0;
            while let Some(digit) = self.decimal_digit() {
                nanoseconds += digit * unit;
                unit /= 10;
                digits += 1;
            }
            if digits == 0 {
                return Err(self.expected("digits after the decimal point of the time"));
            }
        }
        if !self.eat(b')') {
            return Err(self.expected("`)` after the time"));
        }
        seconds
            .checked_mul(1_000_000_000)
            .and_then(|s| s.checked_add(nanoseconds))
            .ok_or(too_large)
    }

    fn frame(&mut self) -> Result<CanFrame, Problem> {
        let start = self.at;
        if self.word().contains(&b':') {
            return Err((start + 1, LineProblem::CanXl));
        }
        self.at = start;
        let raw_id = self.id()?;
        if !self.eat(b'#') {
            return Err(self.expected("`#` after the CAN id of 3 or 8 hexadecimal digits"));
        }
        if self.peek() == Some(b'#') {
            return Err((self.at + 1, LineProblem::CanFd));
        }
        if matches!(self.peek(), Some(b'R' | b'r')) {
            if raw_id & ERROR_FLAG != 0 {
                return Err(self.expected("data, since an error frame cannot be a remote frame"));
            }
            self.at += 1;
            return self.remote(raw_id);
        }
        let mut data = [0; 8];
        let mut len = 0;
        while len < 8 {
            if len > 0 {
                self.eat(b'.');
            }
            let Some(high) = self.hex_digit() else { break };
            let low = self
                .hex_digit()
                .ok_or_else(|| self.expected("the second hexadecimal digit of a data byte"))?;
            data[len] = (high << 4 | low) as u8;
            len += 1;
        }
        if len == 8 {
            self.raw_dlc()?;
        }
        self.end_of_frame("up to 8 data bytes of two hexadecimal digits")?;
        Ok(if raw_id & ERROR_FLAG != 0 {
            CanFrame::error(raw_id, data)
        } else {
            frame_of_checked_parts(raw_id, &data[..len])
        })
    }

    /// The identifier with its flag bits.
    fn id(&mut self) -> Result<u32, Problem> {
        let column = self.at + 1;
        let (mut id, mut digits) = (0, 0);
        while digits < 8 {
            let Some(digit) = self.hex_digit() else { break };
            id = id << 4 | digit;
            digits += 1;
        }
        let too_large = Err((column, LineProblem::IdTooLarge { id }));
        match digits {
            3 if id > 0x7FF => too_large,
            3 => Ok(id),
            8 if id & !(ERROR_FLAG | 0x1FFF_FFFF) != 0 => too_large,
            8 if id & ERROR_FLAG != 0 => Ok(id),
            8 => Ok(id | EXTENDED_FLAG),
            _ => Err(self.expected("a CAN id of 3 or 8 hexadecimal digits")),
        }
    }

    fn remote(&mut self, raw_id: u32) -> Result<CanFrame, Problem> {
        let mut len = 0;
        if let Some(digit @ b'0'..=b'8') = self.peek() {
            self.at += 1;
            len = digit - b'0';
        }
        if len == 8 {
            self.raw_dlc()?;
        }
        self.end_of_frame("a length of 0 to 8 or nothing after `R`")?;
        let extended = raw_id & EXTENDED_FLAG != 0;
        let frame = CanFrame::remote(raw_id & 0x1FFF_FFFF, extended, len);
        Ok(frame.unwrap_or_else(|_| frame_of_checked_parts(raw_id, &[])))
    }

    /// `_9` to `_F`: the length code that was on the wire of a frame of 8 bytes. The frame has no room for it.
    fn raw_dlc(&mut self) -> Result<(), Problem> {
        if self.eat(b'_') && !self.hex_digit().is_some_and(|dlc| dlc > 8) {
            return Err(self.expected("a raw length code of 9 to F after `_`"));
        }
        Ok(())
    }

    fn end_of_frame(&self, expected: &'static str) -> Result<(), Problem> {
        match self.peek() {
            None => Ok(()),
            Some(byte) if byte.is_ascii_whitespace() => Ok(()),
            Some(_) => Err(self.expected(expected)),
        }
    }

    fn direction(&mut self) -> Result<Option<Direction>, Problem> {
        self.skip_blanks();
        let direction = match self.peek() {
            None => return Ok(None),
            Some(b'R' | b'r') => Direction::Received,
            Some(b'T' | b't') => Direction::Transmitted,
            Some(_) => return Err(self.expected("`R`, `T` or the end of the line")),
        };
        self.at += 1;
        self.skip_blanks();
        match self.peek() {
            None => Ok(Some(direction)),
            Some(_) => Err(self.expected("the end of the line")),
        }
    }
}

/// A frame whose identifier and length have been checked, so that making it cannot fail.
fn frame_of_checked_parts(raw_id: u32, data: &[u8]) -> CanFrame {
    match CanFrame::from_raw(raw_id, data) {
        Ok(frame) => frame,
        Err(_) => CanFrame::error(0, [0; 8]),
    }
}

/// Writes a candump log that every reader understands: six digits of time, no direction column.
#[derive(Debug)]
pub struct LogWriter<W> {
    output: W,
}

impl<W: Write> LogWriter<W> {
    /// A writer onto `output`, which should be buffered: each frame is one small write.
    pub fn new(output: W) -> Self {
        Self { output }
    }

    /// Writes one frame. The time is cut off to whole microseconds, so that the order of frames is kept.
    ///
    /// Fails as the output does, and with `InvalidInput` for an interface name that is empty or has blanks in it,
    /// which no reader could take apart.
    pub fn write(&mut self, t_ns: u64, interface: &str, frame: &CanFrame) -> io::Result<()> {
        if interface.is_empty() || interface.bytes().any(|b| b.is_ascii_whitespace()) {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                format!("`{interface}` cannot be an interface name in a candump log: empty or with blanks"),
            ));
        }
        let (seconds, microseconds) = (t_ns / 1_000_000_000, t_ns % 1_000_000_000 / 1_000);
        writeln!(
            self.output,
            "({seconds:010}.{microseconds:06}) {interface} {frame}"
        )
    }

    /// Hands buffered bytes on.
    pub fn flush(&mut self) -> io::Result<()> {
        self.output.flush()
    }

    /// The output back.
    pub fn into_inner(self) -> W {
        self.output
    }
}
