//! The status report, from what the control thread knows.

use crate::snapshot::{BusSnapshot, Snapshot};
use crate::state::State;
use hdrhistogram::Histogram;
use taxel_can::{ArrayCounters, SourceAddress};
use taxel_diagnose::{CurrentProblem, Kind, Place, Problems, Severity};
use taxel_hand::Fault;
use taxel_joints::JointsConfig;
use taxel_skin::{ConditionCounters, Layout};
use taxel_wire::status::{
    ArrayStatus, BoardStatus, BusStatus, ConditioningStatus, ControlStatus, ErrorCounterStatus,
    ErrorFrameStatus, ImagesStatus, ProblemStatus, QuantileStatus, Status, TaxelStatus, TickStatus,
};

impl State {
    /// Everything there is to know: the `status` reply of `docs/wire.md`, with the subscribers of the
    /// newest roster.
    pub(crate) fn status(&self) -> Status {
        let snapshot = self.snapshot();
        let roster = self.roster();
        let layout = &self.config.layout;
        let problems = self.problems.borrow();
        let joints = (self.config.joints.as_ref().zip(self.joints(&snapshot))).and_then(|(config, view)| {
            let kinds = |joint: Option<usize>| names(&problems, joint.map_or(Place::Joints, Place::Joint));
            crate::joints::status(config, &view, self.count_joints(&view), &kinds)
        });
        let mut control = ControlStatus::default();
        self.looking.add_to(&mut control);
        self.changing.add_to(&mut control);
        Status {
            version: env!("CARGO_PKG_VERSION").into(),
            uptime_s: self.uptime_s(),
            layout: layout.name.clone(),
            tick: TickStatus {
                mode: self.tick_mode().into(),
                rate_hz: self.config.tick.rate_hz,
            },
            images: ImagesStatus {
                made: snapshot.images,
                rate_hz: self.rate_hz(snapshot.images),
                overruns: snapshot.overruns,
                unpublished: snapshot.unpublished,
                latency_us: quantiles(snapshot.latency_ns.histogram()),
                latencies: rows(snapshot.latency_ns.histogram()),
                latency_sum_us: snapshot.latency_ns.sum_us(),
                lateness_us: quantiles(snapshot.lateness_ns.histogram()),
                latenesses: rows(snapshot.lateness_ns.histogram()),
                lateness_sum_us: snapshot.lateness_ns.sum_us(),
                jitter_us: quantiles(snapshot.jitter_ns.histogram()),
                jitters: rows(snapshot.jitter_ns.histogram()),
                jitter_sum_us: snapshot.jitter_ns.sum_us(),
                duration_us: quantiles(snapshot.duration_ns.histogram()),
                durations: rows(snapshot.duration_ns.histogram()),
                duration_sum_us: snapshot.duration_ns.sum_us(),
                sent: roster.sent_status(),
                recent: self.recent.borrow().status(&snapshot, &roster),
            },
            paused: snapshot.paused,
            calibrating: snapshot.force.calibrating,
            threshold: snapshot.force.threshold,
            contacts: snapshot.contacts,
            missing: snapshot.missing,
            faulty: snapshot.faulty,
            conditioning: conditioning_status(&snapshot.conditioning),
            profile: roster.own_profile(),
            profiles: roster.profile_status(),
            profile_budget: roster.profile_budget(),
            problems: self.problem_status(&problems),
            buses: (snapshot.buses.iter().enumerate())
                .map(|(index, bus)| self.bus_status(index, bus, &snapshot, &problems))
                .collect(),
            boards: (layout.boards().zip(&snapshot.boards))
                .filter(|((_, _, wiring), _)| wiring.protocol.has_board())
                .map(|((index, module, wiring), board)| BoardStatus {
                    module: module.name.clone(),
                    bus: layout.buses[usize::from(wiring.bus)].clone(),
                    board: wiring.board,
                    problems: names(&problems, Place::Module(index.into())),
                    ..board_status(board, snapshot.now_ns)
                })
                .collect(),
            joints,
            faults: (snapshot.force.faults.iter().enumerate())
                .filter(|(_, faults)| !faults.is_empty())
                .map(|(taxel, faults)| {
                    let reasons = faults.iter().map(|fault: Fault| fault.name().into());
                    taxel_status(layout, taxel, reasons.collect())
                })
                .collect(),
            saturated: (snapshot.force.saturated.iter().enumerate())
                .filter(|(_, saturated)| **saturated)
                .map(|(taxel, _)| taxel_status(layout, taxel, vec!["saturated".into()]))
                .collect(),
            control,
            subscribers: roster.subscriber_status(),
        }
    }

