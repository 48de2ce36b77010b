//! Recorded counts as what a pipeline takes: CAN traffic, frames of pressure arrays, or whole tactile frames.

pub mod array_frames;
pub mod fitted;
pub(crate) mod pauses;
pub mod sweep;
pub(crate) mod whole_frames;
