//! How often something may happen.

use std::time::Duration;
use tokio::time::Instant;

/// So many times at once, and once per interval in the long run.
#[derive(Debug)]
pub struct Allowance {
    burst: Duration,
    interval: Duration,
    /// When what was taken so far would be over, taken evenly; none before the first.
    due: Option<Instant>,
}

impl Allowance {
    /// So many at once, and one per `interval`.
    pub fn new(burst: u32, interval: Duration) -> Self {
        Self {
            burst: interval * burst.saturating_sub(1),
            interval,
            due: None,
        }
    }

    /// Takes one, and says how long to wait for it.
    pub fn take(&mut self, now: Instant) -> Duration {
        let due = self.due.map_or(now, |due| due.max(now));
        self.due = Some(due + self.interval);
        due.duration_since(now).saturating_sub(self.burst)
    }

    /// Takes one where it need not be waited for; says whether.
    pub(crate) fn take_now(&mut self, now: Instant) -> bool {
        let is_there = self.due.is_none_or(|due| due.duration_since(now) <= self.burst);
        if is_there {
            self.take(now);
        }
        is_there
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_is_free_and_the_rest_comes_at_its_pace() {
        let (now, interval) = (Instant::now(), Duration::from_millis(50));
        let mut allowance = Allowance::new(3, interval);
        let waits: Vec<u128> = (0..5).map(|_| allowance.take(now).as_millis()).collect();
        assert_eq!(waits, [0, 0, 0, 50, 100]);
        let rested = now + 5 * interval;
        let waits: Vec<u128> = (0..4).map(|_| allowance.take(rested).as_millis()).collect();
        assert_eq!(waits, [0, 0, 0, 50]);
    }

    #[test]
    fn what_would_have_to_be_waited_for_is_not_taken() {
        let (now, interval) = (Instant::now(), Duration::from_millis(50));
        let mut allowance = Allowance::new(2, interval);
        let taken: Vec<bool> = (0..4).map(|_| allowance.take_now(now)).collect();
        assert_eq!(taken, [true, true, false, false]);
        assert!(allowance.take_now(now + interval));
        assert!(!allowance.take_now(now + interval));
    }
}
