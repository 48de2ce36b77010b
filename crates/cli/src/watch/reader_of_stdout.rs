//! Stdout that a program reads through a pipe: whether it has taken what was written.
//!
//! A pipe holds 64 KiB, of a hand's images some fifty lines: whoever is slow would read what was felt seconds ago. So a line is
//! written when the one before was taken.
#![allow(unsafe_code)]

use nix::errno::Errno;
use nix::fcntl::{FcntlArg, fcntl};
use nix::libc::{self, c_int};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::socket::sockopt::{SndBuf, SockType as TypeOf};
use nix::sys::socket::{MsgFlags, SockType, SockaddrStorage, getpeername, getsockopt, send, setsockopt};
use nix::unistd::write;
use std::fs::File;
use std::io::{self, ErrorKind};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd, RawFd};
use std::os::unix::fs::FileTypeExt;
use std::time::Duration;

/// What a pipe with room takes at once (`PIPE_BUF` of Linux), and a page: as small as a pipe can be.
const PIPE_BUF: usize = 4096;
/// Between two looks whether all was read, where nothing else tells when.
const LOOK: Duration = Duration::from_millis(2);

nix::ioctl_read_bad!(unread_of_pipe, libc::FIONREAD, c_int);
nix::ioctl_read_bad!(unread_of_socket, libc::TIOCOUTQ, c_int);

/// A pipe, a FIFO or a stream socket, and the line that is on its way into it.
#[derive(Debug)]
pub(super) struct ReaderOfStdout {
    out: OwnedFd,
    is_socket: bool,
    line: Vec<u8>,
    written: usize,
    /// Whether there was room and yet something unread, so that room does not tell when a line may begin.
    must_look: bool,
}

/// What is there to be done.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ready {
    /// There is something to read of the other side.
    pub(super) other: bool,
    /// The reader can be given something: the rest of the line, or the next one.
    pub(super) reader: bool,
}

impl ReaderOfStdout {
    /// The reader, where `out` is a pipe, a FIFO or a stream socket. A file, a device and a terminal have none.
    ///
    /// A pipe is made as small as it can be: then it has room when it is empty, which can be waited for. The same is done
    /// with a socket's send buffer. Where that is refused, it is looked at time and again.
    pub(super) fn of(out: impl AsFd) -> io::Result<Option<Self>> {
        let out = File::from(out.as_fd().try_clone_to_owned()?);
        let kind = out.metadata()?.file_type();
        let is_stream = || getsockopt(&out, TypeOf) == Ok(SockType::Stream);
        let has_peer = || getpeername::<SockaddrStorage>(out.as_raw_fd()).is_ok();
        let is_socket = kind.is_socket() && is_stream() && has_peer();
        if is_socket {
            let _ = setsockopt(&out, SndBuf, &0);
        } else if kind.is_fifo() {
            let _ = fcntl(&out, FcntlArg::F_SETPIPE_SZ(PIPE_BUF as c_int));
        } else {
            return Ok(None);
        }
        Ok(Some(Self {
            out: out.into(),
            is_socket,
            line: Vec::new(),
            written: 0,
            must_look: false,
        }))
    }

    /// Whether no line is on its way.
    pub(super) fn is_between_lines(&self) -> bool {
        self.written == self.line.len()
    }

    /// Sets out to write a line, behind a whole one.
    pub(super) fn begin(&mut self, line: &str) {
        debug_assert!(self.is_between_lines());
        self.line.clear();
        self.line.extend_from_slice(line.as_bytes());
        self.line.push(b'\n');
        self.written = 0;
    }

    /// Waits until `other` can be read, where there is one, or until the reader can be given something, where `gives` says that
    /// something is to be given.
    ///
    /// # Errors
    /// [`ErrorKind::BrokenPipe`] where the reader is gone.
    pub(super) fn wait(&mut self, other: Option<BorrowedFd<'_>>, gives: bool) -> io::Result<Ready> {
        loop {
            let looks = gives && self.must_look && self.is_between_lines();
            let room = if gives && !looks {
                PollFlags::POLLOUT
            } else {
                PollFlags::empty()
            };
            let patience = match looks {
                true => PollTimeout::try_from(LOOK).unwrap_or(PollTimeout::ZERO),
                false => PollTimeout::NONE,
            };
            let mut fds = vec![PollFd::new(self.out.as_fd(), room)];
            fds.extend(other.map(|other| PollFd::new(other, PollFlags::POLLIN)));
            match poll(&mut fds, patience) {
                Err(Errno::EINTR) => continue,
                polled => polled?,
            };
            let events: Vec<PollFlags> = fds
                .iter()
                .map(|fd| fd.revents().unwrap_or(PollFlags::empty()))
                .collect();
            if events[0].intersects(PollFlags::POLLERR | PollFlags::POLLHUP) {
                return Err(ErrorKind::BrokenPipe.into());
            }
            let has_room = looks || events[0].contains(PollFlags::POLLOUT);
            let ready = Ready {
                other: events.get(1).is_some_and(|events| !events.is_empty()),
                reader: has_room && (!self.is_between_lines() || self.has_taken_all()?),
            };
            self.must_look = has_room && !ready.reader;
            if ready.other || ready.reader {
                return Ok(ready);
            }
        }
    }

