//! Who is connected.

#[cfg(test)]
mod tests;

use crate::config::Limits;
use crate::crowding::most_crowding;
use crate::delivery::sent::Sent;
use crate::delivery::stream::OverTicks;
use crate::farewell::Farewell;
use crate::log_lines::LogLines;
use std::cell::{Cell, RefCell};
use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use taxel_wire::status::SubscriberStatus;
use tokio::sync::{Notify, watch};

/// A client that tries again and again to get in is told of in the log no more often.
const TURNED_AWAY_PERIOD: Duration = Duration::from_secs(10);
/// Clients that are turned away try again within this time, as a rule.
const OF_LATE: Duration = Duration::from_secs(5);
/// Fewest guests at once: one of another beside one of the process that has most.
const FEWEST_GUESTS: usize = 2;
/// Most guests at once; fewer where there are few places, since each has a file descriptor too.
const MOST_GUESTS: usize = 8;
/// So many processes are known that looked in last.
const LOOKED_IN: usize = 64;

/// A user and a process.
type Process = (Option<u32>, i32);

/// The subscribers of a server.
#[derive(Debug)]
pub(crate) struct Registry {
    entries: RefCell<Vec<Arc<Entry>>>,
    /// Processes that were guests and left before they were settled, those of late.
    looked_in: RefCell<VecDeque<Process>>,
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
    /// Told when it has to leave, and why.
    leave: Notify,
    dismissal: Mutex<Option<Farewell>>,
    /// Number of the display profile it is shown.
    profile: AtomicU32,
    /// Whether it is served beyond the places until it is [settled](Registry::settle).
    guest: watch::Sender<bool>,
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
            dismissal: Mutex::default(),
            profile: AtomicU32::new(profile),
            guest: watch::Sender::new(false),
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

    /// Its process, where the kernel tells it from others.
    fn process(&self) -> Option<Process> {
        self.pid.map(|pid| (self.uid, pid))
    }

    /// Has it leave.
    fn dismiss(&self, why: Farewell) {
        *self.dismissal.lock().unwrap_or_else(PoisonError::into_inner) = Some(why);
        self.leave.notify_one();
    }

    /// Waits until it has to leave, and says why.
    pub(crate) async fn dismissed(&self) -> Farewell {
        self.leave.notified().await;
        let why = self
            .dismissal
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        why.unwrap_or(Farewell::Closed)
    }

    pub(crate) fn is_guest(&self) -> bool {
        *self.guest.borrow()
    }

