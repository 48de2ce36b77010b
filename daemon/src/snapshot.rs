//! What the daemon knows of itself, copied out of the tick thread for the status report.

use hdrhistogram::Histogram;
use taxel_can::{LinkState, SourceCounters};
use taxel_engine::Frames;
use taxel_hand::{Fault, ForceFrame};
use taxel_joints::JointsSnapshot;
use taxel_skin::{BoardStatus, BusCounters, BusLoad, ConditionCounters, Finding, Movement};

/// Findings that are reported at once.
const MOST_FINDINGS: usize = 64;

/// The state of the whole way from the buses to the displays at one instant.
///
/// The tick thread writes into it without allocating and only while nobody reads it; a status
/// report that takes its time makes one update wait for the next tick, never the tick itself.
#[derive(Debug, Clone)]
pub(crate) struct Snapshot {
    /// Whether the tick thread has written into it.
    pub(crate) written: bool,
    /// Number of images made.
    pub(crate) images: u64,
    /// Timer ticks given up because the daemon was held up.
    pub(crate) overruns: u64,
    /// Images that could not be handed over to subscribers.
    pub(crate) unpublished: u64,
    /// The pipeline's clock at the snapshot, nanoseconds.
    pub(crate) now_ns: u64,
    /// Time from a tick's newest reading until all its images were handed over to subscribers, nanoseconds.
    pub(crate) latency_ns: Times,
    /// Time from when a tick was due until all its images were handed over to subscribers, nanoseconds.
    pub(crate) lateness_ns: Times,
    /// The part of it until the tick thread began with the tick, nanoseconds.
    pub(crate) jitter_ns: Times,
    /// The part of it from then on, nanoseconds.
    pub(crate) duration_ns: Times,
    /// One entry per bus.
    pub(crate) buses: Vec<BusSnapshot>,
    /// Counters of each module's board, in the layout's order.
    pub(crate) boards: Vec<BoardStatus>,
    /// What the traffic shows to be wrong.
    pub(crate) findings: Vec<Finding>,
    /// What the hand felt.
    pub(crate) force: ForceFrame,
    /// Whether each taxel is in contact without a change for long.
    pub(crate) unchanging: Vec<bool>,
    /// Taxels in contact.
    pub(crate) contacts: usize,
    /// Taxels without a usable value.
    pub(crate) missing: usize,
    /// Taxels out of use for another reason.
    pub(crate) faulty: usize,
    /// What conditioning made of their counts.
    pub(crate) conditioning: ConditionCounters,
    /// Calibrations that had ended before what was felt; its threshold is that of the last of them.
    pub(crate) calibrations: u64,
    /// What moved in the last of them.
    pub(crate) moved: Movement,
    /// Whether images are paused.
    pub(crate) paused: bool,
    /// Joint angles, and what each joint has delivered.
    pub(crate) joints: JointsSnapshot,
    /// What the bus that joint angles come over has seen.
    pub(crate) joints_source: SourceCounters,
    /// Whether that bus can be reached.
    pub(crate) joints_link: LinkState,
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
    /// How much it carries.
    pub(crate) load: BusLoad,
}

/// How long something took, each time.
#[derive(Debug, Clone)]
pub(crate) struct Times {
    histogram: Histogram<u64>,
    sum_ns: u64,
}

impl Times {
    fn new() -> Self {
        Self {
            histogram: Histogram::new_with_bounds(1, 10_000_000_000, 2).expect("bounds of a histogram"),
            sum_ns: 0,
        }
    }

    /// Counts one, without allocating.
    fn record(&mut self, ns: u64) {
        self.histogram.saturating_record(ns.max(1));
        self.sum_ns = self.sum_ns.saturating_add(ns);
    }

    /// All of them, nanoseconds.
    pub(crate) fn histogram(&self) -> &Histogram<u64> {
        &self.histogram
    }

    /// What all of them add up to, microseconds.
    pub(crate) fn sum_us(&self) -> u64 {
        self.sum_ns / 1000
    }
}

