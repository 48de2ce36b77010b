//! A bus on a real serial port, and the thread that runs it.

mod low_latency;
mod port;
mod port_status;
mod scan;
mod serial_bus;
mod servo_reader;
mod survey;

pub(crate) use port::Port;
pub use port::{PortError, PortLatency};
pub use port_status::{PortState, PortStatus};
pub use scan::{FoundServo, scan};
pub use serial_bus::SerialBus;
pub use servo_reader::{ServoReader, ServoSnapshot, StartError};
pub use survey::{BusSurvey, SurveyedServo, survey};
