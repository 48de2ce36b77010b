//! A blocking reader of a running daemon's images.

use crate::connect::{PATIENCE, connect, retry};
use crate::error::DecodeError;
use crate::format::MAX_MESSAGE;
use crate::header::{Flags, Header, Kind};
use crate::hello::{Clock, Hello};
use crate::image::ImageView;
use crate::message::{Body, decode_packet};
use crate::raw::RawView;
use crate::socket_access::who_may_open;
use crate::socket_folder::{UntrustedFolder, check_socket_folder};
use crate::text::{Event, EventKind, MAX_TEXT, Subscribe};
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::socket::{MsgFlags, SockType, recv, send};
use nix::time::{ClockId, clock_gettime};
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A connection to a daemon's data socket.
///
/// ```no_run
/// let mut subscriber = taxel_wire::Subscriber::connect("/run/taxeld/images.sock")?;
/// loop {
///     let (header, image) = subscriber.next_image()?;
///     println!("{}: {} contacts, {} actuators", header.seq, image.contacts, image.actuators().len());
/// }
/// # #[allow(unreachable_code)]
/// # Ok::<(), taxel_wire::ReadError>(())
/// ```
#[derive(Debug)]
pub struct Subscriber {
    socket: OwnedFd,
    buffer: Vec<u8>,
    /// Bytes in the buffer of the packet that was taken last.
    packet_len: usize,
    text: Vec<u8>,
    unfinished_text: Option<Kind>,
    hello: Option<Hello>,
}

/// What came from the daemon, borrowed from the subscriber until it is asked for the next. The
/// header of a text in several parts is that of its last.
#[derive(Debug, Clone, PartialEq)]
pub enum Received<'a> {
    /// The description of hand and display; comes first, and again when it changes.
    Hello(&'a Hello),
    /// A tactile image.
    Image(Header, ImageView<'a>),
    /// Raw counts, where subscribed.
    Raw(Header, RawView<'a>),
    /// A status report, where subscribed.
    Status(Header, serde_json::Value),
    /// Something to tell people.
    Event(Header, Event),
    /// A completed touch and its category, from programs that publish such; keys as in `docs/wire.md`.
    Touch(Header, serde_json::Value),
    /// An estimate of where on the forearm the hand holds, from programs that publish such.
    Estimate(Header, serde_json::Value),
    /// A message of a later version.
    Other(Header),
}

/// What to look at where a socket cannot be connected to.
fn connect_advice(path: &Path, error: &io::Error) -> String {
    match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::EPROTOTYPE) => {
            "that socket takes requests; images come from images.sock beside it".into()
        }
        Some(Errno::EACCES) => who_may_open(path),
        Some(Errno::ETIMEDOUT) => "its log says what it does, and where it hangs, restart it".into(),
        _ => "is taxeld running there?".into(),
    }
}

/// Why there is no message. Where the connection has [ended](ReadError::is_end) connect again; after the
/// others the next message may be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// No connection to the daemon.
    #[error("cannot connect to {path}: {source}; {}", connect_advice(path, source))]
    Connect {
        /// The socket.
        path: PathBuf,
        /// What the kernel says.
        source: io::Error,
    },
    /// Whoever listens in that folder may be anybody.
    #[error(transparent)]
    Folder(#[from] UntrustedFolder),
    /// The daemon closed the connection.
    #[error("taxeld closed the connection")]
    Closed,
    /// The daemon closed the connection, and said why.
    #[error("taxeld closed the connection: {0}")]
    Disconnected(String),
    /// The connection failed.
    #[error("connection to taxeld: {0}")]
    Socket(io::Error),
    /// A message that cannot be read.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// A text that is not the JSON it should be.
    #[error("the text of a {kind:?} message: {source}")]
    Json {
        /// Type of the message.
        kind: Kind,
        /// What is wrong with it.
        source: serde_json::Error,
    },
    /// A text in several parts of which one is missing, or which is longer than [`MAX_TEXT`].
    #[error("the text of a {kind:?} message was cut off after {len} bytes")]
    BrokenText {
        /// Type of the message.
        kind: Kind,
        /// Bytes that had come.
        len: usize,
    },
}

impl ReadError {
    /// Whether nothing more comes over this connection.
    pub fn is_end(&self) -> bool {
        matches!(self, Self::Closed | Self::Disconnected(_) | Self::Socket(_))
    }
}

/// A message that is wholly there.
enum Ready {
    Packet(usize),
    Text(Header),
}

