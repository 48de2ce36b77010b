//! A program that publishes: its subscribers, its display profiles, and what it tells everybody.

use crate::config::{Limits, ProfilesConfig};
use crate::delivery::Delivery;
use crate::delivery::feed::Feed;
use crate::delivery::lane::Lane;
use crate::delivery::second_hand::{Hands, Prepare};
use crate::delivery::stream::Stream;
use crate::handle::{Request, Roster, ServerHandle};
use crate::profiles::active_profile::Started;
use crate::profiles::output_slots::{OutputSlots, SlotControl, output_slots};
use crate::profiles::profile_maker::{DisplayProfile, ProfileMaker};
use crate::profiles::{Profiles, start_own};
use crate::raw::RawStream;
use crate::registry::Registry;
use crate::turns::Turns;
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;
use taxel_hand::Profile;
use taxel_wire::MAX_SUBSCRIBE;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::{MissedTickBehavior, interval};
use tokio_seqpacket::UnixSeqpacketListener;

/// How often profiles are let go that nobody has needed for a while, and memory is freed that came back.
const TIDY_PERIOD: Duration = Duration::from_millis(100);

/// What serving starts with; it is made before the threads are, and may be sent to the one that serves.
pub struct ServerSeed<M: ProfileMaker> {
    pub(crate) maker: M,
    pub(crate) slots: SlotControl<M::Frames>,
    limits: Limits,
    profiles: ProfilesConfig,
    wanted: DisplayProfile,
    own: Started,
    handle: ServerHandle,
    requests: mpsc::Receiver<Request>,
    /// What is run first on the thread that helps to send, if there is to be one.
    second_hand: Option<Prepare>,
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
        let (handle, requests) = ServerHandle::new();
        let seed = Self {
            maker,
            slots,
            limits,
            profiles,
            wanted,
            own,
            handle,
            requests,
            second_hand: None,
        };
        Ok((seed, table))
    }

    /// A second thread, `images 2`, sends messages too, where they go to more than 64 subscribers at once. `prepare` is
    /// run on it first, as to give it the priority of the thread that serves. It ends with the server.
    pub fn with_second_hand(self, prepare: impl FnOnce() + Send + 'static) -> Self {
        Self {
            second_hand: Some(Box::new(prepare)),
            ..self
        }
    }

    /// What the program's other threads have of the server.
    pub fn handle(&self) -> ServerHandle {
        self.handle.clone()
    }
}

/// A server. Lives on the serving thread alone.
pub struct Server<M: ProfileMaker> {
    pub(crate) registry: Registry,
    pub(crate) profiles: Profiles<M>,
    pub(crate) raw: RawStream,
    /// What images are sent with.
    hands: Rc<Hands>,
    pub(crate) handle: ServerHandle,
    requests: RefCell<Option<mpsc::Receiver<Request>>>,
    /// The task that lets subscribers in.
    letting_in: RefCell<Option<JoinHandle<()>>>,
    /// Where subscriptions are received into, one at a time; one byte longer than the longest, to
    /// tell one too long.
    pub(crate) subscription: RefCell<Box<[u8]>>,
    /// Whose is looked at next.
    pub(crate) turns: Turns,
}

impl<M: ProfileMaker> Server<M> {
    /// The server, on the thread that serves.
    pub fn new(seed: ServerSeed<M>) -> Rc<Self> {
        Rc::new(Self {
            registry: Registry::new(seed.limits),
            profiles: Profiles::new(seed.maker, seed.slots, seed.profiles, seed.wanted, seed.own),
            raw: RawStream::default(),
            hands: Hands::new(seed.second_hand),
            handle: seed.handle,
            requests: RefCell::new(Some(seed.requests)),
            letting_in: RefCell::default(),
            subscription: RefCell::new(vec![0; MAX_SUBSCRIBE + 1].into()),
            turns: Turns::new(),
        })
    }

    /// Serves subscribers, and answers the program's other threads, until the program ends. To be
    /// run in a [`tokio::task::LocalSet`], once.
    pub async fn serve(self: Rc<Self>, listener: UnixSeqpacketListener) {
        self.listen(listener);
        tokio::join!(self.clone().answer_requests(), self.tidy());
    }

    /// Lets subscribers in at this socket, and no longer at the one before.
    fn listen(self: &Rc<Self>, listener: UnixSeqpacketListener) {
        let letting_in = tokio::task::spawn_local(self.clone().let_in(listener));
        if let Some(before) = self.letting_in.replace(Some(letting_in)) {
            before.abort();
        }
    }

    /// One stream on its way to one subscriber.
    pub(crate) fn feed(&self, stream: &Rc<Stream>, lane: &Rc<Lane>, delivery: Delivery) -> Feed {
        Feed::new(stream, lane, delivery, &self.hands)
    }

    /// Who is connected, and what is made for them.
    pub fn roster(&self) -> Roster {
        self.count_skipped();
        Roster {
            subscribers: self.registry.entries(),
            profiles: self.profiles.records(),
            budget: self.profiles.budget(),
            images: self.registry.images.clone(),
            places: self.registry.max,
            is_crowded: self.registry.is_crowded(),
        }
    }

    /// Counts what subscribers will not be sent any more, of whom the task may be waiting for its socket.
    fn count_skipped(&self) {
        let images = self.profiles.over_ticks();
        let raw_frames = self.raw.over_ticks();
        self.registry.count_skipped(&images, raw_frames);
    }

    /// Answers what other threads ask.
    async fn answer_requests(self: Rc<Self>) {
        let Some(mut requests) = self.requests.take() else {
            return;
        };
        while let Some(request) = requests.recv().await {
            match request {
                Request::Roster(answer) => drop(answer.send(self.roster())),
                Request::Listen(listener, answer) => {
                    let listener = UnixSeqpacketListener::try_from(listener);
                    drop(answer.send(listener.map(|listener| self.listen(listener))));
                }
                // Its cost is measured first, which takes a while.
                Request::SetOwnProfile(profile, answer) => {
                    let server = self.clone();
                    tokio::task::spawn_local(async move {
                        let _ = answer.send(server.profiles.set_own(profile).await);
                    });
                }
            }
        }
    }

    /// Lets profiles go that nobody has needed for a while, frees what came back, and tells the log
    /// what it was spared.
    async fn tidy(&self) {
        let mut period = interval(TIDY_PERIOD);
        period.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            period.tick().await;
            self.profiles.tidy();
            self.raw.tidy(&self.profiles.slots);
            self.registry.tidy();
        }
    }
}
