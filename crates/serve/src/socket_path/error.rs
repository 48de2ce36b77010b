//! Why a socket path cannot be had.

use std::io;
use std::path::{Path, PathBuf};
use taxel_wire::UntrustedFolder;

/// Why a socket path cannot be had. The message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum SocketPathError {
    /// Another daemon holds it.
    #[error("{} is in use by another taxeld; stop it, or give this one another socket path", path.display())]
    InUse {
        /// The socket.
        path: PathBuf,
    },
    /// Another program listens there.
    #[error("another program listens on {}; it is left alone, stop it or choose another socket path", path.display())]
    Foreign {
        /// The socket.
        path: PathBuf,
    },
    /// Something that is not a socket is at the path.
    #[error("{} exists and is not a socket; it is left alone, choose another socket path", path.display())]
    NotASocket {
        /// The path.
        path: PathBuf,
    },
    /// The lock file is a link, or another user's.
    #[error(
        "{} is not a lock file of this user's taxeld but a link, or somebody else's; remove it, or choose another \
         socket path", path.display()
    )]
    ForeignLock {
        /// The lock file.
        path: PathBuf,
    },
    /// The folder is not ours to put a socket into.
    #[error(
        "cannot make the lock file {}: this user may not write to its folder; choose [socket] images and control in a \
         folder of your own", path.display()
    )]
    Forbidden {
        /// The lock file.
        path: PathBuf,
    },
    /// The folder may be anybody's.
    #[error(transparent)]
    Folder(#[from] UntrustedFolder),
    /// The group is not known on this machine.
    #[error(
        "the sockets' group \"{group}\" is no group of this machine; create it with `groupadd --system {group}`"
    )]
    UnknownGroup {
        /// The group's name.
        group: String,
    },
    /// The system refused.
    #[error("cannot {what} {}: {error}", path.display())]
    Io {
        /// What was tried.
        what: &'static str,
        /// The path.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
}

impl SocketPathError {
    pub(super) fn io(what: &'static str, path: &Path, error: io::Error) -> Self {
        Self::Io {
            what,
            path: path.to_owned(),
            error,
        }
    }
}
