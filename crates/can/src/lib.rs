//! CAN frames and where they come from.
//!
//! One seam, [`CanSource`], and four sources behind it: SocketCAN, python-can's `udp_multicast`, a
//! recording, and the socket of a pressure array. A source knows nothing of boards; a decoder knows nothing of sockets.
//! [`open`] makes a source of its [`SourceAddress`].

mod address;
mod bit_length;
mod candump;
mod clock;
mod drops;
mod error_frame;
mod filter;
mod frame;
mod kernel;
mod log;
mod log_clock;
mod merge;
mod open;
mod open_error;
mod pressure;
mod python_can;
mod socketcan;
mod source;
mod udp;

pub use address::{AddressError, SourceAddress};
pub use candump::{
    Direction, LineProblem, LogError, LogFrame, LogReader, LogWriter, MOST_INTERFACES, NumberedFrame,
};
pub use clock::{both_clocks_ns, monotonic_ns};
pub use filter::IdFilter;
pub use frame::{CanFrame, EXTENDED_FLAG, FrameError, id_text};
pub use log::{LogSource, interfaces};
pub use log_clock::{ClockJumps, LONGEST_PAUSE_NS, LogClock};
pub use merge::FrameMerge;
pub use open::{SourceOptions, open};
pub use open_error::OpenError;
pub use pressure::{
    ArrayCounters, ArrayHead, MAX_ARRAY_TAXELS, PressureRenewal, PressureSender, PressureSocket,
    pressure_frames,
};
pub use python_can::{Undecodable, decode as decode_python_can};
pub use socketcan::{SocketCan, SocketCanOptions};
pub use source::{BusState, CanSource, ErrorCauses, LinkState, Received, SendError, SourceCounters, Wakeup};
pub use udp::{UdpMulticast, UdpOptions};
