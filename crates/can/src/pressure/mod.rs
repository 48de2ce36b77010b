//! Pressure arrays: a program of the sensor's own sends whole frames over a Unix datagram socket.
//!
//! A message is cut into CAN frames, so that everything behind [`CanSource`](crate::CanSource), recordings and replay
//! included, takes an array as it takes a board. A datagram comes whole or not at all, and there is no connection that
//! could hang: a sender that dies, stops or begins anew needs nothing here.

mod message;
mod sender;
mod socket;
#[cfg(test)]
mod tests;

pub use message::{ArrayHead, MAX_ARRAY_TAXELS, pressure_frames};
pub use sender::PressureSender;
pub use socket::{PressureRenewal, PressureSocket};

/// What a pressure array's socket has seen, in messages. Every count starts at zero and only grows.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct ArrayCounters {
    /// Messages that were taken.
    pub taken: u64,
    /// Messages that did not come, by their sequence.
    pub lost: u64,
    /// Messages taken that were measured more than a quarter of a second before.
    pub late: u64,
    /// Messages taken that say when they were measured.
    pub timed: u64,
    /// How long before they came these were measured, all together, nanoseconds.
    pub aged_ns: u64,
    /// How long before it came the newest of these was measured, nanoseconds.
    pub newest_age_ns: u64,
    /// How often the sequence began anew, or went back: another program sends, or two at once.
    pub restarts: u64,
    /// Refused: no message of a pressure array.
    pub foreign: u64,
    /// Refused: of another version of the protocol.
    pub version: u64,
    /// Refused: of other rows or columns.
    pub size: u64,
    /// Rows and columns of the last that was refused for that.
    pub other_size: [u16; 2],
    /// Refused: fewer or more counts than rows and columns say.
    pub torn: u64,
}

impl ArrayCounters {
    /// Messages that were refused.
    pub fn refused(&self) -> u64 {
        self.foreign + self.version + self.size + self.torn
    }
}
