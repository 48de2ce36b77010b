//! candump's log format, every dialect of it, read and written.
//!
//! One frame per line: `(SECONDS.FRACTION) INTERFACE ID#DATA [R|T]`, as `candump -l`, `candump -L`,
//! python-can and canplayer write and read it; or as candump shows it on the screen,
//! `(SECONDS.FRACTION)  INTERFACE  ID   [LENGTH]  DATA`, where the time may be missing.

mod error;
mod line;
mod log_frame;
mod reader;
mod usual;
mod writer;

pub use error::{LineProblem, LogError};
pub use log_frame::{Direction, LogFrame, NumberedFrame};
pub use reader::{LogReader, MOST_INTERFACES};
pub use writer::LogWriter;

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::any_frame;
