//! The short way of a message: one loop that sends it to every reader whose socket takes it at once.
//!
//! A subscriber has a task of its own for everything that may have to wait. To wake nine hundred of
//! them thirty times a second would cost more than the sending; so a task that waits for nothing but
//! the newest image leaves its lane to the courier, and is woken only where its socket is full.

use super::message::Message;
use super::pace::Pace;
use super::packet::Packet;
use super::sent::Sent;
use super::socket::Socket;
use std::cell::{Cell, RefCell};
use std::os::fd::OwnedFd;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;
use taxel_wire::HEADER_LEN;
use tokio::sync::Notify;

/// The messages of one type on their way to one subscriber, whichever streams they come from.
#[derive(Debug)]
pub(crate) struct Lane {
    pub(crate) socket: Rc<Socket>,
    /// The socket for whoever sends to it; not here while a packet has it. To take it and put it back costs less than one
    /// more that has it: that writes to memory that nothing else here touches, for each reader of each image.
    descriptor: RefCell<Option<Arc<OwnedFd>>>,
    /// Counts of the subscriber, and of all together.
    counts: [Arc<Sent>; 2],
    /// Tick of the last message sent; 0 before the first.
    last: Cell<u64>,
    /// Tick after which messages are asked for, of which the header of the first says how many were skipped.
    begun: Cell<u64>,
    /// Tick up to which messages are none of this subscriber's: they came before it asked.
    before: Cell<u64>,
    /// Which messages are this subscriber's at the rate it asked for.
    pace: Cell<Pace>,
    /// Whether the courier may send: the subscriber's task waits, and has begun nothing.
    is_free: Cell<bool>,
    /// Wakes the task where there is a message that the courier cannot send, or is not to.
    pub(crate) wake: Notify,
}

impl Lane {
    pub(crate) fn new(socket: &Rc<Socket>, counts: [Arc<Sent>; 2]) -> Rc<Self> {
        Rc::new(Self {
            socket: socket.clone(),
            descriptor: RefCell::new(socket.descriptor()),
            counts,
            last: Cell::new(0),
            begun: Cell::new(0),
            before: Cell::new(0),
            pace: Cell::default(),
            is_free: Cell::new(false),
            wake: Notify::new(),
        })
    }

    /// Messages up to this tick are not to be sent.
    pub(crate) fn begin_after(&self, tick: u64) {
        self.before.set(tick);
    }

    /// From now on at most so many messages a second; the next may be sent at once, whatever was asked for before.
    pub(crate) fn limit_rate(&self, max_rate_hz: Option<f64>) {
        self.pace.set(Pace::new(max_rate_hz));
    }

    /// Whether a message is still to be sent.
    pub(crate) fn takes(&self, message: &Message) -> bool {
        message.tick > self.after() && self.pace.get().takes(message.due)
    }

    /// Wakes the task for a message, unless that comes too soon for the rate asked for: then it is never sent.
    pub(crate) fn call(&self, message: &Message) {
        if self.pace.get().takes(message.due) {
            self.wake.notify_one();
        } else if message.tick > self.after() {
            self.begin_after(message.tick);
            let [counts, of_all] = &self.counts;
            counts.pace(of_all, message.tick);
        }
    }

    /// Lets the courier send, or no longer.
    pub(crate) fn set_free(&self, is_free: bool) {
        self.is_free.set(is_free);
    }

    /// The tick after which the next message is.
    pub(crate) fn after(&self) -> u64 {
        self.last.get().max(self.before.get())
    }

    /// Whether no message was sent yet.
    pub(crate) fn is_untouched(&self) -> bool {
        self.last.get() == 0
    }

    /// The header of a message for this subscriber, with how many it was not sent since the one before, or since it asked;
    /// `None` where there is no message.
    pub(crate) fn header(&self, message: &Message) -> Option<[u8; HEADER_LEN]> {
        let before = match self.last.get() {
            0 => self.begun.get(),
            last => last,
        };
        let skipped = message.tick.saturating_sub(before + 1);
        let header = message.header?.with_skipped(skipped.min(u32::MAX.into()) as u32);
        Some(header.to_bytes())
    }

    /// Notes that a message was sent, and when.
    pub(crate) fn note_sent(&self, message: &Message, at: Instant) {
        self.last.set(message.tick);
        let mut pace = self.pace.get();
        pace.note_sent(message.due);
        self.pace.set(pace);
        let [counts, of_all] = &self.counts;
        counts.record(of_all, at, message.due, message.tick);
    }

    /// Messages after this tick are asked for from now on.
    pub(crate) fn begin(&self, tick: u64) {
        self.begun.set(tick);
        self.counts[0].begin(Instant::now(), tick);
    }

    /// None is asked for any more; what was made up to this tick and not sent is counted.
    pub(crate) fn end(&self, tick: u64) {
        let [counts, of_all] = &self.counts;
        counts.end(of_all, Instant::now(), tick);
    }

    /// Whether the courier is to send a message.
    pub(crate) fn waits_for(&self, message: &Message) -> bool {
        self.is_free.get() && message.tick > self.after()
    }

    /// A message for this subscriber, to be [concluded](Self::conclude); `None` where there is none.
    pub(crate) fn packet(&self, message: &Message) -> Option<Packet> {
        let header = self.header(message)?;
        Some(Packet {
            socket: self.descriptor.take()?,
            header,
            sent: None,
        })
    }

    /// The courier has sent a message, as its packet says; or has not, and the task is to.
    pub(crate) fn conclude(&self, message: &Message, packet: Option<Packet>) {
        let sent = packet.and_then(|packet| {
            self.descriptor.replace(Some(packet.socket));
            packet.sent
        });
        match sent {
            Some(at) => self.note_sent(message, at),
            None => {
                self.is_free.set(false);
                self.wake.notify_one();
            }
        }
    }
}
