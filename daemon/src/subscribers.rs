//! Subscribers: each gets the description of the hand, then the newest image whenever it can take one.
//!
//! A subscriber that is slow is given the newest image when it can take it, and told how many it missed. It holds
//! up neither the tick nor another subscriber: all it can block is its own task.

use crate::config::SocketConfig;
use crate::hand::Hand;
use crate::hub::{Encoded, Newest, Published, RawWanted};
use serde_json::{Value, json};
use std::cell::{Cell, RefCell};
use std::future::poll_fn;
use std::io::{self, IoSlice};
use std::rc::Rc;
use std::sync::Arc;
use std::task::Poll;
use std::time::Duration;
use taxel_wire::{Event, EventKind, MAX_SUBSCRIBE, Subscribe, SubscribeError};
use tokio::sync::broadcast;
use tokio::time::{Instant, sleep_until, timeout};
use tokio_seqpacket::{UnixSeqpacket, UnixSeqpacketListener};

/// Least send buffer of a subscriber's socket, bytes; the kernel doubles it. It holds a part of a HELLO, and little
/// more than two images, since every image in it is one that gets old there.
const SEND_BUFFER: usize = 4608;
/// Subscriptions a client may have refused before it is disconnected.
const MAX_REFUSALS: u32 = 8;
/// Longest time between two images to a subscriber that asked for a lower rate.
const LONGEST_PAUSE_S: f64 = 3600.0;
/// Status reports to subscribers that asked for them.
const STATUS_PERIOD: Duration = Duration::from_secs(1);

/// Who is connected.
#[derive(Debug)]
pub(crate) struct Registry {
    entries: RefCell<Vec<Rc<Entry>>>,
    max: usize,
    stall: Duration,
}

/// What is known of one subscriber.
#[derive(Debug)]
struct Entry {
    pid: Option<i32>,
    uid: Option<u32>,
    since: Instant,
    images: Cell<u64>,
    skipped: Cell<u64>,
    raw: Cell<bool>,
}

/// Why a subscriber was let go.
#[derive(Debug, thiserror::Error)]
enum Farewell {
    #[error("it closed the connection")]
    Closed,
    #[error("its connection failed: {0}")]
    Failed(#[from] io::Error),
    #[error("it took no message for {0:?}")]
    Stalled(Duration),
    #[error("it sent what is no subscription: {0}")]
    Nonsense(SubscribeError),
    #[error("{0} subscribers are connected already")]
    TooMany(usize),
}

impl Registry {
    pub(crate) fn new(config: &SocketConfig) -> Self {
        Self {
            entries: RefCell::default(),
            max: config.max_subscribers.into(),
            stall: Duration::from_millis(config.stall_ms.into()),
        }
    }

    /// How many subscribers are connected.
    pub(crate) fn len(&self) -> usize {
        self.entries.borrow().len()
    }

