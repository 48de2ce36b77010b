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
use taxel_can::PressureRenewal;
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
    /// That of a pressure array, among these.
    Array(usize),
}

/// The daemon's sockets, which listen.
#[derive(Debug)]
pub(crate) struct Listeners {
    pub(crate) control: OwnedFd,
    pub(crate) status: OwnedFd,
    pub(crate) images: OwnedFd,
}

/// The socket to which the frames of a pressure array are sent: its place, and the way to what reads it.
#[derive(Debug)]
pub(crate) struct ArraySocket {
    pub(crate) place: SocketPath,
    pub(crate) renewal: PressureRenewal,
}

/// The places of the daemon's sockets. The one that was taken first goes last, and its folder with it.
#[derive(Debug)]
pub(crate) struct Sockets {
    pub(crate) arrays: Vec<ArraySocket>,
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
            arrays: Vec::new(),
            status,
            control,
            images,
        })
    }

    /// Has all of them listen. Those who come wait until they are let in.
    pub(crate) fn listen(&mut self) -> Result<Listeners, SocketPathError> {
        let mut listen = |which: Which| which.listen(self.place(which));
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
            Which::Array(array) => &mut self.arrays[array].place,
        }
    }

    /// Takes again what does not lead here any more, in the order of the start.
    fn retake(&mut self) -> Vec<Retaken> {
        let mut retaken = Vec::new();
        let arrays = (0..self.arrays.len()).map(Which::Array);
        for which in [Which::Images, Which::Control, Which::Status]
            .into_iter()
            .chain(arrays)
        {
            let place = self.place(which);
            if !place.is_whole() {
                retaken.push(Retaken {
                    which,
                    path: place.path().to_owned(),
                    socket: place.retake(|place| which.listen(place)),
                });
            }
        }
        retaken
    }
}

impl Which {
    fn listen(self, place: &mut SocketPath) -> Result<OwnedFd, SocketPathError> {
        match self {
            Self::Images => place.listen(SockType::SeqPacket, BACKLOG),
            Self::Control | Self::Status => place.listen(SockType::Stream, BACKLOG),
            Self::Array(_) => place.bind(SockType::Datagram),
        }
    }
}

/// A place that was spoilt and is taken again: with another socket, where its own had gone.
struct Retaken {
    which: Which,
    path: PathBuf,
    socket: Result<Option<OwnedFd>, SocketPathError>,
}

/// Who serves the sockets.
struct Serving {
    sockets: Arc<Mutex<Sockets>>,
    state: Rc<State>,
    control: JoinHandle<()>,
    status: JoinHandle<()>,
}

impl Serving {
    /// Lets clients in at another socket than before. Those that are connected stay.
    async fn listen(&mut self, which: Which, listener: OwnedFd) -> io::Result<()> {
        let before = match which {
            Which::Images => return self.state.server.listen(listener).await,
            Which::Array(array) => return lock(&self.sockets).arrays[array].renewal.renew(listener),
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
        sockets: sockets.clone(),
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
        for Retaken { which, path, socket } in retaken {
            let path = path.display().to_string();
            let served = match socket {
                Ok(None) => Ok(()),
                Ok(Some(socket)) => serving.listen(which, socket).await.map_err(|error| {
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

pub(crate) fn lock(sockets: &Mutex<Sockets>) -> MutexGuard<'_, Sockets> {
    sockets.lock().unwrap_or_else(|e| e.into_inner())
}
