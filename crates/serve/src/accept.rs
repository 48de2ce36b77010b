//! Lets subscribers in.

use crate::profiles::ProfileMaker;
use crate::server::Server;
use crate::subscriber::welcome;
use std::rc::Rc;
use std::time::Duration;
use tokio_seqpacket::UnixSeqpacketListener;

impl<M: ProfileMaker> Server<M> {
    /// Lets subscribers in until the program ends.
    pub(crate) async fn let_in(self: Rc<Self>, mut listener: UnixSeqpacketListener) {
        let mut failing = false;
        loop {
            match listener.accept().await {
                Ok(socket) => {
                    failing = false;
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
