//! The socket of one subscriber.
//!
//! The kernel is asked to tell when it can be written to only while somebody waits for that. Otherwise every message that
//! a reader takes out would wake the thread: nine hundred times for each image with nine hundred readers.
//!
//! The kernel calls a Unix socket writable when a quarter of its send buffer, or less, has not been read, and takes
//! messages until the buffer is full. What is to be fresh when it is read is sent to a writable socket only, so that few
//! messages get old in it, and a reader that has taken them is sent the newest.

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::socket::{MsgFlags, Shutdown, UnixCredentials, getsockopt, recv, sendmsg, shutdown, sockopt};
use std::cell::RefCell;
use std::future::poll_fn;
use std::io::{self, IoSlice};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

/// A connected `SOCK_SEQPACKET` socket that does not block. One task at a time may wait for it.
#[derive(Debug)]
pub(crate) struct Socket {
    registered: RefCell<Registered>,
}

/// When a packet is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Room {
    /// As long as the send buffer has room.
    Any,
    /// While little before it is unread: it is to be fresh when it is read.
    Fresh,
}

/// What the kernel keeps of a message of so many bytes, at most: it takes powers of two, and adds what describes it.
pub(crate) const fn kept_bytes(message: usize) -> usize {
    const SHARED: usize = 320;
    const HEAD: usize = 256;
    2 * (message + SHARED) + HEAD
}

/// The send buffer in which as much as this is unread while the socket is writable. The kernel doubles what is asked for.
pub(crate) const fn send_buffer(unread: usize) -> usize {
    2 * unread
}

/// What the kernel tells of a socket.
#[derive(Debug)]
enum Registered {
    /// That it can be read.
    Read(AsyncFd<Arc<OwnedFd>>),
    /// That it can be read or written to.
    Both(AsyncFd<Arc<OwnedFd>>),
    /// Nothing: it is closed, since the kernel had no memory to register it once more.
    Closed,
}

impl Registered {
    fn descriptor(&self) -> io::Result<&AsyncFd<Arc<OwnedFd>>> {
        match self {
            Self::Read(descriptor) | Self::Both(descriptor) => Ok(descriptor),
            Self::Closed => Err(Errno::EBADF.into()),
        }
    }

    /// Registers it for something else. The kernel tells at once of what is so already.
    fn change(&mut self, interest: Interest) -> io::Result<()> {
        if let Self::Read(descriptor) | Self::Both(descriptor) = std::mem::replace(self, Self::Closed) {
            let descriptor = register(descriptor.into_inner(), interest)?;
            *self = match interest.is_writable() {
                true => Self::Both(descriptor),
                false => Self::Read(descriptor),
            };
        }
        Ok(())
    }
}

/// Has the kernel tell of a descriptor.
#[allow(
    deprecated,
    reason = "its successor is unsafe for the sake of types that may change their descriptor; an OwnedFd cannot"
)]
fn register(descriptor: Arc<OwnedFd>, interest: Interest) -> io::Result<AsyncFd<Arc<OwnedFd>>> {
    AsyncFd::with_interest(descriptor, interest)
}

/// Which sockets are writable, asked in one call: a call for each costs a fifth of the sending.
pub(crate) fn are_writable<'a>(sockets: impl IntoIterator<Item = BorrowedFd<'a>>) -> io::Result<Vec<bool>> {
    let ask = |socket| PollFd::new(socket, PollFlags::POLLOUT);
    let mut asked: Vec<_> = sockets.into_iter().map(ask).collect();
    poll(&mut asked, PollTimeout::ZERO)?;
    Ok(asked.iter().map(|asked| asked.any().unwrap_or(true)).collect())
}

impl Socket {
    pub(crate) fn new(descriptor: OwnedFd) -> io::Result<Self> {
        let descriptor = register(Arc::new(descriptor), Interest::READABLE)?;
        Ok(Self {
            registered: RefCell::new(Registered::Read(descriptor)),
        })
    }

    /// It, to be sent to by another thread; `None` where it is closed.
    pub(crate) fn descriptor(&self) -> Option<Arc<OwnedFd>> {
        let registered = self.registered.borrow();
        Some(registered.descriptor().ok()?.get_ref().clone())
    }

    /// Who is at the other end.
    pub(crate) fn peer(&self) -> Option<UnixCredentials> {
        let registered = self.registered.borrow();
        getsockopt(registered.descriptor().ok()?, sockopt::PeerCredentials).ok()
    }

