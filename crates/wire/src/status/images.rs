//! What became of the images, and how long it took.

use super::report::report;
use serde::{Deserialize, Serialize};

report! {
    /// When images are made.
    TickStatus {
        /// `timer` or `sweep`.
        mode: String,
        /// Images per second in timer mode.
        rate_hz: f64,
    }

    /// What became of the images.
    ImagesStatus {
        /// Images made.
        made: u64,
        /// Images per second over the last second or so.
        rate_hz: f64,
        /// Ticks given up because the daemon was held up.
        overruns: u64,
        /// Images that could not be handed over.
        unpublished: u64,
        /// From a tick's newest reading until its images were handed over to the thread that sends
        /// them, microseconds.
        latency_us: QuantileStatus,
        /// The same as a histogram, of which differences can be taken: rows of microseconds and the ticks that took
        /// up to that and more than the row before.
        latencies: Vec<(u64, u64)>,
        /// What all of them add up to, microseconds.
        latency_sum_us: u64,
        /// From when a tick was due until its images were handed over to the thread that sends
        /// them, microseconds.
        lateness_us: QuantileStatus,
        /// The same as a histogram, as `latencies`.
        latenesses: Vec<(u64, u64)>,
        /// What all of them add up to, microseconds.
        lateness_sum_us: u64,
        /// The jitter of the tick: the part of its lateness until the tick thread began with it, microseconds.
        jitter_us: QuantileStatus,
        /// The same as a histogram, as `latencies`.
        jitters: Vec<(u64, u64)>,
        /// What all of them add up to, microseconds.
        jitter_sum_us: u64,
        /// The part of a tick's lateness from then on, which is what its images take, microseconds.
        duration_us: QuantileStatus,
        /// The same as a histogram, as `latencies`.
        durations: Vec<(u64, u64)>,
        /// What all of them add up to, microseconds.
        duration_sum_us: u64,
        /// What became of them after that, for all subscribers together.
        sent: SentStatus,
        /// How long it took in the last half to whole minute.
        recent: RecentStatus,
    }

    /// The times of the last half to whole minute; those above are since the start.
    RecentStatus {
        /// As `images.lateness_us`, microseconds.
        lateness_us: QuantileStatus,
        /// As `images.sent.age_us`, microseconds; zeros where nobody was sent any.
        age_us: QuantileStatus,
    }

    /// Images that all subscribers were sent since the start, those that are gone included.
    SentStatus {
        /// How many are connected now.
        subscribers: usize,
        /// Images they were sent.
        images: u64,
        /// Images that were made while one of them asked for images, and that it was not sent, nor will be, since it was too
        /// slow for them.
        skipped: u64,
        /// The same of images that came too soon for the `max_rate_hz` that it asked for.
        paced: u64,
        /// From when an image was due until it was sent, microseconds.
        age_us: QuantileStatus,
        /// The same as a histogram, of which differences can be taken: rows of an age in microseconds
        /// and the images up to that age and above that of the row before.
        ages: Vec<(u64, u64)>,
        /// What all of them add up to, microseconds.
        age_sum_us: u64,
        /// The longest that one of them was without an image between two, milliseconds; those that go on included.
        longest_gap_ms: f64,
    }

    /// How long something takes.
    QuantileStatus {
        /// Median.
        p50: f64,
        /// 99 of 100 take less.
        p99: f64,
        /// 999 of 1000 take less.
        p999: f64,
        /// The longest.
        max: f64,
    }
}
