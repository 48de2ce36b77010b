//! Tests of what the crate promises, as one program: linked once instead of once for each file.

mod accounting;
mod any_bytes;
mod boards;
mod bus_monitor;
mod condition_recordings;
mod condition_synthetic;
mod cyskin;
mod cyskin_library;
mod decoder;
mod discovery;
mod fit;
mod hands;
mod layout;
mod live_boards;
mod protocols;
mod recognise;
mod start_sequences;
mod support;
mod sweep;
mod sweep_config;
