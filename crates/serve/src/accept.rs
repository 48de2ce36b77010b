//! Lets subscribers in, and tells those why that have to go.

use crate::delivery::socket::Socket;
use crate::farewell::Farewell;
use crate::profiles::profile_maker::ProfileMaker;
use crate::registry::{Entry, Registry};
use crate::server::Server;
use crate::subscriber::Subscriber;
use std::convert::Infallible;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;
use taxel_wire::{Event, EventKind};
use tokio::time::{Instant, interval, sleep, timeout};
use tokio_seqpacket::UnixSeqpacketListener;

/// Subscribers that are let in without a pause, and the pause: at most a thousand in a second, so that
/// those who come and go without end leave time for the others, and few at once, so that an image waits
/// for no more of them. The rest wait in `connect`.
const MOST_AT_ONCE: u32 = 2;
const PAUSE: Duration = Duration::from_millis(2);
/// How long a guest has to stay, and be shown the hand, before another makes room for it: whoever only looks in puts no
/// display out.
const STAY: Duration = Duration::from_millis(500);
/// How long a client may take to hear why it has to go.
const LAST_WORDS: Duration = Duration::from_millis(100);

impl<M: ProfileMaker> Server<M> {
    /// Lets subscribers in, to be dropped when they come another way.
    pub(crate) async fn let_in(self: Rc<Self>, mut listener: UnixSeqpacketListener) {
        let mut failing = false;
        let mut pause = interval(PAUSE);
        let mut let_in = 0;
        loop {
            if let_in == MOST_AT_ONCE {
                pause.reset();
                pause.tick().await;
                let_in = 0;
            }
            let accepted = listener.accept().await;
            match accepted.and_then(|socket| Socket::new(socket.into())) {
                Ok(socket) => {
                    failing = false;
                    let_in += 1;
                    drop(tokio::task::spawn_local(welcome(socket, self.clone())));
                }
                Err(error) => {
                    // Out of file descriptors, most likely: try again when some are free. Said
                    // once, however long it lasts.
                    if !std::mem::replace(&mut failing, true) {
                        tracing::warn!(%error, "cannot accept a subscriber");
                    }
                    sleep(Duration::from_millis(100)).await;
                }
            }
        }
    }
}

/// Serves one client until it goes or has to go.
async fn welcome<M: ProfileMaker>(socket: Socket, server: Rc<Server<M>>) {
    let peer = socket.peer();
    // Processes that this namespace does not see are all called 0.
    let pid = peer.map(|p| p.pid()).filter(|pid| *pid > 0);
    let uid = peer.map(|p| p.uid());
    let entry = Arc::new(Entry::new(pid, uid, server.profiles.own().id));
    let registry = &server.registry;
    if !registry.enter(&entry) {
        let farewell = registry.too_many();
        registry.report_turned_away(entry.pid, &farewell);
        send_disconnect(&socket, &farewell, LAST_WORDS).await;
        return;
    }
    if let Some(unsaid) = registry.visits.borrow_mut().take_line(Instant::now()) {
        tracing::info!(pid = entry.pid, uid = entry.uid, "subscriber connected{unsaid}");
    }
    let farewell = match Subscriber::new(socket, server.clone(), &entry) {
        Ok(mut subscriber) => {
            let farewell = tokio::select! {
                farewell = subscriber.attend() => farewell,
                never = settle(registry, &entry), if entry.is_guest() => match never {},
            };
            if let Farewell::TooMany(_) = farewell {
                registry.report_turned_away(entry.pid, &farewell);
            }
            if farewell.is_told() {
                send_disconnect(&subscriber.socket, &farewell, LAST_WORDS).await;
            }
            farewell
        }
        Err(error) => Farewell::Failed(error),
    };
    registry.remove(&entry);
    if let Some(unsaid) = registry.visits.borrow_mut().take_line(Instant::now()) {
        tracing::info!(
            pid = entry.pid,
            images = entry.images.sent(),
            skipped = entry.images.skipped(),
            paced = entry.images.paced(),
            "subscriber gone: {farewell}{unsaid}"
        );
    }
}

/// Sees to a place for a guest once it has stayed.
async fn settle(registry: &Registry, guest: &Arc<Entry>) -> Infallible {
    sleep(STAY).await;
    registry.settle(guest);
    std::future::pending().await
}

/// Tells a client why it is let go, if it takes the message soon.
async fn send_disconnect(socket: &Socket, why: &Farewell, patience: Duration) {
    socket.stop_receiving();
    let packet = Event::new(EventKind::Disconnect, why.to_string()).to_packet(0, 0);
    let _ = timeout(patience, socket.send(&packet)).await;
}
