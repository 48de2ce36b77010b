//! A daemon's data socket that sends what a test tells it to.
#![allow(dead_code, reason = "each test binary uses its part")]

use nix::sys::socket::{
    AddressFamily, Backlog, MsgFlags, SockFlag, SockType, UnixAddr, bind, listen, recv, send, socket,
};
use std::os::fd::AsRawFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;

/// A listening `SOCK_SEQPACKET` socket in a directory of its own.
pub(crate) struct FakeDaemon {
    dir: tempfile::TempDir,
    listener: UnixListener,
}

/// One connected client.
pub(crate) struct Client(UnixStream);

impl FakeDaemon {
    pub(crate) fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let fd = socket(
            AddressFamily::Unix,
            SockType::SeqPacket,
            SockFlag::SOCK_CLOEXEC,
            None,
        )
        .unwrap();
        bind(
            fd.as_raw_fd(),
            &UnixAddr::new(&dir.path().join("images.sock")).unwrap(),
        )
        .unwrap();
        listen(&fd, Backlog::new(8).unwrap()).unwrap();
        Self {
            dir,
            listener: UnixListener::from(fd),
        }
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.dir.path().join("images.sock")
    }

    /// The next client that connects.
    pub(crate) fn accept(&self) -> Client {
        Client(self.listener.accept().unwrap().0)
    }
}

impl Client {
    pub(crate) fn send(&self, packet: &[u8]) {
        assert_eq!(
            send(self.0.as_raw_fd(), packet, MsgFlags::MSG_NOSIGNAL).unwrap(),
            packet.len()
        );
    }

    /// The next packet the client sends; empty when it has left.
    pub(crate) fn receive(&self) -> Vec<u8> {
        let mut packet = vec![0; 8192];
        let len = recv(self.0.as_raw_fd(), &mut packet, MsgFlags::empty()).unwrap();
        packet.truncate(len);
        packet
    }
}
