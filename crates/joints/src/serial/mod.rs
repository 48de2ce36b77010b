//! A bus on a real serial port, and the thread that runs it.

mod low_latency;
mod port;
mod reader;
mod scan;
mod serial_bus;
mod survey;

pub use port::{PortError, PortLatency};
pub use reader::{JointReader, JointSnapshot, PortState, PortStatus, StartError};
pub use scan::{FoundServo, scan};
pub use serial_bus::SerialBus;
pub use survey::{BusSurvey, SurveyedServo, survey};

use nix::time::{ClockId, clock_gettime};

/// `CLOCK_MONOTONIC`, nanoseconds: the clock of tactile frames.
pub(crate) fn now_ns() -> u64 {
    clock_gettime(ClockId::CLOCK_MONOTONIC)
        .map_or(0, |t| t.tv_sec() as u64 * 1_000_000_000 + t.tv_nsec() as u64)
}
