//! A Unix socket path that belongs to one daemon at a time.
//!
//! A daemon that was killed leaves its socket file behind, and `bind` then refuses the path for
//! ever; removing the file without asking would cut a running daemon off. So the path is guarded by
//! an exclusive lock on `PATH.lock`: only its holder removes a stale socket and binds, and the
//! kernel releases the lock however the holder ends.

use nix::fcntl::{Flock, FlockArg};
use nix::unistd::{Gid, Group};
use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// The right to bind a socket path, held until dropped; dropping removes the socket.
#[derive(Debug)]
pub struct SocketPath {
    path: PathBuf,
    _lock: Flock<File>,
}

/// Why a socket path cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum SocketPathError {
    /// Another daemon holds it.
    #[error("{path} is in use by another taxeld; stop it, or give this one another socket path")]
    InUse {
        /// The socket.
        path: String,
    },
    /// Something that is not a socket is at the path.
    #[error("{path} exists and is not a socket; it is left alone, choose another socket path")]
    NotASocket {
        /// The path.
        path: String,
    },
    /// The group is not known on this machine.
    #[error(
        "socket.group = \"{group}\" is no group of this machine; create it with `groupadd --system {group}`"
    )]
    UnknownGroup {
        /// The group's name.
        group: String,
    },
    /// The system refused.
    #[error("cannot {what} {path}: {error}")]
    Io {
        /// What was tried.
        what: &'static str,
        /// The path.
        path: String,
        /// What the system said.
        error: io::Error,
    },
}

impl SocketPath {
    /// Takes the path, removing a socket left behind by a dead daemon. Creates the folder if it is missing.
    pub fn take(path: &Path) -> Result<Self, SocketPathError> {
        let fail = |what, path: &Path, error| SocketPathError::Io {
            what,
            path: path.display().to_string(),
            error,
        };
        if let Some(folder) = path.parent().filter(|p| !p.as_os_str().is_empty() && !p.exists()) {
            fs::create_dir_all(folder).map_err(|e| fail("create the folder", folder, e))?;
        }
        let lock_path = PathBuf::from(format!("{}.lock", path.display()));
        let file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&lock_path)
            .map_err(|e| fail("open the lock file", &lock_path, e))?;
        let lock = Flock::lock(file, FlockArg::LockExclusiveNonblock).map_err(|(_, errno)| match errno {
            nix::errno::Errno::EWOULDBLOCK => SocketPathError::InUse {
                path: path.display().to_string(),
            },
            errno => fail("lock", &lock_path, errno.into()),
        })?;
        match fs::symlink_metadata(path) {
            Ok(meta) if meta.file_type().is_socket() => {
                fs::remove_file(path).map_err(|e| fail("remove the stale socket", path, e))?;
            }
            Ok(_) => {
                return Err(SocketPathError::NotASocket {
                    path: path.display().to_string(),
                });
            }
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => return Err(fail("look at", path, e)),
        }
        Ok(Self {
            path: path.to_owned(),
            _lock: lock,
        })
    }

    /// The path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Sets mode and group of the bound socket; an empty group keeps the daemon's own.
    pub fn set_permissions(&self, mode: u32, group: &str) -> Result<(), SocketPathError> {
        let fail = |what, error| SocketPathError::Io {
            what,
            path: self.path.display().to_string(),
            error,
        };
        if !group.is_empty() {
            let gid: Gid = Group::from_name(group)
                .ok()
                .flatten()
                .ok_or_else(|| SocketPathError::UnknownGroup {
                    group: group.to_owned(),
                })?
                .gid;
            nix::unistd::chown(&self.path, None, Some(gid))
                .map_err(|e| fail("give to the group", e.into()))?;
        }
        fs::set_permissions(&self.path, fs::Permissions::from_mode(mode))
            .map_err(|e| fail("set the mode of", e))
    }
}

impl Drop for SocketPath {
    fn drop(&mut self) {
        // The lock file stays: removing it would let two daemons lock two different files of the same name.
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixListener;

    #[test]
    fn a_stale_socket_is_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("images.sock");
        drop(UnixListener::bind(&path).unwrap());
        assert!(path.exists(), "a dropped listener leaves its file behind");
        let taken = SocketPath::take(&path).unwrap();
        let _listener = UnixListener::bind(taken.path()).unwrap();
    }

    #[test]
    fn a_living_daemon_keeps_its_socket() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("images.sock");
        let held = SocketPath::take(&path).unwrap();
        let _listener = UnixListener::bind(held.path()).unwrap();
        assert!(matches!(
            SocketPath::take(&path),
            Err(SocketPathError::InUse { .. })
        ));
        assert!(path.exists());
    }

    #[test]
    fn a_file_that_is_not_a_socket_is_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("images.sock");
        fs::write(&path, "precious").unwrap();
        assert!(matches!(
            SocketPath::take(&path),
            Err(SocketPathError::NotASocket { .. })
        ));
        assert_eq!(fs::read(&path).unwrap(), b"precious");
    }

    #[test]
    fn the_socket_goes_with_its_owner_and_the_path_is_free_again() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("deep/er/images.sock");
        let taken = SocketPath::take(&path).unwrap();
        let listener = UnixListener::bind(taken.path()).unwrap();
        taken.set_permissions(0o600, "").unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        drop((taken, listener));
        assert!(!path.exists());
        SocketPath::take(&path).unwrap();
    }

    #[test]
    fn an_unknown_group_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let taken = SocketPath::take(&dir.path().join("s")).unwrap();
        let error = taken.set_permissions(0o660, "no-such-group").unwrap_err();
        assert!(error.to_string().contains("no-such-group"), "{error}");
    }
}
