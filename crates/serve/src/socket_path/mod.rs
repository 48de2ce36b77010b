//! A Unix socket path that belongs to one daemon at a time.
//!
//! A daemon that was killed leaves its socket file behind, and `bind` then refuses the path for ever; removing the file
//! without asking would cut a running daemon off. So the path is guarded by an exclusive lock on `PATH.lock`: only its
//! holder removes a stale socket and binds, and the kernel releases the lock however the holder ends.
//!
//! Folders may be anybody's, such as `/tmp`. So no link is followed, the lock file is ours and only we can open it, a
//! socket on which any program listens is left alone, and from its first moment a socket is open to nobody who may not
//! use it.

mod beforehand;
mod error;
mod identity;
mod lock;

pub use beforehand::{check_group, check_socket_path};
pub use error::SocketPathError;

use identity::FileId;
use lock::Lock;
use nix::errno::Errno;
use nix::fcntl::{AT_FDCWD, AtFlags};
use nix::sys::socket::{AddressFamily, Backlog, SockFlag, SockType, UnixAddr, bind, connect, listen, socket};
use nix::sys::stat::{FchmodatFlags, Mode, fchmod, fchmodat};
use nix::unistd::{Gid, Group, fchownat};
use std::fs::{self, DirBuilder};
use std::io;
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::fs::{DirBuilderExt, FileTypeExt};
use std::path::{Path, PathBuf};
use taxel_wire::check_socket_folder;

/// The right to bind a socket path, held until dropped; dropping removes the socket, its lock file and the folders
/// that were made for them, where nothing else is in those. What another daemon has put in their place is left alone.
#[derive(Debug)]
pub struct SocketPath {
    path: PathBuf,
    /// The socket that was bound there, if any was.
    bound: Option<FileId>,
    mode: Mode,
    /// The group that it shall have, and its name.
    group: Option<(Gid, String)>,
    /// Folders that were made for it, the deepest first.
    made: Vec<PathBuf>,
    lock: Option<Lock>,
}

impl SocketPath {
    /// Takes the path, removing a socket left behind by a dead daemon. Creates the folder if it is missing. The socket
    /// will have this mode and, unless it is empty, this group.
    pub fn take(path: &Path, mode: u32, group: &str) -> Result<Self, SocketPathError> {
        // First what may be wrong with the configuration, so that nothing is left behind.
        let group = group_id(group)?.map(|id| (id, group.to_owned()));
        let mut taken = Self {
            path: path.to_owned(),
            bound: None,
            mode: Mode::from_bits_truncate(mode),
            group,
            made: Vec::new(),
            lock: None,
        };
        taken.take_lock()?;
        remove_stale(path)?;
        Ok(taken)
    }

    /// Whether the path leads to the socket that was bound, and nobody else can take it.
    pub fn is_whole(&self) -> bool {
        self.holds_lock() && self.is_bound()
    }

    /// Takes the path once more, of which somebody has removed or replaced the socket, the lock file or their folder, in
    /// the way of [`SocketPath::take`]; returns another socket, which `bind` makes by [`SocketPath::listen`] or
    /// [`SocketPath::bind`], where the path does not lead to the one before.
    pub fn retake(
        &mut self,
        bind: impl FnOnce(&mut Self) -> Result<OwnedFd, SocketPathError>,
    ) -> Result<Option<OwnedFd>, SocketPathError> {
        if !self.holds_lock() {
            self.take_lock()?;
        }
        if self.is_bound() {
            return Ok(None);
        }
        check_socket_folder(&self.path)?;
        remove_stale(&self.path)?;
        let socket = bind(self);
        if socket.is_err() {
            self.unbind();
        }
        socket.map(Some)
    }

    /// Removes the socket where it is still the one that was bound.
    pub fn unbind(&mut self) {
        if let Some(socket) = self.bound.take() {
            socket.remove_from(&self.path);
        }
    }

    fn holds_lock(&self) -> bool {
        self.lock.as_ref().is_some_and(Lock::is_there)
    }

    fn is_bound(&self) -> bool {
        self.bound.is_some() && FileId::at(&self.path) == self.bound
    }

    /// Takes the lock, and makes the folder first where it is missing.
    fn take_lock(&mut self) -> Result<(), SocketPathError> {
        check_socket_folder(&self.path)?;
        self.make_folders()?;
        // Somebody may have been faster.
        check_socket_folder(&self.path)?;
        self.lock = Some(Lock::take(&self.path)?);
        Ok(())
    }

    /// A socket that listens at the path, non-blocking, with the mode and group that it shall have.
    pub fn listen(&mut self, kind: SockType, backlog: i32) -> Result<OwnedFd, SocketPathError> {
        let listener = self.bind(kind)?;
        let fail = |errno: Errno| SocketPathError::io("listen on", &self.path, errno.into());
        let backlog = Backlog::new(backlog).map_err(fail)?;
        listen(&listener, backlog).map_err(fail)?;
        Ok(listener)
    }

