//! Who is connected.

use crate::config::Limits;
use crate::farewell::Farewell;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::{Duration, Instant};
use taxel_wire::status::SubscriberStatus;

/// A client that tries again and again to get in is told of in the log no more often.
const TURNED_AWAY_PERIOD: Duration = Duration::from_secs(10);

/// The subscribers of a server.
#[derive(Debug)]
pub(crate) struct Registry {
    entries: RefCell<Vec<Rc<Entry>>>,
    pub(crate) max: usize,
    pub(crate) stall: Duration,
    /// When the log was told last that one was turned away.
    told_turned_away: Cell<Option<Instant>>,
    /// How many were turned away since.
    turned_away: Cell<u64>,
}

/// What is known of one subscriber.
#[derive(Debug)]
pub(crate) struct Entry {
    pub(crate) pid: Option<i32>,
    pub(crate) uid: Option<u32>,
    pub(crate) since: Instant,
    pub(crate) images: Cell<u64>,
    pub(crate) skipped: Cell<u64>,
    pub(crate) raw_frames: Cell<u64>,
    pub(crate) raw_skipped: Cell<u64>,
    pub(crate) raw: Cell<bool>,
    pub(crate) status: Cell<bool>,
    pub(crate) every: Cell<bool>,
    /// Number of the display profile it is shown.
    pub(crate) profile: Cell<u32>,
}

impl Registry {
    pub(crate) fn new(limits: Limits) -> Self {
        Self {
            entries: RefCell::default(),
            max: limits.max_subscribers,
            stall: Duration::from_millis(limits.stall_ms.into()),
            told_turned_away: Cell::default(),
            turned_away: Cell::default(),
        }
    }

    pub(crate) fn add(&self, entry: &Rc<Entry>) {
        self.entries.borrow_mut().push(entry.clone());
    }

    pub(crate) fn remove(&self, entry: &Rc<Entry>) {
        self.entries.borrow_mut().retain(|e| !Rc::ptr_eq(e, entry));
    }

    /// Says in the log, now and then, that clients were turned away.
    pub(crate) fn report_turned_away(&self, pid: Option<i32>, farewell: &Farewell) {
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

    /// Whether any subscriber asked for status reports.
    pub(crate) fn wants_status(&self) -> bool {
        self.entries.borrow().iter().any(|e| e.status.get())
    }

    /// How many subscribers are shown the profile of this number.
    pub(crate) fn shown(&self, profile: u32) -> usize {
        let entries = self.entries.borrow();
        entries.iter().filter(|e| e.profile.get() == profile).count()
    }

    /// The subscribers, for the status report.
    pub(crate) fn status(&self) -> Vec<SubscriberStatus> {
        let status = |e: &Rc<Entry>| SubscriberStatus {
            pid: e.pid,
            uid: e.uid,
            connected_s: e.since.elapsed().as_secs_f64(),
            images: e.images.get(),
            skipped: e.skipped.get(),
            raw: e.raw.get(),
            raw_frames: e.raw_frames.get(),
            raw_skipped: e.raw_skipped.get(),
            every: e.every.get(),
            profile: e.profile.get(),
        };
        self.entries.borrow().iter().map(status).collect()
    }
}