impl Snapshot {
    /// An empty snapshot with all its memory.
    pub(crate) fn new(buses: usize, boards: usize, taxels: usize, joints: usize) -> Self {
        // Up to 10 s at two significant digits; longer times count as 10 s.
        Self {
            written: false,
            images: 0,
            overruns: 0,
            unpublished: 0,
            now_ns: 0,
            latency_ns: Times::new(),
            lateness_ns: Times::new(),
            jitter_ns: Times::new(),
            duration_ns: Times::new(),
            buses: vec![BusSnapshot::default(); buses],
            boards: vec![BoardStatus::default(); boards],
            findings: Vec::with_capacity(MOST_FINDINGS),
            force: ForceFrame {
                calibrating: true,
                ..ForceFrame::new(taxels)
            },
            unchanging: vec![false; taxels],
            contacts: 0,
            missing: 0,
            faulty: 0,
            conditioning: ConditionCounters::default(),
            calibrations: 0,
            moved: Movement::None,
            paused: false,
            joints: JointsSnapshot::new(joints),
            joints_source: SourceCounters::default(),
            joints_link: LinkState::default(),
        }
    }

    /// Counts the times of a tick whose newest reading, due time, begin and end these are, without allocating.
    pub(crate) fn record_times(&mut self, newest_ns: u64, due_ns: u64, begun_ns: u64, done_ns: u64) {
        // What came after the thread had begun its round was due later than that.
        let begun_ns = begun_ns.max(due_ns);
        for (times, from_ns, to_ns) in [
            (&mut self.latency_ns, newest_ns, done_ns),
            (&mut self.lateness_ns, due_ns, done_ns),
            (&mut self.jitter_ns, due_ns, begun_ns),
            (&mut self.duration_ns, begun_ns, done_ns),
        ] {
            times.record(to_ns.saturating_sub(from_ns));
        }
    }

    /// Copies what the traffic shows, without allocating.
    pub(crate) fn take_findings(&mut self, findings: &[Finding]) {
        self.findings.clear();
        self.findings.extend(findings.iter().take(MOST_FINDINGS));
    }

    /// Copies what the hand felt, and counts it.
    pub(crate) fn take_felt(&mut self, felt: &Frames) {
        (self.calibrations, self.moved) = (felt.calibrations, felt.moved);
        let (felt, force) = (&felt.force, &mut self.force);
        force.seq = felt.seq;
        force.t_ns = felt.t_ns;
        force.threshold = felt.threshold;
        force.calibrating = felt.calibrating;
        force.force.clone_from(&felt.force);
        force.contact.clone_from(&felt.contact);
        force.faults.clone_from(&felt.faults);
        force.repaired.clone_from(&felt.repaired);
        force.saturated.clone_from(&felt.saturated);
        let missing = felt.faults.iter().filter(|f| f.contains(Fault::Missing)).count();
        let faults = felt.faults.iter().filter(|f| !f.is_empty()).count();
        self.contacts = felt.contact.iter().filter(|contact| **contact).count();
        self.missing = missing;
        self.faulty = faults - missing;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lateness_of_a_tick_is_its_jitter_and_what_it_took() {
        let mut snapshot = Snapshot::new(1, 1, 1, 0);
        // It began in time, late, and, as its sweep ended behind the begin of the round, before it was due.
        for (due_ns, begun_ns, done_ns) in [
            (1_000_000, 1_000_000, 1_100_000),
            (2_000_000, 2_500_000, 2_600_000),
            (3_000_000, 2_900_000, 3_100_000),
        ] {
            snapshot.record_times(due_ns - 400_000, due_ns, begun_ns, done_ns);
        }
        let all = |times: &Times| -> Vec<u64> {
            times
                .histogram()
                .iter_recorded()
                .flat_map(|row| {
                    // Two digits of it are kept.
                    let us = (row.value_iterated_to() as f64 / 10_000.0).round() as u64 * 10;
                    vec![us; row.count_since_last_iteration() as usize]
                })
                .collect()
        };
        assert_eq!(all(&snapshot.latency_ns), [500, 500, 1000]);
        assert_eq!(all(&snapshot.lateness_ns), [100, 100, 600]);
        assert_eq!(all(&snapshot.jitter_ns), [0, 0, 500]);
        assert_eq!(all(&snapshot.duration_ns), [100, 100, 100]);
        let sums = [
            &snapshot.latency_ns,
            &snapshot.lateness_ns,
            &snapshot.jitter_ns,
            &snapshot.duration_ns,
        ];
        assert_eq!(sums.map(Times::sum_us), [2000, 800, 500, 300]);
    }
}
