//! A stream of messages: from the thread that makes them to the thread that serves readers, each
//! encoded once, without waiting and without allocating.
//!
//! Readers are given the newest message, or every one: the latter are kept in a backlog of bounded
//! length on the serving thread, beyond which the oldest are lost.

use super::courier::Readers;
use super::message::Message;
use super::second_hand::Hands;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::{Rc, Weak};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Instant;
use taxel_wire::{EncodeError, Header};
use tokio::sync::watch;

/// The end of a stream on the thread that makes its messages.
#[derive(Debug)]
pub(crate) struct Publisher {
    newest: watch::Sender<Arc<Message>>,
    /// Messages on their way to the backlog.
    every: mpsc::SyncSender<Arc<Message>>,
    /// Buffers to encode into: more than readers can hold.
    pool: Vec<Arc<Message>>,
    /// Where the next free buffer is looked for.
    next: usize,
    unpublished: u64,
    every_readers: Arc<AtomicUsize>,
}

/// What is sent to the serving thread of a stream, to be opened there.
#[derive(Debug)]
pub(crate) struct StreamEnd {
    newest: watch::Receiver<Arc<Message>>,
    every: mpsc::Receiver<Arc<Message>>,
    every_readers: Arc<AtomicUsize>,
    depth: usize,
    payload_len: usize,
}

/// The end of a stream on the serving thread, where every reader of it looks.
#[derive(Debug)]
pub(crate) struct Stream {
    pub(crate) newest: watch::Receiver<Arc<Message>>,
    every: mpsc::Receiver<Arc<Message>>,
    every_readers: Arc<AtomicUsize>,
    /// The last messages, oldest first, while there are readers of every one.
    backlog: RefCell<VecDeque<Arc<Message>>>,
    /// Whom the courier hands messages on to.
    pub(crate) readers: Readers,
    depth: usize,
    payload_len: usize,
}

/// The ticks up to which a stream's messages were sent, or never will be: what is sent is chosen and sent in one go on
/// the serving thread, so that none of them is on its way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct OverTicks {
    /// To readers of the newest.
    pub(crate) newest: u64,
    /// To readers of every one.
    pub(crate) every: u64,
}

impl OverTicks {
    pub(crate) fn of(stream: &Stream) -> Self {
        stream.collect();
        let oldest = stream.backlog.borrow().front().map_or(0, |oldest| oldest.tick);
        Self {
            newest: stream.newest_tick().saturating_sub(1),
            every: oldest.saturating_sub(1),
        }
    }
}

/// Buffers beside those of the backlog: one is the newest, one may be being sent.
const SPARE: usize = 4;
/// Most bytes that the messages of a backlog may have together.
const BACKLOG_BYTES: usize = 4 << 20;

/// How many messages a backlog holds: about a second of them, no more than 4 MiB, and eight in any case.
pub(crate) fn backlog_depth(payload_len: usize, rate_hz: f64) -> usize {
    let fit = BACKLOG_BYTES / payload_len.max(1);
    (rate_hz.ceil() as usize).clamp(16, 1024).min(fit).max(8)
}

/// Both ends of a stream, empty, with room for payloads of `payload_len` bytes, of which `rate_hz`
/// come in a second.
pub(crate) fn stream(payload_len: usize, rate_hz: f64) -> (Publisher, StreamEnd) {
    let depth = backlog_depth(payload_len, rate_hz);
    let empty = || Message {
        tick: 0,
        due: Instant::now(),
        header: None,
        payload: Vec::with_capacity(payload_len),
    };
    // A backlog full, and as many on their way to it.
    let pool: Vec<_> = (0..2 * depth + SPARE).map(|_| Arc::new(empty())).collect();
    // One of the pool, so that the publisher frees nothing when it puts the first message in its place.
    let (newest, receiver) = watch::channel(pool[0].clone());
    let (every, backlog) = mpsc::sync_channel(depth);
    let every_readers = Arc::new(AtomicUsize::new(0));
    let publisher = Publisher {
        newest,
        every,
        pool,
        next: 0,
        unpublished: 0,
        every_readers: every_readers.clone(),
    };
    let end = StreamEnd {
        newest: receiver,
        every: backlog,
        every_readers,
        depth,
        payload_len,
    };
    (publisher, end)
}

impl StreamEnd {
    /// That of a stream that never has a message.
    pub(crate) fn silent() -> Self {
        stream(0, 0.0).1
    }

    /// Opens it for readers, on the serving thread.
    pub(crate) fn open(self) -> Stream {
        Stream {
            newest: self.newest,
            every: self.every,
            every_readers: self.every_readers,
            backlog: RefCell::new(VecDeque::with_capacity(self.depth + 1)),
            readers: Readers::default(),
            depth: self.depth,
            payload_len: self.payload_len,
        }
    }
}

impl Publisher {
    /// Encodes the message of a tick that was due at `due` and puts it where readers take the newest from, and every one.
    pub(crate) fn publish(
        &mut self,
        tick: u64,
        due: Instant,
        encode: impl FnOnce(&mut Vec<u8>) -> Result<Header, EncodeError>,
    ) {
        let buffers = self.pool.len();
        let free = (self.next..self.next + buffers)
            .map(|at| at % buffers)
            .find(|at| Arc::strong_count(&self.pool[*at]) == 1);
        let published = free.and_then(|at| {
            self.next = at + 1;
            let message = Arc::get_mut(&mut self.pool[at])?;
            message.tick = tick;
            message.due = due;
            message.header = encode(&mut message.payload).ok();
            message.header.is_some().then(|| self.pool[at].clone())
        });
        let Some(message) = published else {
            self.unpublished += 1;
            return;
        };
        if self.every_readers.load(Ordering::Relaxed) > 0 {
            // Full only where the serving thread does not run; readers count what they miss by the ticks.
            let _ = self.every.try_send(message.clone());
        }
        drop(self.newest.send_replace(message));
    }

