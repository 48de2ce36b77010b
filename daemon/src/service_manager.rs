//! What systemd, or another service manager, is told: sd_notify(3).
//!
//! It may have stopped reading, and no motor waits for it: what finds no room there is dropped.

use std::ffi::OsStr;
use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};

/// Tells it something, such as `READY=1`, and says whether it was taken, or nobody wants to be told.
pub fn tell(state: &str) -> bool {
    std::env::var_os("NOTIFY_SOCKET").is_none_or(|socket| send(&socket, state).is_ok())
}

/// `socket` is a path, or a name behind an `@`.
fn send(socket: &OsStr, state: &str) -> io::Result<()> {
    let address = match socket.as_bytes() {
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name)?,
        _ => SocketAddr::from_pathname(socket)?,
    };
    let sender = UnixDatagram::unbound()?;
    sender.set_nonblocking(true)?;
    sender.send_to_addr(state.as_bytes(), &address).map(drop)
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
            let taken = (0..100_000)
                .take_while(|_| send(socket, "WATCHDOG=1").is_ok())
                .count();
            assert!((1..100_000).contains(&taken), "{socket:?}: {taken}");
            let refused = send(socket, "READY=1").unwrap_err();
            assert_eq!(refused.kind(), io::ErrorKind::WouldBlock, "{socket:?}");
            let mut read = [0; 100];
            for _ in 0..taken {
                let len = manager.recv(&mut read).unwrap();
                assert_eq!(&read[..len], b"WATCHDOG=1");
            }
            send(socket, "READY=1").unwrap();
            let len = manager.recv(&mut read).unwrap();
            assert_eq!(&read[..len], b"READY=1");
        }
        assert!(send(OsStr::new("/nowhere/notify"), "READY=1").is_err());
    }
}
