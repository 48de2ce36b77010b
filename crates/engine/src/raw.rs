//! What a viewer or recorder is given of a tick: every taxel as its board sent it, and what
//! conditioning made of it.

use crate::frames::Frames;
use taxel_wire::{Encode, EncodeError, Header};

/// Makes RAW messages of what ticks felt.
#[derive(Debug, Default, Clone, Copy)]
pub struct RawFrames;

impl Encode<Frames> for RawFrames {
    fn encode(&mut self, frames: &Frames, payload: &mut Vec<u8>) -> Result<Header, EncodeError> {
        let Frames {
            tactile,
            force,
            baseline,
            ..
        } = frames;
        taxel_wire::encode_raw_payload(tactile, force, Some(baseline), payload)?;
        Ok(Header::of_frame(tactile, force, payload.len()))
    }
}
