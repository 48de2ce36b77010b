//! Subscribers: each gets the description of the hand, then the newest image whenever it can take one.
//!
//! A subscriber that is slow is given the newest image when it can take it, and told how many it missed. It holds
//! up neither the tick nor another subscriber: all it can block is its own task.

use crate::config::SocketConfig;
use crate::feed::Feed;
use crate::hand::Hand;
use crate::hub::Reading;
use crate::profiles::{DisplayProfile, Lease, Made};
use serde_json::{Value, json};
use std::cell::{Cell, RefCell};
use std::future::poll_fn;
use std::io;
use std::rc::Rc;
use std::task::{Poll, ready};
use std::time::Duration;
use taxel_wire::{Event, EventKind, Subscribe, SubscribeError};
use tokio::sync::{broadcast, watch};
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep_until, timeout};
use tokio_seqpacket::{UnixSeqpacket, UnixSeqpacketListener};

/// Least send buffer of a subscriber's socket, bytes; the kernel doubles it. It holds a part of a HELLO, and little
/// more than two images, since every image in it is one that gets old there.
const SEND_BUFFER: usize = 4608;
/// Subscriptions a client may have refused before it is disconnected.
const MAX_REFUSALS: u32 = 8;
/// Status reports to subscribers that asked for them.
const STATUS_PERIOD: Duration = Duration::from_secs(1);
/// A client that tries again and again to get in is told of in the log no more often.
const TURNED_AWAY_PERIOD: Duration = Duration::from_secs(10);

/// Who is connected.
#[derive(Debug)]
pub(crate) struct Registry {
    entries: RefCell<Vec<Rc<Entry>>>,
    max: usize,
    stall: Duration,
    /// When the log was told last that one was turned away.
    told_turned_away: Cell<Option<Instant>>,
    /// How many were turned away since.
    turned_away: Cell<u64>,
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
    /// Number of the display profile it is shown.
    profile: Cell<u32>,
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
    #[error("it asked too often for what it cannot have: {0}")]
    Insists(String),
    #[error("{0} subscribers are connected already")]
    TooMany(usize),
}

impl Registry {
    pub(crate) fn new(config: &SocketConfig) -> Self {
        Self {
            entries: RefCell::default(),
            max: config.max_subscribers.into(),
            stall: Duration::from_millis(config.stall_ms.into()),
            told_turned_away: Cell::default(),
            turned_away: Cell::default(),
        }
    }

    /// Says in the log, now and then, that clients were turned away.
    fn tell_turned_away(&self, pid: Option<i32>, farewell: &Farewell) {
        let clients = self.turned_away.get() + 1;
        let told = self.told_turned_away.get();
        if told.is_some_and(|at| at.elapsed() < TURNED_AWAY_PERIOD) {
            self.turned_away.set(clients);
            return;
        }
        self.turned_away.set(0);
        self.told_turned_away.set(Some(Instant::now()));
        tracing::warn!(pid, clients, "turned away: {farewell}");
    }

    /// How many subscribers are connected.
    pub(crate) fn len(&self) -> usize {
        self.entries.borrow().len()
    }

    /// How many subscribers are shown the profile of this number.
    pub(crate) fn shown(&self, profile: u32) -> usize {
        let entries = self.entries.borrow();
        entries.iter().filter(|e| e.profile.get() == profile).count()
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
                    "profile": e.profile.get(),
                })
            })
            .collect()
    }
}

