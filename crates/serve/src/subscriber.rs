//! One subscriber: it gets the description of the hand, then the newest image whenever it can take
//! one, or every one.
//!
//! A subscriber that is slow is given the newest image when it can take it, and told how many it
//! missed. It holds up neither the tick nor another subscriber: all it can block is its own task. While
//! that task waits, the courier sends the newest image (see [`crate::lane`]).

use crate::active_profile::{ActiveProfile, Lease};
use crate::delivery::Delivery;
use crate::farewell::Farewell;
use crate::feed::Feed;
use crate::handle::{Announcement, Packets};
use crate::lane::Lane;
use crate::profile_maker::{DisplayProfile, ProfileMaker};
use crate::registry::Entry;
use crate::sent::Sent;
use crate::server::Server;
use crate::socket::{Socket, kept_bytes, send_buffer};
use crate::stream::Stream;
use crate::turns::Account;
use std::collections::VecDeque;
use std::future::poll_fn;
use std::io;
use std::rc::Rc;
use std::sync::Arc;
use std::task::{Poll, ready};
use taxel_wire::{Event, EventKind, HEADER_LEN, Subscribe, SubscribeError, Subscription};
use tokio::sync::{broadcast, watch};
use tokio::task::JoinHandle;
use tokio::time::timeout;

/// Least send buffer of a subscriber's socket, bytes: it holds a part of a HELLO.
const LEAST_BUFFER: usize = 4608;
/// The same of one that wants the status alone: a status or two of a usual hand, and why it has to go, are unread in it.
const ONLOOKER_BUFFER: usize = 32_768;
/// Most send buffer of a subscriber that is sent every message: the usual limit for programs
/// without privileges.
const EVERY_BUFFER: usize = 212_992;
/// Subscriptions in a row that a client may have refused before it is disconnected.
const MAX_REFUSALS: u32 = 8;

/// A client that was let in.
pub(crate) struct Subscriber<'a, M: ProfileMaker> {
    pub(crate) socket: Rc<Socket>,
    server: Rc<Server<M>>,
    entry: &'a Arc<Entry>,
    wants: Subscribe,
    /// The profile it is shown.
    shown: Rc<ActiveProfile>,
    /// Holds that profile where it stated one.
    lease: Option<Lease>,
    /// The profile of whoever states none, to follow it.
    own: watch::Receiver<Rc<ActiveProfile>>,
    /// A subscription whose profile is being looked at. Nothing more is taken from the client meanwhile.
    asked: Option<Asked>,
    /// Its share of what is looked at of all clients' packets.
    account: Account,
    image_lane: Rc<Lane>,
    raw_lane: Rc<Lane>,
    images: Feed,
    raw: Option<Feed>,
    status: watch::Receiver<Packets>,
    /// Announcements that come behind messages still to be sent: the tick, and the packets.
    held: VecDeque<(u64, Packets)>,
    refusals: u32,
}

/// A subscription that waits for its profile.
struct Asked {
    wants: Subscribe,
    /// Whether the client asked; otherwise the profile of whoever states none has changed, of which
    /// it is shown a region.
    by_client: bool,
    lease: JoinHandle<Result<Lease, String>>,
}

impl Drop for Asked {
    /// Who is gone must not be in the way of those that ask now.
    fn drop(&mut self) {
        self.lease.abort();
    }
}

/// What a subscriber's task is woken for.
enum Turn {
    Answer(Result<Lease, String>),
    Follow,
    Packet(io::Result<Vec<u8>>),
    Announcement(Result<Announcement, broadcast::error::RecvError>),
    Status(Result<(), watch::error::RecvError>),
    Image,
    Raw,
}

/// Which of a subscriber's feeds.
#[derive(Clone, Copy)]
enum Which {
    Image,
    Raw,
}

impl<'a, M: ProfileMaker> Subscriber<'a, M> {
    pub(crate) fn new(socket: Socket, server: Rc<Server<M>>, entry: &'a Arc<Entry>) -> io::Result<Self> {
        let mut own = server.profiles.follow_own();
        let shown = own.borrow_and_update().clone();
        let socket = Rc::new(socket);
        let registry = &server.registry;
        let lane = |own: &Arc<Sent>, all: &Arc<Sent>| Lane::new(&socket, [own.clone(), all.clone()]);
        let image_lane = lane(&entry.images, &registry.images);
        let raw_lane = lane(&entry.raw_frames, &registry.raw_frames);
        let wants = Subscribe::default();
        let subscriber = Self {
            entry,
            images: server.feed(&shown.stream, &image_lane, Delivery::of_images(&wants)),
            wants,
            image_lane,
            raw_lane,
            socket,
            account: server.turns.account(),
            raw: None,
            status: server.handle.status.subscribe(),
            held: VecDeque::new(),
            shown,
            lease: None,
            own,
            asked: None,
            refusals: 0,
            server,
        };
        subscriber.size_send_buffer()?;
        subscriber.image_lane.begin(subscriber.newest_tick());
        Ok(subscriber)
    }

