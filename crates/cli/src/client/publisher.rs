//! What programs beside the daemon publish: one text for all subscribers, in the daemon's own manner.

use crate::piped_file;
use anyhow::{Context, anyhow};
use nix::sys::socket::SockType;
use std::io;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use taxel_playback::interrupt::before_the_end;
use taxel_serve::{
    Announcements, Limits, ProfilesConfig, Server, ServerHandle, ServerSeed, SocketPath, SocketPathError,
};
use taxel_wire::{Hello, Kind};
use tokio_seqpacket::UnixSeqpacketListener;

/// The socket of the publisher, until the program ends.
static PUBLISHED: Mutex<Option<SocketPath>> = Mutex::new(None);

/// A socket that texts are published on, served by a thread of its own as long as the program runs. A program has one at
/// most; it is gone when the publisher is dropped and when a signal ends the program.
pub(crate) struct Publisher {
    handle: ServerHandle,
    _published: Published,
}

impl Publisher {
    /// Takes the socket of this name; `what` is published there, and `hello` is what subscribers are told of the hand.
    pub(crate) fn start(path: &Path, hello: Hello, what: &'static str) -> anyhow::Result<Self> {
        // A signal ends the program without any destructor.
        before_the_end(last).context("cannot handle signals")?;
        let (published, listening) = Published::take(path).map_err(not_published)?;
        let limits = Limits {
            max_subscribers: 16,
            stall_ms: 2000,
        };
        let maker = Announcements::new(Hello {
            daemon: format!("taxel {}", env!("CARGO_PKG_VERSION")),
            ..hello
        });
        let profile = taxel_hand::Profile::default();
        let (seed, _) = ServerSeed::new(maker, limits, ProfilesConfig::default(), profile, || ())
            .map_err(anyhow::Error::msg)?;
        let handle = seed.handle();
        let serve = move || -> io::Result<()> {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build()?;
            let local = tokio::task::LocalSet::new();
            runtime.block_on(local.run_until(async {
                let listener = UnixSeqpacketListener::try_from(listening)?;
                Server::new(seed).serve(listener).await;
                Ok(())
            }))
        };
        let report = move || {
            if let Err(error) = serve() {
                say!("taxel: {what} are not published: {error}");
            }
        };
        std::thread::Builder::new().name("publish".into()).spawn(report)?;
        Ok(Self {
            handle,
            _published: published,
        })
    }

    /// Sends a text to every subscriber; `seq` and `t_ns` are those of the newest frame that it is about.
    pub(crate) fn publish(&self, kind: Kind, text: &[u8], seq: u64, t_ns: u64) {
        self.handle.publish_text(kind, text, seq, t_ns);
    }
}

/// What is advised of a daemon's sockets is settings of the daemon; here there is only the path of `--publish`.
fn not_published(error: SocketPathError) -> anyhow::Error {
    match error {
        SocketPathError::InUse { path } => anyhow!(
            "{} is in use by another program of taxeld's; --publish takes another path",
            path.display()
        ),
        SocketPathError::Forbidden { path, error } => anyhow!(
            "cannot make {}: {error}; --publish takes a path in a folder that this user may write to",
            path.display()
        ),
        error => error.into(),
    }
}

/// Gives [`PUBLISHED`] back.
struct Published;

impl Published {
    /// Takes the socket of this name. A signal meanwhile waits until it is there to be removed.
    fn take(path: &Path) -> Result<(Self, OwnedFd), SocketPathError> {
        let mut published = published();
        let path = published.insert(SocketPath::take(path, 0o660, "")?);
        match path.listen(SockType::SeqPacket, 16) {
            Ok(listening) => Ok((Self, listening)),
            Err(error) => {
                *published = None;
                Err(error)
            }
        }
    }
}

impl Drop for Published {
    fn drop(&mut self) {
        drop(published().take());
    }
}

fn published() -> MutexGuard<'static, Option<SocketPath>> {
    PUBLISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

fn last() {
    drop(Published);
    piped_file::remove();
}
