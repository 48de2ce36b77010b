//! How often one thing may be said.

/// Sentences on one thing that may follow each other; after that one per `SENTENCE_NS`.
const SENTENCES: u64 = 4;
const SENTENCE_NS: u64 = 10_000_000_000;

/// Lets a few sentences on one thing through, then one now and then, and counts those between.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RateLimiter {
    /// Sentences that may be said, and since when that many.
    left: u64,
    at_ns: u64,
    unsaid: u64,
}

impl RateLimiter {
    pub(crate) fn new(now_ns: u64) -> Self {
        Self {
            left: SENTENCES,
            at_ns: now_ns,
            unsaid: 0,
        }
    }

    /// Whether a sentence may be said now, with how many before it were not.
    pub(crate) fn poll(&mut self, now_ns: u64) -> Option<u64> {
        let earned = now_ns.saturating_sub(self.at_ns) / SENTENCE_NS;
        if self.left + earned >= SENTENCES {
            (self.left, self.at_ns) = (SENTENCES, now_ns);
        } else {
            self.left += earned;
            self.at_ns += earned * SENTENCE_NS;
        }
        if self.left == 0 {
            self.unsaid += 1;
            return None;
        }
        self.left -= 1;
        Some(std::mem::take(&mut self.unsaid))
    }
}
