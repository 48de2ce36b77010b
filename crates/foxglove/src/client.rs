//! A client's task: what it says, and what it is sent.

use crate::counts::add;
use crate::flight::Flight;
use crate::hub::{Client, Hub, ToSend};
use crate::protocol::{ClientText, DATA_HEAD};
use crate::stream::{Stream, TooMuch};
use nix::sys::socket::{Shutdown, shutdown};
use std::io;
use std::os::fd::AsRawFd;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::net::TcpStream;
use tokio::time::{MissedTickBehavior, interval, timeout};
use tungstenite::error::ProtocolError;
use tungstenite::protocol::CloseFrame;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::{Bytes, Error, Message, WebSocket};

/// How long a client may take nothing while something waits for it.
const STALL: Duration = Duration::from_secs(5);
/// Between two questions whether a client is still there.
const PING: Duration = Duration::from_secs(10);
/// How long it may answer none of them.
const SILENCE: Duration = Duration::from_secs(30);
/// How often to look at these.
const LOOK: Duration = Duration::from_millis(500);
/// How often a client may ask for what cannot be done.
const MOST_FAULTS: u32 = 100;
/// Bytes in front of an answer to a ping.
const PONG_HEAD: usize = 2;
/// Bytes of answers that a client may leave untaken while it goes on asking: WebSocket answers every ping.
const MOST_UNTAKEN: usize = 16 << 10;
/// Bytes that are put together to be sent at once.
const AT_ONCE: usize = 64 << 10;
/// How long a client that is let go has to read why.
const FAREWELL: Duration = Duration::from_millis(500);
/// The most bytes of the reason.
const MOST_OF_REASON: usize = 120;
/// The most bytes of what was wrong, which may hold what the client said.
const MOST_OF_FAULT: usize = 200;

/// Why a connection ends.
#[derive(Debug)]
enum End {
    /// The client has closed it, or it is torn.
    Left,
    /// This program ends.
    Over,
    /// It is let go, for this.
    LetGo(CloseCode, String),
}

impl From<Error> for End {
    fn from(error: Error) -> Self {
        match error {
            Error::ConnectionClosed | Error::AlreadyClosed => Self::Left,
            Error::Protocol(ProtocolError::ResetWithoutClosingHandshake) => Self::Left,
            Error::Io(error) if error.get_ref().is_some_and(|inner| inner.is::<TooMuch>()) => {
                Self::LetGo(CloseCode::Policy, TooMuch.to_string())
            }
            Error::Io(_) => Self::Left,
            Error::Capacity(error) => Self::LetGo(CloseCode::Size, error.to_string()),
            error => Self::LetGo(CloseCode::Protocol, error.to_string()),
        }
    }
}

/// Serves a client until it is gone, or let go.
pub(crate) async fn attend(
    hub: &Hub,
    client: &Arc<Client>,
    socket: &TcpStream,
    websocket: WebSocket<Stream>,
) {
    let mut attended = Attended {
        hub,
        client,
        websocket,
        unsent_since: None,
        untaken: 0,
        pinged: Instant::now(),
        flight: Flight::new(Instant::now()),
        faults: 0,
        messages: 0,
    };
    let end = attended.serve(socket).await;
    let lost = hub.leave(client);
    let (code, why) = match end {
        End::Left => {
            let messages = attended.messages;
            hub.remark(format!(
                "{} left: {messages} messages, {lost} lost",
                client.address
            ));
            return;
        }
        End::Over => (CloseCode::Away, "taxel foxglove ends".into()),
        End::LetGo(code, why) => {
            add(&hub.counters.let_go, 1);
            hub.remark(format!("{} is let go: {why}", client.address));
            (code, why)
        }
    };
    attended.say_why(code, &why);
    part(socket).await;
}

/// Closes a connection so that what was sent last is read: where something of the client were unread, the kernel would
/// throw that away.
pub(crate) async fn part(socket: &TcpStream) {
    let _ = shutdown(socket.as_raw_fd(), Shutdown::Write);
    let _ = timeout(FAREWELL, drain(socket)).await;
}

/// Reads what a client still sends, until it closes.
async fn drain(socket: &TcpStream) -> io::Result<()> {
    let mut passed_over = [0; 4096];
    loop {
        socket.readable().await?;
        match socket.try_read(&mut passed_over) {
            Ok(0) => return Ok(()),
            Ok(_) => tokio::task::yield_now().await,
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
    }
}

struct Attended<'a> {
    hub: &'a Hub,
    client: &'a Arc<Client>,
    websocket: WebSocket<Stream>,
    /// Since when something waits to be taken by the socket.
    unsent_since: Option<Instant>,
    /// Bytes of answers since the socket last took all.
    untaken: usize,
    pinged: Instant,
    flight: Flight,
    faults: u32,
    messages: u64,
}