    /// Messages that could not be handed over: every reader skipped them. Zero unless the program
    /// is wrong, since there are more buffers than readers hold, and what is too large to encode is
    /// refused beforehand.
    pub(crate) fn unpublished(&self) -> u64 {
        self.unpublished
    }
}

impl Stream {
    /// Bytes of the longest payload.
    pub(crate) fn payload_len(&self) -> usize {
        self.payload_len
    }

    /// Bytes of a full backlog.
    pub(crate) fn backlog_bytes(&self) -> usize {
        self.depth * self.payload_len
    }

    /// Another reader wants every message from now on. Somebody has to call [`Stream::collect`] after each.
    pub(crate) fn keep(&self) {
        if self.every_readers.fetch_add(1, Ordering::Relaxed) == 0 {
            // What was on its way when the last such reader left.
            self.forget();
        }
    }

    /// Moves what has come into the backlog.
    pub(crate) fn collect(&self) {
        let mut backlog = self.backlog.borrow_mut();
        while let Ok(message) = self.every.try_recv() {
            if backlog.len() == self.depth {
                backlog.pop_front();
            }
            backlog.push_back(message);
        }
    }

    /// A reader that called [`Stream::keep`] is gone.
    pub(crate) fn release(&self) {
        if self.every_readers.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.forget();
        }
    }

    /// The tick of the newest message.
    pub(crate) fn newest_tick(&self) -> u64 {
        self.newest.borrow().tick
    }

    fn forget(&self) {
        while self.every.try_recv().is_ok() {}
        self.backlog.borrow_mut().clear();
    }

    /// The oldest message that is kept of those after this tick.
    pub(crate) fn after(&self, tick: u64) -> Option<Arc<Message>> {
        self.collect();
        let backlog = self.backlog.borrow();
        let at = backlog.partition_point(|message| message.tick <= tick);
        backlog.get(at).cloned()
    }
}

/// The courier: hands on the newest message of a stream as it comes, until nobody reads it.
pub(crate) async fn deliver(
    stream: Weak<Stream>,
    mut newest: watch::Receiver<Arc<Message>>,
    hands: Rc<Hands>,
) {
    while newest.changed().await.is_ok() {
        let message = newest.borrow_and_update().clone();
        let Some(stream) = stream.upgrade() else {
            return;
        };
        // However long the sockets of those are full that want every one.
        stream.collect();
        if !stream.readers.hand_on(&message, &hands) {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_wire::Kind;

    fn publish(publisher: &mut Publisher, tick: u64) {
        publisher.publish(tick, Instant::now(), |payload| {
            payload.clear();
            payload.extend_from_slice(&tick.to_le_bytes());
            Ok(Header::new(Kind::Image, payload.len()))
        });
    }

    #[test]
    fn every_message_is_kept_in_order_up_to_the_depth_and_the_oldest_are_lost() {
        let (mut publisher, end) = stream(8, 20.0);
        let stream = end.open();
        publish(&mut publisher, 1);
        stream.keep();
        for tick in 2..=31 {
            publish(&mut publisher, tick);
            // The serving thread looks now and then.
            if tick % 10 == 0 {
                assert_eq!(stream.after(0).unwrap().tick, 2.max(tick.saturating_sub(19)));
            }
        }
        let mut last = 0;
        let mut seen = Vec::new();
        while let Some(message) = stream.after(last) {
            assert_eq!(message.payload, message.tick.to_le_bytes());
            last = message.tick;
            seen.push(last);
        }
        assert_eq!(seen, (12..=31).collect::<Vec<_>>());
        assert_eq!(publisher.unpublished(), 0);
    }

    #[test]
    fn a_serving_thread_that_sleeps_costs_the_newest_readers_nothing() {
        let (mut publisher, end) = stream(8, 16.0);
        let stream = end.open();
        stream.keep();
        // A full backlog, and then a sleep.
        for tick in 1..=16 {
            publish(&mut publisher, tick);
        }
        assert_eq!(stream.after(0).unwrap().tick, 1);
        for tick in 17..=1000 {
            publish(&mut publisher, tick);
            assert_eq!(stream.newest.borrow().tick, tick);
        }
        assert_eq!(publisher.unpublished(), 0);
        // What was on its way is there; what found no room is missing, and the ticks tell.
        assert_eq!(stream.after(16).unwrap().tick, 17);
        assert!(stream.after(32).is_none());
    }

    #[test]
    fn nothing_is_kept_where_nobody_wants_every_message() {
        let (mut publisher, end) = stream(8, 16.0);
        let stream = end.open();
        stream.keep();
        publish(&mut publisher, 1);
        stream.release();
        publish(&mut publisher, 2);
        assert!(stream.after(0).is_none());
        stream.keep();
        publish(&mut publisher, 3);
        assert_eq!(stream.after(0).unwrap().tick, 3);
    }

    #[test]
    fn a_backlog_is_a_second_long_and_bounded_in_bytes() {
        for (payload_len, rate_hz, depth) in [
            (608, 30.0, 30),
            (608, 1.0, 16),
            (608, 1000.0, 1000),
            (4_920, 1000.0, 852),
            (320_164, 100.0, 13),
            (0, 0.0, 16),
        ] {
            assert_eq!(
                backlog_depth(payload_len, rate_hz),
                depth,
                "{payload_len} {rate_hz}"
            );
        }
    }
}
