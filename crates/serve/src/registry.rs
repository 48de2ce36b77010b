//! Who is connected.

use crate::config::Limits;
use crate::crowding::most_crowding;
use crate::farewell::Farewell;
use crate::log_lines::LogLines;
use crate::sent::Sent;
use crate::stream::OverTicks;
use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use std::time::{Duration, Instant};
use taxel_wire::status::SubscriberStatus;
use tokio::sync::Notify;

/// A client that tries again and again to get in is told of in the log no more often.
const TURNED_AWAY_PERIOD: Duration = Duration::from_secs(10);
/// Clients that are turned away try again within this time, as a rule.
const OF_LATE: Duration = Duration::from_secs(5);

/// The subscribers of a server.
#[derive(Debug)]
pub(crate) struct Registry {
    entries: RefCell<Vec<Arc<Entry>>>,
    pub(crate) max: usize,
    pub(crate) stall: Duration,
    /// What all subscribers were sent since the start, those that are gone included.
    pub(crate) images: Arc<Sent>,
    pub(crate) raw_frames: Arc<Sent>,
    /// Lines that tell who came and went.
    pub(crate) visits: RefCell<LogLines>,
    /// Lines that tell that one was turned away.
    turned_away: RefCell<LogLines>,
    /// When the last one was.
    turned_away_at: Cell<Option<Instant>>,
}

/// What is known of one subscriber. The serving thread writes it, others read it whenever they like.
#[derive(Debug)]
pub(crate) struct Entry {
    pub(crate) pid: Option<i32>,
    pub(crate) uid: Option<u32>,
    since: Instant,
    pub(crate) images: Arc<Sent>,
    pub(crate) raw_frames: Arc<Sent>,
    wants_image: AtomicBool,
    wants_raw: AtomicBool,
    wants_status: AtomicBool,
    wants_every: AtomicBool,
    /// Told when another one takes its place.
    pub(crate) leave: Notify,
    /// Number of the display profile it is shown.
    profile: AtomicU32,
}

impl Entry {
    pub(crate) fn new(pid: Option<i32>, uid: Option<u32>, profile: u32) -> Self {
        Self {
            pid,
            uid,
            since: Instant::now(),
            images: Arc::default(),
            raw_frames: Arc::default(),
            wants_image: AtomicBool::new(true),
            wants_raw: AtomicBool::default(),
            wants_status: AtomicBool::default(),
            wants_every: AtomicBool::default(),
            leave: Notify::new(),
            profile: AtomicU32::new(profile),
        }
    }

    pub(crate) fn set_wants(&self, wants: &taxel_wire::Subscribe) {
        self.wants_image.store(wants.image, Relaxed);
        self.wants_raw.store(wants.raw, Relaxed);
        self.wants_status.store(wants.status, Relaxed);
        self.wants_every.store(wants.every, Relaxed);
    }

    pub(crate) fn set_profile(&self, profile: u32) {
        self.profile.store(profile, Relaxed);
    }

    pub(crate) fn wants_status(&self) -> bool {
        self.wants_status.load(Relaxed)
    }

    fn process(&self) -> (Option<u32>, Option<i32>) {
        (self.uid, self.pid)
    }

    /// Why it makes room for another.
    pub(crate) fn farewell(&self) -> Farewell {
        match self.is_shown_anything() {
            true => Farewell::Crowds,
            false => Farewell::MadeRoom,
        }
    }

    /// Whether it is shown anything of the hand. Whoever has just come is, unless it says otherwise.
    fn is_shown_anything(&self) -> bool {
        self.wants_image.load(Relaxed) || self.wants_raw.load(Relaxed)
    }

    pub(crate) fn is_shown(&self, profile: u32) -> bool {
        self.profile.load(Relaxed) == profile
    }

    /// What a status report says of it.
    pub(crate) fn status(&self) -> SubscriberStatus {
        SubscriberStatus {
            pid: self.pid,
            uid: self.uid,
            connected_s: self.since.elapsed().as_secs_f64(),
            images: self.images.sent(),
            skipped: self.images.skipped(),
            paced: self.images.paced(),
            raw: self.wants_raw.load(Relaxed),
            raw_frames: self.raw_frames.sent(),
            raw_skipped: self.raw_frames.skipped(),
            raw_paced: self.raw_frames.paced(),
            every: self.wants_every.load(Relaxed),
            profile: self.profile.load(Relaxed),
            age_us: self.images.age_us(),
            longest_gap_ms: self.images.longest_gap_ms(),
        }
    }
}

impl Registry {
    pub(crate) fn new(limits: Limits) -> Self {
        Self {
            entries: RefCell::default(),
            max: limits.max_subscribers,
            stall: Duration::from_millis(limits.stall_ms.into()),
            images: Arc::default(),
            raw_frames: Arc::default(),
            visits: RefCell::default(),
            turned_away: RefCell::new(LogLines::new(1, TURNED_AWAY_PERIOD)),
            turned_away_at: Cell::default(),
        }
    }

