//! When the configuration is read again: at once, but not again and again however often that is asked for.

use std::time::{Duration, Instant};

/// Between two times: each may bring another display profile, which every reader of the daemon's own is moved to.
const PAUSE: Duration = Duration::from_millis(500);

/// Requests to read it again. Several that come meanwhile are one.
#[derive(Debug, Default)]
pub(crate) struct Rereads {
    is_asked: bool,
    last: Option<Instant>,
}

impl Rereads {
    /// It is asked for.
    pub(crate) fn ask(&mut self) {
        self.is_asked = true;
    }

    /// Whether to read it now; that is one time.
    pub(crate) fn take(&mut self, now: Instant) -> bool {
        let is_due = self.is_asked && self.last.is_none_or(|last| now.duration_since(last) >= PAUSE);
        if is_due {
            (self.is_asked, self.last) = (false, Some(now));
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_storm_of_requests_is_two_a_second_and_the_last_is_not_lost() {
        let start = Instant::now();
        let mut rereads = Rereads::default();
        let mut taken = Vec::new();
        for ms in 0..5000 {
            // A hundred a second for 1.2 s, and one later.
            if (ms <= 1200 && ms % 10 == 0) || ms == 4000 {
                rereads.ask();
            }
            if rereads.take(start + Duration::from_millis(ms)) {
                taken.push(ms);
            }
        }
        assert_eq!(taken, [0, 500, 1000, 1500, 4000]);
    }
}
