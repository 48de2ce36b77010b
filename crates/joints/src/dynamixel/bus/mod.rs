//! What is asked of the servos when, and what their answers mean: no I/O and no clock.
//!
//! [`Bus`] runs one cycle after the other. A cycle asks every servo that is alive for the twelve
//! bytes from Present PWM to Present Position, with a sync read or a fast sync read, and at most
//! one of them for something slower (voltage, temperature, hardware error, identity). It ends when
//! all have answered or at its deadline, with one `Result` per servo: what one servo does wrong
//! never hides another.

mod cycle;
mod outcomes;
mod pass;
mod reading;
mod servo;
mod slow;
mod writes;

pub(crate) use cycle::DEFAULT_MARGIN_NS;
pub use cycle::{Bus, BusCounters, FastState, Step};
pub(crate) use outcomes::Outcomes;
pub(crate) use reading::PRESENT_BYTES;
pub use reading::{JointReading, NoReading};
pub(crate) use servo::FACTORY_RETURN_DELAY_NS;
pub use servo::{MotorOff, ServoCounters, ServoIdentity, ServoState};
pub use writes::{MotorLost, WriteCommand, WriteError, WriteRefused, Written, check_goals};

/// Nanoseconds that so many bytes take on the wire: ten bits each.
pub fn wire_ns(bytes: usize, baud: u32) -> u64 {
    bytes as u64 * 10_000_000_000 / u64::from(baud.max(1))
}