    /// Waits until it has a place of its own, which may be for ever.
    pub(crate) async fn settled(&self) {
        let _ = self.guest.subscribe().wait_for(|guest| !guest).await;
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
            looked_in: RefCell::default(),
            max: limits.max_subscribers,
            stall: Duration::from_millis(limits.stall_ms.into()),
            images: Arc::default(),
            raw_frames: Arc::default(),
            visits: RefCell::default(),
            turned_away: RefCell::new(LogLines::new(1, TURNED_AWAY_PERIOD)),
            turned_away_at: Cell::default(),
        }
    }

    /// Lets `new` in, as a guest where all places are taken; `false` where nobody would leave for it, or there are guests
    /// enough. Guests too make room for those of a process that has fewer, and those of one that has looked in before for
    /// those of one that has not.
    pub(crate) fn enter(&self, new: &Arc<Entry>) -> bool {
        let mut entries = self.entries.borrow_mut();
        if entries.len() >= self.max {
            let (guests, settled) = divide(&entries);
            if self.leaving(&settled, new).is_none() {
                return false;
            }
            let most = (self.max / 4).clamp(FEWEST_GUESTS, MOST_GUESTS);
            if guests.len() >= most {
                let leaving = crowding(most, &guests, new).or_else(|| self.onlooker(&guests, new));
                let Some(guest) = leaving else {
                    return false;
                };
                dismiss(&mut entries, &guest, self.too_many());
            }
            new.guest.send_replace(true);
        }
        entries.push(new.clone());
        true
    }

    /// Gives a guest a place, or has it leave. Who has gone by then, or is shown nothing, has put nobody out.
    pub(crate) fn settle(&self, guest: &Arc<Entry>) {
        let mut entries = self.entries.borrow_mut();
        if !entries.iter().any(|entry| Arc::ptr_eq(entry, guest)) {
            return;
        }
        let (_, settled) = divide(&entries);
        if settled.len() >= self.max {
            let leaving = self.leaving(&settled, guest);
            let Some(leaving) = leaving.filter(|_| guest.is_shown_anything()) else {
                return dismiss(&mut entries, guest, self.too_many());
            };
            let why = match leaving.is_shown_anything() {
                true => Farewell::Crowds,
                false => Farewell::MadeRoom,
            };
            dismiss(&mut entries, &leaving, why);
        }
        // Last: who leaves is woken first, and gives its profile back before the guest asks for one again.
        guest.guest.send_replace(false);
        let mut looked_in = self.looked_in.borrow_mut();
        looked_in.retain(|process| guest.process() != Some(*process));
    }

    /// The oldest of these guests that is of a process which has looked in before, where `new` is of none.
    fn onlooker(&self, guests: &[Arc<Entry>], new: &Entry) -> Option<Arc<Entry>> {
        let looked_in = self.looked_in.borrow();
        let has_looked_in = |entry: &Entry| {
            entry
                .process()
                .is_some_and(|process| looked_in.contains(&process))
        };
        let mut onlookers = guests.iter().filter(|guest| has_looked_in(guest));
        onlookers.next().filter(|_| !has_looked_in(new)).cloned()
    }

    /// Who of those that have a place leaves for `new`: the oldest that is shown nothing of the hand, or else the oldest of
    /// the process that crowds the others.
    fn leaving(&self, settled: &[Arc<Entry>], new: &Entry) -> Option<Arc<Entry>> {
        let idle = settled.iter().find(|entry| !entry.is_shown_anything());
        idle.cloned().or_else(|| crowding(self.max, settled, new))
    }

    /// Why one that is turned away is.
    pub(crate) fn too_many(&self) -> Farewell {
        Farewell::TooMany(self.max)
    }

    /// Whether clients are turned away these days.
    pub(crate) fn is_crowded(&self) -> bool {
        (self.turned_away_at.get()).is_some_and(|at| at.elapsed() < OF_LATE)
    }

    pub(crate) fn remove(&self, entry: &Arc<Entry>) {
        let mut entries = self.entries.borrow_mut();
        let Some(at) = entries.iter().position(|other| Arc::ptr_eq(other, entry)) else {
            return;
        };
        entries.remove(at);
        if let Some(process) = entry.process().filter(|_| entry.is_guest()) {
            let mut looked_in = self.looked_in.borrow_mut();
            looked_in.retain(|other| *other != process);
            looked_in.push_back(process);
            if looked_in.len() > LOOKED_IN {
                looked_in.pop_front();
            }
        }
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
            tracing::info!("lines on subscribers that came and went that are not in this log: {lines}");
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

    /// All of them.
    pub(crate) fn entries(&self) -> Vec<Arc<Entry>> {
        self.entries.borrow().clone()
    }
}

/// The guests, and those that have a place.
fn divide(entries: &[Arc<Entry>]) -> (Vec<Arc<Entry>>, Vec<Arc<Entry>>) {
    entries.iter().cloned().partition(|entry| entry.is_guest())
}

/// The oldest of the process that has most of these `places`, where `new` is of one that has fewer. Those that the kernel
/// does not tell apart crowd nobody.
fn crowding(places: usize, entries: &[Arc<Entry>], new: &Entry) -> Option<Arc<Entry>> {
    let (crowding, most) = most_crowding(places, entries.iter().filter_map(|entry| entry.process()))?;
    let is_own = |entry: &&Arc<Entry>| new.pid.is_some() && entry.process() == new.process();
    // Or each would push the other out in turn.
    if entries.iter().filter(is_own).count() + 1 >= most {
        return None;
    }
    let mut of_crowding = entries.iter().filter(|entry| entry.process() == Some(crowding));
    of_crowding.next().cloned()
}

/// Has one leave.
fn dismiss(entries: &mut Vec<Arc<Entry>>, leaving: &Arc<Entry>, why: Farewell) {
    entries.retain(|entry| !Arc::ptr_eq(entry, leaving));
    leaving.dismiss(why);
}
