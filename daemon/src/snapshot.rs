//! What the daemon knows of itself, copied out of the tick thread for the status report.

use hdrhistogram::Histogram;
use taxel_can::{LinkState, SourceCounters};
use taxel_skin::{BoardCounters, BusCounters, Faults};

/// The state of the whole way from the buses to the displays at one instant.
///
/// The tick thread writes into it without allocating and only while nobody reads it; a status report that takes its
/// time makes one update wait for the next tick, never the tick itself.
#[derive(Debug, Clone)]
pub(crate) struct Snapshot {
    /// Number of images made.
    pub(crate) images: u64,
    /// Timer ticks given up because the daemon was held up.
    pub(crate) overruns: u64,
    /// Images that could not be handed over to subscribers.
    pub(crate) unpublished: u64,
    /// The pipeline's clock at the snapshot, nanoseconds.
    pub(crate) now_ns: u64,
    /// Time from an image's newest reading to its hand-over to subscribers, nanoseconds.
    pub(crate) latency_ns: Histogram<u64>,
    /// Time from when an image was due to its hand-over to subscribers, nanoseconds.
    pub(crate) lateness_ns: Histogram<u64>,
    /// One entry per bus.
    pub(crate) buses: Vec<BusSnapshot>,
    /// Counters of each module's board, in the layout's order.
    pub(crate) boards: Vec<BoardCounters>,
    /// Faults of each taxel.
    pub(crate) faults: Vec<Faults>,
    /// Contact threshold, in the unit of the force.
    pub(crate) threshold: f64,
    /// Whether the baseline is being measured.
    pub(crate) calibrating: bool,
    /// Taxels in contact.
    pub(crate) contacts: u16,
    /// Taxels without a usable value.
    pub(crate) missing: u16,
    /// Taxels out of use for another reason.
    pub(crate) faulty: u16,
    /// Whether images are paused.
    pub(crate) paused: bool,
}

/// What one bus has delivered.
#[derive(Debug, Clone, Default)]
pub(crate) struct BusSnapshot {
    /// What its source has seen.
    pub(crate) source: SourceCounters,
    /// Whether it can be reached.
    pub(crate) link: LinkState,
    /// What its decoder made of the frames.
    pub(crate) decoder: BusCounters,
}

impl Snapshot {
    /// An empty snapshot with all its memory.
    pub(crate) fn new(buses: usize, boards: usize, taxels: usize) -> Self {
        // Up to 10 s at two significant digits; longer times count as 10 s.
        let histogram = || Histogram::new_with_bounds(1, 10_000_000_000, 2).expect("bounds of a histogram");
        Self {
            images: 0,
            overruns: 0,
            unpublished: 0,
            now_ns: 0,
            latency_ns: histogram(),
            lateness_ns: histogram(),
            buses: vec![BusSnapshot::default(); buses],
            boards: vec![BoardCounters::default(); boards],
            faults: vec![Faults::NONE; taxels],
            threshold: 0.0,
            calibrating: true,
            contacts: 0,
            missing: 0,
            faulty: 0,
            paused: false,
        }
    }
}
