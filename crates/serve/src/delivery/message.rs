//! A message on its way to readers.

use std::time::Instant;
use taxel_wire::Header;

/// The message that one tick made for a stream. Shared by all its readers; only the header's count
/// of skipped messages is their own.
#[derive(Debug)]
pub(crate) struct Message {
    /// Number of the tick, from 1; the difference between two is what a reader skipped. All streams
    /// count the same ticks, so a reader that changes from one to another goes on counting.
    pub(crate) tick: u64,
    /// When that tick was due.
    pub(crate) due: Instant,
    /// The header of a reader that skipped nothing; `None` where there is no message.
    pub(crate) header: Option<Header>,
    /// The payload.
    pub(crate) payload: Vec<u8>,
}
