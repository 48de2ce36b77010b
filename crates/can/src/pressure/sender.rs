//! The other end of the socket, for simulators and recordings.

use super::message::{ArrayHead, HEADER};
use crate::clock::monotonic_ns;
use crate::{CanFrame, CanSource, LinkState, Received, SendError, SourceCounters, Wakeup};
use std::io;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};

/// Sends the frames of a pressure array ([`pressure_frames`](super::pressure_frames)) as the messages that they were cut
/// from. Nothing comes back.
#[derive(Debug)]
pub struct PressureSender {
    socket: UnixDatagram,
    path: PathBuf,
    /// The message that is being put together.
    message: Option<(ArrayHead, Vec<u8>)>,
    counters: SourceCounters,
}

impl PressureSender {
    /// Sends to the socket at this path.
    ///
    /// # Errors
    /// The system's, where nothing reads there.
    pub fn open(path: &Path) -> io::Result<Self> {
        let socket = UnixDatagram::unbound()?;
        socket.set_nonblocking(true)?;
        // Only to see whether anybody is there: a daemon may come and go.
        UnixDatagram::unbound()?.connect(path)?;
        Ok(Self {
            socket,
            path: path.into(),
            message: None,
            counters: SourceCounters::default(),
        })
    }

    /// Puts a frame to its message, which goes out with its last one.
    fn put(&mut self, frame: &CanFrame) -> Result<(), SendError> {
        let Some(id) = frame.standard_id().map(usize::from) else {
            return Ok(());
        };
        if id == 0 {
            self.message =
                ArrayHead::of_frame(frame.data()).map(|head| (head, vec![0; HEADER + 2 * head.taxels()]));
            return Ok(());
        }
        let Some((head, bytes)) = &mut self.message else {
            return Ok(());
        };
        let from = HEADER + 8 * (id - 1);
        if let Some(place) = bytes.get_mut(from..from + frame.data().len()) {
            place.copy_from_slice(frame.data());
        }
        if id + 1 != head.frames() {
            return Ok(());
        }
        let head = ArrayHead {
            measured_ns: monotonic_ns(),
            ..*head
        };
        bytes[..HEADER].copy_from_slice(&head.to_header());
        match self.socket.send_to(bytes, &self.path) {
            Ok(_) => {
                self.message = None;
                Ok(())
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Err(SendError::QueueFull),
            Err(error) => match error.kind() {
                io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused => {
                    Err(SendError::LinkLost(LinkState::Absent))
                }
                _ => Err(SendError::Io(error)),
            },
        }
    }
}

impl CanSource for PressureSender {
    fn wakeup(&self) -> Wakeup<'_> {
        Wakeup::default()
    }

    fn receive(&mut self, _now_ns: u64, _batch: &mut Vec<Received>) -> bool {
        false
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), SendError> {
        let result = self.put(frame);
        self.counters.count_sent(&result);
        result
    }

    fn counters(&self) -> &SourceCounters {
        &self.counters
    }
}
