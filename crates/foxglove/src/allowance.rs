//! How much a client may send: it has little to say.

use std::time::{Duration, Instant};

/// Bytes at once: a subscription to every channel has some 500, and a thousand of them 30,000.
const MOST: usize = 256 << 10;
/// Bytes that are granted per second.
const PER_SECOND: f64 = 64e3;
/// Bytes that a message counts for beside its own: one of no length is looked at, too, and may be answered.
pub(crate) const PER_MESSAGE: usize = 100;

/// Bytes that a client may still send.
#[derive(Debug)]
pub(crate) struct Allowance {
    left: usize,
    at: Instant,
}

impl Allowance {
    pub(crate) fn new(now: Instant) -> Self {
        Self { left: MOST, at: now }
    }

    /// How many bytes are left by then.
    pub(crate) fn left(&mut self, now: Instant) -> usize {
        let waited = now.saturating_duration_since(self.at);
        // What is less than a byte is left for the next look.
        if waited >= Duration::from_millis(1) {
            self.at = now;
            let granted = (waited.as_secs_f64() * PER_SECOND) as usize;
            self.left = (self.left.saturating_add(granted)).min(MOST);
        }
        self.left
    }

    /// Takes some of what is left.
    pub(crate) fn take(&mut self, bytes: usize) {
        self.left = self.left.saturating_sub(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_is_granted_again_with_time_and_no_more_than_at_first() {
        let began = Instant::now();
        let mut allowance = Allowance::new(began);
        allowance.take(MOST);
        assert_eq!(allowance.left(began), 0);
        let later = |seconds| began + Duration::from_secs(seconds);
        assert_eq!(allowance.left(later(1)), PER_SECOND as usize);
        assert_eq!(allowance.left(later(1000)), MOST);
    }
}
