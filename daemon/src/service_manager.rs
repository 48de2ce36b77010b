//! What systemd, or another service manager, is told: sd_notify(3).
//!
//! It may have stopped reading, and no motor waits for it: what finds no room there is dropped. Its socket is opened once, so
//! that it is told of the watchdog also while no more files may be opened.

use std::ffi::OsStr;
use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::sync::OnceLock;

static MANAGER: OnceLock<Manager> = OnceLock::new();

/// Has the service manager told of this process, where it wants to be: a program that runs a daemon as a part of itself
/// has a life of its own, and does not call this.
pub fn attach() {
    if let Some(socket) = std::env::var_os("NOTIFY_SOCKET")
        && let Ok(manager) = Manager::at(&socket)
    {
        let _ = MANAGER.set(manager);
    }
}

/// Tells it something, such as `READY=1`, and says whether it was taken, or nobody wants to be told.
pub fn tell(state: &str) -> bool {
    MANAGER.get().is_none_or(|manager| manager.tell(state).is_ok())
}

struct Manager {
    sender: UnixDatagram,
    address: SocketAddr,
}

impl Manager {
    /// `socket` is a path, or a name behind an `@`.
    fn at(socket: &OsStr) -> io::Result<Self> {
        let address = match socket.as_bytes() {
            [b'@', name @ ..] => SocketAddr::from_abstract_name(name)?,
            _ => SocketAddr::from_pathname(socket)?,
        };
        let sender = UnixDatagram::unbound()?;
        sender.set_nonblocking(true)?;
        Ok(Self { sender, address })
    }

    fn tell(&self, state: &str) -> io::Result<()> {
        self.sender
            .send_to_addr(state.as_bytes(), &self.address)
            .map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_reads_nothing_is_waited_for_by_nobody_and_told_again_once_there_is_room() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let name = format!("@taxeld test {}", std::process::id());
        let abstracted = SocketAddr::from_abstract_name(&name[1..]).unwrap();
        for (socket, manager) in [
            (path.as_os_str(), UnixDatagram::bind(&path).unwrap()),
            (OsStr::new(&name), UnixDatagram::bind_addr(&abstracted).unwrap()),
        ] {
            let told = Manager::at(socket).unwrap();
            let send = |state| told.tell(state);
            let taken = (0..100_000).take_while(|_| send("WATCHDOG=1").is_ok()).count();
            assert!((1..100_000).contains(&taken), "{socket:?}: {taken}");
            let refused = send("READY=1").unwrap_err();
            assert_eq!(refused.kind(), io::ErrorKind::WouldBlock, "{socket:?}");
            let mut read = [0; 100];
            for _ in 0..taken {
                let len = manager.recv(&mut read).unwrap();
                assert_eq!(&read[..len], b"WATCHDOG=1");
            }
            send("READY=1").unwrap();
            let len = manager.recv(&mut read).unwrap();
            assert_eq!(&read[..len], b"READY=1");
        }
        let nobody = Manager::at(OsStr::new("/nowhere/notify")).unwrap();
        assert!(nobody.tell("READY=1").is_err());
    }
}
