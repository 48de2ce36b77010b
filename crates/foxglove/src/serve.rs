//! The two threads of a bridge, and who is let in.

use crate::client::{attend, part};
use crate::counts::{Counts, add};
use crate::daemon::{Socket, read_daemon};
use crate::handshake::shake;
use crate::hub::{Hub, Say};
use crate::protocol;
use nix::sys::socket::{setsockopt, sockopt};
use std::collections::VecDeque;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread;
use std::time::Duration;
use taxel_can::both_clocks_ns;
use taxel_journal::Priority;
use tokio::net::TcpStream;
use tokio::sync::Semaphore;
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};
use tungstenite::Error;

/// Clients at most.
const CLIENTS: usize = 32;
/// Connections that have not asked yet. One more takes the place of the first.
const ASKING: usize = 64;
/// How long a connection may take to ask.
const PATIENCE: Duration = Duration::from_secs(5);
/// Between two connections: a flood of them leaves time for the clients.
const PACE: Duration = Duration::from_millis(1);
/// After a connection could not be taken.
const AGAIN: Duration = Duration::from_millis(100);
/// How often to look whether it is over.
const LOOK: Duration = Duration::from_millis(100);
/// How long clients have to take leave at the end.
const LEAVE: Duration = Duration::from_secs(1);
/// What the kernel may keep for a client, bytes: more would only get old there.
const SEND_BUFFER: usize = 256 << 10;

/// What is served, and what comes from outside meanwhile.
pub struct Plan {
    /// Where clients connect, bound already.
    pub listener: TcpListener,
    /// What clients are told that this is.
    pub name: String,
    /// The daemon's image socket, asked before each attempt to reach it: the next one may be elsewhere.
    pub socket: Socket,
    /// Whether to stop; asked ten times a second.
    pub stop: Box<dyn Fn() -> bool + Send + Sync>,
    /// Tells people something.
    pub say: Say,
}

/// Why nothing can be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The listener cannot be used.
    #[error("the listening socket: {0}")]
    Listener(io::Error),
    /// No thread can be had.
    #[error("cannot start a thread: {0}")]
    Thread(io::Error),
}

/// Serves until it is stopped.
///
/// # Errors
/// Where it cannot begin.
pub fn serve(plan: Plan) -> Result<Counts, ServeError> {
    // Connections have it of the listener.
    let _ = setsockopt(&plan.listener, sockopt::SndBuf, &SEND_BUFFER);
    plan.listener
        .set_nonblocking(true)
        .map_err(ServeError::Listener)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(ServeError::Thread)?;
    let hub = Arc::new(Hub::new(plan.say));
    let (socket, read) = (plan.socket, hub.clone());
    let reader = thread::Builder::new().name("daemon".into());
    let reader = reader.spawn(move || read_daemon(&socket, &read));
    reader.map_err(ServeError::Thread)?;
    runtime.block_on(async {
        let listener = tokio::net::TcpListener::from_std(plan.listener).map_err(ServeError::Listener)?;
        let door = Door {
            hub: hub.clone(),
            // A client sees by it whether it is still the same whose channels it knows.
            greeting: Arc::new([
                protocol::server_info(&plan.name, &both_clocks_ns().0.to_string()),
                protocol::advertise(),
            ]),
            places: Arc::new(Semaphore::new(CLIENTS)),
        };
        tokio::select! {
            () = door.accept(&listener) => {}
            () = stopped(&plan.stop) => {}
        }
        hub.end();
        let _ = timeout(LEAVE, door.places.acquire_many(CLIENTS as u32)).await;
        Ok(())
    })?;
    Ok(hub.counters.read())
}

async fn stopped(stop: &(dyn Fn() -> bool + Send + Sync)) {
    while !stop() {
        sleep(LOOK).await;
    }
}

/// Where clients come in.
#[derive(Clone)]
struct Door {
    hub: Arc<Hub>,
    greeting: Arc<[String; 2]>,
    places: Arc<Semaphore>,
}

impl Door {
    /// Lets clients in, for ever.
    async fn accept(&self, listener: &tokio::net::TcpListener) {
        let mut asking: VecDeque<JoinHandle<()>> = VecDeque::new();
        let mut is_failing = false;
        loop {
            let (socket, address) = match listener.accept().await {
                Ok(accepted) => accepted,
                Err(error) => {
                    // Out of file descriptors, most likely. Said once, however long it lasts.
                    if !std::mem::replace(&mut is_failing, true) {
                        let what =
                            format!("cannot take a connection: {error}; it is tried again every {AGAIN:?}");
                        self.hub.say(Priority::Warning, &what);
                    }
                    sleep(AGAIN).await;
                    continue;
                }
            };
            is_failing = false;
            asking.retain(|asking| !asking.is_finished());
            if asking.len() == ASKING
                && let Some(first) = asking.pop_front()
            {
                first.abort();
            }
            let asks = Asking {
                hub: self.hub.clone(),
                is_let_in: false,
            };
            asking.push_back(tokio::spawn(self.clone().let_in(asks, socket, address)));
            sleep(PACE).await;
        }
    }

    /// Lets a client in that asks in time, as the protocol says.
    async fn let_in(self, mut asks: Asking, socket: TcpStream, address: SocketAddr) {
        let hub = self.hub;
        // What is small is not to wait for more.
        let _ = socket.set_nodelay(true);
        let socket = Arc::new(socket);
        let why = match timeout(PATIENCE, shake(&socket, self.places)).await {
            Ok(Ok((websocket, place))) => {
                asks.is_let_in = true;
                let client = hub.join(address, &*self.greeting);
                hub.remark(format!("{address} is connected"));
                // Who is in is not put out for one who asks.
                tokio::spawn(async move {
                    attend(&hub, &client, &socket, websocket).await;
                    drop(place);
                });
                return;
            }
            Ok(Err(Error::Http(answer))) => {
                let body = answer.body().as_deref().unwrap_or_default();
                String::from_utf8_lossy(body).trim().to_owned()
            }
            Ok(Err(error)) => error.to_string(),
            Err(_) => format!("did not ask within {PATIENCE:?}"),
        };
        drop(asks);
        hub.remark(format!("{address} is not let in: {why}"));
        part(&socket).await;
    }
}

/// A connection that has not been let in yet. Where it ends so, whoever ends it, it is counted as refused.
struct Asking {
    hub: Arc<Hub>,
    is_let_in: bool,
}

impl Drop for Asking {
    fn drop(&mut self) {
        if !self.is_let_in {
            add(&self.hub.counters.refused, 1);
        }
    }
}
