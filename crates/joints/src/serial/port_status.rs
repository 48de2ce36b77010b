//! What is known of a serial port that is opened again and again.

use super::port::{PortError, PortLatency};
use std::path::{Path, PathBuf};
use taxel_can::monotonic_ns;

/// Whether the serial port is there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PortState {
    /// Not opened yet.
    Starting,
    /// Open.
    Open,
    /// Not there; it is tried again and again, at most half a second apart.
    Away {
        /// Why, in words for the user.
        reason: String,
        /// Since when, nanoseconds.
        since_ns: u64,
    },
}

/// What is known of the serial port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortStatus {
    /// The device as the configuration names it.
    pub path: PathBuf,
    /// What that name led to when it was opened last, such as `/dev/ttyUSB1` for a link; `None` before.
    pub device: Option<PathBuf>,
    /// Whether it is there.
    pub state: PortState,
    /// How fast it hands over what it receives; `None` before it was open.
    pub latency: Option<PortLatency>,
    /// How often it was opened; more than once means that it went away and came back.
    pub opened: u64,
    /// When another program last took bytes out of it that had come for this one, nanoseconds; `None` if none has since
    /// it was opened.
    pub taken_ns: Option<u64>,
    /// Whether nobody reads it any more, since the thread that did has panicked. The rest of this is from before.
    pub abandoned: bool,
}

impl PortStatus {
    pub(crate) fn starting(path: PathBuf) -> Self {
        Self {
            path,
            device: None,
            state: PortState::Starting,
            latency: None,
            opened: 0,
            taken_ns: None,
            abandoned: false,
        }
    }

    pub(crate) fn opened(&mut self, device: &Path, latency: PortLatency) {
        self.state = PortState::Open;
        self.device = Some(device.to_path_buf());
        self.latency = Some(latency);
        self.opened += 1;
        self.taken_ns = None;
    }

    /// It is not there, for this reason; since when does not change while it stays away.
    pub(crate) fn lost(&mut self, error: &PortError) {
        let since_ns = match self.state {
            PortState::Away { since_ns, .. } => since_ns,
            _ => monotonic_ns(),
        };
        self.state = PortState::Away {
            reason: error.to_string(),
            since_ns,
        };
    }
}
