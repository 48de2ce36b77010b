//! The courier of a stream: one task that offers each of its messages to every lane.

use crate::message::Message;
use crate::stream::Stream;
use std::rc::Weak;
use std::sync::Arc;
use tokio::sync::watch;

/// Offers every message of a stream to its lanes as it comes, until there are none.
pub(crate) async fn deliver(stream: Weak<Stream>, mut newest: watch::Receiver<Arc<Message>>) {
    while newest.changed().await.is_ok() {
        let message = newest.borrow_and_update().clone();
        let Some(stream) = stream.upgrade() else {
            return;
        };
        if !stream.for_each_lane(|lane| lane.offer(&message)) {
            return;
        }
    }
}