impl Attended<'_> {
    async fn serve(&mut self, socket: &TcpStream) -> End {
        let mut look = interval(LOOK);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            self.websocket.get_mut().begin_turn();
            if let Err(end) = self.read().and_then(|()| self.write()) {
                return end;
            }
            if self.hub.has_ended() {
                return End::Over;
            }
            let is_cut_short = self.websocket.get_ref().is_turn_over();
            let ready = tokio::select! {
                () = std::future::ready(()), if is_cut_short => Ok(()),
                ready = socket.readable() => ready,
                ready = socket.writable(), if self.unsent_since.is_some() => ready,
                () = self.client.wake.notified() => Ok(()),
                _ = look.tick() => match self.look() {
                    Ok(()) => Ok(()),
                    Err(end) => return end,
                },
            };
            if ready.is_err() {
                return End::Left;
            }
            // The others' turn, however much this one has to say.
            tokio::task::yield_now().await;
        }
    }

    /// Does what the client says, as much as is read in a turn.
    fn read(&mut self) -> Result<(), End> {
        loop {
            let message = match self.websocket.read() {
                Ok(message) => message,
                Err(error) => return unless_blocked(Err(error)),
            };
            self.websocket.get_mut().count_message();
            match message {
                Message::Text(text) => self.heed(text.as_str())?,
                Message::Binary(_) => self.fault("nothing is published by clients here")?,
                Message::Ping(asked) => self.is_asked(asked.len())?,
                Message::Pong(pong) => self.flight.is_answered(&pong, Instant::now()),
                Message::Close(_) | Message::Frame(_) => {}
            }
        }
    }

    /// The WebSocket answers with as many bytes. It keeps what the socket does not take.
    fn is_asked(&mut self, bytes: usize) -> Result<(), End> {
        self.is_unsent();
        self.untaken += bytes + PONG_HEAD;
        match self.untaken {
            MOST_UNTAKEN.. => Err(End::LetGo(CloseCode::Policy, "asks and takes no answers".into())),
            _ => Ok(()),
        }
    }

    fn heed(&mut self, text: &str) -> Result<(), End> {
        let done = match serde_json::from_str(text) {
            Ok(ClientText::Subscribe { subscriptions }) => self.hub.subscribe(self.client, &subscriptions),
            Ok(ClientText::Unsubscribe { subscription_ids }) => {
                self.hub.unsubscribe(self.client, &subscription_ids)
            }
            Ok(ClientText::Other) => Err("this server only sends: it knows subscribe and unsubscribe".into()),
            Err(error) => Err(format!("not understood: {error}")),
        };
        done.or_else(|why| self.fault(&why))
    }

    fn fault(&mut self, why: &str) -> Result<(), End> {
        let why = cut(why, MOST_OF_FAULT);
        self.hub.fault(self.client, why);
        self.faults += 1;
        match self.faults {
            MOST_FAULTS.. => {
                let why = format!("asks again and again for what cannot be done, as this: {why}");
                Err(End::LetGo(CloseCode::Policy, why))
            }
            _ => Ok(()),
        }
    }

    fn is_unsent(&mut self) {
        self.unsent_since.get_or_insert_with(Instant::now);
    }

    /// Sends what there is, as far as the socket takes it and the client reads it.
    fn write(&mut self) -> Result<(), End> {
        while self.websocket.can_write() {
            if self.unsent_since.is_some() {
                match self.websocket.flush() {
                    Ok(()) => (self.unsent_since, self.untaken) = (None, 0),
                    blocked => return unless_blocked(blocked),
                }
            }
            let mut put = 0;
            while put < AT_ONCE
                && !self.flight.is_full()
                && let Some(next) = self.client.next()
            {
                let message = match next {
                    ToSend::Text(text) => Message::from(text),
                    ToSend::Data(data) => {
                        self.messages += 1;
                        add(&self.hub.counters.messages, 1);
                        add(&self.hub.counters.bytes, (data.len() - DATA_HEAD) as u64);
                        Message::from(data)
                    }
                };
                let bytes = message.len();
                put += bytes;
                self.is_unsent();
                // What the socket does not take is kept, and flushed.
                unless_blocked(self.websocket.write(message))?;
                if let Some(ping) = self.flight.send(bytes, Instant::now()) {
                    unless_blocked(self.websocket.write(Message::Ping(ping.to_vec().into())))?;
                }
            }
            if put == 0 {
                break;
            }
        }
        Ok(())
    }

    /// Whether the client is still there, and takes something.
    fn look(&mut self) -> Result<(), End> {
        let now = Instant::now();
        let since = |then: Instant| now.saturating_duration_since(then);
        let stream = self.websocket.get_ref();
        let is_stuck = (self.unsent_since).is_some_and(|unsent| since(unsent.max(stream.taken)) > STALL);
        if is_stuck || self.flight.stands(now) > STALL {
            return Err(End::LetGo(
                CloseCode::Policy,
                format!("takes nothing for {STALL:?}"),
            ));
        }
        if since(stream.heard) > SILENCE {
            return Err(End::LetGo(
                CloseCode::Policy,
                format!("answers nothing for {SILENCE:?}"),
            ));
        }
        if since(self.pinged) > PING && self.websocket.can_write() {
            self.pinged = now;
            self.is_unsent();
            unless_blocked(self.websocket.write(Message::Ping(Bytes::new())))?;
        }
        Ok(())
    }

    /// Tells the client why it is let go, if it takes that at once.
    fn say_why(&mut self, code: CloseCode, why: &str) {
        let reason = cut(why, MOST_OF_REASON).into();
        let _ = self.websocket.close(Some(CloseFrame { code, reason }));
    }
}