impl Subscriber {
    /// Connects to the daemon that listens at `path`, and waits five seconds at most for one that hangs. A folder `/tmp/taxeld-UID` is refused where somebody else than
    /// UID owns or may write it.
    pub fn connect(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = path.as_ref();
        check_socket_folder(path)?;
        let socket = connect(path, SockType::SeqPacket).map_err(|errno| ReadError::Connect {
            path: path.to_owned(),
            source: errno.into(),
        })?;
        Ok(Self::from_socket(socket))
    }

    /// Reads from a connected `SOCK_SEQPACKET` socket.
    pub fn from_socket(socket: OwnedFd) -> Self {
        Self {
            socket,
            buffer: vec![0; MAX_MESSAGE],
            packet_len: 0,
            text: Vec::new(),
            unfinished_text: None,
            hello: None,
        }
    }

    /// Tells the daemon what to send; without it every image comes and no raw counts. It replaces
    /// the subscription before. The answer is a HELLO that tells what is in force, or an EVENT that says
    /// why it is refused. Where the daemon has closed the connection, it is an error that says why if the daemon did; what
    /// else was unread is passed over.
    pub fn subscribe(&mut self, subscribe: &Subscribe) -> Result<(), ReadError> {
        let packet = subscribe.to_packet();
        match retry(|| send(self.socket.as_raw_fd(), &packet, MsgFlags::MSG_NOSIGNAL)) {
            Ok(_) => Ok(()),
            Err(Errno::EPIPE | Errno::ECONNRESET) => Err(self.farewell()),
            Err(errno) => Err(ReadError::Socket(errno.into())),
        }
    }

