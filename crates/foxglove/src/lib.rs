//! A running hand live in Foxglove, Lichtblick and whatever else speaks their WebSocket protocol, with the topics and
//! messages of a recording.
//!
//! Two threads: one reads the daemon, as any subscriber, and makes messages; one serves the clients and waits for none of
//! them. A client that is slow loses its oldest messages, and one that asks too much or takes nothing is let go; neither
//! holds up another one, or the daemon. The protocol is <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>.

mod allowance;
mod client;
mod counts;
mod daemon;
mod flight;
mod handshake;
mod hub;
mod protocol;
mod queue;
mod remarks;
mod serve;
mod stream;

pub use counts::Counts;
pub use serve::{Plan, ServeError, serve};
