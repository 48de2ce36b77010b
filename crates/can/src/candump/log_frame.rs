//! What a line of a recording holds.

use crate::CanFrame;
use std::sync::Arc;

/// One frame of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogFrame {
    /// The recorded time in nanoseconds of the log's own clock, often the wall clock. A frame without a
    /// time follows the one before it as soon as a bus of 1 Mbit/s lets it.
    pub t_ns: u64,
    /// The interface it was recorded on. Bytes that are not UTF-8 are replaced.
    pub interface: Arc<str>,
    /// The frame.
    pub frame: CanFrame,
    /// The direction column, where the log has one.
    pub direction: Option<Direction>,
}

/// A frame of a recording, whose interface its reader knows by a number ([`LogReader::interface`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NumberedFrame {
    /// See [`LogFrame::t_ns`].
    pub t_ns: u64,
    /// The number of its interface.
    pub interface: usize,
    /// The frame.
    pub frame: CanFrame,
    /// See [`LogFrame::direction`].
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
