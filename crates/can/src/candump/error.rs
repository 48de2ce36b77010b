//! Why a line of a recording holds no frame.

use std::fmt;
use std::io;

/// The longest line that is looked at; the longest that can be meant, CAN XL with 2048 bytes, has about 4200.
pub(super) const LONGEST_LINE: usize = 16 * 1024;

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
    /// A form of candump's screen that cannot be read, or not for certain.
    Screen {
        /// The option that makes candump show it.
        option: &'static str,
        /// What it shows.
        shows: &'static str,
    },
    /// The line is longer than any frame can be; the file is probably no candump log at all.
    LineTooLong,
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
            LineProblem::Screen { option, shows } => {
                write!(f, "`candump {option}` shows {shows}; record with `candump -l`")
            }
            LineProblem::LineTooLong => {
                write!(
                    f,
                    "longer than {LONGEST_LINE} bytes; is this a candump log at all?"
                )
            }
        }
    }
}
