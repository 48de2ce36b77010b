//! What decodes the frames of a board that carry several taxels.

use crate::reading::Readings;

/// Decodes the frames of one board. It is made with the table of ids and asked once per frame, so
/// it must not allocate.
pub(crate) trait BoardDecoder {
    /// Reads a data frame with one of the ids it was entered with, and adds the readings of taxels
    /// of the layout.
    fn decode(&mut self, id: u16, data: &[u8], readings: &mut Readings) -> BoardFrame;

    /// Newest raw value of a channel that is no taxel of the hand; `None` where nothing was heard,
    /// or there is no such channel.
    fn auxiliary(&self, channel: u8) -> Option<u16>;
}

/// What a frame of a board was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BoardFrame {
    Readings,
    /// ... and the board has just calibrated a part of its skin anew, so that its baseline holds no longer.
    Recalibrated,
    Malformed,
}

/// In place of a module or taxel: there is none.
pub(crate) const NOBODY: u16 = u16::MAX;
