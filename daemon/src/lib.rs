//! The taxeld daemon as a library: tick thread, sockets and supervision around an engine.
//!
//! `taxeld` is this and a `main`; `taxel demo` runs the same daemon inside its own process, and
//! `taxel compress` runs the same [`taxel_engine::Engine`] without any of the rest.

mod arguments;
mod check;
mod claims;
mod clients;
mod control;
mod daemon;
mod descriptors;
mod gather;
mod image_maker;
mod joints;
pub mod log;
mod out_of_use;
mod overruns;
mod realtime;
mod recent;
mod reload;
pub mod service_manager;
mod snapshot;
mod sockets;
mod sources;
mod start;
mod start_error;
mod state;
mod status;
pub mod stdout;
mod supervise;
mod tick;

pub use arguments::Arguments;
pub use check::{check, left_to_service};
pub use daemon::Daemon;
pub use descriptors::{MORE_FILES, TooFewFiles};
pub use realtime::set_fifo;
pub use sources::{left_out, open_array, untimed};
pub use start_error::StartError;
pub use taxel_config::{self as config, Config, ConfigError};
pub use taxel_serve::SocketPathError;