/// Serves subscribers until the daemon ends.
pub(crate) async fn serve(mut listener: UnixSeqpacketListener, hand: Rc<Hand>) {
    let mut failing = false;
    loop {
        match listener.accept().await {
            Ok(socket) => {
                failing = false;
                drop(tokio::task::spawn_local(welcome(socket, hand.clone())));
            }
            Err(error) => {
                // Out of file descriptors, most likely: try again when some are free. Said once, however long it lasts.
                if !std::mem::replace(&mut failing, true) {
                    tracing::warn!(%error, "cannot accept a subscriber");
                }
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
        profile: Cell::new(hand.profiles.own().id),
    });
    let registry = &hand.subscribers;
    if registry.len() >= registry.max {
        let farewell = Farewell::TooMany(registry.len());
        registry.tell_turned_away(entry.pid, &farewell);
        tell_disconnect(&socket, &farewell).await;
        return;
    }
    registry.entries.borrow_mut().push(entry.clone());
    tracing::info!(pid = entry.pid, uid = entry.uid, "subscriber connected");
    let farewell = match Subscriber::new(socket, hand.clone(), &entry) {
        Ok(mut subscriber) => {
            let farewell = subscriber.attend().await;
            if let Farewell::Nonsense(_) | Farewell::Insists(_) = farewell {
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
    hand: Rc<Hand>,
    entry: &'a Entry,
    wants: Subscribe,
    /// The profile it is shown.
    made: Rc<Made>,
    /// Holds that profile where it is not the daemon's own.
    lease: Option<Lease>,
    /// The daemon's own profile, to follow it.
    own: watch::Receiver<Rc<Made>>,
    /// A subscription whose profile is being looked at. Nothing more is taken from the client meanwhile.
    asked: Option<Asked>,
    images: Feed,
    raw: Feed,
    raw_reading: Option<Reading>,
    refusals: u32,
}

/// A subscription that waits for its profile.
struct Asked {
    wants: Subscribe,
    /// Whether the client asked; otherwise the daemon's own profile has changed, of which it is shown a region.
    by_client: bool,
    lease: JoinHandle<Result<Lease, String>>,
}

impl Drop for Asked {
    /// Who is gone must not be in the way of those that ask now.
    fn drop(&mut self) {
        self.lease.abort();
    }
}

/// Which of a subscriber's feeds.
#[derive(Clone, Copy)]
enum Stream {
    Image,
    Raw,
}

impl<'a> Subscriber<'a> {
    fn new(socket: UnixSeqpacket, hand: Rc<Hand>, entry: &'a Entry) -> io::Result<Self> {
        let mut own = hand.profiles.follow_own();
        let made = own.borrow_and_update().clone();
        let subscriber = Self {
            socket,
            entry,
            wants: Subscribe::default(),
            images: Feed::new(&made.newest),
            raw: Feed::new(&hand.raw),
            raw_reading: None,
            made,
            lease: None,
            own,
            asked: None,
            refusals: 0,
            hand,
        };
        subscriber.size_send_buffer()?;
        Ok(subscriber)
    }

    /// Room for about two messages: a queue in the kernel would be latency that nobody sees.
    fn size_send_buffer(&self) -> io::Result<()> {
        let (image, raw) = crate::payload_lens(&self.hand.config.layout, &self.made.wanted.profile);
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
        let mut events = self.hand.events.subscribe();
        let mut status_at = Instant::now();
        self.send_hello().await?;
        loop {
            tokio::select! {
                biased;
                answer = answer(&mut self.asked), if self.asked.is_some() => {
                    self.take_answer(answer).await?;
                }
                _ = self.own.changed(), if self.wants.profile.is_none() && self.asked.is_none() => {
                    self.follow().await?;
                }
                packet = receive(&self.socket, &self.hand), if self.asked.is_none() => {
                    match packet? {
                        packet if packet.is_empty() => return Err(Farewell::Closed),
                        packet => self.obey(&packet).await?,
                    }
                }
                event = events.recv() => {
                    // A subscriber that missed events missed only news of what the images themselves show.
                    if let Ok(event) = event {
                        self.tell(&event).await?;
                    } else if let Err(broadcast::error::RecvError::Closed) = event {
                        return Err(Farewell::Closed);
                    }
                }
                _ = sleep_until(status_at), if self.wants.status => {
                    status_at = Instant::now() + STATUS_PERIOD;
                    self.send_status().await?;
                }
                ready = self.images.ready(), if self.wants.image && !self.images.is_over() => {
                    if ready.is_err() {
                        // Another profile is on its way, or the daemon ends, and with it this.
                        continue;
                    }
                    self.send_newest(Stream::Image).await?;
                    // Or a subscriber whose socket is always full would be sent images alone.
                    if self.wants.raw && self.raw.is_ready() {
                        self.send_newest(Stream::Raw).await?;
                    }
                }
                ready = self.raw.ready(), if self.wants.raw => {
                    ready.map_err(|_| Farewell::Closed)?;
                    self.send_newest(Stream::Raw).await?;
                }
            }
        }
    }

    /// Sequence number and time of the newest image.
    fn now(&self) -> (u64, u64) {
        let newest = |made: &Made| made.newest.receiver.borrow().header;
        let header = newest(&self.made).or_else(|| newest(&self.own.borrow()));
        header.map_or((0, 0), |h| (h.seq, h.t_ns))
    }

    /// Takes a subscription; tells the client what is wrong with one that is refused.
    async fn obey(&mut self, packet: &[u8]) -> Result<(), Farewell> {
        match Subscribe::from_packet(packet) {
            Ok(wants) => self.ask(wants, true).await,
            Err(
                error @ (SubscribeError::Json(_) | SubscribeError::Rate { .. } | SubscribeError::Profile(_)),
            ) if self.refusals < MAX_REFUSALS => self.refuse(error.to_string()).await,
            Err(error) => Err(Farewell::Nonsense(error)),
        }
    }

    /// Puts a subscription into effect, or asks for its profile first.
    async fn ask(&mut self, wants: Subscribe, by_client: bool) -> Result<(), Farewell> {
        let region = match self.hand.profiles.region(wants.region.as_deref()) {
            Ok(region) => region,
            Err(reason) => return self.refuse(reason).await,
        };
        if wants.profile.is_none() && region.is_none() {
            let stated = wants.region.is_some();
            let own = self.own.borrow_and_update().clone();
            let is_shown = Rc::ptr_eq(&own, &self.made);
            self.wants(wants)?;
            self.give_up_lease();
            return match (is_shown, stated) {
                (true, false) => Ok(()),
                _ => self.show(own).await,
            };
        }
        let profile = wants.profile.clone();
        let wanted = DisplayProfile {
            profile: profile.unwrap_or_else(|| self.own.borrow_and_update().wanted.profile.clone()),
            region,
        };
        let hand = self.hand.clone();
        let instead_of = self.lease.as_ref().map(|lease| lease.made().clone());
        let lease = tokio::task::spawn_local(async move { hand.profiles.lease(wanted, instead_of).await });
        self.asked = Some(Asked {
            wants,
            by_client,
            lease,
        });
        Ok(())
    }

    /// Puts the subscription that was asked for into effect, now that its profile is there; or says why not.
    async fn take_answer(&mut self, answer: Result<Lease, String>) -> Result<(), Farewell> {
        let Some(asked) = self.asked.take() else {
            return Ok(());
        };
        match answer {
            Ok(lease) => {
                let made = lease.made().clone();
                self.wants(asked.wants.clone())?;
                self.give_up_lease();
                self.lease = Some(lease);
                self.show(made).await
            }
            Err(reason) if asked.by_client => self.refuse(reason).await,
            // It goes on with what it is shown, and is not to blame.
            Err(reason) => self.tell(&Event::new(EventKind::Refused, reason)).await,
        }
    }

    /// Goes on with the daemon's own profile after that has changed.
    async fn follow(&mut self) -> Result<(), Farewell> {
        if self.wants.region.is_some() {
            return self.ask(self.wants.clone(), false).await;
        }
        let own = self.own.borrow_and_update().clone();
        self.show(own).await
    }

    fn wants(&mut self, wants: Subscribe) -> Result<(), Farewell> {
        if wants.raw != self.wants.raw {
            self.raw = Feed::new(&self.hand.raw);
            self.raw_reading = wants.raw.then(|| self.hand.raw.read());
            self.entry.raw.set(wants.raw);
        }
        if wants.image != self.wants.image {
            self.images = Feed::new(&self.made.newest);
        }
        self.images.hold_back_no_longer();
        self.raw.hold_back_no_longer();
        self.wants = wants;
        Ok(self.size_send_buffer()?)
    }

    fn give_up_lease(&mut self) {
        if let Some(lease) = self.lease.take() {
            self.hand.profiles.give_up(lease);
        }
    }

    /// Shows another profile, and says so. Ticks go on being counted across the change.
    async fn show(&mut self, made: Rc<Made>) -> Result<(), Farewell> {
        self.images = self.images.go_on_with(&made.newest);
        self.entry.profile.set(made.id);
        self.made = made;
        self.size_send_buffer()?;
        self.send_hello().await
    }

    async fn refuse(&mut self, reason: String) -> Result<(), Farewell> {
        if self.refusals >= MAX_REFUSALS {
            return Err(Farewell::Insists(reason));
        }
        self.refusals += 1;
        self.tell(&Event::new(EventKind::Refused, reason)).await
    }

    async fn tell(&self, event: &Event) -> Result<(), Farewell> {
        let (seq, t_ns) = self.now();
        self.send(&event.to_packet(seq, t_ns)).await
    }

    async fn send_hello(&self) -> Result<(), Farewell> {
        for packet in &self.made.hello {
            self.send(packet).await?;
        }
        Ok(())
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
        let feed = match stream {
            Stream::Image => &mut self.images,
            Stream::Raw => &mut self.raw,
        };
        let sending = timeout(stall, feed.send(&self.socket, self.wants.max_rate_hz));
        match (sending.await, stream) {
            (Ok(Ok(Some(skipped))), Stream::Image) => {
                self.entry.images.set(self.entry.images.get() + 1);
                self.entry.skipped.set(self.entry.skipped.get() + skipped);
                Ok(())
            }
            (Ok(sent), _) => Ok(sent.map(drop)?),
            (Err(_), _) => Err(Farewell::Stalled(stall)),
        }
    }
}

/// What the client sent: a packet, or nothing where it has gone.
async fn receive(socket: &UnixSeqpacket, hand: &Hand) -> io::Result<Vec<u8>> {
    poll_fn(|cx| {
        let mut buffer = hand.subscription.borrow_mut();
        let received = ready!(socket.poll_recv(cx, &mut buffer))?;
        Poll::Ready(Ok(buffer[..received.bytes_read()].to_vec()))
    })
    .await
}

/// What became of the profile that was asked for.
async fn answer(asked: &mut Option<Asked>) -> Result<Lease, String> {
    match asked {
        Some(asked) => (&mut asked.lease).await.unwrap_or_else(|e| Err(e.to_string())),
        None => std::future::pending().await,
    }
}