    /// Whether nothing that was written is still to be read.
    fn has_taken_all(&self) -> io::Result<bool> {
        let mut unread: c_int = 0;
        let count: unsafe fn(RawFd, *mut c_int) -> nix::Result<c_int> = if self.is_socket {
            unread_of_socket
        } else {
            unread_of_pipe
        };
        // SAFETY: the descriptor is open as long as it is owned, and the kernel writes one int, which lives through the call.
        unsafe { count(self.out.as_raw_fd(), &mut unread) }?;
        Ok(unread == 0)
    }

    /// Writes what there is room for of the line. Where there is none, nothing; it does not wait, if there was any.
    pub(super) fn write(&mut self) -> io::Result<()> {
        let rest = &self.line[self.written..];
        let written = match self.is_socket {
            true => send(
                self.out.as_raw_fd(),
                rest,
                MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL,
            ),
            false => write(&self.out, &rest[..rest.len().min(PIPE_BUF)]),
        };
        match written {
            Ok(bytes) => self.written += bytes,
            Err(Errno::EAGAIN | Errno::EINTR) => {}
            Err(errno) => return Err(errno.into()),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::sys::socket::{AddressFamily, SockFlag, socketpair};
    use std::io::{Read, Write};
    use std::os::unix::net::UnixStream;

    /// Both ends of a pipe.
    fn pipe() -> (File, File) {
        let (from, to) = nix::unistd::pipe().unwrap();
        (from.into(), to.into())
    }

    /// And of a socket, as a child of Node.js has it.
    fn sockets() -> (File, File) {
        let kind = (AddressFamily::Unix, SockType::Stream);
        let (from, to) = socketpair(kind.0, kind.1, None, SockFlag::empty()).unwrap();
        (from.into(), to.into())
    }

    fn reader(to: &File) -> ReaderOfStdout {
        ReaderOfStdout::of(to).unwrap().unwrap()
    }

    /// Whether a line may begin, or goes on, now.
    fn is_ready(reader: &mut ReaderOfStdout, always: &UnixStream) -> bool {
        let ready = reader.wait(Some(always.as_fd()), true).unwrap();
        assert!(ready.other, "it can always be read");
        ready.reader
    }

    /// Something that can be read, so that nothing is waited for.
    fn always() -> [UnixStream; 2] {
        let (here, mut there) = UnixStream::pair().unwrap();
        there.write_all(b".").unwrap();
        [here, there]
    }

    #[test]
    fn a_line_begins_when_all_of_the_one_before_was_taken() {
        let [always, _there] = always();
        for (mut from, to) in [pipe(), sockets()] {
            let mut reader = reader(&to);
            for line in ["first", "second"] {
                assert!(is_ready(&mut reader, &always));
                reader.begin(line);
                reader.write().unwrap();
                assert!(reader.is_between_lines());
                let mut taken = vec![0; line.len() + 1];
                let (begin, end) = taken.split_at_mut(3);
                for part in [begin, end] {
                    for _ in 0..3 {
                        assert!(!is_ready(&mut reader, &always), "{line}");
                    }
                    from.read_exact(part).unwrap();
                }
                assert_eq!(taken, format!("{line}\n").as_bytes());
            }
        }
    }

    #[test]
    fn where_the_pipe_stays_large_a_line_waits_for_what_is_in_it() {
        let [always, _there] = always();
        let (mut from, mut to) = pipe();
        let mut before = vec![b'.'; 2 * PIPE_BUF];
        to.write_all(&before).unwrap();
        let mut reader = reader(&to);
        for _ in 0..3 {
            assert!(!is_ready(&mut reader, &always));
        }
        from.read_exact(&mut before).unwrap();
        assert!(is_ready(&mut reader, &always));
    }

    #[test]
    fn a_long_line_arrives_whole_while_other_things_come() {
        let [always, _there] = always();
        let line: String = ('a'..='z').cycle().take(300_000).collect();
        for (mut from, to) in [pipe(), sockets()] {
            let mut reader = reader(&to);
            reader.begin(&line);
            let mut taken = Vec::new();
            let mut part = [0; 1000];
            while !reader.is_between_lines() {
                // It does not wait where there is no room.
                while !reader.is_between_lines() && is_ready(&mut reader, &always) {
                    reader.write().unwrap();
                }
                let read = from.read(&mut part).unwrap();
                taken.extend_from_slice(&part[..read]);
            }
            drop((reader, to));
            from.read_to_end(&mut taken).unwrap();
            assert_eq!(taken, format!("{line}\n").as_bytes());
        }
    }

    #[test]
    fn a_reader_that_is_gone_is_told_though_nothing_is_to_be_given() {
        for (from, to) in [pipe(), sockets()] {
            let mut reader = reader(&to);
            drop(from);
            let gone = reader.wait(None, false).unwrap_err();
            assert_eq!(gone.kind(), ErrorKind::BrokenPipe);
        }
    }

    #[test]
    fn a_file_a_device_and_packets_have_no_reader() {
        let file = tempfile::tempfile().unwrap();
        let device = File::options().write(true).open("/dev/null").unwrap();
        let (packets, _) =
            socketpair(AddressFamily::Unix, SockType::Datagram, None, SockFlag::empty()).unwrap();
        let alone =
            nix::sys::socket::socket(AddressFamily::Unix, SockType::Stream, SockFlag::empty(), None).unwrap();
        for out in [file, device, packets.into(), alone.into()] {
            assert!(ReaderOfStdout::of(&out).unwrap().is_none(), "{out:?}");
        }
    }
}
