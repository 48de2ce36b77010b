//! The whole way from CAN frames to what is published, without I/O, without a clock and without
//! threads: bytes and time come in as arguments, so that a recording gives the same bytes every
//! time, live or offline.
//!
//! [`Engine`] has one scheme of verbs: what happens outside is told by `handle_frame`,
//! `handle_joints`, `handle_link` and `handle_time`; what it has to give is taken by `poll_output`
//! (what a tick felt: [`Frames`]), `poll_command` (a frame to send) and `poll_due_ns` (when it
//! wants to be asked again). The daemon, the doctor, the demo, `taxel compress`, `taxel eval` and
//! the tests all drive it so.
//!
//! Of frames, [`Display`] makes tactile images and IMAGE messages, [`RawFrames`] RAW messages.

mod change;
mod command;
mod config;
mod display;
mod engine;
mod frames;
mod raw;
mod recorded;
mod schedule;

pub use change::{Change, Recorded};
pub use command::Command;
pub use config::{EngineConfig, EngineJoints, TickConfig, TickMode};
pub use display::{Display, RegionError, resolve_region};
pub use engine::{Engine, EngineError};
pub use frames::Frames;
pub use raw::RawFrames;
pub use recorded::{run_recorded, run_whole_frames};
