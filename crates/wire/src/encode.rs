//! What makes messages out of frames.

use crate::error::EncodeError;
use crate::header::Header;

/// Frames in, bytes out: makes the payload of a message from what is at hand at one instant.
///
/// `F` is what the messages are made of: the frames of a hand's engine for images and raw frames, a
/// touch or an estimate for programs beside the daemon. An encoder may keep a memory of the frames
/// before.
pub trait Encode<F> {
    /// Writes the payload of one message into `payload`, replacing what was there, and returns the
    /// message's header.
    ///
    /// Where it is called on a thread that must not wait, it neither allocates nor blocks once
    /// `payload` has grown to the longest message.
    fn encode(&mut self, of: &F, payload: &mut Vec<u8>) -> Result<Header, EncodeError>;
}
