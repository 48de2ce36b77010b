//! The times of the last minute, from what is counted since the start.

use crate::snapshot::Snapshot;
use hdrhistogram::Histogram;
use std::time::{Duration, Instant};
use taxel_serve::Roster;
use taxel_wire::status::{QuantileStatus, RecentStatus};

/// How often it is kept what was counted by then: what is told is of this time and up to as much before it.
const HALF: Duration = Duration::from_secs(30);

/// How often each time was counted, in rising order: nanoseconds, and how many took up to that and more than the row before.
type Rows = Vec<(u64, u64)>;

/// Of ticks, and of images that were sent.
#[derive(Debug, Default)]
pub(crate) struct Recent {
    lateness: Since,
    age: Since,
}

/// What was counted a while ago.
#[derive(Debug, Default)]
struct Since {
    older: Rows,
    newer: Rows,
    kept: Option<Instant>,
}

impl Recent {
    /// Is to be called again and again.
    pub(crate) fn keep(&mut self, now: Instant, snapshot: &Snapshot, roster: &Roster) {
        self.lateness
            .keep(now, || of_ticks(snapshot.lateness_ns.histogram()));
        self.age.keep(now, || of_sent(roster));
    }

    pub(crate) fn status(&self, snapshot: &Snapshot, roster: &Roster) -> RecentStatus {
        RecentStatus {
            lateness_us: self
                .lateness
                .quantiles(&of_ticks(snapshot.lateness_ns.histogram())),
            age_us: self.age.quantiles(&of_sent(roster)),
        }
    }
}

impl Since {
    fn keep(&mut self, now: Instant, rows: impl FnOnce() -> Rows) {
        if now.duration_since(*self.kept.get_or_insert(now)) >= HALF {
            self.older = std::mem::replace(&mut self.newer, rows());
            self.kept = Some(now);
        }
    }

    /// Of what was counted since, microseconds; zeros where nothing was.
    fn quantiles(&self, rows: &Rows) -> QuantileStatus {
        let before = |ns: &u64| {
            let at = self.older.binary_search_by_key(ns, |(ns, _)| *ns);
            at.map_or(0, |at| self.older[at].1)
        };
        let since: Rows = (rows.iter())
            .map(|(ns, count)| (*ns, count.saturating_sub(before(ns))))
            .filter(|(_, count)| *count > 0)
            .collect();
        let all: u64 = since.iter().map(|(_, count)| count).sum();
        let quantile = |share: f64| {
            let rank = (all as f64 * share).ceil() as u64;
            let mut below = 0;
            let row = since.iter().find(|(_, count)| {
                below += count;
                below >= rank
            });
            row.map_or(0.0, |(ns, _)| *ns as f64 / 1000.0)
        };
        QuantileStatus {
            p50: quantile(0.5),
            p99: quantile(0.99),
            p999: quantile(0.999),
            max: quantile(1.0),
        }
    }
}

fn of_ticks(lateness_ns: &Histogram<u64>) -> Rows {
    let recorded = lateness_ns.iter_recorded();
    recorded
        .map(|row| (row.value_iterated_to(), row.count_since_last_iteration()))
        .collect()
}

fn of_sent(roster: &Roster) -> Rows {
    let ages = roster.sent_status().ages;
    ages.into_iter().map(|(us, count)| (us * 1000, count)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_minute_after_months_shows_and_is_over_a_minute_later() {
        let mut since = Since::default();
        let mut lateness = Histogram::new_with_bounds(1, 10_000_000_000, 2).unwrap();
        lateness.record_n(80_000, 300_000_000).unwrap();
        let mut now = Instant::now();
        let mut minute = |us: u64| {
            for _ in 0..60 {
                now += Duration::from_secs(1);
                lateness.record_n(us * 1000, 30).unwrap();
                since.keep(now, || of_ticks(&lateness));
            }
            let recent = since.quantiles(&of_ticks(&lateness));
            let whole = lateness.value_at_quantile(0.99) as f64 / 1000.0;
            // In tenths of a millisecond: a histogram has two digits.
            [recent.p50, recent.p99, recent.max, whole].map(|us| (us / 100.0).round())
        };
        minute(80);
        assert_eq!(minute(80), [1.0; 4]);
        assert_eq!(minute(5000), [50.0, 50.0, 50.0, 1.0], "the whole life hides it");
        assert_eq!(minute(80), [1.0; 4]);
        assert_eq!(
            Since::default().quantiles(&Rows::new()),
            QuantileStatus::default()
        );
    }
}
