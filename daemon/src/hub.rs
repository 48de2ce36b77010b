//! From the tick thread to the subscribers: the newest image, encoded once, without waiting and without allocating.

use crate::pipeline::Outputs;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use taxel_wire::{Flags, Header};
use tokio::sync::watch;

/// What one tick made, as bytes. Shared by all subscribers; only the header's count of skipped images is their own.
#[derive(Debug, Default)]
pub(crate) struct Published {
    /// Number of images published before this one; the difference between two is what a reader skipped.
    pub(crate) index: u64,
    /// The IMAGE message.
    pub(crate) image: Encoded,
    /// The RAW message; without a header while nobody asks for it.
    pub(crate) raw: Encoded,
}

/// A message as it is shared: the payload, and the header of a reader that skipped nothing.
#[derive(Debug, Default)]
pub(crate) struct Encoded {
    /// The header; `None` where there is no message.
    pub(crate) header: Option<Header>,
    /// The payload.
    pub(crate) payload: Vec<u8>,
}

/// The tick thread's end.
#[derive(Debug)]
pub(crate) struct Publisher {
    newest: watch::Sender<Arc<Published>>,
    /// Buffers to encode into. One is in the watch, one may be in the hand of the socket thread.
    pool: Vec<Arc<Published>>,
    published: u64,
    unpublished: u64,
    raw_readers: Arc<AtomicUsize>,
}

/// The socket thread's end; every subscriber has a clone of it.
#[derive(Debug, Clone)]
pub(crate) struct Newest {
    pub(crate) receiver: watch::Receiver<Arc<Published>>,
    raw_readers: Arc<AtomicUsize>,
}

/// Says that raw frames are wanted, as long as it lives.
#[derive(Debug)]
pub(crate) struct RawWanted(Arc<AtomicUsize>);

const POOL: usize = 4;

/// Both ends, empty, with room for payloads of these lengths.
pub(crate) fn channel(image_len: usize, raw_len: usize) -> (Publisher, Newest) {
    let encoded = |len| Encoded {
        header: None,
        payload: Vec::with_capacity(len),
    };
    let empty = || Published {
        index: 0,
        image: encoded(image_len),
        raw: encoded(raw_len),
    };
    let (sender, receiver) = watch::channel(Arc::new(Published::default()));
    let raw_readers = Arc::new(AtomicUsize::new(0));
    let publisher = Publisher {
        newest: sender,
        pool: (0..POOL).map(|_| Arc::new(empty())).collect(),
        published: 0,
        unpublished: 0,
        raw_readers: raw_readers.clone(),
    };
    (
        publisher,
        Newest {
            receiver,
            raw_readers,
        },
    )
}

impl Publisher {
    /// Encodes what a tick made and puts it where every subscriber takes the newest from.
    pub(crate) fn publish(&mut self, outputs: &Outputs) {
        self.published += 1;
        if !self.encode(outputs) {
            self.unpublished += 1;
        }
    }

    /// Images that could not be handed over: every reader skipped them. Zero unless the program is wrong, since the
    /// socket thread holds a buffer only while it sends, and what is too large to encode is refused at the start.
    pub(crate) fn unpublished(&self) -> u64 {
        self.unpublished
    }

    fn encode(&mut self, outputs: &Outputs) -> bool {
        let Some(slot) = self.pool.iter_mut().find(|slot| Arc::strong_count(slot) == 1) else {
            return false;
        };
        let Some(published) = Arc::get_mut(slot) else {
            return false;
        };
        published.index = self.published;
        let Outputs {
            image,
            tactile,
            force,
            ..
        } = outputs;
        let flags = Flags::of_image(image) | Flags::of_frame(tactile, force);
        let raw_wanted = self.raw_readers.load(Ordering::Relaxed) > 0;

        let Encoded { header, payload } = &mut published.image;
        let encoded = taxel_wire::encode_image_payload(image, payload).is_ok();
        *header = encoded.then(|| Header {
            flags,
            ..Header::of_image(image, payload.len())
        });
        let Encoded { header, payload } = &mut published.raw;
        let raw_encoded = raw_wanted && taxel_wire::encode_raw_payload(tactile, force, payload).is_ok();
        *header = raw_encoded.then(|| Header {
            flags,
            ..Header::of_frame(tactile, force, payload.len())
        });

        self.newest.send_replace(slot.clone());
        encoded && (raw_encoded || !raw_wanted)
    }
}

impl Newest {
    /// Asks for raw frames until the returned value is dropped.
    pub(crate) fn want_raw(&self) -> RawWanted {
        self.raw_readers.fetch_add(1, Ordering::Relaxed);
        RawWanted(self.raw_readers.clone())
    }
}

impl Drop for RawWanted {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}