    pub(crate) fn set_send_buffer(&self, bytes: usize) -> io::Result<()> {
        let registered = self.registered.borrow();
        let descriptor = registered.descriptor()?.as_fd();
        Ok(nix::sys::socket::setsockopt(
            &descriptor,
            sockopt::SndBuf,
            &bytes,
        )?)
    }

    /// Waits for a packet and leaves it where it is; returns its length, 0 where the other end is closed.
    pub(crate) fn poll_len(&self, cx: &mut Context) -> Poll<io::Result<usize>> {
        self.poll_recv_with(cx, &mut [], MsgFlags::MSG_PEEK | MsgFlags::MSG_TRUNC)
    }

    /// Waits for a packet; returns its length, 0 where the other end is closed.
    pub(crate) fn poll_recv(&self, cx: &mut Context, buffer: &mut [u8]) -> Poll<io::Result<usize>> {
        self.poll_recv_with(cx, buffer, MsgFlags::empty())
    }

    fn poll_recv_with(
        &self,
        cx: &mut Context,
        buffer: &mut [u8],
        flags: MsgFlags,
    ) -> Poll<io::Result<usize>> {
        let registered = self.registered.borrow();
        let descriptor = registered.descriptor()?;
        let flags = flags | MsgFlags::MSG_DONTWAIT;
        loop {
            let mut guard = ready!(descriptor.poll_read_ready(cx))?;
            let received = guard.try_io(|d| Ok(recv(d.as_raw_fd(), buffer, flags)?));
            match received {
                Ok(Err(error)) if error.kind() == io::ErrorKind::Interrupted => {}
                Ok(result) => return Poll::Ready(result),
                Err(_would_block) => {}
            }
        }
    }

    /// Takes nothing more, and drops what was not taken. A socket that is closed with something unread is reset, which the
    /// other end is told before it is given what was sent to it.
    pub(crate) fn stop_receiving(&self) {
        let registered = self.registered.borrow();
        if let Ok(descriptor) = registered.descriptor() {
            let _ = shutdown(descriptor.as_raw_fd(), Shutdown::Read);
            let mut byte = [0];
            while let Ok(1..) = recv(descriptor.as_raw_fd(), &mut byte, MsgFlags::MSG_DONTWAIT) {}
        }
    }

    /// Sends a packet if there is room for it at once; otherwise the error is `EAGAIN`.
    pub(crate) fn try_send(&self, packet: &[IoSlice], room: Room) -> io::Result<()> {
        let registered = self.registered.borrow();
        let descriptor = registered.descriptor()?;
        if room == Room::Fresh && are_writable([descriptor.as_fd()])? == [false] {
            return Err(Errno::EAGAIN.into());
        }
        let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL;
        sendmsg::<()>(descriptor.as_raw_fd(), packet, &[], flags, None)?;
        Ok(())
    }