/// So many bytes of a text, or a few less.
fn cut(text: &str, most: usize) -> &str {
    let end = (0..=most.min(text.len())).rfind(|at| text.is_char_boundary(*at));
    &text[..end.unwrap_or(0)]
}

/// What is wrong, if it is more than that the socket is not ready.
fn unless_blocked(outcome: Result<(), Error>) -> Result<(), End> {
    match outcome {
        Err(Error::Io(error)) if error.kind() == io::ErrorKind::WouldBlock => Ok(()),
        outcome => outcome.map_err(End::from),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::A_TURN;
    use nix::sys::socket::{setsockopt, sockopt};
    use std::io::Write;
    use std::net::SocketAddr;
    use std::sync::Mutex;
    use std::thread;
    use tungstenite::protocol::Role;

    /// A client's end of a connection, the server's, and the client's address.
    fn connection() -> (std::net::TcpStream, std::net::TcpStream, SocketAddr) {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let client = std::net::TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (server, address) = listener.accept().unwrap();
        server.set_nonblocking(true).unwrap();
        (client, server, address)
    }

    /// Serves a client that is let in.
    async fn attended(hub: &Hub, server: std::net::TcpStream, address: SocketAddr) {
        let client = hub.join(address, &[]);
        let socket = Arc::new(TcpStream::from_std(server).unwrap());
        let websocket = WebSocket::from_raw_socket(Stream::new(socket.clone()), Role::Server, None);
        attend(hub, &client, &socket, websocket).await;
    }

    fn block_on<T>(future: impl Future<Output = T>) -> T {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        runtime.block_on(future)
    }

    /// A message under a mask of zeros.
    fn masked(opcode: u8, bytes: &[u8]) -> Vec<u8> {
        [&[0x80 | opcode, 0x80 | bytes.len() as u8, 0, 0, 0, 0], bytes].concat()
    }

    const TEXT: u8 = 1;
    const PING: u8 = 9;
    const PONG: u8 = 10;

    #[test]
    fn who_has_much_to_say_is_heard_a_turn_at_a_time() {
        let (mut talks, much, talker) = connection();
        let (mut asks, little, asker) = connection();
        // As much as the kernel takes though nobody reads, which none has to answer.
        let said = masked(PONG, &[b'x'; 125]).repeat(10 * A_TURN / 131);
        talks.write_all(&said).unwrap();
        asks.write_all(&masked(TEXT, b"?")).unwrap();
        let unread = much.try_clone().unwrap();
        let unread = || unread.peek(&mut vec![0; said.len() + 1]).unwrap_or_default();
        while unread() < said.len() {
            thread::yield_now();
        }
        let hub = Hub::new(Box::new(|_, _| ()));
        let left = block_on(async {
            let is_heard = async {
                while hub.counters.read().faults == 0 {
                    tokio::task::yield_now().await;
                }
            };
            tokio::select! {
                biased;
                () = attended(&hub, much, talker) => panic!("who talks is let go"),
                () = attended(&hub, little, asker) => panic!("who asks is let go"),
                () = is_heard => unread(),
            }
        });
        let heard = said.len() - left;
        assert!(heard <= 2 * A_TURN, "another waited for {heard} bytes");
    }

    #[test]
    fn who_asks_and_takes_no_answers_is_let_go_before_they_pile_up() {
        let said = Arc::new(Mutex::new(Vec::<String>::new()));
        let (mut asking, server, address) = connection();
        // What the kernel would keep of answers is no pile of ours.
        setsockopt(&asking, sockopt::RcvBuf, &4096).unwrap();
        setsockopt(&server, sockopt::SndBuf, &4096).unwrap();
        let asks = thread::spawn(move || {
            let _ = asking.write_all(&masked(PING, &[b'x'; 125]).repeat(1000));
            asking
        });
        let told = said.clone();
        let hub = Hub::new(Box::new(move |_, line| told.lock().unwrap().push(line.into())));
        block_on(attended(&hub, server, address));
        drop(asks.join().unwrap());
        let said = said.lock().unwrap();
        assert!(
            said[0].ends_with("is let go: asks and takes no answers"),
            "{said:?}"
        );
    }
}