    fn problem_status(&self, problems: &Problems) -> Vec<ProblemStatus> {
        let layout = &self.config.layout;
        let joints = (self.config.joints.as_ref()).map_or_else(Vec::new, JointsConfig::joint_names);
        let status = |CurrentProblem { problem, since_ns }: &CurrentProblem| {
            let modules: Vec<String> = (problem.modules.iter())
                .map(|m| layout.modules[*m].name.clone())
                .collect();
            ProblemStatus {
                kind: problem.kind.name().into(),
                bus: problem.bus(layout).map(|bus| layout.buses[bus].clone()),
                board: problem.modules.first().map(|m| layout.wiring[*m].board),
                module: modules.first().cloned(),
                modules,
                joint: match problem.place {
                    Place::Joint(joint) => joints.get(joint).cloned(),
                    _ => None,
                },
                severe: problem.severity() == Severity::Error,
                sentence: problem.sentence(),
                since_s: problems.now_ns().saturating_sub(*since_ns) as f64 / 1e9,
            }
        };
        problems.current().iter().map(status).collect()
    }

    fn bus_status(
        &self,
        index: usize,
        bus: &BusSnapshot,
        snapshot: &Snapshot,
        problems: &Problems,
    ) -> BusStatus {
        let layout = &self.config.layout;
        let boards = (layout.wiring.iter().zip(&snapshot.boards))
            .filter(|(wiring, _)| usize::from(wiring.bus) == index)
            .map(|(_, counters)| counters);
        let sum = |count: fn(&taxel_skin::BoardStatus) -> u64| boards.clone().map(count).sum::<u64>();
        let has_joints =
            (self.config.joints_bus()).is_some_and(|b| b.shared && usize::from(b.index) == index);
        let source = &bus.source;
        let [tx, rx] = source.error_counters;
        let is_array = matches!(self.config.sources[index], SourceAddress::Pressure { .. });
        let array = is_array.then(|| array_status(&source.array));
        BusStatus {
            name: layout.buses[index].clone(),
            source: self.config.sources[index].to_string(),
            link: bus.link.to_string(),
            state: source.bus_state.to_string(),
            state_changes: source.state_changes,
            error_counters: ErrorCounterStatus { tx, rx },
            frames_hz: bus.load.frames_hz,
            load_percent: if array.is_some() {
                0.0
            } else {
                100.0 * bus.load.share
            },
            load_percent_most: if array.is_some() {
                0.0
            } else {
                100.0 * bus.load.share_most
            },
            array,
            problems: names(problems, Place::Bus(index)),
            received: source.received,
            readings: bus.decoder.readings,
            used: sum(|b| b.used),
            unknown: bus.decoder.unknown,
            not_data: bus.decoder.not_data,
            commands: bus.decoder.commands,
            joints: if has_joints { snapshot.joints.frames } else { 0 },
            partial: bus.decoder.partial,
            abandoned: bus.decoder.abandoned,
            malformed: sum(|b| b.malformed),
            queue_overflows: sum(|b| b.queue_overflows),
            duplicate: sum(|b| b.duplicate),
            late: sum(|b| b.late),
            settling: sum(|b| b.settling),
            lost_in_kernel: source.lost_in_kernel,
            undecodable: source.undecodable,
            can_fd: source.can_fd,
            reopens: source.reopens,
            link_losses: source.link_losses,
            sent: source.sent,
            send_failures: source.send_failures,
            clock_jumps: source.jumps.count(),
            remote: source.remote,
            errors: error_frames(&source.errors),
        }
    }
}

fn taxel_status(layout: &Layout, taxel: usize, reasons: Vec<String>) -> TaxelStatus {
    TaxelStatus {
        taxel,
        module: layout.module_of(taxel).name.clone(),
        k: layout.k[taxel],
        reasons,
    }
}

