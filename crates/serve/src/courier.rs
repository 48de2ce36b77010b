//! The courier of a stream: one task that offers each of its messages to every lane.

use crate::lane::Lane;
use crate::message::Message;
use crate::socket::are_writable;
use crate::stream::Stream;
use std::rc::{Rc, Weak};
use std::sync::Arc;
use tokio::sync::watch;

/// Lanes whose sockets are asked for room in one call: few, so that the first are not kept waiting for the last.
const ASKED_AT_ONCE: usize = 64;

/// Offers every message of a stream to its lanes as it comes, until there are none.
pub(crate) async fn deliver(stream: Weak<Stream>, mut newest: watch::Receiver<Arc<Message>>) {
    while newest.changed().await.is_ok() {
        let message = newest.borrow_and_update().clone();
        let Some(stream) = stream.upgrade() else {
            return;
        };
        if !stream.with_lanes(|lanes| lanes.chunks(ASKED_AT_ONCE).for_each(|some| offer(&message, some))) {
            return;
        }
    }
}

/// Offers a message to those of some lanes that wait for it.
fn offer(message: &Message, lanes: &[Rc<Lane>]) {
    let waiting = || lanes.iter().filter(|lane| lane.waits_for(message));
    // Where the kernel cannot be asked, each lane's own task finds out why.
    let writable = are_writable(waiting().map(|lane| &*lane.socket)).unwrap_or_default();
    let mut writable = writable.into_iter();
    for lane in waiting() {
        lane.offer(message, writable.next().unwrap_or(false));
    }
}
