//! What a program's other threads have of its server: they tell its subscribers something, and ask
//! who is connected, without holding up the thread that sends.

use crate::delivery::sent::Sent;
use crate::profiles::active_profile::ProfileRecord;
use crate::registry::Entry;
use std::collections::BTreeMap;
use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use taxel_hand::Profile;
use taxel_wire::status::{ProfileStatus, ProfilesBudget, SentStatus, SubscriberStatus};
use taxel_wire::{Event, Kind, TEXT_PART};
use tokio::sync::{broadcast, mpsc, oneshot, watch};

/// Announcements that a subscriber may be behind with, before it misses some.
const ANNOUNCEMENTS: usize = 64;
/// Questions that may wait for an answer.
const REQUESTS: usize = 16;

/// The packets of one text.
pub(crate) type Packets = Arc<Vec<Vec<u8>>>;

/// What every subscriber is told.
#[derive(Debug, Clone)]
pub(crate) enum Announcement {
    /// To be stamped with what the subscriber was sent last.
    Event(Event),
    /// Stamped: the number of the tick that it comes behind, and its packets.
    Stamped(u64, Packets),
}

/// What the serving thread is asked.
#[derive(Debug)]
pub(crate) enum Request {
    Roster(oneshot::Sender<Roster>),
    SetOwnProfile(Profile, oneshot::Sender<Result<(), String>>),
    Listen(OwnedFd, oneshot::Sender<io::Result<()>>),
}

/// A server as other threads see it.
#[derive(Debug, Clone)]
pub struct ServerHandle {
    pub(crate) announcements: broadcast::Sender<Announcement>,
    /// What whoever comes is told behind the first HELLO.
    pub(crate) standing: watch::Sender<Option<Event>>,
    pub(crate) status: watch::Sender<Packets>,
    requests: mpsc::Sender<Request>,
}

impl ServerHandle {
    /// A handle, and where its server takes what it is asked.
    pub(crate) fn new() -> (Self, mpsc::Receiver<Request>) {
        let (requests, asked) = mpsc::channel(REQUESTS);
        let handle = Self {
            announcements: broadcast::channel(ANNOUNCEMENTS).0,
            standing: watch::channel(None).0,
            status: watch::channel(Packets::default()).0,
            requests,
        };
        (handle, asked)
    }

    /// Tells every subscriber, with the number and time of what it was sent last.
    pub fn announce(&self, event: Event) {
        let _ = self.announcements.send(Announcement::Event(event));
    }

    /// Tells every subscriber of something that lasts, and whoever comes later too, until it is over (`None`). Who comes in
    /// this moment may be told twice.
    pub fn set_standing(&self, event: Option<Event>) {
        self.standing.send_replace(event.clone());
        if let Some(event) = event {
            self.announce(event);
        }
    }

    /// Tells every subscriber what happened at `t_ns`, when frame `seq` was the newest. Whoever is
    /// sent every message is sent those of that frame and before it first.
    pub fn announce_at(&self, event: &Event, seq: u64, t_ns: u64) {
        let packets = Arc::new(vec![event.to_packet(seq, t_ns)]);
        let _ = self.announcements.send(Announcement::Stamped(seq + 1, packets));
    }

    /// Sends every subscriber a text of another type, such as TOUCH or ESTIMATE, in the same order as
    /// [`ServerHandle::announce_at`].
    pub fn publish_text(&self, kind: Kind, text: &[u8], seq: u64, t_ns: u64) {
        let packets = Arc::new(text_packets(kind, text, seq, t_ns));
        let _ = self.announcements.send(Announcement::Stamped(seq + 1, packets));
    }

    /// Gives those who want status reports the newest: a JSON object.
    pub fn set_status(&self, text: &[u8], seq: u64, t_ns: u64) {
        let packets = text_packets(Kind::Status, text, seq, t_ns);
        self.status.send_replace(Arc::new(packets));
    }

    /// Who is connected, and what is made for them; `None` where nobody serves any more.
    pub async fn roster(&self) -> Option<Roster> {
        let (answer, answered) = oneshot::channel();
        self.requests.send(Request::Roster(answer)).await.ok()?;
        answered.await.ok()
    }

    /// Makes this the profile of whoever states none, from the next tick on. The error is fit for
    /// whoever asked.
    pub async fn set_own_profile(&self, profile: Profile) -> Result<(), String> {
        let (answer, answered) = oneshot::channel();
        let asked = self.requests.send(Request::SetOwnProfile(profile, answer)).await;
        let stopping = || Err("the daemon is stopping".into());
        match asked {
            Ok(()) => answered.await.unwrap_or_else(|_| stopping()),
            Err(_) => stopping(),
        }
    }

