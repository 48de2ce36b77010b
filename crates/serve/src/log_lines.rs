//! What happens often is told in the log a few times, and counted after that.

use std::cell::Cell;
use std::time::{Duration, Instant};

/// Lines of one kind to a minute.
const LINES: u64 = 20;
const MINUTE: Duration = Duration::from_secs(60);

/// The lines of one kind.
#[derive(Debug)]
pub(crate) struct LogLines {
    since: Cell<Instant>,
    lines: Cell<u64>,
}

impl Default for LogLines {
    fn default() -> Self {
        Self {
            since: Cell::new(Instant::now()),
            lines: Cell::new(0),
        }
    }
}

impl LogLines {
    /// Whether one more may be written; it is counted in any case.
    pub(crate) fn may_write(&self) -> bool {
        self.lines.set(self.lines.get() + 1);
        self.lines.get() <= LINES
    }

    /// Once a minute: how many were not written in the last one, if any.
    pub(crate) fn held_back(&self) -> Option<u64> {
        self.held_back_at(Instant::now())
    }

    fn held_back_at(&self, now: Instant) -> Option<u64> {
        if now.duration_since(self.since.get()) < MINUTE {
            return None;
        }
        self.since.set(now);
        let lines = self.lines.take();
        (lines > LINES).then(|| lines - LINES)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_storm_is_told_a_few_times_and_then_once_a_minute() {
        let lines = LogLines::default();
        let start = lines.since.get();
        let written = (0..10_000).filter(|_| lines.may_write()).count();
        assert_eq!(written as u64, LINES);
        assert_eq!(lines.held_back_at(start + MINUTE / 2), None);
        assert!(!lines.may_write());
        assert_eq!(lines.held_back_at(start + MINUTE), Some(10_001 - LINES));
        // A minute later what happens now and then is told again, and nothing was held back.
        assert!(lines.may_write());
        assert_eq!(lines.held_back_at(start + 2 * MINUTE), None);
    }
}
