//! What a subscriber was sent of a stream, and how old it was then. The serving thread writes, others
//! read whenever they like.

use std::sync::atomic::{
    AtomicU64,
    Ordering::{Acquire, Relaxed, Release},
};
use std::time::{Duration, Instant};
use taxel_wire::status::QuantileStatus;

/// Steps to an octave: a quantile is at most an eighth too high.
const STEPS: usize = 8;
/// Octaves of microseconds, up to 16 s.
const OCTAVES: usize = 24;

/// In place of a tick: no message is asked for.
const NONE_ASKED: u64 = u64::MAX;

/// Counts of one subscriber, or of all together. A message that was made while it was asked for is counted once: as
/// sent, as paced where it came too soon for the rate asked for, or as skipped as soon as it is certain that it will not
/// be sent.
#[derive(Debug)]
pub(crate) struct Sent {
    sent: AtomicU64,
    skipped: AtomicU64,
    paced: AtomicU64,
    /// How old messages were when they were sent.
    ages: [AtomicU64; STEPS * OCTAVES],
    oldest_us: AtomicU64,
    ages_us: AtomicU64,
    /// The tick up to which messages are counted.
    counted: AtomicU64,
    since: Instant,
    /// When they were asked for, microseconds after `since`.
    asked_us: AtomicU64,
    /// When the last one was sent, or they were asked for where the first has been skipped, microseconds after `since`;
    /// 0 where none was due yet.
    last_us: AtomicU64,
    longest_gap_us: AtomicU64,
}

impl Default for Sent {
    fn default() -> Self {
        Self {
            sent: AtomicU64::default(),
            skipped: AtomicU64::default(),
            paced: AtomicU64::default(),
            ages: [const { AtomicU64::new(0) }; STEPS * OCTAVES],
            oldest_us: AtomicU64::default(),
            ages_us: AtomicU64::default(),
            counted: AtomicU64::new(NONE_ASKED),
            since: Instant::now(),
            asked_us: AtomicU64::default(),
            last_us: AtomicU64::default(),
            longest_gap_us: AtomicU64::default(),
        }
    }
}

impl Sent {
    /// Messages after this tick are asked for from `now` on.
    pub(crate) fn begin(&self, now: Instant, tick: u64) {
        self.asked_us.store(self.us_at(now), Relaxed);
        self.counted.store(tick, Relaxed);
    }

    /// No message after this tick is asked for, nor will an earlier one be sent. That none comes from now on is no gap.
    pub(crate) fn end(&self, of_all: &Self, now: Instant, tick: u64) {
        self.skip_to(of_all, tick);
        self.close_gap(of_all, now);
        self.last_us.store(0, Release);
        self.counted.store(NONE_ASKED, Relaxed);
    }

    /// Messages up to this tick were sent, or never will be: the latter are counted, `of_all`, too.
    pub(crate) fn skip_to(&self, of_all: &Self, tick: u64) {
        let skipped = tick.saturating_sub(self.counted.load(Relaxed));
        if skipped == 0 {
            return;
        }
        self.counted.store(tick, Relaxed);
        for counts in [self, of_all] {
            counts.skipped.fetch_add(skipped, Relaxed);
        }
        if self.last_us.load(Relaxed) == 0 {
            self.last_us.store(self.asked_us.load(Relaxed), Release);
        }
    }

    /// The message of this tick will not be sent, since it came too soon for the rate asked for.
    pub(crate) fn pace(&self, of_all: &Self, tick: u64) {
        self.skip_to(of_all, tick.saturating_sub(1));
        if self.counted.load(Relaxed) < tick {
            self.counted.store(tick, Relaxed);
            for counts in [self, of_all] {
                counts.paced.fetch_add(1, Relaxed);
            }
        }
    }

    /// The message of a tick that was due at `due` was sent at `now`. It is counted `of_all`, too.
    pub(crate) fn record(&self, of_all: &Self, now: Instant, due: Instant, tick: u64) {
        self.skip_to(of_all, tick.saturating_sub(1));
        self.close_gap(of_all, now);
        self.counted.store(tick, Relaxed);
        self.last_us.store(self.us_at(now), Release);
        let age_us = micros(now.duration_since(due));
        for counts in [self, of_all] {
            counts.sent.fetch_add(1, Relaxed);
            counts.ages[step_of(age_us)].fetch_add(1, Relaxed);
            counts.oldest_us.fetch_max(age_us, Relaxed);
            counts.ages_us.fetch_add(age_us, Relaxed);
        }
    }

    fn close_gap(&self, of_all: &Self, now: Instant) {
        let gap_us = self.open_gap_us(now);
        for counts in [self, of_all] {
            counts.longest_gap_us.fetch_max(gap_us, Relaxed);
        }
    }

    fn open_gap_us(&self, now: Instant) -> u64 {
        match self.last_us.load(Acquire) {
            0 => 0,
            last_us => self.us_at(now).saturating_sub(last_us),
        }
    }

    /// Microseconds after `since`; never 0.
    fn us_at(&self, now: Instant) -> u64 {
        micros(now.duration_since(self.since)).max(1)
    }

