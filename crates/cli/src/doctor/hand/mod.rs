//! The hand: which boards speak, what they are, how fast, and which of their taxels can be used.

mod boards;
mod strangers;
mod taxels;

pub(super) use boards::firmware_text;

use super::capacity;
use super::finding::Check;
use super::picture;
use std::collections::BTreeMap;
use taxel_can::{CanFrame, LinkState, SourceCounters};
use taxel_diagnose::{BusView, Kind, Place, Problem, Starting, board_name};
use taxel_hand::{Faults, plural, shell_word};
use taxel_skin::{BoardStatus, BoardsConfig, DiscoveryReport, Finding, Layout};

const AREA: &str = "hand";
/// A bus that is busier than this has no room for a lost arbitration.
const BUSY_PERCENT: f64 = 90.0;

/// What was heard on one bus.
#[derive(Debug, Default, Clone)]
pub(super) struct BusFacts {
    /// Its name in the layout.
    pub(super) name: String,
    /// Its source.
    pub(super) source: String,
    pub(super) link: LinkState,
    /// Bits per second, where known or told by convention.
    pub(super) bitrate: u64,
    /// Frames heard, and fewest and most bits of them.
    pub(super) frames: u64,
    pub(super) bits: [u64; 2],
    pub(super) counters: SourceCounters,
    /// Commands to boards that the doctor has not sent.
    pub(super) obeyed: u64,
    /// Frames that are nothing of this hand's, by id (extended ones with [`taxel_can::EXTENDED_FLAG`]).
    pub(super) unclaimed: BTreeMap<u32, Unclaimed>,
    /// Id of a frame of somebody who spoke before anything was sent.
    pub(super) overheard: Option<u32>,
    /// Whether the doctor has sent anything there.
    pub(super) spoken_to: bool,
    /// Whether the configuration leaves the boards to another program.
    pub(super) is_passive: bool,
}

impl BusFacts {
    /// Whether it is the socket of a pressure array, which has no boards to be recognised and no bit rate.
    fn is_array(&self) -> bool {
        self.source.starts_with("pressure:")
    }

    /// The command that tells which boards are on the bus. Those that the doctor has started are silent again by then.
    fn scan(&self) -> String {
        let start = if self.spoken_to { " --start" } else { "" };
        format!("taxel doctor --scan{start} {}", shell_word(&self.source))
    }

    /// The bus as the judges of problems are told of it.
    pub(super) fn view(&self) -> BusView {
        BusView {
            counters: self.counters,
            link: self.link,
            unknown: self.unclaimed.values().map(|of_id| of_id.count).sum(),
            obeyed: self.obeyed,
            starting: match (self.spoken_to, self.is_passive) {
                (true, _) => Starting::Repeated,
                (false, true) => Starting::ByOthers,
                (false, false) => Starting::NotAllowed,
            },
        }
    }
}

/// A problem that there was while the hand was listened to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NotedProblem {
    /// In its last figures.
    pub(super) problem: Problem,
    /// Whether it was over when the listening ended.
    pub(super) is_over: bool,
}

/// Frames of one id that belongs to nobody.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unclaimed {
    pub(super) count: u64,
    pub(super) last: CanFrame,
}

/// What was heard of the hand.
#[derive(Debug, Default, Clone)]
pub(super) struct HandFacts {
    /// How long it was listened to, on the clock of the buses.
    pub(super) seconds: f64,
    pub(super) buses: Vec<BusFacts>,
    /// By module.
    pub(super) boards: Vec<BoardStatus>,
    /// By taxel: how many readings it had, all of them.
    pub(super) readings: Vec<u32>,
    pub(super) discovery: Option<DiscoveryReport>,
    /// What the traffic showed at any time.
    pub(super) findings: Vec<Finding>,
    /// What was wrong at any time.
    pub(super) problems: Vec<NotedProblem>,
    /// By taxel; empty where no baseline could be measured.
    pub(super) faults: Vec<Faults>,
    /// By taxel: every axis reads 0 or 65535 most of the time, so that its chip does not answer.
    pub(super) dead: Vec<bool>,
    /// By taxel: at the end of its range most of the time.
    pub(super) saturated: Vec<bool>,
    /// Taxels that moved while the baseline was measured.
    pub(super) touched: u32,
}

impl HandFacts {
    /// The problems of one bus and of its boards.
    fn problems_of(&self, layout: &Layout, bus: u8) -> impl Iterator<Item = &NotedProblem> {
        let of_bus = move |noted: &&NotedProblem| noted.problem.bus(layout) == Some(bus.into());
        self.problems.iter().filter(of_bus)
    }

    /// Whether a bus itself has a problem of one of these kinds.
    fn has(&self, bus: u8, kinds: &[Kind]) -> bool {
        let mut problems = self.problems.iter().map(|noted| &noted.problem);
        problems.any(|p| kinds.contains(&p.kind) && p.is_of(Place::Bus(bus.into())))
    }

    /// Whether it is told that a board that is not of the layout speaks on this bus under this address.
    fn is_told_stranger(&self, bus: u8, address: u32) -> bool {
        self.findings.iter().any(|finding| match *finding {
            Finding::NotInLayout {
                bus: b, address: a, ..
            } => (b, a) == (bus, address),
            _ => false,
        })
    }

