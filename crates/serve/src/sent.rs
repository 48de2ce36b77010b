//! What a subscriber was sent of a stream, and how old it was then. The serving thread writes, others
//! read whenever they like.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};
use taxel_wire::status::QuantileStatus;

/// Steps to an octave: a quantile is at most an eighth too high.
const STEPS: usize = 8;
/// Octaves of microseconds, up to 16 s.
const OCTAVES: usize = 24;

/// Counts of one subscriber, or of all together.
#[derive(Debug)]
pub(crate) struct Sent {
    sent: AtomicU64,
    skipped: AtomicU64,
    /// How old messages were when they were sent.
    ages: [AtomicU64; STEPS * OCTAVES],
    oldest_us: AtomicU64,
    since: Instant,
    /// When the last one was sent, microseconds after `since`; 0 where none is due.
    last_us: AtomicU64,
    longest_gap_us: AtomicU64,
}

impl Default for Sent {
    fn default() -> Self {
        Self {
            sent: AtomicU64::default(),
            skipped: AtomicU64::default(),
            ages: [const { AtomicU64::new(0) }; STEPS * OCTAVES],
            oldest_us: AtomicU64::default(),
            since: Instant::now(),
            last_us: AtomicU64::default(),
            longest_gap_us: AtomicU64::default(),
        }
    }
}

impl Sent {
    /// One more was sent at `now`, which was due at `due`, behind so many that were not sent. It is
    /// counted `of_all`, too.
    pub(crate) fn record(&self, of_all: &Self, now: Instant, due: Instant, skipped: u64) {
        let age_us = micros(now.duration_since(due));
        let now_us = micros(now.duration_since(self.since)).max(1);
        let gap_us = match self.last_us.swap(now_us, Relaxed) {
            0 => 0,
            last_us => now_us.saturating_sub(last_us),
        };
        for counts in [self, of_all] {
            counts.sent.fetch_add(1, Relaxed);
            counts.skipped.fetch_add(skipped, Relaxed);
            counts.ages[step_of(age_us)].fetch_add(1, Relaxed);
            counts.oldest_us.fetch_max(age_us, Relaxed);
            counts.longest_gap_us.fetch_max(gap_us, Relaxed);
        }
    }

    /// None is due for a while: that is no gap.
    pub(crate) fn rest(&self) {
        self.last_us.store(0, Relaxed);
    }

    pub(crate) fn sent(&self) -> u64 {
        self.sent.load(Relaxed)
    }

    pub(crate) fn skipped(&self) -> u64 {
        self.skipped.load(Relaxed)
    }

    /// The longest time between two messages, milliseconds; that which goes on included.
    pub(crate) fn longest_gap_ms(&self) -> f64 {
        let gap_us = match self.last_us.load(Relaxed) {
            0 => 0,
            last_us => micros(self.since.elapsed()).saturating_sub(last_us),
        };
        gap_us.max(self.longest_gap_us.load(Relaxed)) as f64 / 1000.0
    }

    /// How many messages were how old when they were sent: the most microseconds of each step that has
    /// any, and its messages.
    pub(crate) fn ages(&self) -> Vec<(u64, u64)> {
        let counts = self.ages.iter().map(|count| count.load(Relaxed)).enumerate();
        counts
            .filter(|(_, count)| *count > 0)
            .map(|(step, count)| (end_of(step) as u64, count))
            .collect()
    }

    /// How old messages were when they were sent, microseconds; zeros where none was.
    pub(crate) fn age_us(&self) -> QuantileStatus {
        let counts = self.ages.each_ref().map(|count| count.load(Relaxed));
        let all: u64 = counts.iter().sum();
        let oldest_us = self.oldest_us.load(Relaxed) as f64;
        let quantile = |share: f64| {
            let rank = ((all as f64 * share).ceil() as u64).max(1);
            let mut below = 0;
            let step = counts.iter().position(|count| {
                below += count;
                below >= rank
            });
            step.map_or(0.0, |step| end_of(step).min(oldest_us))
        };
        QuantileStatus {
            p50: quantile(0.5),
            p99: quantile(0.99),
            p999: quantile(0.999),
            max: oldest_us,
        }
    }
}

fn micros(time: Duration) -> u64 {
    time.as_micros() as u64
}

/// The step that a number of microseconds falls into.
fn step_of(us: u64) -> usize {
    if us < STEPS as u64 {
        return us as usize;
    }
    let octave = us.ilog2() as usize - STEPS.ilog2() as usize;
    let within = (us >> octave) as usize - STEPS;
    ((octave + 1) * STEPS + within).min(STEPS * OCTAVES - 1)
}

/// The most microseconds that fall into a step.
fn end_of(step: usize) -> f64 {
    match step / STEPS {
        0 => step as f64,
        octave => (((STEPS + step % STEPS + 1) << (octave - 1)) - 1) as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_age_falls_into_a_step_at_most_an_eighth_long() {
        for us in (0..5000).chain([10_000, 99_999, 1_000_000, 15_999_999]) {
            let end = end_of(step_of(us));
            assert!(end >= us as f64 && end <= us as f64 * 1.126, "{us}: {end}");
        }
        assert_eq!(step_of(u64::MAX), STEPS * OCTAVES - 1);
    }

    #[test]
    fn quantiles_gaps_and_counts_are_of_what_was_sent() {
        let (sent, all) = (Sent::default(), Sent::default());
        assert_eq!(
            (sent.age_us(), sent.longest_gap_ms()),
            (QuantileStatus::default(), 0.0)
        );
        let start = sent.since;
        let at = |ms| start + Duration::from_millis(ms);
        for image in 0..998 {
            sent.record(&all, at(image + 1), at(image), 0);
        }
        sent.record(&all, at(1500), at(1490), 3);
        sent.record(&all, at(1501), at(1401), 0);
        let age = sent.age_us();
        assert!((1000.0..1130.0).contains(&age.p50), "{age:?}");
        assert!((1000.0..1130.0).contains(&age.p99), "{age:?}");
        assert!((10_000.0..11_300.0).contains(&age.p999), "{age:?}");
        assert_eq!(age.max, 100_000.0);
        let ages = sent.ages();
        assert_eq!(ages.iter().map(|(_, count)| count).sum::<u64>(), 1000);
        assert_eq!((ages.len(), ages[0].1), (3, 998), "{ages:?}");
        assert_eq!((sent.sent(), sent.skipped()), (1000, 3));
        sent.rest();
        assert_eq!(sent.longest_gap_ms(), 502.0);
        assert_eq!((all.age_us(), all.longest_gap_ms()), (age, 502.0));
    }
}