    /// Sees to a place for `new`, and says whether there is one. Who is shown nothing of the hand loses its own for it, the
    /// oldest first; or else the oldest of the process that has most of them, where `new` is of one that has fewer.
    pub(crate) fn make_room(&self, new: &Entry) -> bool {
        let mut entries = self.entries.borrow_mut();
        if entries.len() < self.max {
            return true;
        }
        let idle = entries.iter().position(|entry| !entry.is_shown_anything());
        let leaving = idle.or_else(|| {
            let processes = || entries.iter().map(|entry| entry.process());
            let (crowding, most) = most_crowding(self.max, processes())?;
            let own = processes().filter(|process| *process == new.process()).count();
            // Or each would push the other out in turn.
            (own + 1 < most).then(|| processes().position(|process| process == crowding))?
        });
        if let Some(leaving) = leaving {
            entries.remove(leaving).leave.notify_one();
        }
        leaving.is_some()
    }

    /// Whether clients are turned away these days.
    pub(crate) fn is_crowded(&self) -> bool {
        (self.turned_away_at.get()).is_some_and(|at| at.elapsed() < OF_LATE)
    }

    pub(crate) fn add(&self, entry: &Arc<Entry>) {
        self.entries.borrow_mut().push(entry.clone());
    }

    pub(crate) fn remove(&self, entry: &Arc<Entry>) {
        self.entries.borrow_mut().retain(|e| !Arc::ptr_eq(e, entry));
    }

    /// Says in the log, now and then, that clients were turned away.
    pub(crate) fn report_turned_away(&self, pid: Option<i32>, farewell: &Farewell) {
        let now = Instant::now();
        self.turned_away_at.set(Some(now));
        if let Some(untold) = self.turned_away.borrow_mut().take(false, now.into()) {
            tracing::warn!(pid, clients = untold + 1, "turned away: {farewell}");
        }
    }

    /// Tells the log what was not told line by line.
    pub(crate) fn tidy(&self) {
        if let Some(lines) = self.visits.borrow_mut().take_unsaid(Instant::now().into()) {
            tracing::info!("{lines} lines on subscribers that came and went are not in this log");
        }
        if let Some(clients) = self.turned_away.borrow_mut().take_unsaid(Instant::now().into()) {
            tracing::warn!(clients, "turned away");
        }
    }

    /// Counts what subscribers will not be sent any more, given the images of each profile, by its number, and the raw
    /// frames.
    pub(crate) fn count_skipped(&self, images: &HashMap<u32, OverTicks>, raw_frames: Option<OverTicks>) {
        for entry in self.entries.borrow().iter() {
            let over = |ticks: &OverTicks| match entry.wants_every.load(Relaxed) {
                true => ticks.every,
                false => ticks.newest,
            };
            // One that is no longer made is followed by another one soon.
            if let Some(images) = images.get(&entry.profile.load(Relaxed)) {
                entry.images.skip_to(&self.images, over(images));
            }
            if let Some(raw_frames) = &raw_frames {
                entry.raw_frames.skip_to(&self.raw_frames, over(raw_frames));
            }
        }
    }

    /// How many subscribers are connected.
    pub(crate) fn len(&self) -> usize {
        self.entries.borrow().len()
    }

    /// All of them.
    pub(crate) fn entries(&self) -> Vec<Arc<Entry>> {
        self.entries.borrow().clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn registry(max_subscribers: usize) -> Registry {
        let stall_ms = 1000;
        Registry::new(Limits {
            max_subscribers,
            stall_ms,
        })
    }

    /// Whether one of this process is let in.
    fn enter(registry: &Registry, pid: i32) -> bool {
        let entry = Arc::new(Entry::new(Some(pid), Some(1000), 0));
        let has_room = registry.make_room(&entry);
        if has_room {
            registry.add(&entry);
        }
        has_room
    }

    fn places(registry: &Registry) -> Vec<i32> {
        registry.entries().iter().filter_map(|entry| entry.pid).collect()
    }

    #[test]
    fn the_process_with_most_readers_makes_room_for_one_that_has_fewer_until_both_have_as_many() {
        let registry = registry(8);
        assert!((0..7).all(|_| enter(&registry, 1)) && enter(&registry, 2));
        let oldest = registry.entries()[0].clone();
        assert!(!enter(&registry, 1), "it has most of them itself");
        assert!(enter(&registry, 3));
        assert!(!registry.entries().iter().any(|entry| Arc::ptr_eq(entry, &oldest)));
        assert_eq!(places(&registry), [1, 1, 1, 1, 1, 1, 2, 3]);
        assert!(matches!(oldest.farewell(), Farewell::Crowds));
        assert!(enter(&registry, 2) && enter(&registry, 2));
        assert_eq!(places(&registry), [1, 1, 1, 1, 2, 3, 2, 2]);
        assert!(!enter(&registry, 2), "both would push each other out in turn");
        assert!(enter(&registry, 3));
        assert_eq!(places(&registry), [1, 1, 1, 2, 3, 2, 2, 3]);
    }

    #[test]
    fn who_is_shown_nothing_makes_room_first_and_nobody_where_each_has_one() {
        let registry = registry(8);
        assert!((0..8).all(|_| enter(&registry, 1)));
        let onlooker = registry.entries()[5].clone();
        onlooker.set_wants(&taxel_wire::Subscribe {
            image: false,
            ..Default::default()
        });
        assert!(matches!(onlooker.farewell(), Farewell::MadeRoom));
        assert!(enter(&registry, 2));
        assert!(
            !registry
                .entries()
                .iter()
                .any(|entry| Arc::ptr_eq(entry, &onlooker))
        );

        let registry = self::registry(8);
        assert!((0..8).all(|pid| enter(&registry, pid)) && !enter(&registry, 9));
    }
}
