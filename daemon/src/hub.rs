//! From the tick thread to the subscribers: the newest message of a stream, encoded once, without waiting and without
//! allocating.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use taxel_wire::{EncodeError, Header};
use tokio::sync::watch;

/// The message that one tick made for a stream. Shared by all its subscribers; only the header's count of skipped
/// messages is their own.
#[derive(Debug, Default)]
pub(crate) struct Published {
    /// Number of the tick, from 1; the difference between two is what a reader skipped. All streams count the same
    /// ticks, so a reader that changes from one to another goes on counting.
    pub(crate) tick: u64,
    /// The header of a reader that skipped nothing; `None` where there is no message.
    pub(crate) header: Option<Header>,
    /// The payload.
    pub(crate) payload: Vec<u8>,
}

/// The tick thread's end of a stream.
#[derive(Debug)]
pub(crate) struct Publisher {
    newest: watch::Sender<Arc<Published>>,
    /// Buffers to encode into. One is in the watch, one may be in the hand of the socket thread.
    pool: Vec<Arc<Published>>,
    unpublished: u64,
    readers: Arc<AtomicUsize>,
}

/// The socket thread's end; every subscriber has a clone of it.
#[derive(Debug, Clone)]
pub(crate) struct Newest {
    pub(crate) receiver: watch::Receiver<Arc<Published>>,
    readers: Arc<AtomicUsize>,
}

/// Says that a stream's messages are wanted, as long as it lives.
#[derive(Debug)]
pub(crate) struct Reading(Arc<AtomicUsize>);

const POOL: usize = 4;

/// Both ends, empty, with room for payloads of this length.
pub(crate) fn channel(payload_len: usize) -> (Publisher, Newest) {
    let empty = || Published {
        payload: Vec::with_capacity(payload_len),
        ..Published::default()
    };
    let pool: Vec<_> = (0..POOL).map(|_| Arc::new(empty())).collect();
    // One of the pool, so that the tick thread frees nothing when it puts the first message in its place.
    let (sender, receiver) = watch::channel(pool[0].clone());
    let readers = Arc::new(AtomicUsize::new(0));
    let publisher = Publisher {
        newest: sender,
        pool,
        unpublished: 0,
        readers: readers.clone(),
    };
    (publisher, Newest { receiver, readers })
}

impl Publisher {
    /// Encodes the message of a tick and puts it where every subscriber takes the newest from.
    pub(crate) fn publish(
        &mut self,
        tick: u64,
        encode: impl FnOnce(&mut Vec<u8>) -> Result<Header, EncodeError>,
    ) {
        let free = self.pool.iter_mut().find(|slot| Arc::strong_count(slot) == 1);
        let published = free.and_then(|slot| {
            let published = Arc::get_mut(slot)?;
            published.tick = tick;
            published.header = encode(&mut published.payload).ok();
            published.header.is_some().then_some(slot)
        });
        match published {
            Some(slot) => drop(self.newest.send_replace(slot.clone())),
            None => self.unpublished += 1,
        }
    }

    /// Messages that could not be handed over: every reader skipped them. Zero unless the program is wrong, since the
    /// socket thread holds a buffer only while it sends, and what is too large to encode is refused beforehand.
    pub(crate) fn unpublished(&self) -> u64 {
        self.unpublished
    }

    /// Whether anybody holds a [`Reading`].
    pub(crate) fn is_read(&self) -> bool {
        self.readers.load(Ordering::Relaxed) > 0
    }
}

impl Newest {
    /// Asks for messages until the returned value is dropped.
    pub(crate) fn read(&self) -> Reading {
        self.readers.fetch_add(1, Ordering::Relaxed);
        Reading(self.readers.clone())
    }
}

impl Drop for Reading {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
