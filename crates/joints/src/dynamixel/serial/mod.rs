//! A bus on a real serial port, and the thread that runs it.

mod scan;
mod serial_bus;
mod servo_reader;
mod servo_thread;
mod shared_servos;
mod survey;

pub use scan::{FoundServo, scan};
pub use serial_bus::SerialBus;
pub use servo_reader::ServoReader;
pub use shared_servos::ServoSnapshot;
pub use survey::{BusSurvey, SurveyedServo, survey};