    /// Has subscribers let in at another socket, which listens, and no longer at the one before. Those who are in stay.
    pub async fn listen(&self, listener: OwnedFd) -> io::Result<()> {
        let (answer, answered) = oneshot::channel();
        let stopping = || io::Error::other("the daemon is stopping");
        let asked = self.requests.send(Request::Listen(listener, answer)).await;
        asked.map_err(|_| stopping())?;
        answered.await.unwrap_or_else(|_| Err(stopping()))
    }
}

fn text_packets(kind: Kind, text: &[u8], seq: u64, t_ns: u64) -> Vec<Vec<u8>> {
    taxel_wire::split_text(kind, text, TEXT_PART, seq, t_ns)
        .map(|(header, part)| [&header.to_bytes(), part].concat())
        .collect()
}

/// Who was connected at one instant, and what was made for them. Their counts go on: a report made
/// of it later has the counts of then, and costs the serving thread nothing.
#[derive(Debug, Clone, Default)]
pub struct Roster {
    pub(crate) subscribers: Vec<Arc<Entry>>,
    pub(crate) profiles: Vec<ProfileRecord>,
    pub(crate) budget: ProfilesBudget,
    pub(crate) images: Arc<Sent>,
    pub(crate) places: usize,
    /// Whether clients were turned away of late.
    pub(crate) is_crowded: bool,
}

/// Who holds the places of subscribers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Holder {
    /// The user; `None` where the kernel says nothing.
    pub uid: Option<u32>,
    /// The process.
    pub pid: Option<i32>,
    /// How many.
    pub places: usize,
}

impl Roster {
    /// Where clients were turned away of late since no place was free: how many places there are, and who holds them, the
    /// most first.
    pub fn crowd(&self) -> Option<(usize, Vec<Holder>)> {
        if !self.is_crowded {
            return None;
        }
        let mut places: BTreeMap<_, usize> = BTreeMap::new();
        for entry in &self.subscribers {
            *places.entry((entry.uid, entry.pid)).or_default() += 1;
        }
        let holder = |((uid, pid), places)| Holder { uid, pid, places };
        let mut holders: Vec<Holder> = places.into_iter().map(holder).collect();
        holders.sort_by_key(|holder| std::cmp::Reverse(holder.places));
        Some((self.places, holders))
    }

    /// How many subscribers are connected.
    pub fn subscribers(&self) -> usize {
        self.subscribers.len()
    }

    /// The images that all were sent since the start, for a status report.
    pub fn sent_status(&self) -> SentStatus {
        // Those that go on are in no total yet.
        let gaps = self.subscribers.iter().map(|entry| entry.images.longest_gap_ms());
        SentStatus {
            subscribers: self.subscribers.len(),
            images: self.images.sent(),
            skipped: self.images.skipped(),
            paced: self.images.paced(),
            age_us: self.images.age_us(),
            ages: self.images.ages(),
            age_sum_us: self.images.age_sum_us(),
            longest_gap_ms: gaps.fold(self.images.longest_gap_ms(), f64::max),
        }
    }

    /// Whether any subscriber wants status reports.
    pub fn wants_status(&self) -> bool {
        self.subscribers.iter().any(|entry| entry.wants_status())
    }

    /// The profile of whoever states none.
    pub fn own_profile(&self) -> Profile {
        let own = self.profiles.iter().find(|record| record.own);
        own.map(|record| record.wanted.profile.clone())
            .unwrap_or_default()
    }

    /// The subscribers, for a status report.
    pub fn subscriber_status(&self) -> Vec<SubscriberStatus> {
        self.subscribers.iter().map(|entry| entry.status()).collect()
    }

    /// The profiles that are made, for a status report.
    pub fn profile_status(&self) -> Vec<ProfileStatus> {
        let shown = |id| (self.subscribers.iter().filter(|entry| entry.is_shown(id))).count();
        let records = self.profiles.iter();
        records.map(|record| record.status(shown(record.id))).collect()
    }

    /// What the profiles may take of a tick and what they take of it, for a status report.
    pub fn profile_budget(&self) -> ProfilesBudget {
        ProfilesBudget {
            spent_us: self.profiles.iter().map(ProfileRecord::cost_us).sum(),
            ..self.budget
        }
    }
}