    /// The same of one that does not listen: programs send datagrams to it.
    pub fn bind(&mut self, kind: SockType) -> Result<OwnedFd, SocketPathError> {
        let Self {
            path,
            bound,
            mode,
            group,
            ..
        } = self;
        let path = path.as_path();
        let fail = |what| move |errno: Errno| SocketPathError::io(what, path, errno.into());
        let listener = bind_private(path, kind)?;
        *bound = FileId::at(path);
        if let Some((id, name)) = group {
            fchownat(AT_FDCWD, path, None, Some(*id), AtFlags::AT_SYMLINK_NOFOLLOW).map_err(|errno| {
                match errno {
                    Errno::EPERM => SocketPathError::GroupNotOurs {
                        path: path.into(),
                        group: name.clone(),
                    },
                    errno => fail("change the group of")(errno),
                }
            })?;
        }
        fchmodat(AT_FDCWD, path, *mode, FchmodatFlags::NoFollowSymlink).map_err(fail("set the mode of"))?;
        Ok(listener)
    }

    /// The path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn make_folders(&mut self) -> Result<(), SocketPathError> {
        let path = self.path.clone();
        let missing: Vec<&Path> = (path.ancestors().skip(1))
            .take_while(|folder| !folder.as_os_str().is_empty() && !folder.exists())
            .collect();
        for folder in missing.into_iter().rev() {
            match DirBuilder::new().mode(0o755).create(folder) {
                // One that is made again is in its place already.
                Ok(()) if self.made.iter().any(|made| made == folder) => {}
                Ok(()) => self.made.insert(0, folder.to_owned()),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(SocketPathError::making(folder, error)),
            }
        }
        Ok(())
    }
}

/// A socket at the path that nobody but its owner can open, at no instant, whatever the umask is.
fn bind_private(path: &Path, kind: SockType) -> Result<OwnedFd, SocketPathError> {
    let fail = |what| move |errno: Errno| SocketPathError::io(what, path, errno.into());
    let flags = SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK;
    let socket = socket(AddressFamily::Unix, kind, flags, None).map_err(fail("make a socket for"))?;
    // The file that `bind` makes has the mode of the socket, less the umask.
    fchmod(&socket, Mode::S_IRUSR | Mode::S_IWUSR).map_err(fail("set the mode of"))?;
    let address = UnixAddr::new(path).map_err(fail("listen on"))?;
    bind(socket.as_raw_fd(), &address).map_err(|errno| SocketPathError::making(path, errno.into()))?;
    Ok(socket)
}

fn group_id(name: &str) -> Result<Option<Gid>, SocketPathError> {
    if name.is_empty() {
        return Ok(None);
    }
    let group = Group::from_name(name).ok().flatten();
    let unknown = || SocketPathError::UnknownGroup { group: name.into() };
    group.map(|group| Some(group.gid)).ok_or_else(unknown)
}

/// Whether a socket is at the path; refuses everything else that may be there.
fn refuse_other_files(path: &Path) -> Result<bool, SocketPathError> {
    match fs::symlink_metadata(path) {
        Ok(found) if found.file_type().is_socket() => Ok(true),
        Ok(_) => Err(SocketPathError::NotASocket { path: path.into() }),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(SocketPathError::io("look at", path, error)),
    }
}

/// Removes a socket on which nobody listens.
fn remove_stale(path: &Path) -> Result<(), SocketPathError> {
    if !refuse_other_files(path)? {
        return Ok(());
    }
    let fail = |what| move |error| SocketPathError::io(what, path, error);
    let flags = SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK;
    let knock = socket(AddressFamily::Unix, SockType::Stream, flags, None)
        .and_then(|knock| connect(knock.as_raw_fd(), &UnixAddr::new(path)?));
    match knock {
        Err(Errno::ECONNREFUSED) => fs::remove_file(path).map_err(fail("remove the stale socket")),
        Err(Errno::ENOENT) => Ok(()),
        // A socket of another type, or one whose queue is full, is somebody's as well.
        Ok(()) | Err(Errno::EPROTOTYPE | Errno::EAGAIN) => {
            Err(SocketPathError::Foreign { path: path.into() })
        }
        Err(errno) => Err(fail("see whether anybody listens on")(errno.into())),
    }
}

impl Drop for SocketPath {
    fn drop(&mut self) {
        self.unbind();
        if let Some(lock) = &self.lock {
            lock.remove();
        }
        for folder in &self.made {
            // Fails, rightly, where something else is in it.
            let _ = fs::remove_dir(folder);
        }
    }
}

#[cfg(test)]
mod tests;
