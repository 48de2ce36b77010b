//! The daemon's sockets: their places, and what is done where somebody removes or replaces one while it runs.

use crate::control::{serve_control, serve_status};
use crate::state::State;
use nix::sys::socket::SockType;
use std::io;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;
use taxel_config::Config;
use taxel_serve::{SocketPath, SocketPathError};
use taxel_wire::{Event, EventKind};
use tokio::net::UnixListener;
use tokio::task::{JoinHandle, spawn_local};
use tokio::time::{MissedTickBehavior, interval};

/// Connections that may wait to be accepted.
const BACKLOG: i32 = 128;
/// How often it is looked whether the sockets can be reached.
const PERIOD: Duration = Duration::from_secs(1);

/// Which of the daemon's sockets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Which {
    Images,
    Control,
    Status,
}

/// The daemon's sockets, which listen.
#[derive(Debug)]
pub(crate) struct Listeners {
    pub(crate) control: OwnedFd,
    pub(crate) status: OwnedFd,
    pub(crate) images: OwnedFd,
}

/// The places of the daemon's sockets. The one that was taken first goes last, and its folder with it.
#[derive(Debug)]
pub(crate) struct Sockets {
    status: SocketPath,
    control: SocketPath,
    images: SocketPath,
}

impl Sockets {
    pub(crate) fn take(config: &Config) -> Result<Self, SocketPathError> {
        let Config { socket, control, .. } = config;
        // Checked when the configuration was read; what cannot be read is open to nobody else.
        let mode = socket.mode_bits().unwrap_or(0o600);
        let images = SocketPath::take(&socket.images, mode, &socket.group)?;
        let control_mode = control.mode_bits().unwrap_or(0o600);
        let control = SocketPath::take(&socket.control, control_mode, &control.group)?;
        let status = SocketPath::take(&socket.status_path(), mode, &socket.group)?;
        Ok(Self {
            status,
            control,
            images,
        })
    }

    /// Has all of them listen. Those who come wait until they are let in.
    pub(crate) fn listen(&mut self) -> Result<Listeners, SocketPathError> {
        let mut listen = |which: Which| self.place(which).listen(which.kind(), BACKLOG);
        Ok(Listeners {
            control: listen(Which::Control)?,
            status: listen(Which::Status)?,
            images: listen(Which::Images)?,
        })
    }

    fn place(&mut self, which: Which) -> &mut SocketPath {
        match which {
            Which::Images => &mut self.images,
            Which::Control => &mut self.control,
            Which::Status => &mut self.status,
        }
    }

    /// Takes again what does not lead here any more, in the order of the start.
    fn retake(&mut self) -> Vec<Retaken> {
        let mut retaken = Vec::new();
        for which in [Which::Images, Which::Control, Which::Status] {
            let place = self.place(which);
            if !place.is_whole() {
                retaken.push(Retaken {
                    which,
                    path: place.path().to_owned(),
                    listener: place.retake(which.kind(), BACKLOG),
                });
            }
        }
        retaken
    }
}

impl Which {
    fn kind(self) -> SockType {
        match self {
            Self::Images => SockType::SeqPacket,
            Self::Control | Self::Status => SockType::Stream,
        }
    }
}

/// A place that was spoilt and is taken again: with a listener, where its socket had gone.
struct Retaken {
    which: Which,
    path: PathBuf,
    listener: Result<Option<OwnedFd>, SocketPathError>,
}

/// Who serves the control sockets.
struct Serving {
    state: Rc<State>,
    control: JoinHandle<()>,
    status: JoinHandle<()>,
}

impl Serving {
    /// Lets clients in at another socket than before. Those that are connected stay.
    async fn listen(&mut self, which: Which, listener: OwnedFd) -> io::Result<()> {
        let before = match which {
            Which::Images => return self.state.server.listen(listener).await,
            Which::Control => {
                let listener = UnixListener::from_std(listener.into())?;
                let anew = spawn_local(serve_control(listener, self.state.clone()));
                std::mem::replace(&mut self.control, anew)
            }
            Which::Status => {
                let listener = UnixListener::from_std(listener.into())?;
                let anew = spawn_local(serve_status(listener, self.state.clone()));
                std::mem::replace(&mut self.status, anew)
            }
        };
        before.abort();
        Ok(())
    }
}

/// Serves the control sockets, and takes the places of all sockets again that somebody has spoilt, until the daemon
/// ends: a hand whose motors nobody can switch off any more is worse than one more look each second.
pub(crate) async fn serve(
    sockets: Arc<Mutex<Sockets>>,
    control: UnixListener,
    status: UnixListener,
    state: Rc<State>,
) {
    let mut serving = Serving {
        control: spawn_local(serve_control(control, state.clone())),
        status: spawn_local(serve_status(status, state.clone())),
        state: state.clone(),
    };
    let mut period = interval(PERIOD);
    period.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        period.tick().await;
        let retaken = lock(&sockets).retake();
        let (mut again, mut lost) = (Vec::new(), Vec::new());
        for Retaken {
            which,
            path,
            listener,
        } in retaken
        {
            let path = path.display().to_string();
            let served = match listener {
                Ok(None) => Ok(()),
                Ok(Some(listener)) => serving.listen(which, listener).await.map_err(|error| {
                    // To be tried again.
                    lock(&sockets).place(which).unbind();
                    format!("cannot listen on it: {error}")
                }),
                Err(error) => Err(error.to_string()),
            };
            match served {
                Ok(()) => again.push(path),
                Err(why) => lost.push((path, why)),
            }
        }
        if !again.is_empty() {
            let sentence = format!(
                "somebody has removed or replaced {}, or a lock file beside: it is made again, and whoever is connected \
                 has stayed so",
                again.join(", ")
            );
            tracing::warn!("{sentence}");
            state.server.announce(Event::new(EventKind::Notice, sentence));
        }
        state.sockets_lost.replace(lost.first().map(|(_, why)| {
            let paths: Vec<&str> = lost.iter().map(|(path, _)| path.as_str()).collect();
            format!("{}: {why}", paths.join(", "))
        }));
    }
}

fn lock(sockets: &Mutex<Sockets>) -> MutexGuard<'_, Sockets> {
    sockets.lock().unwrap_or_else(|e| e.into_inner())
}
