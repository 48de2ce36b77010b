//! How often a subscriber is sent a message that asked for fewer than are made.

use std::time::{Duration, Instant};

/// Longest time between two messages.
const LONGEST_PAUSE_S: f64 = 3600.0;

/// Which messages are a subscriber's at its highest rate: each is sent when it is made, or not at all, since one that waits
/// for its turn is old by then. On average there are no more than that rate allows.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Pace {
    /// Time between two messages, where there is a highest rate.
    between: Option<Duration>,
    /// When the next message may be due.
    turn: Option<Instant>,
}

impl Pace {
    /// At most so many a second, of those that come from now on.
    pub(crate) fn new(max_rate_hz: Option<f64>) -> Self {
        let between = |hz: f64| Duration::from_secs_f64((1.0 / hz).min(LONGEST_PAUSE_S));
        Self {
            between: max_rate_hz.map(between),
            turn: None,
        }
    }

    /// Whether the message that was due then is to be sent.
    pub(crate) fn takes(&self, due: Instant) -> bool {
        match (self.between, self.turn) {
            // Ticks are not punctual: with the sweeps of a hand they come a little early now and then.
            (Some(between), Some(turn)) => due + between / 4 >= turn,
            _ => true,
        }
    }

    /// A message that was due then was sent. Where it came behind its turn, since ticks are no multiple of the rate, the next
    /// has its turn so much sooner.
    pub(crate) fn note_sent(&mut self, due: Instant) {
        if let Some(between) = self.between {
            let turn = self.turn.filter(|turn| due < *turn + between);
            self.turn = Some(turn.unwrap_or(due) + between);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which of so many ticks a second are taken in a second, and the least and the most ticks from one to the next.
    fn taken(max_rate_hz: f64, tick_hz: u32, jitter: Duration) -> (usize, u32, u32) {
        let mut pace = Pace::new(Some(max_rate_hz));
        let begin = Instant::now();
        let due = |tick: u32| begin + Duration::from_secs(1) / tick_hz * tick + jitter * (tick * 7 % 3);
        let mut ticks = Vec::new();
        for tick in 0..10 * tick_hz {
            if pace.takes(due(tick)) {
                pace.note_sent(due(tick));
                ticks.push(tick);
            }
        }
        let steps = || ticks.windows(2).map(|pair| pair[1] - pair[0]);
        (ticks.len() / 10, steps().min().unwrap(), steps().max().unwrap())
    }

    #[test]
    fn as_many_are_taken_as_the_rate_allows_and_evenly() {
        for jitter in [0, 1, 3].map(Duration::from_millis) {
            assert_eq!(taken(30.0, 30, jitter), (30, 1, 1), "{jitter:?}");
            assert_eq!(taken(60.0, 30, jitter), (30, 1, 1), "{jitter:?}");
            assert_eq!(taken(10.0, 30, jitter), (10, 3, 3), "{jitter:?}");
            assert_eq!(taken(20.0, 30, jitter), (20, 1, 2), "{jitter:?}");
            assert_eq!(taken(25.0, 30, jitter), (25, 1, 2), "{jitter:?}");
        }
        assert_eq!(taken(30.0, 100, Duration::ZERO), (30, 3, 4));
    }

    #[test]
    fn after_a_pause_no_more_come_than_before() {
        let mut pace = Pace::new(Some(10.0));
        let begin = Instant::now();
        let at = |ms: u64| begin + Duration::from_millis(ms);
        for (ms, taken) in [
            (0, true),
            (33, false),
            (5000, true),
            (5033, false),
            (5067, false),
            (5100, true),
        ] {
            assert_eq!(pace.takes(at(ms)), taken, "{ms}");
            if taken {
                pace.note_sent(at(ms));
            }
        }
    }
}