/// The names of the kinds of problems of one bus, board or joint.
fn names(problems: &Problems, place: Place) -> Vec<String> {
    let kinds = problems.kinds(place).into_iter();
    kinds.map(|kind: Kind| kind.name().into()).collect()
}

fn board_status(board: &taxel_skin::BoardStatus, now_ns: u64) -> BoardStatus {
    BoardStatus {
        state: board.state.name().into(),
        used: board.used,
        malformed: board.malformed,
        queue_overflows: board.queue_overflows,
        duplicate: board.duplicate,
        late: board.late,
        missed: board.missed,
        settling: board.settling,
        sweeps: board.sweeps,
        status_errors: board.status_errors,
        silences: board.silences,
        restarts: board.restarts,
        recalibrations: board.recalibrations,
        period_ms: board.period_ns.map(|period| period as f64 / 1e6),
        silent_ms: board.last_ns.map(|last| now_ns.saturating_sub(last) / 1_000_000),
        ..BoardStatus::default()
    }
}

fn conditioning_status(counters: &ConditionCounters) -> ConditioningStatus {
    ConditioningStatus {
        samples: counters.samples,
        held: counters.held,
        glitches: counters.glitches,
        wraps: counters.wraps,
        ambiguous_steps: counters.long_ways,
        corrected_turns: counters.recoveries,
        runaways: counters.runaways,
        dead: counters.dead_samples,
        status_errors: counters.status_errors,
        drift_limited: counters.drift_limited,
    }
}

fn array_status(array: &ArrayCounters) -> ArrayStatus {
    ArrayStatus {
        taken: array.taken,
        lost: array.lost,
        late: array.late,
        restarts: array.restarts,
        foreign: array.foreign,
        version: array.version,
        size: array.size,
        torn: array.torn,
    }
}

fn error_frames(errors: &taxel_can::ErrorCauses) -> ErrorFrameStatus {
    ErrorFrameStatus {
        frames: errors.frames,
        tx_timeout: errors.tx_timeout,
        lost_arbitration: errors.lost_arbitration,
        controller: errors.controller,
        controller_overflow: errors.controller_overflow,
        protocol: errors.protocol,
        transceiver: errors.transceiver,
        no_acknowledge: errors.no_acknowledge,
        bus_off: errors.bus_off,
        bus_error: errors.bus_error,
        restarted: errors.restarted,
    }
}

/// The times of a histogram of nanoseconds as rows of 1, 2, 5, 10 .. microseconds, as far as there are any.
fn rows(histogram: &Histogram<u64>) -> Vec<(u64, u64)> {
    let mut steps = (0..).flat_map(|power| [1, 2, 5].map(|digit| digit * 10_u64.pow(power)));
    let mut rows: Vec<(u64, u64)> = Vec::new();
    for recorded in histogram.iter_recorded() {
        let (us, count) = (
            recorded.value_iterated_to() / 1000,
            recorded.count_since_last_iteration(),
        );
        match rows.last_mut() {
            Some((most_us, all)) if us <= *most_us => *all += count,
            _ => rows.extend(steps.find(|step| us <= *step).map(|step| (step, count))),
        }
    }
    rows
}

fn quantiles(histogram: &Histogram<u64>) -> QuantileStatus {
    let us = |ns: u64| ns as f64 / 1000.0;
    QuantileStatus {
        p50: us(histogram.value_at_quantile(0.5)),
        p99: us(histogram.value_at_quantile(0.99)),
        p999: us(histogram.value_at_quantile(0.999)),
        max: us(histogram.max()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_time_is_in_the_row_of_the_next_step() {
        let mut histogram = Histogram::new_with_bounds(1, 10_000_000_000, 2).unwrap();
        assert_eq!(rows(&histogram), []);
        for us in [0, 1, 3, 4, 90, 130, 150, 8_000_000] {
            histogram.saturating_record(us * 1000);
        }
        assert_eq!(
            rows(&histogram),
            [(1, 2), (5, 2), (100, 1), (200, 2), (10_000_000, 1)]
        );
    }
}