    /// One message of each kind may be unread when the next is sent: a queue in the kernel would be latency that nobody
    /// sees. Who wants every message has no use for freshness, and is woken less often.
    fn size_send_buffer(&self) -> io::Result<()> {
        let kept = |stream: &Stream| kept_bytes(HEADER_LEN + stream.payload_len());
        let raw = self.raw.as_ref().map_or(0, |feed| kept(feed.stream()));
        let least = match self.wants.image || self.raw.is_some() {
            true => LEAST_BUFFER,
            false => ONLOOKER_BUFFER,
        };
        let newest = send_buffer(kept(&self.shown.stream) + raw).max(least);
        let bytes = match self.wants.every {
            true => newest.max(EVERY_BUFFER.min(self.shown.stream.backlog_bytes())),
            false => newest,
        };
        self.socket.set_send_buffer(bytes)
    }

    /// Serves this subscriber until it goes or has to go.
    pub(crate) async fn attend(&mut self) -> Farewell {
        let entry = self.entry;
        let farewell = tokio::select! {
            biased;
            farewell = entry.dismissed() => farewell,
            served = self.serve() => match served {
                Ok(never) => match never {},
                Err(farewell) => farewell,
            }
        };
        if self.wants.image {
            self.image_lane.end(self.newest_tick());
        }
        self.end_raw();
        // For whoever has its place: it may take a while to be told why it leaves.
        self.lease = None;
        farewell
    }

    async fn serve(&mut self) -> Result<std::convert::Infallible, Farewell> {
        let mut announcements = self.server.handle.announcements.subscribe();
        self.send_hello().await?;
        let standing = self.server.handle.standing.borrow().clone();
        if let Some(event) = standing {
            self.send_event(&event).await?;
        }
        loop {
            self.image_lane.set_free(self.wants.image);
            let turn = tokio::select! {
                biased;
                answer = answer(&mut self.asked), if self.asked.is_some() => Turn::Answer(answer),
                _ = self.own.changed(), if self.wants.profile.is_none() && self.asked.is_none() => Turn::Follow,
                packet = receive(&self.socket, &self.server, &self.account), if self.asked.is_none() => {
                    Turn::Packet(packet)
                }
                announcement = announcements.recv() => Turn::Announcement(announcement),
                changed = self.status.changed(), if self.wants.status => Turn::Status(changed),
                () = self.images.ready(), if self.wants.image => Turn::Image,
                () = raw_ready(&self.raw), if self.raw.is_some() => Turn::Raw,
            };
            // What is begun now is not to be cut in two.
            self.image_lane.set_free(false);
            self.take(turn).await?;
        }
    }

    async fn take(&mut self, turn: Turn) -> Result<(), Farewell> {
        match turn {
            Turn::Answer(answer) => self.handle_answer(answer).await,
            Turn::Follow => self.follow().await,
            Turn::Packet(packet) => match packet? {
                packet if packet.is_empty() => Err(Farewell::Closed),
                packet => self.handle_packet(&packet).await,
            },
            Turn::Announcement(Ok(Announcement::Event(event))) => self.send_event(&event).await,
            Turn::Announcement(Ok(Announcement::Stamped(tick, packets))) => {
                self.held.push_back((tick, packets));
                self.send_held().await
            }
            Turn::Announcement(Err(broadcast::error::RecvError::Closed)) => Err(Farewell::Closed),
            // A subscriber that missed announcements missed only news of what the images themselves show.
            Turn::Announcement(Err(broadcast::error::RecvError::Lagged(_))) => Ok(()),
            Turn::Status(changed) => {
                changed.map_err(|_| Farewell::Closed)?;
                let packets = self.status.borrow_and_update().clone();
                self.send_packets(&packets).await
            }
            Turn::Image => {
                self.send_next(Which::Image).await?;
                // Or a subscriber whose socket is always full would be sent images alone.
                if self.raw.as_ref().is_some_and(Feed::is_ready) {
                    self.send_next(Which::Raw).await?;
                }
                self.send_held().await
            }
            Turn::Raw => {
                self.send_next(Which::Raw).await?;
                self.send_held().await
            }
        }
    }

    /// Sequence number and time of the newest image.
    fn now(&self) -> (u64, u64) {
        let newest = |active: &ActiveProfile| active.stream.newest.borrow().header;
        let header = newest(&self.shown).or_else(|| newest(&self.own.borrow()));
        header.map_or((0, 0), |h| (h.seq, h.t_ns))
    }

