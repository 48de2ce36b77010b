//! The hand: which boards speak, what they are, how fast, and which of their taxels can be used.

mod boards;
mod findings;
mod strangers;
mod taxels;

use super::capacity;
use super::finding::Check;
use super::picture;
use std::collections::BTreeMap;
use taxel_can::{CanFrame, LinkState, SourceCounters};
use taxel_hand::Faults;
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
    /// Frames that are nothing of this hand's, by id (extended ones with [`taxel_can::EXTENDED_FLAG`]).
    pub(super) unclaimed: BTreeMap<u32, Unclaimed>,
    /// Id of a frame of somebody who spoke before anything was sent.
    pub(super) overheard: Option<u32>,
    /// Whether the doctor has sent anything there.
    pub(super) spoken_to: bool,
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
    pub(super) discovery: Option<DiscoveryReport>,
    /// What the traffic showed at any time.
    pub(super) findings: Vec<Finding>,
    /// By taxel; empty where no baseline could be measured.
    pub(super) faults: Vec<Faults>,
    /// By taxel: every axis reads 0 or 65535 most of the time, so that its chip does not answer.
    pub(super) dead: Vec<bool>,
    /// By taxel: at the end of its range most of the time.
    pub(super) saturated: Vec<bool>,
    /// Taxels that moved while the baseline was measured.
    pub(super) touched: u32,
}

/// What is to be said of the hand, bus by bus.
pub(super) fn check(layout: &Layout, config: &BoardsConfig, facts: &HandFacts) -> Vec<Check> {
    let mut checks = Vec::new();
    for (index, bus) in facts.buses.iter().enumerate() {
        let index = index as u8;
        checks.extend(capacity::check(layout, index, config, bus.bitrate, &bus.name));
        if bus.link != LinkState::Up {
            let found = format!("{} is {}: nothing to listen to", bus.source, bus.link);
            checks.push(Check::error(AREA, "traffic", &bus.name, found).wanted("up"));
            continue;
        }
        if let Some(id) = bus.overheard {
            let found = format!("somebody speaks here already (id {id:X}): nothing was sent");
            checks.push(Check::skipped(AREA, "start", &bus.name, found));
        }
        checks.extend(check_traffic(bus, facts.seconds));
        checks.extend(boards::check(layout, index, config, facts));
        checks.extend(boards::check_discovery(layout, index, facts));
        checks.extend(strangers::check(layout, index, facts));
    }
    checks.extend(findings::check(layout, facts));
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

fn check_traffic(bus: &BusFacts, seconds: f64) -> Vec<Check> {
    let mut checks = Vec::new();
    let seconds = seconds.max(1e-3);
    let [low, high] = bus
        .bits
        .map(|bits| 100.0 * bits as f64 / seconds / bus.bitrate as f64);
    let found = format!(
        "{:.0} frames/s, {low:.0} to {high:.0} % of {} Mbit/s",
        bus.frames as f64 / seconds,
        bus.bitrate as f64 / 1e6
    );
    checks.push(if bus.frames == 0 {
        Check::error(
            AREA,
            "traffic",
            &bus.name,
            format!("nothing is heard on {}", bus.source),
        )
        .advise("are the boards powered, on this bus and at its bit rate? Is another interface meant?")
    } else if high > BUSY_PERCENT {
        Check::warning(AREA, "traffic", &bus.name, found)
            .wanted(format!("up to {BUSY_PERCENT:.0} %"))
            .advise("fewer boards on this bus, or a lower rate: [boards] mode = \"triggered\"")
    } else {
        Check::ok(AREA, "traffic", &bus.name, found)
    });
    let errors = &bus.counters.errors;
    if errors.frames > 0 {
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
        let harmless = errors.frames == errors.lost_arbitration;
        checks.push(match (harmless, errors.bus_off) {
            (true, _) => Check::ok(AREA, "error frames", &bus.name, found),
            (false, 0) => Check::warning(AREA, "error frames", &bus.name, found)
                .wanted("none")
                .advise("wiring, termination, ground, or a node at another bit rate"),
            _ => Check::error(AREA, "error frames", &bus.name, found)
                .wanted("none")
                .advise("wiring, termination, ground, or a node at another bit rate"),
        });
    }
    if bus.counters.lost_in_kernel > 0 {
        let found = format!("{} frames lost in the kernel", bus.counters.lost_in_kernel);
        checks.push(
            Check::warning(AREA, "lost frames", &bus.name, found)
                .wanted("none")
                .advise("net.core.rmem_max (see machine), or a machine that is too busy"),
        );
    }
    checks
}

/// A board as people find it.
fn object(layout: &Layout, module: usize) -> String {
    let (name, wiring) = (&layout.modules[module].name, &layout.wiring[module]);
    let bus = layout
        .buses
        .get(usize::from(wiring.bus))
        .map_or("", String::as_str);
    let place = format!("{bus} board {}", wiring.board);
    match *name == place {
        true => place,
        false => format!("{name} ({place})"),
    }
}

#[cfg(test)]
mod tests;
