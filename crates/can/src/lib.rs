//! CAN frames and where they come from.
//!
//! One seam, [`CanSource`], and four sources behind it: SocketCAN, python-can's `udp_multicast`, a recording,
//! and memory. A source knows nothing of boards; a decoder knows nothing of sockets.

mod frame;
mod source;

pub use frame::{CanFrame, ERROR_FLAG, EXTENDED_FLAG, FrameError, REMOTE_FLAG};
pub use source::{BusState, CanSource, ErrorCauses, LinkState, Received, SendError, SourceCounters, Wakeup};