    /// The subscribers, for the status report.
    pub(crate) fn status(&self) -> Vec<Value> {
        (self.entries.borrow().iter())
            .map(|e| {
                json!({
                    "pid": e.pid,
                    "uid": e.uid,
                    "connected_s": e.since.elapsed().as_secs_f64(),
                    "images": e.images.get(),
                    "skipped": e.skipped.get(),
                    "raw": e.raw.get(),
                })
            })
            .collect()
    }
}

/// Serves subscribers until the daemon ends.
pub(crate) async fn serve(mut listener: UnixSeqpacketListener, hand: Rc<Hand>) {
    loop {
        match listener.accept().await {
            Ok(socket) => drop(tokio::task::spawn_local(welcome(socket, hand.clone()))),
            Err(error) => {
                // Out of file descriptors, most likely: try again when some are free.
                tracing::warn!(%error, "cannot accept a subscriber");
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
}

async fn welcome(socket: UnixSeqpacket, hand: Rc<Hand>) {
    let peer = socket.peer_cred().ok();
    let entry = Rc::new(Entry {
        pid: peer.as_ref().and_then(|p| p.pid()),
        uid: peer.as_ref().map(|p| p.uid()),
        since: Instant::now(),
        images: Cell::new(0),
        skipped: Cell::new(0),
        raw: Cell::new(false),
    });
    let registry = &hand.subscribers;
    if registry.len() >= registry.max {
        let farewell = Farewell::TooMany(registry.len());
        tracing::warn!(pid = entry.pid, "subscriber turned away: {farewell}");
        tell_disconnect(&socket, &farewell).await;
        return;
    }
    registry.entries.borrow_mut().push(entry.clone());
    tracing::info!(pid = entry.pid, uid = entry.uid, "subscriber connected");
    let farewell = match Subscriber::new(socket, &hand, &entry) {
        Ok(mut subscriber) => {
            let farewell = subscriber.attend().await;
            if let Farewell::Nonsense(_) = farewell {
                tell_disconnect(&subscriber.socket, &farewell).await;
            }
            farewell
        }
        Err(error) => Farewell::Failed(error),
    };
    registry.entries.borrow_mut().retain(|e| !Rc::ptr_eq(e, &entry));
    tracing::info!(
        pid = entry.pid,
        images = entry.images.get(),
        skipped = entry.skipped.get(),
        "subscriber gone: {farewell}"
    );
}

/// Tells a client why it is let go, if it takes the message at once.
async fn tell_disconnect(socket: &UnixSeqpacket, why: &Farewell) {
    let packet = Event::new(EventKind::Disconnect, why.to_string()).to_packet(0, 0);
    let _ = timeout(Duration::from_millis(100), socket.send(&packet)).await;
}

struct Subscriber<'a> {
    socket: UnixSeqpacket,
    hand: &'a Hand,
    entry: &'a Entry,
    newest: Newest,
    wants: Subscribe,
    raw_wanted: Option<RawWanted>,
    /// Number of the last image and of the last raw frame sent, for the count of those skipped; 0 before the first.
    last_image: u64,
    last_raw: u64,
    refusals: u32,
}

/// Which of the messages of a tick.
#[derive(Clone, Copy)]
enum Stream {
    Image,
    Raw,
}

impl<'a> Subscriber<'a> {
    fn new(socket: UnixSeqpacket, hand: &'a Hand, entry: &'a Entry) -> io::Result<Self> {
        let subscriber = Self {
            socket,
            hand,
            entry,
            newest: hand.newest.clone(),
            wants: Subscribe::default(),
            raw_wanted: None,
            last_image: 0,
            last_raw: 0,
            refusals: 0,
        };
        subscriber.size_send_buffer()?;
        Ok(subscriber)
    }

    /// Room for about two messages: a queue in the kernel would be latency that nobody sees.
    fn size_send_buffer(&self) -> io::Result<()> {
        let (image, raw) = crate::payload_lens(&self.hand.config.layout, &self.hand.profile());
        let bytes = SEND_BUFFER.max(image + if self.wants.raw { raw } else { 0 } + 2048);
        nix::sys::socket::setsockopt(&self.socket, nix::sys::socket::sockopt::SndBuf, &bytes)?;
        Ok(())
    }

    /// Serves this subscriber until it goes or has to go.
    async fn attend(&mut self) -> Farewell {
        match self.serve().await {
            Ok(never) => match never {},
            Err(farewell) => farewell,
        }
    }

    async fn serve(&mut self) -> Result<std::convert::Infallible, Farewell> {
        let mut hello = self.hand.hello.subscribe();
        hello.mark_changed();
        let mut events = self.hand.events.subscribe();
        let mut buffer = [0; MAX_SUBSCRIBE + 1];
        let mut not_before = Instant::now();
        let mut status_at = Instant::now();
        // The next image is the first: the newest may be as old as the time since the bus fell silent.
        self.newest.receiver.mark_unchanged();
        let mut newest = self.newest.receiver.clone();
        loop {
            let wants_images = self.wants.image || self.wants.raw;
            tokio::select! {
                biased;
                _ = hello.changed() => {
                    let packets = hello.borrow_and_update().clone();
                    for packet in packets.iter() {
                        self.send(packet).await?;
                    }
                }
                received = self.socket.recv(&mut buffer) => {
                    match received?.bytes_read() {
                        0 => return Err(Farewell::Closed),
                        len => self.obey(&buffer[..len]).await?,
                    }
                }
                event = events.recv() => {
                    // A subscriber that missed events missed only news of what the images themselves show.
                    if let Ok(event) = event {
                        let (seq, t_ns) = self.now();
                        self.send(&event.to_packet(seq, t_ns)).await?;
                    } else if let Err(broadcast::error::RecvError::Closed) = event {
                        return Err(Farewell::Closed);
                    }
                }
                _ = sleep_until(status_at), if self.wants.status => {
                    status_at = Instant::now() + STATUS_PERIOD;
                    self.send_status().await?;
                }
                // A reader with a highest rate is given the newest image when its time has come.
                _ = sleep_until(not_before), if wants_images && not_before > Instant::now() => {}
                changed = newest.changed(), if wants_images && not_before <= Instant::now() => {
                    if changed.is_err() {
                        return Err(Farewell::Closed);
                    }
                    if let Some(hz) = self.wants.max_rate_hz {
                        not_before = Instant::now() + Duration::from_secs_f64((1.0 / hz).min(LONGEST_PAUSE_S));
                    }
                    if self.wants.image {
                        self.send_newest(Stream::Image).await?;
                    }
                    if self.wants.raw {
                        self.send_newest(Stream::Raw).await?;
                    }
                }
            }
        }
    }

    /// Sequence number and time of the newest image.
    fn now(&self) -> (u64, u64) {
        self.newest
            .receiver
            .borrow()
            .image
            .header
            .map_or((0, 0), |h| (h.seq, h.t_ns))
    }

    /// Takes a subscription; tells the client what is wrong with one that is refused.
    async fn obey(&mut self, packet: &[u8]) -> Result<(), Farewell> {
        let (seq, t_ns) = self.now();
        match Subscribe::from_packet(packet) {
            Ok(wants) => {
                self.raw_wanted = wants.raw.then(|| self.newest.want_raw());
                self.entry.raw.set(wants.raw);
                self.wants = wants;
                self.size_send_buffer()?;
                Ok(())
            }
            Err(error @ (SubscribeError::Json(_) | SubscribeError::Rate { .. }))
                if self.refusals < MAX_REFUSALS =>
            {
                self.refusals += 1;
                let refused = Event::new(EventKind::Refused, error.to_string());
                self.send(&refused.to_packet(seq, t_ns)).await
            }
            Err(error) => Err(Farewell::Nonsense(error)),
        }
    }

    async fn send_status(&self) -> Result<(), Farewell> {
        let (seq, t_ns) = self.now();
        let text = self.hand.status().to_string();
        for (header, part) in taxel_wire::split_text(
            taxel_wire::Kind::Status,
            text.as_bytes(),
            taxel_wire::TEXT_PART,
            seq,
            t_ns,
        ) {
            self.send(&[&header.to_bytes(), part].concat()).await?;
        }
        Ok(())
    }

    async fn send(&self, packet: &[u8]) -> Result<(), Farewell> {
        let stall = self.hand.subscribers.stall;
        match timeout(stall, self.socket.send(packet)).await {
            Ok(sent) => Ok(sent.map(drop)?),
            Err(_) => Err(Farewell::Stalled(stall)),
        }
    }

    /// Sends the image or raw frame that is newest at the moment when the socket takes it.
    async fn send_newest(&mut self, stream: Stream) -> Result<(), Farewell> {
        let stall = self.hand.subscribers.stall;
        let Self {
            socket,
            newest,
            entry,
            last_image,
            last_raw,
            ..
        } = self;
        let last = match stream {
            Stream::Image => last_image,
            Stream::Raw => last_raw,
        };
        let sent = poll_fn(|cx| {
            // A clone, so that the tick thread is not kept from publishing while the kernel copies the message.
            let published: Arc<Published> = newest.receiver.borrow().clone();
            let Encoded { header, payload } = match stream {
                Stream::Image => &published.image,
                Stream::Raw => &published.raw,
            };
            let Some(header) = header.filter(|_| published.index > *last) else {
                return Poll::Ready(Ok(()));
            };
            let skipped = if *last == 0 {
                0
            } else {
                published.index - *last - 1
            };
            let header = header
                .with_skipped(skipped.min(u32::MAX.into()) as u32)
                .to_bytes();
            match socket.poll_send_vectored(cx, &[IoSlice::new(&header), IoSlice::new(payload)]) {
                Poll::Ready(Ok(_)) => {
                    *last = published.index;
                    if let Stream::Image = stream {
                        entry.images.set(entry.images.get() + 1);
                        entry.skipped.set(entry.skipped.get() + skipped);
                    }
                    Poll::Ready(Ok(()))
                }
                Poll::Ready(Err(error)) => Poll::Ready(Err(error)),
                Poll::Pending => Poll::Pending,
            }
        });
        match timeout(stall, sent).await {
            Ok(sent) => Ok(sent?),
            Err(_) => Err(Farewell::Stalled(stall)),
        }
    }
}
