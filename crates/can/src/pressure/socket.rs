//! The daemon's end of the socket.

use super::message::{ArrayHead, HEADER, Refusal};
use crate::{CanFrame, CanSource, LinkState, Received, SendError, SourceCounters, Wakeup};
use std::any::Any;
use std::fmt;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixDatagram;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

/// Messages that are refused at once: a program that floods the socket must not hold up the rest.
const REFUSED_AT_ONCE: usize = 64;
/// A time of measurement that is older than this is of another clock.
const OLDEST_NS: u64 = 10_000_000_000;
/// A message that was measured longer ago than this is late.
const LATE_NS: u64 = 250_000_000;
/// A sequence that goes on further than this begins anew.
const MOST_LOST: u32 = 1 << 16;

/// A pressure array's socket as a source of frames.
pub struct PressureSocket {
    socket: UnixDatagram,
    size: [u16; 2],
    /// A message, and one byte more, which tells a longer one.
    buffer: Box<[u8]>,
    /// The message at work: its time, and its next frame.
    message: Option<(ArrayHead, u64, usize)>,
    last_sequence: Option<u32>,
    last_ns: u64,
    counters: SourceCounters,
    /// Another socket, where the path does not lead to this one any more.
    renewed: Option<Receiver<UnixDatagram>>,
    /// Kept until the source is dropped.
    _path: Box<dyn Any + Send>,
}

/// Gives a pressure array's source another socket, from whatever thread looks whether its path still leads to it.
#[derive(Debug)]
pub struct PressureRenewal(SyncSender<UnixDatagram>);

impl PressureRenewal {
    /// Has the source read this socket, which is bound, once it has taken what came by the one before.
    ///
    /// # Errors
    /// The system's, where the socket cannot be made non-blocking; `WouldBlock` where the source has not yet taken the one
    /// before, and `BrokenPipe` where it is gone.
    pub fn renew(&self, socket: OwnedFd) -> io::Result<()> {
        let socket = UnixDatagram::from(socket);
        socket.set_nonblocking(true)?;
        self.0.try_send(socket).map_err(|error| match error {
            TrySendError::Full(_) => io::ErrorKind::WouldBlock.into(),
            TrySendError::Disconnected(_) => io::ErrorKind::BrokenPipe.into(),
        })
    }
}

impl PressureSocket {
    /// Reads a datagram socket that is bound, for an array of so many rows and columns, at most
    /// [`MAX_ARRAY_TAXELS`](super::MAX_ARRAY_TAXELS) taxels. `path` is what keeps the socket's place, dropped with it.
    ///
    /// # Errors
    /// The system's, where the socket cannot be made non-blocking.
    pub fn new(socket: OwnedFd, [rows, columns]: [u16; 2], path: impl Any + Send) -> io::Result<Self> {
        let socket = UnixDatagram::from(socket);
        socket.set_nonblocking(true)?;
        let taxels = usize::from(rows) * usize::from(columns);
        Ok(Self {
            socket,
            size: [rows, columns],
            buffer: vec![0; HEADER + 2 * taxels + 1].into(),
            message: None,
            last_sequence: None,
            last_ns: 0,
            counters: SourceCounters::default(),
            renewed: None,
            _path: Box::new(path),
        })
    }

    /// What gives it another socket later.
    pub fn renewal(&mut self) -> PressureRenewal {
        let (renewal, renewed) = sync_channel(1);
        self.renewed = Some(renewed);
        PressureRenewal(renewal)
    }

    /// Goes on with another socket where it was given one; whether it was.
    fn renew(&mut self) -> bool {
        let renewed = self.renewed.as_ref().and_then(|renewed| renewed.try_recv().ok());
        let is_renewed = renewed.is_some();
        if let Some(socket) = renewed {
            self.socket = socket;
        }
        is_renewed
    }

    /// Counts a message that came at `now_ns`, and goes on with its frames.
    fn take(&mut self, head: ArrayHead, now_ns: u64) {
        let counters = &mut self.counters.array;
        counters.taken += 1;
        if let Some(last) = self.last_sequence.replace(head.sequence) {
            match head.sequence.wrapping_sub(last).wrapping_sub(1) {
                lost @ ..MOST_LOST => counters.lost += u64::from(lost),
                _ => counters.restarts += 1,
            }
        }
        let age_ns = match head.measured_ns {
            0 => None,
            measured_ns => now_ns.checked_sub(measured_ns).filter(|age| *age <= OLDEST_NS),
        };
        if let Some(age_ns) = age_ns {
            counters.late += u64::from(age_ns > LATE_NS);
            counters.timed += 1;
            counters.aged_ns += age_ns;
            counters.newest_age_ns = age_ns;
        }
        // Frames of a board come in the order of their times.
        let t_ns = age_ns.map_or(now_ns, |_| head.measured_ns).max(self.last_ns);
        self.last_ns = t_ns;
        self.message = Some((head, t_ns, 0));
    }

    fn refuse(&mut self, refusal: Refusal) {
        self.counters.undecodable += 1;
        let counters = &mut self.counters.array;
        match refusal {
            Refusal::Foreign => counters.foreign += 1,
            Refusal::Version => counters.version += 1,
            Refusal::Torn => counters.torn += 1,
            Refusal::Size(size) => {
                counters.size += 1;
                counters.other_size = size;
            }
        }
    }
}

impl fmt::Debug for PressureSocket {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = f.debug_struct("PressureSocket");
        text.field("size", &self.size).finish_non_exhaustive()
    }
}

impl CanSource for PressureSocket {
    fn wakeup(&self) -> Wakeup<'_> {
        Wakeup {
            fd: Some(self.socket.as_fd()),
            at_ns: None,
        }
    }

    fn receive(&mut self, now_ns: u64, batch: &mut Vec<Received>) -> bool {
        let mut refused = 0;
        loop {
            while let Some((head, t_ns, next)) = &mut self.message {
                if *next == head.frames() {
                    self.message = None;
                    break;
                }
                if batch.len() == batch.capacity() {
                    return true;
                }
                let counts = &self.buffer[HEADER..HEADER + 2 * head.taxels()];
                let frame = head.frame(*next, counts);
                *next += 1;
                self.counters.count(&frame);
                batch.push(Received { t_ns: *t_ns, frame });
            }
            let len = match self.socket.recv(&mut self.buffer) {
                Ok(len) => len,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(_) if self.renew() => continue,
                Err(_) => return false,
            };
            match ArrayHead::of_message(&self.buffer[..len], self.size) {
                Ok(head) => self.take(head, now_ns),
                Err(refusal) => {
                    self.refuse(refusal);
                    refused += 1;
                    if refused == REFUSED_AT_ONCE {
                        return true;
                    }
                }
            }
        }
    }

    fn send(&mut self, _frame: &CanFrame) -> Result<(), SendError> {
        Err(SendError::ReceiveOnly)
    }

    fn counters(&self) -> &SourceCounters {
        &self.counters
    }

    /// Always up: whether a program sends is to be seen by what comes.
    fn link(&self) -> LinkState {
        LinkState::Up
    }
}
