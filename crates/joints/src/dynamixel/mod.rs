//! Dynamixel servos on a serial bus, read by a thread of their own.
//!
//! [`protocol2`] is Dynamixel Protocol 2.0 as bytes, [`bus`] decides what is asked when; neither
//! does I/O or holds a clock. `serial` runs a bus on a real port.

pub mod bus;
mod config;
pub mod protocol2;
pub mod registers;
mod serial;

pub use config::{DynamixelConfig, FastSyncRead, ServoConfig};
pub use serial::{BusSurvey, FoundServo, SerialBus, ServoReader, ServoSnapshot, SurveyedServo, scan, survey};