    /// The newest tick of which there is an image, of whichever profile: one that is made anew has none of its own yet.
    fn newest_tick(&self) -> u64 {
        let published = self.server.profiles.slots.newest_tick();
        // Its own may be there while others of the same tick are still made.
        published.max(self.shown.stream.newest_tick())
    }

    fn end_raw(&mut self) {
        if let Some(raw) = self.raw.take() {
            self.raw_lane.end(raw.stream().newest_tick());
        }
    }

    /// Takes a subscription; tells the client what is wrong with one that is refused.
    async fn handle_packet(&mut self, packet: &[u8]) -> Result<(), Farewell> {
        match Subscribe::from_packet(packet) {
            Ok(wants) => self.ask(wants, true).await,
            Err(
                error @ (SubscribeError::TooLong { .. }
                | SubscribeError::Decode(_)
                | SubscribeError::WrongKind { .. }),
            ) => Err(Farewell::Nonsense(error)),
            Err(error) => self.refuse(error.to_string()).await,
        }
    }

    /// Puts a subscription into effect, or asks for its profile first.
    async fn ask(&mut self, wants: Subscribe, by_client: bool) -> Result<(), Farewell> {
        let region = match self.server.profiles.region(wants.region.as_deref()) {
            Ok(region) => region,
            Err(reason) => return self.refuse(reason).await,
        };
        // Kept as the hand has it, however often the client names a part.
        let wants = Subscribe {
            region: region.clone(),
            ..wants
        };
        if wants.profile.is_none() && region.is_none() {
            let own = self.own.borrow_and_update().clone();
            if let Err(reason) = self.subscribe(wants)? {
                return self.refuse(reason).await;
            }
            self.give_up_lease();
            return self.show(own).await;
        }
        let profile = wants.profile.clone();
        let wanted = DisplayProfile {
            profile: profile.unwrap_or_else(|| self.own.borrow_and_update().wanted.profile.clone()),
            region,
        };
        let server = self.server.clone();
        let instead_of = self.lease.as_ref().map(|lease| lease.profile().clone());
        let entry = self.entry.clone();
        let lease = tokio::task::spawn_local(async move {
            let profiles = &server.profiles;
            let lease = profiles.lease(wanted.clone(), instead_of.clone()).await;
            if lease.is_ok() || !entry.is_guest() {
                return lease;
            }
            // Whoever leaves for it may have the profile that is one too many.
            entry.settled().await;
            profiles.lease(wanted, instead_of).await
        });
        self.asked = Some(Asked {
            wants,
            by_client,
            lease,
        });
        Ok(())
    }

    /// Puts the subscription that was asked for into effect, now that its profile is there; or says why not.
    async fn handle_answer(&mut self, answer: Result<Lease, String>) -> Result<(), Farewell> {
        let Some(asked) = self.asked.take() else {
            return Ok(());
        };
        match answer {
            Ok(lease) => {
                let shown = lease.profile().clone();
                if let Err(reason) = self.subscribe(asked.wants.clone())? {
                    return self.refuse(reason).await;
                }
                self.give_up_lease();
                self.lease = Some(lease);
                self.show(shown).await
            }
            Err(reason) if asked.by_client => self.refuse(reason).await,
            // It goes on with what it is shown, and is not to blame.
            Err(reason) => self.send_event(&Event::new(EventKind::Refused, reason)).await,
        }
    }

    /// Goes on with the profile of whoever states none after that has changed.
    async fn follow(&mut self) -> Result<(), Farewell> {
        if self.wants.region.is_some() {
            return self.ask(self.wants.clone(), false).await;
        }
        let own = self.own.borrow_and_update().clone();
        self.show(own).await
    }

    /// Takes what is wanted but for the profile. The inner error says why it cannot be had, and
    /// nothing has changed then.
    fn subscribe(&mut self, wants: Subscribe) -> Result<Result<(), String>, Farewell> {
        let raw_delivery = Delivery::of_raw_frames(&wants);
        if !wants.raw {
            self.end_raw();
        } else if self.raw.as_ref().is_none_or(|raw| raw.delivery() != raw_delivery) {
            let profiles = &self.server.profiles;
            match self.server.raw.open(&profiles.maker, &profiles.slots) {
                Ok(stream) => {
                    if self.raw.is_none() {
                        self.raw_lane.begin(stream.newest_tick().max(self.newest_tick()));
                    }
                    self.raw = Some(self.server.feed(&stream, &self.raw_lane, raw_delivery));
                }
                Err(reason) => return Ok(Err(reason)),
            }
        }
        let image_delivery = Delivery::of_images(&wants);
        if wants.image != self.wants.image || self.images.delivery() != image_delivery {
            self.images = self
                .server
                .feed(&self.shown.stream, &self.image_lane, image_delivery);
        }
        match (self.wants.image, wants.image) {
            (true, false) => self.image_lane.end(self.newest_tick()),
            (false, true) => self.image_lane.begin(self.newest_tick()),
            _ => {}
        }
        if wants.status && !self.wants.status {
            self.status.mark_unchanged();
        }
        self.entry.set_wants(&wants);
        for lane in [&self.image_lane, &self.raw_lane] {
            lane.limit_rate(wants.max_rate_hz);
        }
        self.wants = wants;
        self.refusals = 0;
        self.size_send_buffer()?;
        Ok(Ok(()))
    }

