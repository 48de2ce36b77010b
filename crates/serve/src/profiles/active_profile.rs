//! A profile that images are made for, and what those hold who need it.

use super::output_slots::CostPerTick;
use super::profile_maker::{Cost, DisplayProfile, ProfileMaker};
use crate::delivery::stream::{Stream, StreamEnd};
use std::cell::Cell;
use std::rc::Rc;
use std::time::Instant;
use taxel_wire::HelloText;
use taxel_wire::status::{CostStatus, ProfileStatus};

/// A profile that images are made for.
#[derive(Debug)]
pub(crate) struct ActiveProfile {
    /// Number for the status report, never used twice.
    pub(crate) id: u32,
    pub(crate) wanted: DisplayProfile,
    /// The same, to be compared.
    pub(crate) canonical: DisplayProfile,
    pub(crate) stream: Rc<Stream>,
    /// Its HELLO message.
    pub(crate) hello: HelloText,
    /// Its slot in the table; `None` where no images are made at all.
    pub(crate) slot: Option<usize>,
    pub(crate) reserved: Cost,
    pub(crate) cost_ns: CostPerTick,
    /// Subscribers that stated it.
    pub(crate) readers: Cell<usize>,
    /// Whether it is that of whoever states none.
    pub(crate) own: Cell<bool>,
    /// Since when nobody has needed it.
    pub(crate) idle_since: Cell<Option<Instant>>,
}

/// What other threads know of a profile.
#[derive(Debug, Clone)]
pub(crate) struct ProfileRecord {
    pub(crate) id: u32,
    pub(crate) own: bool,
    pub(crate) wanted: DisplayProfile,
    pub(crate) reserved: Cost,
    pub(crate) cost_ns: CostPerTick,
}

impl ProfileRecord {
    /// What it takes of each tick, microseconds.
    pub(crate) fn cost_us(&self) -> f64 {
        us(cost_ns(self.reserved, &self.cost_ns))
    }

    /// What a status report says of it where so many are shown it.
    pub(crate) fn status(&self, subscribers: usize) -> ProfileStatus {
        let cost_ns = self.cost_ns.lock().unwrap_or_else(|e| e.into_inner());
        ProfileStatus {
            id: self.id,
            own: self.own,
            profile: self.wanted.profile.clone(),
            region: self.wanted.region.clone(),
            subscribers,
            images: cost_ns.len(),
            cost_us: CostStatus {
                p50: us(cost_ns.value_at_quantile(0.5)),
                p99: us(cost_ns.value_at_quantile(0.99)),
                reserved: us(self.reserved.reserved_ns()),
            },
        }
    }
}

/// A profile that a subscriber stated; it is made at least as long as this lives.
#[derive(Debug)]
pub(crate) struct Lease(Rc<ActiveProfile>);

impl ActiveProfile {
    pub(crate) fn is_needed(&self) -> bool {
        self.own.get() || self.readers.get() > 0
    }

    pub(crate) fn cost_ns(&self) -> u64 {
        cost_ns(self.reserved, &self.cost_ns)
    }
}

/// What a profile takes of each tick: what was set aside for it, or what it has turned out to take
/// if that is more.
fn cost_ns(reserved: Cost, measured: &CostPerTick) -> u64 {
    let measured = measured.lock().unwrap_or_else(|e| e.into_inner());
    reserved.reserved_ns().max(measured.value_at_quantile(0.5))
}

impl Lease {
    pub(crate) fn new(active: Rc<ActiveProfile>) -> Self {
        active.readers.set(active.readers.get() + 1);
        active.idle_since.set(None);
        Self(active)
    }

    pub(crate) fn profile(&self) -> &Rc<ActiveProfile> {
        &self.0
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        let readers = self.0.readers.get() - 1;
        self.0.readers.set(readers);
        if readers == 0 {
            self.0.idle_since.set(Some(Instant::now()));
        }
    }
}

/// An output that is made from the next tick on; it may be sent to another thread.
pub(crate) struct Started {
    pub(crate) slot: Option<usize>,
    pub(crate) stream: StreamEnd,
    pub(crate) cost_ns: CostPerTick,
    pub(crate) reserved: Cost,
}

impl Started {
    pub(crate) fn activate<M: ProfileMaker>(
        self,
        maker: &M,
        wanted: DisplayProfile,
        id: u32,
    ) -> ActiveProfile {
        ActiveProfile {
            id,
            hello: HelloText::new(&maker.hello(&wanted)),
            canonical: wanted.canonical(),
            wanted,
            stream: Rc::new(self.stream.open()),
            slot: self.slot,
            reserved: self.reserved,
            cost_ns: self.cost_ns,
            readers: Cell::new(0),
            own: Cell::new(false),
            idle_since: Cell::new(None),
        }
    }
}

/// Nanoseconds as microseconds.
pub(crate) fn us(ns: u64) -> f64 {
    ns as f64 / 1000.0
}
