//! How often one thing may be said, and what of it is still to be said.

/// Sentences on one thing that may follow each other; after that one per `FIRST_NS`, then twice as long each time, up to
/// `LONGEST_NS`.
const SENTENCES: u64 = 4;
const FIRST_NS: u64 = 10_000_000_000;
const LONGEST_NS: u64 = 600_000_000_000;
/// What has not changed for this long is how it is.
const SETTLED_NS: u64 = 10_000_000_000;

/// Lets a few sentences on one thing through, then one now and then, ever less often.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RateLimiter {
    /// Sentences that may be said, and since when that many.
    left: u64,
    at_ns: u64,
    /// How long it is until there is one more.
    wait_ns: u64,
}

impl RateLimiter {
    pub(crate) fn new(now_ns: u64) -> Self {
        Self {
            left: SENTENCES,
            at_ns: now_ns,
            wait_ns: FIRST_NS,
        }
    }

    /// Whether a sentence may be said now.
    pub(crate) fn poll(&mut self, now_ns: u64) -> bool {
        let earned = now_ns.saturating_sub(self.at_ns) / self.wait_ns;
        if self.left + earned >= SENTENCES {
            *self = Self::new(now_ns);
        } else {
            self.left += earned;
            self.at_ns += earned * self.wait_ns;
            if earned > 0 {
                self.wait_ns = (2 * self.wait_ns).min(LONGEST_NS);
            }
        }
        let may = self.left > 0;
        self.left -= u64::from(may);
        may
    }
}

/// What was said of one thing that comes and goes. It may change as often as it likes: what was said last is what is so,
/// [`SETTLED_NS`] after the last change at the latest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Telling {
    limiter: RateLimiter,
    /// Whether the newest sentence said that it is there.
    said: bool,
    /// How often it has come or gone since, and when it did last.
    changes: u64,
    changed_ns: u64,
}

impl Telling {
    pub(crate) fn new(now_ns: u64) -> Self {
        Self {
            limiter: RateLimiter::new(now_ns),
            said: false,
            changes: 0,
            changed_ns: now_ns,
        }
    }

    /// It has come, or is over.
    pub(crate) fn change(&mut self, now_ns: u64) {
        self.changes += 1;
        self.changed_ns = now_ns;
    }

    /// Whether it is still to be said that it is there, or that it is over.
    pub(crate) fn owes(&self, is_there: bool) -> bool {
        self.said != is_there
    }

    /// Whether that may be said now, with how many changes before this one were not told.
    pub(crate) fn poll(&mut self, is_there: bool, now_ns: u64) -> Option<u64> {
        let is_settled = || now_ns.saturating_sub(self.changed_ns) >= SETTLED_NS;
        if !self.owes(is_there) || !(self.limiter.poll(now_ns) || is_settled()) {
            return None;
        }
        self.said = is_there;
        Some(std::mem::take(&mut self.changes).saturating_sub(1))
    }
}