    /// Whether the board of a module has a problem.
    fn has_of_board(&self, module: usize) -> bool {
        let mut problems = self.problems.iter();
        problems.any(|noted| noted.problem.is_of(Place::Module(module)))
    }
}

/// What is to be said of the hand, bus by bus: its problems, and what only who listens knows.
pub(super) fn check(layout: &Layout, config: &BoardsConfig, facts: &HandFacts) -> Vec<Check> {
    let mut checks = Vec::new();
    for (index, bus) in facts.buses.iter().enumerate() {
        let index = index as u8;
        checks.extend(capacity::check(layout, index, config, bus.bitrate, &bus.name));
        let problems = facts.problems_of(layout, index);
        checks.extend(problems.map(|noted| boards::of_problem(layout, bus, facts, noted)));
        if bus.link != LinkState::Up {
            continue;
        }
        if let Some(id) = bus.overheard {
            let found = format!("somebody speaks here already (id {id:X}): nothing was sent");
            checks.push(Check::skipped(AREA, "start", &bus.name, found));
        }
        checks.extend(check_traffic(index, bus, facts));
        checks.extend(boards::check(layout, index, facts));
        checks.extend(boards::check_discovery(layout, index, facts));
        checks.extend(strangers::check(layout, index, facts));
    }
    checks.extend(taxels::check(layout, facts));
    checks
}

/// The letter of each taxel that is not healthy, for the drawing.
pub(super) fn marks(facts: &HandFacts) -> Vec<Option<char>> {
    let is = |set: &[bool], taxel: usize| set.get(taxel).copied().unwrap_or(false);
    facts
        .faults
        .iter()
        .enumerate()
        .map(|(taxel, faults)| match is(&facts.dead, taxel) {
            true => Some(picture::DEAD),
            false => {
                picture::letter(*faults).or_else(|| is(&facts.saturated, taxel).then_some(picture::SATURATED))
            }
        })
        .collect()
}

fn check_traffic(index: u8, bus: &BusFacts, facts: &HandFacts) -> Vec<Check> {
    let mut checks = vec![check_load(bus, facts.seconds)];
    checks.extend(check_errors(index, bus, facts));
    if bus.counters.lost_in_kernel > 0 && !facts.has(index, &[Kind::FramesLost]) {
        let found = format!(
            "{} lost in the kernel",
            plural(bus.counters.lost_in_kernel, "frame")
        );
        checks.push(
            Check::warning(AREA, "lost frames", &bus.name, found)
                .wanted("none")
                .advise("net.core.rmem_max (see machine), or a machine that is too busy"),
        );
    }
    checks
}

fn check_load(bus: &BusFacts, seconds: f64) -> Check {
    let seconds = seconds.max(1e-3);
    let [low, high] = bus
        .bits
        .map(|bits| 100.0 * bits as f64 / seconds / bus.bitrate as f64);
    let found = format!(
        "{:.0} frames/s, {low:.0} to {high:.0} % of {} Mbit/s",
        bus.frames as f64 / seconds,
        bus.bitrate as f64 / 1e6
    );
    if bus.frames == 0 {
        // That its boards are silent was told above.
        let found = format!("nothing is heard on {}", bus.source);
        let check = Check::skipped(AREA, "traffic", &bus.name, found);
        match bus.is_array() {
            true => check,
            false => check.advise(
                "are the boards powered, on this bus and at its bit rate? Is another interface meant?",
            ),
        }
    } else if high > BUSY_PERCENT {
        Check::warning(AREA, "traffic", &bus.name, found)
            .wanted(format!("up to {BUSY_PERCENT:.0} %"))
            .advise("fewer boards on this bus, or a lower rate: [boards] mode = \"triggered\"")
    } else {
        Check::ok(AREA, "traffic", &bus.name, found)
    }
}

fn check_errors(index: u8, bus: &BusFacts, facts: &HandFacts) -> Option<Check> {
    let errors = &bus.counters.errors;
    let told_as = [
        Kind::BusOff,
        Kind::Flapping,
        Kind::ErrorWarning,
        Kind::ErrorPassive,
        Kind::BusErrors,
        Kind::NoAcknowledge,
        Kind::ControllerOverflow,
    ];
    if errors.frames == 0 || facts.has(index, &told_as) {
        return None;
    }
    let causes: Vec<String> = [
        ("bus-off", errors.bus_off),
        ("protocol violations", errors.protocol),
        ("not acknowledged", errors.no_acknowledge),
        ("bus errors", errors.bus_error),
        ("controller queue overflows", errors.controller_overflow),
        ("controller", errors.controller),
        ("transceiver", errors.transceiver),
        ("lost arbitration", errors.lost_arbitration),
        ("transmit timeouts", errors.tx_timeout),
    ]
    .into_iter()
    .filter(|(_, n)| *n > 0)
    .map(|(what, n)| format!("{what} {n}"))
    .collect();
    let found = format!(
        "{} error frames ({}), now {}",
        errors.frames,
        causes.join(", "),
        bus.counters.bus_state
    );
    if errors.frames == errors.lost_arbitration {
        return Some(Check::ok(AREA, "error frames", &bus.name, found));
    }
    let check = match errors.bus_off {
        0 => Check::warning(AREA, "error frames", &bus.name, found),
        _ => Check::error(AREA, "error frames", &bus.name, found),
    };
    Some(
        check
            .wanted("none")
            .advise("wiring, termination, ground, or a node at another bit rate"),
    )
}

#[cfg(test)]
mod tests;