    /// Why the daemon closes the connection: what it sends last may come after it has ceased to read.
    fn farewell(&mut self) -> ReadError {
        let deadline = Instant::now() + PATIENCE;
        loop {
            match self.next_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(Some(Received::Event(_, event))) if event.event == EventKind::Disconnect => {
                    return ReadError::Disconnected(event.message);
                }
                Err(error) if error.is_end() => return error,
                Ok(Some(_)) | Err(_) if Instant::now() < deadline => {}
                Ok(_) | Err(_) => return ReadError::Closed,
            }
        }
    }

    /// The newest description of hand and display, once it has come.
    pub fn hello(&self) -> Option<&Hello> {
        self.hello.as_ref()
    }

    /// Waits for the next message of any type.
    #[expect(
        clippy::should_implement_trait,
        reason = "what it returns borrows from the subscriber"
    )]
    pub fn next(&mut self) -> Result<Received<'_>, ReadError> {
        loop {
            if let Some(ready) = self.receive(None)? {
                return self.take(ready);
            }
        }
    }

    /// Waits for the next message of any type, at most for `timeout`.
    pub fn next_timeout(&mut self, timeout: Duration) -> Result<Option<Received<'_>>, ReadError> {
        match self.receive(Instant::now().checked_add(timeout))? {
            Some(ready) => self.take(ready).map(Some),
            None => Ok(None),
        }
    }

    /// Waits for the next image and passes over everything else, but remembers the description.
    pub fn next_image(&mut self) -> Result<(Header, ImageView<'_>), ReadError> {
        loop {
            match self.receive(None)? {
                Some(Ready::Packet(len)) if Header::decode(&self.buffer[..len])?.kind == Kind::Image => {
                    return match self.take(Ready::Packet(len))? {
                        Received::Image(header, image) => Ok((header, image)),
                        other => unreachable!("an IMAGE message was read as {other:?}"),
                    };
                }
                Some(ready) => drop(self.take(ready)?),
                None => {}
            }
        }
    }

    /// The bytes of the image, raw frame or other message that was received last, to be kept and [decoded](decode_packet)
    /// again; none behind a text.
    pub fn packet(&self) -> &[u8] {
        &self.buffer[..self.packet_len]
    }

    /// How long after its time of validity a message is being looked at, nanoseconds.
    ///
    /// None before HELLO has told the clock, and for recordings, whose clock tells no latency.
    pub fn latency_ns(&self, header: &Header) -> Option<i64> {
        let clock = match self.hello.as_ref()?.clock {
            Clock::Monotonic => ClockId::CLOCK_MONOTONIC,
            Clock::Realtime => ClockId::CLOCK_REALTIME,
            Clock::Recording | Clock::Unknown => return None,
        };
        let now = Duration::from(clock_gettime(clock).ok()?);
        i64::try_from(now.as_nanos())
            .ok()?
            .checked_sub(i64::try_from(header.t_ns).ok()?)
    }

    /// Receives packets until a message is whole; none by the deadline.
    fn receive(&mut self, deadline: Option<Instant>) -> Result<Option<Ready>, ReadError> {
        self.packet_len = 0;
        loop {
            if let Some(deadline) = deadline
                && !self.wait(deadline)?
            {
                return Ok(None);
            }
            let fd = self.socket.as_raw_fd();
            let len = match retry(|| recv(fd, &mut self.buffer, MsgFlags::MSG_TRUNC)) {
                Ok(0) => return Err(ReadError::Closed),
                Ok(len) => len,
                // The daemon left with our subscription unread; what it said before can be read still.
                Err(Errno::ECONNRESET) => continue,
                Err(errno) => return Err(ReadError::Socket(errno.into())),
            };
            if len > self.buffer.len() {
                // The header says the same and is refused for it.
                Header::decode(&self.buffer)?;
                return Err(DecodeError::Trailing {
                    expected: self.buffer.len(),
                    extra: len - self.buffer.len(),
                }
                .into());
            }
            let header = Header::decode(&self.buffer[..len])?;
            match header.kind {
                Kind::Hello | Kind::Status | Kind::Event | Kind::Touch | Kind::Estimate => {
                    if self.add_text(len, header.kind)? {
                        return Ok(Some(Ready::Text(header)));
                    }
                }
                _ => {
                    self.whole_text()?;
                    return Ok(Some(Ready::Packet(len)));
                }
            }
        }
    }

    /// Adds a packet's text to what came before; returns whether it is whole.
    fn add_text(&mut self, len: usize, kind: Kind) -> Result<bool, ReadError> {
        let message = decode_packet(&self.buffer[..len])?;
        let (Body::Hello(part)
        | Body::Status(part)
        | Body::Event(part)
        | Body::Touch(part)
        | Body::Estimate(part)) = message.body
        else {
            unreachable!("a {kind:?} message has text");
        };
        if self.unfinished_text != Some(kind) {
            let broken = self.unfinished_text.take();
            if let Some(kind) = broken {
                return Err(ReadError::BrokenText {
                    kind,
                    len: self.text.len(),
                });
            }
            self.text.clear();
        }
        let whole = !message.header.flags.contains(Flags::MORE);
        self.unfinished_text = (!whole).then_some(kind);
        if self.text.len() + part.len() > MAX_TEXT {
            self.unfinished_text = None;
            return Err(ReadError::BrokenText {
                kind,
                len: self.text.len(),
            });
        }
        self.text.extend_from_slice(part);
        Ok(whole)
    }

    /// An unfinished text must not be followed by anything else.
    fn whole_text(&mut self) -> Result<(), ReadError> {
        match self.unfinished_text.take() {
            Some(kind) => Err(ReadError::BrokenText {
                kind,
                len: self.text.len(),
            }),
            None => Ok(()),
        }
    }

    fn take(&mut self, ready: Ready) -> Result<Received<'_>, ReadError> {
        match ready {
            Ready::Packet(len) => {
                let message = decode_packet(&self.buffer[..len])?;
                self.packet_len = len;
                Ok(match message.body {
                    Body::Image(image) => Received::Image(message.header, image),
                    Body::Raw(raw) => Received::Raw(message.header, raw),
                    _ => Received::Other(message.header),
                })
            }
            Ready::Text(header) => {
                let (kind, text) = (header.kind, &self.text);
                let json = |source| ReadError::Json { kind, source };
                let value = || serde_json::from_slice(text).map_err(json);
                Ok(match kind {
                    Kind::Hello => Received::Hello(self.hello.insert(Hello::parse(text).map_err(json)?)),
                    Kind::Status => Received::Status(header, value()?),
                    Kind::Touch => Received::Touch(header, value()?),
                    Kind::Estimate => Received::Estimate(header, value()?),
                    _ => Received::Event(header, Event::parse(text).map_err(json)?),
                })
            }
        }
    }

    /// Waits until something can be read; returns whether it can.
    fn wait(&self, deadline: Instant) -> Result<bool, ReadError> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let mut fds = [PollFd::new(self.socket.as_fd(), PollFlags::POLLIN)];
            // Rounded up, so that the last wait does not spin.
            let timeout_ms = left.as_nanos().div_ceil(1_000_000);
            let timeout = PollTimeout::try_from(timeout_ms).unwrap_or(PollTimeout::MAX);
            match poll(&mut fds, timeout) {
                Ok(0) if left.is_zero() => return Ok(false),
                Ok(0) | Err(Errno::EINTR) => {}
                Ok(_) => return Ok(true),
                Err(errno) => return Err(ReadError::Socket(errno.into())),
            }
        }
    }
}

impl AsFd for Subscriber {
    /// The socket, to wait for with other things; readable when there is something for [`Subscriber::next`].
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}