    pub(crate) fn sent(&self) -> u64 {
        self.sent.load(Relaxed)
    }

    pub(crate) fn skipped(&self) -> u64 {
        self.skipped.load(Relaxed)
    }

    pub(crate) fn paced(&self) -> u64 {
        self.paced.load(Relaxed)
    }

    /// The longest time between two messages, milliseconds; that which goes on included.
    pub(crate) fn longest_gap_ms(&self) -> f64 {
        // Asked first: it is closed before the next one is opened, so that the longest never falls.
        let open_us = self.open_gap_us(Instant::now());
        open_us.max(self.longest_gap_us.load(Relaxed)) as f64 / 1000.0
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

    /// What the ages of all messages add up to, microseconds.
    pub(crate) fn age_sum_us(&self) -> u64 {
        self.ages_us.load(Relaxed)
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
        sent.begin(start, 0);
        for image in 0..998 {
            sent.record(&all, at(image + 1), at(image), image + 1);
        }
        sent.record(&all, at(1500), at(1490), 1002);
        sent.record(&all, at(1501), at(1401), 1003);
        sent.end(&all, at(1502), 1003);
        let age = sent.age_us();
        assert!((1000.0..1130.0).contains(&age.p50), "{age:?}");
        assert!((1000.0..1130.0).contains(&age.p99), "{age:?}");
        assert!((10_000.0..11_300.0).contains(&age.p999), "{age:?}");
        assert_eq!(age.max, 100_000.0);
        let ages = sent.ages();
        assert_eq!(ages.iter().map(|(_, count)| count).sum::<u64>(), 1000);
        assert_eq!((ages.len(), ages[0].1), (3, 998), "{ages:?}");
        assert_eq!((sent.age_sum_us(), all.age_sum_us()), (1_108_000, 1_108_000));
        assert_eq!((sent.sent(), sent.skipped()), (1000, 3));
        assert_eq!(sent.longest_gap_ms(), 502.0);
        assert_eq!((all.age_us(), all.longest_gap_ms()), (age, 502.0));
        assert_eq!((all.sent(), all.skipped()), (1000, 3));
    }

    #[test]
    fn what_was_not_sent_is_counted_once_whether_another_one_is_sent_or_not() {
        /// What happens, at which time in ms.
        enum Act {
            Begin(u64),
            /// Nothing up to this tick will be sent.
            SkipTo(u64),
            Send(u64),
            End(u64),
        }
        use Act::*;
        for (what, acts, skipped, gap_ms) in [
            ("never sent one", vec![(100, Begin(50)), (400, End(59))], 9, 300.0),
            (
                "the same, looked at meanwhile",
                vec![
                    (100, Begin(50)),
                    (200, SkipTo(52)),
                    (300, SkipTo(55)),
                    (400, End(59)),
                ],
                9,
                300.0,
            ),
            (
                "none was made",
                vec![(100, Begin(50)), (900, SkipTo(49)), (900, End(50))],
                0,
                0.0,
            ),
            (
                "the first came long after it was asked for, since none was made before",
                vec![(100, Begin(50)), (900, Send(51)), (901, End(51))],
                0,
                1.0,
            ),
            (
                "took one and no more",
                vec![
                    (100, Begin(50)),
                    (133, Send(51)),
                    (1133, SkipTo(80)),
                    (1163, End(82)),
                ],
                31,
                1030.0,
            ),
            (
                "took one again",
                vec![
                    (100, Begin(50)),
                    (133, Send(51)),
                    (1133, SkipTo(80)),
                    (1166, Send(82)),
                    (1199, End(82)),
                ],
                30,
                1033.0,
            ),
            (
                "asked for none in between",
                vec![
                    (100, Begin(50)),
                    (133, Send(51)),
                    (140, End(51)),
                    (900, SkipTo(74)),
                    (900, Begin(74)),
                    (933, Send(75)),
                ],
                0,
                7.0,
            ),
        ] {
            let (sent, all) = (Sent::default(), Sent::default());
            let at = |ms| sent.since + Duration::from_millis(ms);
            let mut before = (0, 0);
            for (ms, act) in acts {
                match act {
                    Begin(tick) => sent.begin(at(ms), tick),
                    SkipTo(tick) => sent.skip_to(&all, tick),
                    Send(tick) => sent.record(&all, at(ms), at(ms), tick),
                    End(tick) => sent.end(&all, at(ms), tick),
                }
                let now = (all.skipped(), all.longest_gap_us.load(Relaxed));
                assert!(
                    now.0 >= before.0 && now.1 >= before.1,
                    "{what}: {now:?} after {before:?}"
                );
                before = now;
            }
            let gap_us = sent.longest_gap_us.load(Relaxed);
            assert_eq!(
                (sent.skipped(), gap_us as f64 / 1000.0),
                (skipped, gap_ms),
                "{what}"
            );
            assert_eq!(
                (all.skipped(), all.longest_gap_us.load(Relaxed)),
                (skipped, gap_us),
                "{what}"
            );
        }
    }
}
