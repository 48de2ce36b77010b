//! Why a socket path cannot be had.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use taxel_wire::UntrustedFolder;

/// Why a socket path cannot be had. The message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum SocketPathError {
    /// Another daemon holds it.
    #[error(
        "{} is in use by another taxeld; stop it, or give this one sockets of its own: [socket] images, control and \
         status, which is status.sock beside control where no other is named", path.display()
    )]
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
        "cannot make {}: {error}; choose [socket] images and control in a folder that this user may write to",
        path.display()
    )]
    Forbidden {
        /// The file or folder that is to be made there.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
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
    /// The group is not one of this user's.
    #[error(
        "cannot give {} to group {group}: the daemon's user is not in it; name one of its groups (`id -Gn`), or have \
         it join that one", path.display()
    )]
    GroupNotOurs {
        /// The socket.
        path: PathBuf,
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

    /// What cannot be made: for good, where this user may not write to its folder.
    pub(super) fn making(path: &Path, error: io::Error) -> Self {
        match error.kind() {
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem | ErrorKind::NotADirectory => {
                Self::Forbidden {
                    path: path.to_owned(),
                    error,
                }
            }
            _ => Self::io("make", path, error),
        }
    }

    /// Whether it would be so the next time as well, since the configuration is at fault, and neither another
    /// program nor the system.
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::NotASocket { .. }
            | Self::Forbidden { .. }
            | Self::UnknownGroup { .. }
            | Self::GroupNotOurs { .. } => true,
            Self::InUse { .. }
            | Self::Foreign { .. }
            | Self::ForeignLock { .. }
            | Self::Folder(_)
            | Self::Io { .. } => false,
        }
    }
}
