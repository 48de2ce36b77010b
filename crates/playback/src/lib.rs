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
    ($($words:tt)*) => { $crate::remarks::say($crate::remarks::Priority::Info, format!($($words)*)) };
}

mod buses;
mod counts;
mod interfaces;
pub mod interrupt;
mod mcap;
pub mod newest_reading;
mod output;
pub mod pipeline;
pub mod progress;
pub mod remarks;
pub mod scene_input;
pub mod stand_in;

pub use buses::{player, target, traffic, traffic_output};
pub use counts::{array_frames, fitted, sweep};
pub use interfaces::log_interfaces;
pub use mcap::{calibrated, daemon_changes, head, recorded};
pub use output::{image_line, image_output, output_file, raw_line};
