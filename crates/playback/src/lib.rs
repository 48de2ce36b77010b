//! Recordings and scenes, played: through the daemon's pipeline without a daemon, onto buses, and into other files.
//!
//! What `taxel replay`, `convert`, `compress`, `eval` and others do with every frame; their arguments are `taxel`'s. As there,
//! errors are for people, and what they should know besides is said to them ([`remarks`]).

#![cfg_attr(not(test), deny(clippy::print_stdout, clippy::print_stderr))]

/// Says a line to people, if this process has not remarked it before ([`remarks::remark`]).
#[macro_export]
macro_rules! remark {
    ($($words:tt)*) => { $crate::remarks::remark(format!($($words)*)) };
}

/// Says a line to people, however often it was said before ([`remarks::say`]).
#[macro_export]
macro_rules! say {
    ($($words:tt)*) => { $crate::remarks::say(format!($($words)*)) };
}

pub mod array_frames;
mod bus_orders;
pub mod calibrated;
pub mod daemon_changes;
mod fitted;
mod frame_file;
pub mod head;
mod heard;
pub mod image_line;
pub mod image_output;
pub mod interrupt;
pub mod log_interfaces;
pub mod output_file;
mod pass;
pub mod pipeline;
pub mod player;
pub mod progress;
pub mod raw_line;
pub mod recorded;
mod recorded_buses;
pub mod remarks;
pub mod scene_input;
pub mod stand_in;
pub mod sweep;
pub mod target;
pub mod traffic;
pub mod traffic_output;
mod whole_frames;
