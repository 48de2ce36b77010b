//! Recordings and scenes, played: through the daemon's pipeline without a daemon, onto buses, and into other files.
//!
//! What `taxel replay`, `convert`, `compress`, `eval` and others do with every frame; their arguments are `taxel`'s. As there,
//! errors are for people, and what they should know besides goes to stderr.

#![cfg_attr(not(test), deny(clippy::print_stdout, clippy::print_stderr))]

/// For people, on stderr, with the names that they gave files. Unlike the standard library's it does not panic where the
/// terminal is gone or the disk full.
#[macro_export]
macro_rules! eprintln {
    () => { $crate::eprintln!("") };
    ($($words:tt)*) => {{
        use std::io::Write;
        let line = $crate::stand_in::as_named(format!($($words)*));
        let _ = writeln!(std::io::stderr(), "{line}");
    }};
}

pub mod array_frames;
mod frame_file;
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
pub mod scene_input;
pub mod stand_in;
pub mod sweep;
pub mod target;
pub mod traffic;
pub mod traffic_output;
