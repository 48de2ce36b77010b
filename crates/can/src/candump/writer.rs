//! candump's log format written.

use crate::CanFrame;
use crate::frame::FrameText;
use std::io::{self, Write};

/// Writes a candump log that every reader understands: six digits of time, no direction column.
#[derive(Debug)]
pub struct LogWriter<W> {
    output: W,
    /// A line; its beginning is that of the next one, where second and interface are the same.
    line: Vec<u8>,
    second: Option<u64>,
    interface: String,
    /// Where in `line` the microseconds stand, and where the frame.
    microseconds_at: usize,
    frame_at: usize,
}

impl<W: Write> LogWriter<W> {
    /// A writer onto `output`, which should be buffered: each frame is one small write.
    pub fn new(output: W) -> Self {
        Self {
            output,
            line: Vec::with_capacity(128),
            second: None,
            interface: String::new(),
            microseconds_at: 0,
            frame_at: 0,
        }
    }

    /// Writes one frame. The time is cut off to whole microseconds, so that the order of frames is kept.
    ///
    /// Fails as the output does, and with `InvalidInput` for an interface name that is empty or has
    /// blanks in it, which no reader could take apart.
    pub fn write(&mut self, t_ns: u64, interface: &str, frame: &CanFrame) -> io::Result<()> {
        let second = t_ns / 1_000_000_000;
        if self.second != Some(second) || self.interface != interface {
            self.begin(second, interface)?;
        }
        let microseconds = (t_ns % 1_000_000_000 / 1_000) as u32;
        self.line[self.microseconds_at..][..6].copy_from_slice(&six_digits(microseconds));
        self.line.truncate(self.frame_at);
        self.line.extend_from_slice(FrameText::of(frame).as_bytes());
        self.line.push(b'\n');
        self.output.write_all(&self.line)
    }

    /// Writes what the lines of a second and an interface begin with.
    fn begin(&mut self, second: u64, interface: &str) -> io::Result<()> {
        if interface.is_empty() || interface.bytes().any(|b| b.is_ascii_whitespace()) {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                format!("`{interface}` cannot be an interface name in a candump log: empty or with blanks"),
            ));
        }
        self.line.clear();
        write!(self.line, "({second:010}.")?;
        self.microseconds_at = self.line.len();
        write!(self.line, "000000) {interface} ")?;
        self.frame_at = self.line.len();
        self.second = Some(second);
        self.interface.clear();
        self.interface.push_str(interface);
        Ok(())
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

/// A number below a million.
#[inline]
fn six_digits(number: u32) -> [u8; 6] {
    let (thousands, ones) = (number / 1000, number % 1000);
    [
        thousands / 100,
        thousands / 10 % 10,
        thousands % 10,
        ones / 100,
        ones / 10 % 10,
        ones % 10,
    ]
    .map(|digit| b'0' + digit as u8)
}
