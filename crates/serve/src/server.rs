//! A program that publishes: its subscribers, its display profiles, and what it tells everybody.

use crate::config::{Limits, ProfilesConfig};
use crate::output_slots::{OutputSlots, SlotControl, output_slots};
use crate::profiles::{DisplayProfile, ProfileMaker, Profiles, Started, start_own};
use crate::raw::RawStream;
use crate::registry::Registry;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use taxel_hand::Profile;
use taxel_wire::status::{ProfileStatus, ProfilesBudget, SubscriberStatus};
use taxel_wire::{Event, Kind, MAX_SUBSCRIBE, TEXT_PART};
use tokio::sync::{broadcast, watch};

/// Announcements that a subscriber may be behind with, before it misses some.
const ANNOUNCEMENTS: usize = 64;

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

/// What serving starts with; it is made before the threads are, and may be sent to the one that serves.
pub struct ServerSeed<M: ProfileMaker> {
    pub(crate) maker: M,
    pub(crate) slots: SlotControl<M::Frames>,
    limits: Limits,
    profiles: ProfilesConfig,
    wanted: DisplayProfile,
    own: Started,
}

impl<M: ProfileMaker> ServerSeed<M> {
    /// What is served, and the table that the thread with the frames publishes from. `own` is the
    /// profile of whoever states none, made from the first tick on; `wake` has that thread look at
    /// the table soon. The error is fit for people.
    pub fn new(
        maker: M,
        limits: Limits,
        profiles: ProfilesConfig,
        own: Profile,
        wake: impl Fn() + Send + 'static,
    ) -> Result<(Self, OutputSlots<M::Frames>), String> {
        // Twice as many slots as profiles, so that one can come while another is still on its way
        // back; and raw frames.
        let slots = 2 * (usize::from(profiles.max) + 1);
        let (table, slots) = output_slots(slots, Box::new(wake));
        let wanted = DisplayProfile {
            profile: own,
            region: None,
        };
        let own = start_own(&maker, &slots, &profiles, &wanted)?;
        let seed = Self {
            maker,
            slots,
            limits,
            profiles,
            wanted,
            own,
        };
        Ok((seed, table))
    }
}

/// A server. Lives on the serving thread alone.
pub struct Server<M: ProfileMaker> {
    pub(crate) registry: Registry,
    pub(crate) profiles: Profiles<M>,
    pub(crate) raw: RawStream,
    pub(crate) announcements: broadcast::Sender<Announcement>,
    pub(crate) status: watch::Sender<Packets>,
    /// Where subscriptions are received into, one at a time; one byte longer than the longest, to
    /// tell one too long.
    pub(crate) subscription: RefCell<Box<[u8]>>,
}

impl<M: ProfileMaker> Server<M> {
    /// The server, on the thread that serves.
    pub fn new(seed: ServerSeed<M>) -> Rc<Self> {
        Rc::new(Self {
            registry: Registry::new(seed.limits),
            profiles: Profiles::new(seed.maker, seed.slots, seed.profiles, seed.wanted, seed.own),
            raw: RawStream::default(),
            announcements: broadcast::channel(ANNOUNCEMENTS).0,
            status: watch::channel(Packets::default()).0,
            subscription: RefCell::new(vec![0; MAX_SUBSCRIBE + 1].into()),
        })
    }

    /// Tells every subscriber, with the number and time of what it was sent last.
    pub fn announce(&self, event: Event) {
        let _ = self.announcements.send(Announcement::Event(event));
    }

    /// Tells every subscriber what happened at `t_ns`, when frame `seq` was the newest. Whoever is
    /// sent every message is sent those of that frame and before it first.
    pub fn announce_at(&self, event: &Event, seq: u64, t_ns: u64) {
        let packets = Arc::new(vec![event.to_packet(seq, t_ns)]);
        let _ = self.announcements.send(Announcement::Stamped(seq + 1, packets));
    }

    /// Sends every subscriber a text of another type, such as TOUCH or ESTIMATE, in the same order as
    /// [`Server::announce_at`].
    pub fn publish_text(&self, kind: Kind, text: &[u8], seq: u64, t_ns: u64) {
        let packets = Arc::new(text_packets(kind, text, seq, t_ns));
        let _ = self.announcements.send(Announcement::Stamped(seq + 1, packets));
    }

    /// Whether any subscriber wants status reports.
    pub fn wants_status(&self) -> bool {
        self.registry.wants_status()
    }

    /// Gives those who want status reports the newest: a JSON object.
    pub fn set_status(&self, text: &[u8], seq: u64, t_ns: u64) {
        let packets = text_packets(Kind::Status, text, seq, t_ns);
        self.status.send_replace(Arc::new(packets));
    }

    /// The profile of whoever states none.
    pub fn own_profile(&self) -> Profile {
        self.profiles.own().wanted.profile.clone()
    }

    /// Makes this the profile of whoever states none, from the next tick on.
    pub async fn set_own_profile(&self, profile: Profile) -> Result<(), String> {
        self.profiles.set_own(profile).await
    }

    /// Lets profiles go that nobody has needed for a while, and frees what came back. To be called
    /// a few times a second.
    pub fn tidy(&self) {
        self.profiles.tidy();
        self.raw.tidy(&self.profiles.slots);
    }

    /// How many subscribers are connected.
    pub fn subscribers(&self) -> usize {
        self.registry.len()
    }

    /// The subscribers, for a status report.
    pub fn subscriber_status(&self) -> Vec<SubscriberStatus> {
        self.registry.status()
    }

    /// The profiles that are made, for a status report.
    pub fn profile_status(&self) -> Vec<ProfileStatus> {
        self.profiles.status(|id| self.registry.shown(id))
    }

    /// What the profiles may take of a tick and what they take of it, for a status report.
    pub fn profile_budget(&self) -> ProfilesBudget {
        self.profiles.budget()
    }
}

fn text_packets(kind: Kind, text: &[u8], seq: u64, t_ns: u64) -> Vec<Vec<u8>> {
    taxel_wire::split_text(kind, text, TEXT_PART, seq, t_ns)
        .map(|(header, part)| [&header.to_bytes(), part].concat())
        .collect()
}