    /// Sends a packet as soon as there is room for it.
    pub(crate) fn poll_send(&self, cx: &mut Context, packet: &[IoSlice], room: Room) -> Poll<io::Result<()>> {
        loop {
            match self.try_send(packet, room) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Poll::Ready(Err(error)),
                Ok(()) => {
                    let mut registered = self.registered.borrow_mut();
                    if matches!(*registered, Registered::Both(_)) {
                        registered.change(Interest::READABLE)?;
                    }
                    return Poll::Ready(Ok(()));
                }
            }
            let mut registered = self.registered.borrow_mut();
            if matches!(*registered, Registered::Read(_)) {
                registered.change(Interest::READABLE | Interest::WRITABLE)?;
            }
            // What is told from now on ends the next wait.
            ready!(registered.descriptor()?.poll_write_ready(cx))?.clear_ready();
        }
    }

    /// Sends a packet as soon as there is room for it.
    pub(crate) async fn send(&self, packet: &[u8]) -> io::Result<()> {
        poll_fn(|cx| self.poll_send(cx, &[IoSlice::new(packet)], Room::Any)).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::sys::socket::{AddressFamily, SockFlag, SockType, socketpair};
    use std::time::Duration;
    use tokio::time::timeout;

    /// A socket and its other end.
    fn pair() -> (Socket, OwnedFd) {
        let flags = SockFlag::SOCK_NONBLOCK | SockFlag::SOCK_CLOEXEC;
        let (ours, theirs) = socketpair(AddressFamily::Unix, SockType::SeqPacket, None, flags).unwrap();
        (Socket::new(ours).unwrap(), theirs)
    }

    fn fill(socket: &Socket) -> usize {
        (0..100_000)
            .find(|_| socket.try_send(&[IoSlice::new(&[7; 100])], Room::Any).is_err())
            .unwrap()
    }

    fn take(theirs: &OwnedFd) -> Result<usize, Errno> {
        recv(theirs.as_raw_fd(), &mut [0; 1000], MsgFlags::MSG_DONTWAIT)
    }

    fn waits_for_room(socket: &Socket) -> bool {
        matches!(*socket.registered.borrow(), Registered::Both(_))
    }

    #[tokio::test(flavor = "current_thread")]
    async fn it_waits_for_room_and_only_then_asks_to_be_told_of_it() {
        let (socket, theirs) = pair();
        socket.send(&[1; 100]).await.unwrap();
        for _ in 0..3 {
            let sent = fill(&socket);
            assert!(sent > 10 && !waits_for_room(&socket));
            let short = timeout(Duration::from_millis(20), socket.send(&[2; 50]));
            assert!(short.await.is_err(), "a packet more than there is room for");
            assert!(waits_for_room(&socket));
            let (outcome, taken) = tokio::join!(socket.send(&[3; 60]), async {
                tokio::task::yield_now().await;
                let mut taken = 0;
                while take(&theirs).is_ok() {
                    taken += 1;
                }
                taken
            });
            outcome.unwrap();
            assert!(!waits_for_room(&socket));
            assert!(taken >= sent, "{taken} of {sent}");
            assert_eq!(take(&theirs), Ok(60));
        }
    }

    #[tokio::test(flavor = "current_thread")]
    async fn of_what_is_to_be_fresh_one_packet_is_unread_when_the_next_is_sent() {
        let mut packet = [0; 300_000];
        for bytes in [200, 300, 450, 704, 705, 1728, 3000, 10_000, 40_000, 90_000] {
            let (socket, theirs) = pair();
            socket.set_send_buffer(send_buffer(kept_bytes(bytes))).unwrap();
            let mut send = |number: u8| {
                packet[0] = number;
                socket
                    .try_send(&[IoSlice::new(&packet[..bytes])], Room::Fresh)
                    .is_ok()
            };
            let queued = (0..100).find(|n| !send(*n)).unwrap();
            assert!((2..=3).contains(&queued), "{queued} of {bytes} bytes");
            // A reader that takes one at a time is sent the newest each time.
            for number in 100..110 {
                let before = take(&theirs);
                assert_eq!(before, Ok(bytes.min(1000)));
                assert!(send(number) || queued > 2, "{bytes}");
            }
            let short = timeout(
                Duration::from_millis(20),
                poll_fn(|cx| socket.poll_send(cx, &[IoSlice::new(&packet[..bytes])], Room::Fresh)),
            );
            assert!(short.await.is_err(), "{bytes}");
            socket.send(b"news").await.unwrap();
        }
    }

    #[tokio::test(flavor = "current_thread")]
    async fn the_last_words_are_read_before_the_end_though_something_was_not_taken() {
        let (socket, theirs) = pair();
        for _ in 0..3 {
            nix::sys::socket::send(theirs.as_raw_fd(), b"more", MsgFlags::MSG_DONTWAIT).unwrap();
        }
        socket.stop_receiving();
        socket.send(b"farewell").await.unwrap();
        drop(socket);
        assert_eq!((take(&theirs), take(&theirs)), (Ok(8), Ok(0)));
    }

    #[tokio::test(flavor = "current_thread")]
    async fn what_the_other_end_sends_comes_while_room_is_waited_for_and_so_does_its_end() {
        let (socket, theirs) = pair();
        fill(&socket);
        let short = timeout(Duration::from_millis(20), socket.send(&[2; 50]));
        assert!(short.await.is_err());
        let mut buffer = [0; 100];
        let flags = MsgFlags::MSG_DONTWAIT;
        nix::sys::socket::send(theirs.as_raw_fd(), b"subscribe", flags).unwrap();
        assert_eq!(
            poll_fn(|cx| socket.poll_len(cx)).await.unwrap(),
            b"subscribe".len()
        );
        let received = poll_fn(|cx| socket.poll_recv(cx, &mut buffer)).await.unwrap();
        assert_eq!(&buffer[..received], b"subscribe");
        let (ended, ()) = tokio::join!(socket.send(&[2; 50]), async {
            tokio::task::yield_now().await;
            drop(theirs);
        });
        assert!(ended.is_err(), "nobody will read it");
    }
}
