//! Connecting to a daemon, which may hang.

use nix::errno::Errno;
use nix::sys::socket::{
    AddressFamily, SockFlag, SockType, UnixAddr, connect as connect_to, setsockopt, socket, sockopt,
};
use nix::sys::time::{TimeVal, TimeValLike};
use std::io;
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

/// How long a daemon is waited for that takes no connection.
pub(crate) const PATIENCE: Duration = Duration::from_secs(5);

/// Connects to a socket that takes requests, such as `status.sock`. What is written to it waits for five seconds at most.
///
/// # Errors
/// What the kernel says; `TimedOut` where the daemon takes no connection for five seconds, as one that hangs.
pub fn connect_for_requests(path: &Path) -> io::Result<UnixStream> {
    Ok(UnixStream::from(connect(path, SockType::Stream)?))
}

/// The same for a socket of any type.
pub(crate) fn connect(path: &Path, kind: SockType) -> nix::Result<OwnedFd> {
    connect_within(PATIENCE, path, kind)
}

fn connect_within(patience: Duration, path: &Path, kind: SockType) -> nix::Result<OwnedFd> {
    let fd = socket(AddressFamily::Unix, kind, SockFlag::SOCK_CLOEXEC, None)?;
    let address = UnixAddr::new(path)?;
    // Else the kernel waits for ever for room in the queue of those that are not accepted yet.
    let patience = TimeVal::microseconds(patience.as_micros() as i64);
    setsockopt(&fd, sockopt::SendTimeout, &patience)?;
    match retry(|| connect_to(fd.as_raw_fd(), &address)) {
        Ok(()) => Ok(fd),
        Err(Errno::EAGAIN) => Err(Errno::ETIMEDOUT),
        Err(errno) => Err(errno),
    }
}

/// Calls again what a signal interrupted.
pub(crate) fn retry<T>(mut call: impl FnMut() -> nix::Result<T>) -> nix::Result<T> {
    loop {
        match call() {
            Err(Errno::EINTR) => {}
            result => return result,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::sys::socket::{Backlog, bind, listen};

    #[test]
    fn a_daemon_that_takes_no_connection_is_not_waited_for_without_end() {
        let folder = tempfile::tempdir().unwrap();
        for kind in [SockType::Stream, SockType::SeqPacket] {
            let path = folder.path().join(format!("{kind:?}"));
            let hangs = socket(AddressFamily::Unix, kind, SockFlag::SOCK_CLOEXEC, None).unwrap();
            bind(hangs.as_raw_fd(), &UnixAddr::new(&path).unwrap()).unwrap();
            listen(&hangs, Backlog::new(1).unwrap()).unwrap();
            let queue: Vec<_> = (0..9)
                .map(|_| connect_within(Duration::from_millis(10), &path, kind))
                .collect();
            assert!(queue[0].is_ok(), "{queue:?}");
            assert_eq!(queue[8].as_ref().err(), Some(&Errno::ETIMEDOUT), "{queue:?}");
        }
    }
}
