//! How long joints are waited for.

use crate::joints_view::JointsView;

/// A servo that does not answer for so long is silent; one that was not heard since the port was opened, or since all were
/// silent, is given longer: until it was asked again.
const SILENT_NS: u64 = 200_000_000;
const UNHEARD_NS: u64 = 1_000_000_000;
/// A joint whose source is well and whose angle is unknown for so long.
const STALE_NS: u64 = 500_000_000;

/// How many servos' cycles were over at a look, and since when.
#[derive(Debug, Default)]
struct Cycles {
    count: u64,
    since_ns: u64,
}

/// Since when each servo or finger is quiet, and each angle unknown.
#[derive(Debug, Default)]
pub(crate) struct Patience {
    /// Which opening of the port, and since when the port or the hand's bus is there.
    opened: u64,
    there_ns: Option<u64>,
    cycles: Cycles,
    /// When all servos were silent last.
    all_silent_ns: Option<u64>,
    pub(super) heard: Vec<bool>,
    quiet_ns: Vec<Option<u64>>,
    unknown_ns: Vec<Option<u64>>,
}

impl Patience {
    pub(super) fn begin(&mut self, opened: u64, sources: usize, now_ns: u64) {
        if self.there_ns.is_none() || self.opened != opened {
            self.opened = opened;
            self.there_ns = Some(now_ns);
            self.cycles.since_ns = now_ns;
            self.all_silent_ns = None;
            self.heard = vec![false; sources];
            self.quiet_ns = vec![None; sources];
        }
    }

    /// The port or the hand's bus is away: nothing is awaited until it is back.
    pub(super) fn away(&mut self) {
        self.there_ns = None;
        self.all_explained();
    }

    /// For how long no cycle has ended while the port is open, nanoseconds.
    pub(super) fn without_cycle_ns(&mut self, count: u64, now_ns: u64) -> u64 {
        if count != self.cycles.count {
            self.cycles = Cycles {
                count,
                since_ns: now_ns,
            };
        }
        now_ns.saturating_sub(self.cycles.since_ns)
    }

    /// Whether a source is silent.
    pub(super) fn is_silent(&mut self, source: usize, speaks: bool, now_ns: u64) -> bool {
        if speaks {
            self.heard[source] = true;
            self.quiet_ns[source] = None;
            return false;
        }
        let since_ns = *self.quiet_ns[source].get_or_insert(now_ns);
        let there_ns = self.there_ns.unwrap_or(now_ns);
        now_ns.saturating_sub(since_ns) >= SILENT_NS
            && (self.heard[source] || now_ns.saturating_sub(there_ns) >= UNHEARD_NS)
    }

    /// Whether that all are silent explains a servo's silence and an unknown angle: `all` says that they are, and for a while
    /// each is still to be asked again.
    pub(super) fn is_of_all(&mut self, all: bool, now_ns: u64) -> bool {
        if all {
            self.all_silent_ns = Some(now_ns);
        }
        let explains = (self.all_silent_ns).is_some_and(|t| now_ns.saturating_sub(t) < UNHEARD_NS);
        if explains {
            self.all_explained();
        }
        explains
    }

    /// Something else explains that a joint's angle is unknown.
    pub(super) fn explained(&mut self, joint: usize) {
        self.unknown_ns[joint] = None;
    }

    /// Something else explains whatever angle is unknown.
    pub(super) fn all_explained(&mut self) {
        self.unknown_ns.fill(None);
    }

    /// Joints whose angle has been unknown for too long.
    pub(super) fn unknown(&mut self, view: &JointsView) -> Vec<bool> {
        self.unknown_ns.resize(view.tick.angles.len(), None);
        (self.unknown_ns.iter_mut().zip(&view.tick.angles))
            .map(|(since, angle)| {
                if angle.is_finite() {
                    *since = None;
                }
                let since_ns = *since.get_or_insert(view.now_ns);
                !angle.is_finite() && view.now_ns.saturating_sub(since_ns) >= STALE_NS
            })
            .collect()
    }
}
