//! How often the log says one and the same thing.

use super::Allowance;
use std::time::Duration;
use tokio::time::Instant;

/// Lines of the log at once, and in the long run.
pub(super) const LINES: u32 = 30;
pub(super) const LINE_INTERVAL: Duration = Duration::from_secs(3);

/// How much may be said of one kind of thing that others bring about as often as they like.
#[derive(Debug)]
pub(crate) struct Lines {
    allowance: Allowance,
    unsaid: u64,
}

impl Default for Lines {
    fn default() -> Self {
        Self {
            allowance: Allowance::new(LINES, LINE_INTERVAL),
            unsaid: 0,
        }
    }
}

impl Lines {
    /// Whether a line may be said, or is to be `always`: how many before it were not.
    pub(crate) fn take(&mut self, always: bool, now: Instant) -> Option<u64> {
        if !self.allowance.take_now(now) && !always {
            self.unsaid += 1;
            return None;
        }
        Some(std::mem::take(&mut self.unsaid))
    }

    /// How many lines were not said, where that may be said now.
    pub(crate) fn take_unsaid(&mut self, now: Instant) -> Option<u64> {
        (self.unsaid > 0 && self.allowance.take_now(now)).then(|| std::mem::take(&mut self.unsaid))
    }

    /// Whether something was not said, and that not yet either.
    pub(super) fn has_left_out(&self) -> bool {
        self.unsaid > 0
    }

    /// Says in the log that something has changed.
    pub(crate) fn say(&mut self, text: &str, now: Instant) {
        match self.take(false, now) {
            None => {}
            Some(0) => tracing::info!("{text}"),
            Some(unsaid) => tracing::info!("{text}; {unsaid} such changes before it are not in the log"),
        }
    }
}