    fn give_up_lease(&mut self) {
        if let Some(lease) = self.lease.take() {
            self.server.profiles.give_up(lease);
        }
    }

    /// Shows a profile, and says so. Ticks go on being counted across a change.
    async fn show(&mut self, shown: Rc<ActiveProfile>) -> Result<(), Farewell> {
        if !Rc::ptr_eq(&shown, &self.shown) {
            self.images = self
                .server
                .feed(&shown.stream, &self.image_lane, self.images.delivery());
            self.image_lane.limit_rate(self.wants.max_rate_hz);
            self.entry.set_profile(shown.id);
            self.shown = shown;
            if self.wants.image && self.image_lane.is_untouched() {
                self.image_lane.begin(self.newest_tick());
            }
            self.size_send_buffer()?;
        }
        self.send_hello().await
    }

    async fn refuse(&mut self, reason: String) -> Result<(), Farewell> {
        if self.refusals >= MAX_REFUSALS {
            return Err(Farewell::Insists(reason));
        }
        self.refusals += 1;
        self.send_event(&Event::new(EventKind::Refused, reason)).await
    }

    async fn send_event(&self, event: &Event) -> Result<(), Farewell> {
        let (seq, t_ns) = self.now();
        self.send(&event.to_packet(seq, t_ns)).await
    }

    async fn send_hello(&self) -> Result<(), Farewell> {
        let (seq, t_ns) = self.now();
        let subscription = Subscription::from(&self.wants);
        let packets = self.shown.hello.to_packets(&subscription, seq, t_ns);
        self.send_packets(&packets).await
    }

    async fn send_packets(&self, packets: &[Vec<u8>]) -> Result<(), Farewell> {
        for packet in packets {
            self.send(packet).await?;
        }
        Ok(())
    }

    /// Sends the announcements whose turn has come: those behind no message that is still to be
    /// sent. Whoever is sent the newest message alone is told at once.
    async fn send_held(&mut self) -> Result<(), Farewell> {
        while let Some((tick, _)) = self.held.front() {
            let owes = |feed: &Feed| self.wants.every && feed.owes(*tick);
            if (self.wants.image && owes(&self.images)) || self.raw.as_ref().is_some_and(owes) {
                break;
            }
            if let Some((_, packets)) = self.held.pop_front() {
                self.send_packets(&packets).await?;
            }
        }
        Ok(())
    }

    async fn send(&self, packet: &[u8]) -> Result<(), Farewell> {
        let stall = self.server.registry.stall;
        match timeout(stall, self.socket.send(packet)).await {
            Ok(sent) => Ok(sent?),
            Err(_) => Err(Farewell::Stalled(stall)),
        }
    }

    /// Sends the image or raw frame whose turn it is at the moment when the socket takes it.
    async fn send_next(&mut self, which: Which) -> Result<(), Farewell> {
        let stall = self.server.registry.stall;
        let feed = match (which, &mut self.raw) {
            (Which::Raw, Some(raw)) => raw,
            _ => &mut self.images,
        };
        match timeout(stall, feed.send()).await {
            Ok(sent) => Ok(sent?),
            Err(_) => Err(Farewell::Stalled(stall)),
        }
    }
}

/// Waits for the next raw frame.
async fn raw_ready(raw: &Option<Feed>) {
    match raw {
        Some(feed) => feed.ready().await,
        None => std::future::pending().await,
    }
}

/// What the client sent: a packet, in its turn, or nothing where it has gone.
async fn receive<M: ProfileMaker>(
    socket: &Socket,
    server: &Server<M>,
    account: &Account,
) -> io::Result<Vec<u8>> {
    let len = poll_fn(|cx| socket.poll_len(cx)).await?;
    if len > 0 {
        server.turns.wait(account, len).await;
    }
    poll_fn(|cx| {
        let mut buffer = server.subscription.borrow_mut();
        let received = ready!(socket.poll_recv(cx, &mut buffer))?;
        Poll::Ready(Ok(buffer[..received].to_vec()))
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
