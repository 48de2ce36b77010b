//! A client's connection as the WebSocket reads and writes it: never waiting, and within what a client may send.

use crate::allowance::Allowance;
use std::io::{self, Read, Write};
use std::sync::Arc;
use std::time::Instant;
use tokio::net::TcpStream;

/// What the read of a client that sends too much fails with.
#[derive(Debug, thiserror::Error)]
#[error("sends too much")]
pub(crate) struct TooMuch;

/// A connection.
#[derive(Debug)]
pub(crate) struct Stream {
    socket: Arc<TcpStream>,
    allowance: Allowance,
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
            heard: now,
            taken: now,
        }
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let now = Instant::now();
        let most = self.allowance.left(now).min(buffer.len());
        if most == 0 {
            return Err(io::Error::other(TooMuch));
        }
        let bytes = self.socket.try_read(&mut buffer[..most])?;
        self.allowance.take(bytes);
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
