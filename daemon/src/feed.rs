//! One stream on its way to one subscriber: the newest message when the socket can take one, and a count of those skipped.

use crate::hub::{Newest, Published};
use std::future::poll_fn;
use std::io::{self, IoSlice};
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
    newest: watch::Receiver<Arc<Published>>,
    /// Tick of the last message sent, for the count of those skipped; 0 before the first.
    last: u64,
    /// When the subscriber's highest rate allows the next message.
    not_before: Instant,
    /// Nothing will ever come: what made the messages is gone.
    is_over: bool,
}

impl Feed {
    /// The next message is the first: the newest may be as old as the time since the bus fell silent.
    pub(crate) fn new(newest: &Newest) -> Self {
        let mut newest = newest.receiver.clone();
        newest.mark_unchanged();
        Self {
            newest,
            last: 0,
            not_before: Instant::now(),
            is_over: false,
        }
    }

    /// The next message is of another stream; ticks go on being counted.
    pub(crate) fn go_on_with(&self, newest: &Newest) -> Self {
        Self {
            last: self.last,
            ..Self::new(newest)
        }
    }

    /// The next message may be sent at once, whatever rate was asked for before.
    pub(crate) fn hold_back_no_longer(&mut self) {
        self.not_before = Instant::now();
    }

    /// Waits until there is a message to send and the time for it has come. Fails when there is none and none will ever
    /// come; see [`Feed::is_over`].
    pub(crate) async fn ready(&mut self) -> Result<(), RecvError> {
        if self.not_before > Instant::now() {
            sleep_until(self.not_before).await;
        }
        loop {
            let changed = self.newest.changed().await;
            self.is_over = changed.is_err();
            changed?;
            // A message may have been sent already that came while the one before it waited for the socket.
            if self.newest.borrow().tick > self.last {
                return Ok(());
            }
        }
    }

    /// Whether [`Feed::ready`] has failed: the profile it is of is no longer made. So it is for a moment where a
    /// subscriber that was shown the daemon's own profile waits for one of its own, and the daemon's own changes.
    pub(crate) fn is_over(&self) -> bool {
        self.is_over
    }

    /// Whether [`Feed::ready`] would not wait.
    pub(crate) fn is_ready(&self) -> bool {
        let has_changed = self.newest.has_changed().unwrap_or(false);
        has_changed && self.not_before <= Instant::now() && self.newest.borrow().tick > self.last
    }

    /// Sends the message that is newest at the moment when the socket takes it, and returns how many were skipped since
    /// the one before; nothing is sent where there is none. The next is held back for the sake of the highest rate.
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
            // A clone, so that the tick thread is not kept from publishing while the kernel copies the message.
            let published: Arc<Published> = self.newest.borrow().clone();
            let Some(header) = published.header.filter(|_| published.tick > self.last) else {
                return Poll::Ready(Ok(None));
            };
            let skipped = match self.last {
                0 => 0,
                last => published.tick - last - 1,
            };
            let header = header
                .with_skipped(skipped.min(u32::MAX.into()) as u32)
                .to_bytes();
            let message = [IoSlice::new(&header), IoSlice::new(&published.payload)];
            ready!(socket.poll_send_vectored(cx, &message))?;
            self.last = published.tick;
            Poll::Ready(Ok(Some(skipped)))
        })
        .await
    }
}
