//! A message's packet for one reader.

use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::time::Instant;
use taxel_wire::HEADER_LEN;

/// What is sent to one reader's socket before the message's payload, by whichever thread sends it.
#[derive(Debug)]
pub(crate) struct Packet {
    pub(crate) socket: Arc<OwnedFd>,
    pub(crate) header: [u8; HEADER_LEN],
    /// When it was sent, if the socket took it at once.
    pub(crate) sent: Option<Instant>,
}
