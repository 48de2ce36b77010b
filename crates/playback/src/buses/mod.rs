//! The CAN traffic of a recording: read, played onto buses, and written to files.

pub(crate) mod frame_file;
pub(crate) mod pass;
pub mod player;
pub(crate) mod recorded_buses;
pub mod target;
pub mod traffic;
pub mod traffic_output;
