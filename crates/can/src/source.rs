//! The seam between a CAN bus and everything that reads it.

use crate::{ArrayCounters, CanFrame, ClockJumps};
use std::fmt;
use std::os::fd::BorrowedFd;
use std::sync::Arc;

/// A frame and the time it was received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Received {
    /// Receive time in nanoseconds: `CLOCK_MONOTONIC` for a live source, the recorded time for a recording.
    /// A live source takes it from the kernel's receive stamp, not from the moment of reading.
    pub t_ns: u64,
    /// The frame.
    pub frame: CanFrame,
}

/// Where CAN frames come from, and where commands to boards go.
///
/// A source never blocks and, once open, never allocates in `receive` or `send`. A recording is the exception: it may
/// wait for its disk, and a line that is longer than all before, or cannot be read, takes memory. A source survives the
/// loss of what is behind it: an interface that goes away is reopened by name, and meanwhile `receive` simply has nothing.
/// The caller waits for [`CanSource::wakeup`], then calls [`CanSource::receive`].
pub trait CanSource: Send {
    /// What to wait for before the next `receive`. Ask again after each call, since a source may change it.
    fn wakeup(&self) -> Wakeup<'_>;

    /// Moves the frames that are ready into the free capacity of `batch`, oldest first.
    ///
    /// `now_ns` is the caller's clock on the scale of [`Received::t_ns`]. Returns whether more may be ready,
    /// which is so when `batch` was filled.
    fn receive(&mut self, now_ns: u64, batch: &mut Vec<Received>) -> bool;

    /// Hands one frame to the bus, or says why that cannot be done now.
    fn send(&mut self, frame: &CanFrame) -> Result<(), SendError>;

    /// What has been received, lost and reported since the source was made.
    fn counters(&self) -> &SourceCounters;

    /// The state of what is behind the source; always up where that has none of its own.
    fn link(&self) -> LinkState {
        LinkState::Up
    }

    /// Whether no frame will ever come again; only so for a recording that has been played to its end.
    fn is_finished(&self) -> bool {
        false
    }

    /// Whether its times were measured; not so where a recording has none, whose frames are taken to follow each other on
    /// a full bus.
    fn has_times(&self) -> bool {
        true
    }

    /// Interfaces of a recording whose frames are not played, since they are another bus.
    fn left_out(&self) -> &[Arc<str>] {
        &[]
    }
}

/// What a caller waits for before it asks a source again: whichever comes first.
#[derive(Debug, Default, Clone, Copy)]
pub struct Wakeup<'a> {
    /// Wait until this is readable **or has an error**: the kernel reports a vanished CAN interface
    /// as an error without readability.
    pub fd: Option<BorrowedFd<'a>>,
    /// Wake at this time, nanoseconds on the scale of [`Received::t_ns`]: the next attempt to reopen, or the
    /// next frame of a recording.
    pub at_ns: Option<u64>,
}

/// Whether the bus can be reached.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum LinkState {
    /// There is no interface of that name; the source looks for it again and again.
    #[default]
    Absent,
    /// The interface exists and is down.
    Down,
    /// Frames can come.
    Up,
}

impl fmt::Display for LinkState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            LinkState::Absent => "absent",
            LinkState::Down => "down",
            LinkState::Up => "up",
        })
    }
}

/// The error state of a CAN controller, as its last error frame told it.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum BusState {
    /// Taking part in the bus; also the state before any error frame came.
    #[default]
    ErrorActive,
    /// An error counter went over 96.
    ErrorWarning,
    /// An error counter went over 127.
    ErrorPassive,
    /// Off the bus until the kernel restarts the controller (`restart-ms`).
    BusOff,
}

impl fmt::Display for BusState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            BusState::ErrorActive => "error-active",
            BusState::ErrorWarning => "error-warning",
            BusState::ErrorPassive => "error-passive",
            BusState::BusOff => "bus-off",
        })
    }
}

/// What a source has seen. Every count but `since_bus_off` starts at zero and only grows.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct SourceCounters {
    /// Frames delivered to the caller, error and remote frames included.
    pub received: u64,
    /// Frames the kernel dropped because this socket's queue was full (`SO_RXQ_OVFL`).
    pub lost_in_kernel: u64,
    /// Datagrams or lines that were not a frame, or not one a hand can send (CAN FD); messages of a pressure array that
    /// were refused.
    pub undecodable: u64,
    /// CAN FD frames among `undecodable`, where the source can tell.
    pub can_fd: u64,
    /// Remote frames among `received`.
    pub remote: u64,
    /// Error frames among `received`, by cause.
    pub errors: ErrorCauses,
    /// The controller's state by the newest error frame, or by the interface where that shows more.
    pub bus_state: BusState,
    /// How often `bus_state` has changed.
    pub state_changes: u64,
    /// The controller's transmit and receive error counters, as the newest error frame with such told them.
    pub error_counters: [u8; 2],
    /// Data frames received since the controller went bus-off; 0 while it is on the bus.
    pub since_bus_off: u64,
    /// How often the source was opened again after its interface was lost.
    pub reopens: u64,
    /// How often the link went down or its interface vanished.
    pub link_losses: u64,
    /// Frames sent.
    pub sent: u64,
    /// Frames that could not be sent. None where there is nobody to send to ([`SendError::ReceiveOnly`]): nothing is
    /// wrong there, and nothing to be mended.
    pub send_failures: u64,
    /// The last line of a recording that cannot be read any further; 0 where it can be, and from 1 otherwise.
    pub cut_off_line: u64,
    /// Where the time of a recording was not taken as it stands there.
    pub jumps: ClockJumps,
    /// What the socket of a pressure array has seen.
    pub array: ArrayCounters,
}

impl SourceCounters {
    /// Counts one frame that a source was to send.
    pub fn count_sent(&mut self, outcome: &Result<(), SendError>) {
        match outcome {
            Ok(()) => self.sent += 1,
            Err(_) => self.send_failures += 1,
        }
    }
}

/// Error frames by cause. One frame may name several causes, so the causes can add up to more than `frames`.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct ErrorCauses {
    /// Error frames received.
    pub frames: u64,
    /// Transmission timed out.
    pub tx_timeout: u64,
    /// Lost arbitration; harmless on a busy bus.
    pub lost_arbitration: u64,
    /// Controller problems: its own receive or transmit queue overflowed, or an error level changed.
    pub controller: u64,
    /// Frames the controller or driver dropped for want of space (its receive overflow flag).
    pub controller_overflow: u64,
    /// Protocol violations: bit, form or stuff errors.
    pub protocol: u64,
    /// Transceiver status.
    pub transceiver: u64,
    /// Nobody acknowledged a frame.
    pub no_acknowledge: u64,
    /// The controller went bus-off.
    pub bus_off: u64,
    /// Bus errors.
    pub bus_error: u64,
    /// The controller was restarted.
    pub restarted: u64,
}

/// Why a frame could not be sent.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// The source cannot send: a recording, for example.
    #[error("this CAN source only receives")]
    ReceiveOnly,
    /// The interface is absent or down; the caller may try again later.
    #[error("the CAN link is {0}")]
    LinkLost(LinkState),
    /// The transmit queue is full; the caller may try again later.
    #[error("the CAN transmit queue is full; raise it with `ip link set IFACE txqueuelen 100`")]
    QueueFull,
    /// Anything else the kernel said.
    #[error("the CAN frame could not be sent: {0}")]
    Io(#[from] std::io::Error),
}
