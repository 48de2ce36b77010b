//! One stream on its way to one subscriber: the newest message when the socket can take one, or
//! every message in order; and a count of those skipped.

use crate::stream::{Message, Stream};
use std::future::poll_fn;
use std::io::{self, IoSlice};
use std::rc::{Rc, Weak};
use std::sync::Arc;
use std::task::{Poll, ready};
use std::time::Duration;
use tokio::sync::watch::{self, error::RecvError};
use tokio::time::{Instant, sleep_until};
use tokio_seqpacket::UnixSeqpacket;

/// Longest time between two messages to a subscriber that asked for a lower rate.
const LONGEST_PAUSE_S: f64 = 3600.0;

/// One stream of messages to one subscriber.
#[derive(Debug)]
pub(crate) struct Feed {
    stream: Rc<Stream>,
    newest: watch::Receiver<Arc<Message>>,
    /// Whether every message is sent, and not only the newest.
    every: bool,
    /// Tick of the last message sent, for the count of those skipped; 0 before the first.
    last: u64,
    /// Tick up to which messages are none of this subscriber's: they came before it asked.
    before: u64,
    /// When the subscriber's highest rate allows the next message.
    not_before: Instant,
    /// Nothing will ever come: what made the messages is gone.
    is_over: bool,
}

impl Feed {
    /// The next message is the first: the newest may be as old as the time since the bus fell silent.
    pub(crate) fn new(stream: &Rc<Stream>, every: bool) -> Self {
        let mut newest = stream.newest.clone();
        newest.mark_unchanged();
        let before = newest.borrow().tick;
        if every && stream.keep() {
            tokio::task::spawn_local(fill_backlog(Rc::downgrade(stream), newest.clone()));
        }
        Self {
            stream: stream.clone(),
            newest,
            every,
            last: 0,
            before,
            not_before: Instant::now(),
            is_over: false,
        }
    }

    /// The next message is of another stream; ticks go on being counted.
    pub(crate) fn go_on_with(&self, stream: &Rc<Stream>) -> Self {
        let mut feed = Self::new(stream, self.every);
        feed.last = self.last;
        feed
    }

    /// The stream it is of.
    pub(crate) fn stream(&self) -> &Stream {
        &self.stream
    }

    /// The next message may be sent at once, whatever rate was asked for before.
    pub(crate) fn hold_back_no_longer(&mut self) {
        self.not_before = Instant::now();
    }

    /// Waits until there is a message to send and the time for it has come. Fails when there is
    /// none and none will ever come; see [`Feed::is_over`].
    pub(crate) async fn ready(&mut self) -> Result<(), RecvError> {
        if self.not_before > Instant::now() {
            sleep_until(self.not_before).await;
        }
        loop {
            // A message may have been sent already that came while the one before it waited for the socket.
            if self.next().is_some() {
                return Ok(());
            }
            let changed = self.newest.changed().await;
            self.is_over = changed.is_err();
            changed?;
        }
    }

    /// Whether [`Feed::ready`] has failed: the profile it is of is no longer made. So it is for a
    /// moment where a subscriber that was shown the daemon's own profile waits for one of its own,
    /// and the daemon's own changes.
    pub(crate) fn is_over(&self) -> bool {
        self.is_over
    }

    /// Whether [`Feed::ready`] would not wait.
    pub(crate) fn is_ready(&self) -> bool {
        self.not_before <= Instant::now() && self.next().is_some()
    }

    /// Whether a message of this tick or an earlier one is still to be sent.
    pub(crate) fn owes(&self, tick: u64) -> bool {
        self.next().is_some_and(|message| message.tick <= tick)
    }

    /// The message to be sent now, if there is one.
    fn next(&self) -> Option<Arc<Message>> {
        let after = self.last.max(self.before);
        match self.every {
            true => self.stream.after(after),
            // A clone, so that the publisher is not kept waiting while the kernel copies the message.
            false => Some(self.newest.borrow().clone()).filter(|message| message.tick > after),
        }
    }

    /// Sends the message whose turn it is at the moment when the socket takes it, and returns how
    /// many were skipped since the one before; nothing is sent where there is none. The next is
    /// held back for the sake of the highest rate.
    pub(crate) async fn send(
        &mut self,
        socket: &UnixSeqpacket,
        max_rate_hz: Option<f64>,
    ) -> io::Result<Option<u64>> {
        self.newest.mark_unchanged();
        if let Some(hz) = max_rate_hz {
            self.not_before = Instant::now() + Duration::from_secs_f64((1.0 / hz).min(LONGEST_PAUSE_S));
        }
        poll_fn(|cx| {
            let Some(message) = self.next() else {
                return Poll::Ready(Ok(None));
            };
            let Some(header) = message.header else {
                return Poll::Ready(Ok(None));
            };
            let skipped = match self.last {
                0 => 0,
                last => message.tick - last - 1,
            };
            let header = header
                .with_skipped(skipped.min(u32::MAX.into()) as u32)
                .to_bytes();
            let packet = [IoSlice::new(&header), IoSlice::new(&message.payload)];
            ready!(socket.poll_send_vectored(cx, &packet))?;
            self.last = message.tick;
            Poll::Ready(Ok(Some(skipped)))
        })
        .await
    }
}

/// Takes every message into the backlog as it comes, however long its readers' sockets are full.
async fn fill_backlog(stream: Weak<Stream>, mut newest: watch::Receiver<Arc<Message>>) {
    while newest.changed().await.is_ok() {
        if !stream.upgrade().is_some_and(|stream| stream.collect()) {
            return;
        }
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        if self.every {
            self.stream.release();
        }
    }
}
