//! What is counted.

use std::sync::atomic::{AtomicU64, Ordering};

/// What a bridge has done, since it was started.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct Counts {
    /// Connections to a daemon.
    pub daemons: u64,
    /// Images and frames that the daemon passed over, since this program was slow.
    pub skipped: u64,
    /// Clients that were let in.
    pub clients: u64,
    /// Connections that were not: no WebSocket of this protocol, too slow to ask, or one too many.
    pub refused: u64,
    /// Clients that were let go, since they sent what is none of theirs to send, or took nothing.
    pub let_go: u64,
    /// Messages sent, each once for each client.
    pub messages: u64,
    /// Bytes of these.
    pub bytes: u64,
    /// Messages that a client was too slow for.
    pub lost: u64,
    /// Messages of clients that could not be done.
    pub faults: u64,
}

/// The same while it runs.
#[derive(Debug, Default)]
pub(crate) struct Counters {
    pub(crate) daemons: AtomicU64,
    pub(crate) skipped: AtomicU64,
    pub(crate) clients: AtomicU64,
    pub(crate) refused: AtomicU64,
    pub(crate) let_go: AtomicU64,
    pub(crate) messages: AtomicU64,
    pub(crate) bytes: AtomicU64,
    pub(crate) lost: AtomicU64,
    pub(crate) faults: AtomicU64,
}

/// Counts so many more.
pub(crate) fn add(counter: &AtomicU64, more: u64) {
    counter.fetch_add(more, Ordering::Relaxed);
}

impl Counters {
    pub(crate) fn read(&self) -> Counts {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Counts {
            daemons: read(&self.daemons),
            skipped: read(&self.skipped),
            clients: read(&self.clients),
            refused: read(&self.refused),
            let_go: read(&self.let_go),
            messages: read(&self.messages),
            bytes: read(&self.bytes),
            lost: read(&self.lost),
            faults: read(&self.faults),
        }
    }
}
