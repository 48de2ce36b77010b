//! One subscriber: it gets the description of the hand, then the newest image whenever it can take
//! one, or every one.
//!
//! A subscriber that is slow is given the newest image when it can take it, and told how many it
//! missed. It holds up neither the tick nor another subscriber: all it can block is its own task. While
//! that task waits, the courier sends the newest image (see [`crate::delivery::lane`]).

mod subscription;

use crate::delivery::Delivery;
use crate::delivery::feed::Feed;
use crate::delivery::lane::Lane;
use crate::delivery::sent::Sent;
use crate::delivery::socket::{Socket, kept_bytes, send_buffer};
use crate::delivery::stream::Stream;
use crate::farewell::Farewell;
use crate::handle::{Announcement, Packets};
use crate::profiles::active_profile::{ActiveProfile, Lease};
use crate::profiles::profile_maker::ProfileMaker;
use crate::registry::Entry;
use crate::server::Server;
use crate::turns::Account;
use std::collections::VecDeque;
use std::future::poll_fn;
use std::io;
use std::rc::Rc;
use std::sync::Arc;
use std::task::{Poll, ready};
use subscription::{Asked, answer};
use taxel_wire::{Event, HEADER_LEN, Subscribe, Subscription};
use tokio::sync::{broadcast, watch};
use tokio::time::timeout;

/// Least send buffer of a subscriber's socket, bytes: it holds a part of a HELLO.
const LEAST_BUFFER: usize = 4608;
/// The same of one that wants the status alone: a status or two of a usual hand, and why it has to go, are unread in it.
const ONLOOKER_BUFFER: usize = 32_768;
/// Most send buffer of a subscriber that is sent every message: the usual limit for programs
/// without privileges.
const EVERY_BUFFER: usize = 212_992;

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
