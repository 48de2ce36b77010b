//! A client's connection as the WebSocket reads and writes it: never waiting, and within what a client may send.

use crate::allowance::{Allowance, PER_MESSAGE};
use std::io::{self, Read, Write};
use std::sync::Arc;
use std::time::Instant;
use tokio::net::TcpStream;

/// Bytes of a client that are read before it is another one's turn.
pub(crate) const A_TURN: usize = 4 << 10;

/// What the read of a client that sends too much fails with.
#[derive(Debug, thiserror::Error)]
#[error("sends too much")]
pub(crate) struct TooMuch;

/// A connection.
#[derive(Debug)]
pub(crate) struct Stream {
    socket: Arc<TcpStream>,
    allowance: Allowance,
    /// Bytes that are still read in this turn.
    turn: usize,
    /// When something last came, and when something was last taken.
    pub(crate) heard: Instant,
    pub(crate) taken: Instant,
}

impl Stream {
    pub(crate) fn new(socket: Arc<TcpStream>) -> Self {
        let now = Instant::now();
        Self {
            socket,
            allowance: Allowance::new(now),
            turn: A_TURN,
            heard: now,
            taken: now,
        }
    }

    /// Lets so much be read again as is in a turn.
    pub(crate) fn begin_turn(&mut self) {
        self.turn = A_TURN;
    }

    /// Whether there may be more to be read than a turn has.
    pub(crate) fn is_turn_over(&self) -> bool {
        self.turn == 0
    }

    /// The client has sent one more message.
    pub(crate) fn count_message(&mut self) {
        self.allowance.take(PER_MESSAGE);
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let now = Instant::now();
        let left = self.allowance.left(now);
        if left == 0 {
            return Err(io::Error::other(TooMuch));
        }
        if self.turn == 0 {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        let most = buffer.len().min(left).min(self.turn);
        let bytes = self.socket.try_read(&mut buffer[..most])?;
        self.allowance.take(bytes);
        self.turn -= bytes;
        self.heard = now;
        Ok(bytes)
    }
}

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = self.socket.try_write(bytes)?;
        self.taken = Instant::now();
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
