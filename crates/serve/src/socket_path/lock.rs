//! The lock file beside a socket.

use super::SocketPathError;
use super::identity::FileId;
use nix::errno::Errno;
use nix::fcntl::OFlag;
use nix::unistd::geteuid;
use std::fs::{File, OpenOptions, Permissions, TryLockError};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// An exclusive lock on a file that nobody else can open, held until dropped.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    file: File,
}

impl Lock {
    /// Takes the lock of a socket; `InUse` where it is held.
    pub(super) fn take(socket: &Path) -> Result<Self, SocketPathError> {
        let path = PathBuf::from(format!("{}.lock", socket.display()));
        loop {
            let file = open(&path)?;
            file.try_lock().map_err(|error| match error {
                TryLockError::WouldBlock => SocketPathError::InUse { path: socket.into() },
                TryLockError::Error(error) => SocketPathError::io("lock", &path, error),
            })?;
            let path = path.clone();
            let lock = Self { path, file };
            // Whoever held it may have removed the file between our opening it and locking it.
            if lock.is_there() {
                return Ok(lock);
            }
        }
    }

    fn id(&self) -> Option<FileId> {
        Some(FileId::of(&self.file.metadata().ok()?))
    }

    /// Whether its file is the one at its path, so that nobody else can have the lock there.
    pub(super) fn is_there(&self) -> bool {
        (self.id()).is_some_and(|id| FileId::at(&self.path) == Some(id))
    }

    /// Removes the file while the lock is still held.
    pub(super) fn remove(&self) {
        if let Some(id) = self.id() {
            id.remove_from(&self.path);
        }
    }
}

fn open(path: &Path) -> Result<File, SocketPathError> {
    // A pipe in its place would otherwise wait for a reader.
    let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK;
    let opened = OpenOptions::new()
        .create(true)
        .truncate(false)
        .write(true)
        .mode(0o600)
        .custom_flags(flags.bits())
        .open(path);
    let foreign = || SocketPathError::ForeignLock { path: path.into() };
    let file = opened.map_err(|error| match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::ELOOP | Errno::ENXIO | Errno::EISDIR) => foreign(),
        _ if error.kind() == io::ErrorKind::PermissionDenied && path.symlink_metadata().is_ok() => foreign(),
        _ => SocketPathError::making(path, error),
    })?;
    let fail = |what| move |error| SocketPathError::io(what, path, error);
    let found = file.metadata().map_err(fail("look at the lock file"))?;
    if !found.is_file() || found.uid() != geteuid().as_raw() || found.nlink() > 1 {
        return Err(foreign());
    }
    // One that an earlier version has left may be opened, and so be held, by others.
    if found.mode() & 0o077 != 0 {
        let own = Permissions::from_mode(0o600);
        file.set_permissions(own)
            .map_err(fail("set the mode of the lock file"))?;
    }
    Ok(file)
}
