//! Lets subscribers in.

use crate::profile_maker::ProfileMaker;
use crate::server::Server;
use crate::socket::Socket;
use crate::subscriber::welcome;
use std::rc::Rc;
use std::time::Duration;
use tokio::time::interval;
use tokio_seqpacket::UnixSeqpacketListener;

/// Subscribers that are let in without a pause, and the pause: at most a thousand in a second, so that
/// those who come and go without end leave time for the others, and few at once, so that an image waits
/// for no more of them. The rest wait in `connect`.
const MOST_AT_ONCE: u32 = 2;
const PAUSE: Duration = Duration::from_millis(2);

impl<M: ProfileMaker> Server<M> {
    /// Lets subscribers in until the program ends.
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
                    tokio::time::sleep(Duration::from_millis(100)).await;
                }
            }
        }
    }
}
