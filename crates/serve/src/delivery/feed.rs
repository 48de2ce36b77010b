//! One stream on its way to one subscriber: the newest message when the socket can take one, or
//! every message in order; and a count of those skipped.

use super::lane::Lane;
use super::message::Message;
use super::second_hand::Hands;
use super::stream::{Stream, deliver};
use crate::delivery::Delivery;
use std::future::poll_fn;
use std::io::{self, IoSlice};
use std::rc::Rc;
use std::sync::Arc;
use std::task::{Poll, ready};
use std::time::Instant;

/// One stream of messages to one subscriber.
#[derive(Debug)]
pub(crate) struct Feed {
    stream: Rc<Stream>,
    lane: Rc<Lane>,
    delivery: Delivery,
}

impl Feed {
    /// The next message is the first to come: the newest may be as old as the time since the bus fell
    /// silent. Ticks go on being counted where the lane has had messages. A courier sends with these hands.
    pub(crate) fn new(stream: &Rc<Stream>, lane: &Rc<Lane>, delivery: Delivery, hands: &Rc<Hands>) -> Self {
        let mut newest = stream.newest.clone();
        newest.mark_unchanged();
        lane.begin_after(newest.borrow().tick);
        if delivery == Delivery::Every {
            stream.keep();
        }
        if stream.readers.join(lane, delivery) {
            tokio::task::spawn_local(deliver(Rc::downgrade(stream), newest, hands.clone()));
        }
        Self {
            stream: stream.clone(),
            lane: lane.clone(),
            delivery,
        }
    }

    /// The stream it is of.
    pub(crate) fn stream(&self) -> &Stream {
        &self.stream
    }

    /// Which of its messages are sent, and by whom.
    pub(crate) fn delivery(&self) -> Delivery {
        self.delivery
    }

    /// Waits until there is a message to send: for ever, where its profile is no longer made.
    pub(crate) async fn ready(&self) {
        // It may be woken for a message that it has sent already, or is not to send.
        while !self.is_ready() {
            self.lane.wake.notified().await;
        }
    }

    /// Whether [`Feed::ready`] would not wait.
    pub(crate) fn is_ready(&self) -> bool {
        self.next().is_some()
    }

    /// Whether a message of this tick or an earlier one is still to be sent.
    pub(crate) fn owes(&self, tick: u64) -> bool {
        self.next().is_some_and(|message| message.tick <= tick)
    }

    /// The message to be sent now, if there is one.
    fn next(&self) -> Option<Arc<Message>> {
        match self.delivery {
            Delivery::Every => self.stream.after(self.lane.after()),
            // A clone, so that the publisher is not kept waiting while the kernel copies the message.
            _ => Some(self.stream.newest.borrow().clone()).filter(|message| self.lane.takes(message)),
        }
    }

    /// Sends the message whose turn it is at the moment when the socket takes it, if there is one.
    pub(crate) async fn send(&self) -> io::Result<()> {
        poll_fn(|cx| {
            let Some(message) = self.next() else {
                return Poll::Ready(Ok(()));
            };
            let Some(header) = self.lane.header(&message) else {
                return Poll::Ready(Ok(()));
            };
            let packet = [IoSlice::new(&header), IoSlice::new(&message.payload)];
            ready!(self.lane.socket.poll_send(cx, &packet, self.delivery.room()))?;
            self.lane.note_sent(&message, Instant::now());
            Poll::Ready(Ok(()))
        })
        .await
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        self.stream.readers.leave(&self.lane, self.delivery);
        if self.delivery == Delivery::Every {
            self.stream.release();
        }
    }
}
