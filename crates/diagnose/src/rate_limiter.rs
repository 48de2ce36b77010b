//! How often one thing may be said, and what of it is still to be said.

/// Sentences on one thing that may follow each other; after that one per `SENTENCE_NS`.
const SENTENCES: u64 = 4;
const SENTENCE_NS: u64 = 10_000_000_000;

/// Lets a few sentences on one thing through, then one now and then.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RateLimiter {
    /// Sentences that may be said, and since when that many.
    left: u64,
    at_ns: u64,
}

impl RateLimiter {
    pub(crate) fn new(now_ns: u64) -> Self {
        Self {
            left: SENTENCES,
            at_ns: now_ns,
        }
    }

    /// Whether a sentence may be said now.
    pub(crate) fn poll(&mut self, now_ns: u64) -> bool {
        let earned = now_ns.saturating_sub(self.at_ns) / SENTENCE_NS;
        if self.left + earned >= SENTENCES {
            (self.left, self.at_ns) = (SENTENCES, now_ns);
        } else {
            self.left += earned;
            self.at_ns += earned * SENTENCE_NS;
        }
        let may = self.left > 0;
        self.left -= u64::from(may);
        may
    }
}

/// What was said of one thing that comes and goes. It may change as often as it likes: what was said last is what is so,
/// `SENTENCE_NS` after the last change at the latest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Telling {
    limiter: RateLimiter,
    /// Whether the newest sentence said that it is there.
    said: bool,
    /// How often it has come or gone since.
    changes: u64,
}

impl Telling {
    pub(crate) fn new(now_ns: u64) -> Self {
        Self {
            limiter: RateLimiter::new(now_ns),
            said: false,
            changes: 0,
        }
    }

    /// It has come, or is over.
    pub(crate) fn change(&mut self) {
        self.changes += 1;
    }

    /// Whether it is still to be said that it is there, or that it is over.
    pub(crate) fn owes(&self, is_there: bool) -> bool {
        self.said != is_there
    }

    /// Whether that may be said now, with how many changes before this one were not told.
    pub(crate) fn poll(&mut self, is_there: bool, now_ns: u64) -> Option<u64> {
        if !self.owes(is_there) || !self.limiter.poll(now_ns) {
            return None;
        }
        self.said = is_there;
        Some(std::mem::take(&mut self.changes).saturating_sub(1))
    }
}
