//! Potentiometers: a microcontroller that prints its converter's counts as lines on a serial port.
//!
//! A line is numbers in the order of the channels, such as `512,498`, or names with numbers, such as `p0 512 p1 498` or
//! `p0:512 p1:498` (docs/protocols.md, "Potentiometers").

mod config;
mod lines;
mod reader;

pub(crate) use config::READINGS_KEPT;
pub use config::{AnalogueConfig, AnalogueJointConfig, Channel};
pub use lines::{AnalogueCounters, AnalogueLines, HeardChannel, NoAngle};
pub use reader::{AnalogueReader, AnalogueSnapshot};
