//! The hand: which boards speak, what they are, how fast, and which of their taxels can be used.

use super::capacity::{self, plural};
use super::finding::{Check, State};
use super::picture;
use std::collections::BTreeMap;
use taxel_can::{CanFrame, EXTENDED_FLAG, LinkState, SourceCounters};
use taxel_joints::{AllegroConfig, AllegroDecoder, AllegroFrame};
use taxel_skin::{
    BoardCounters, BoardState, BoardsConfig, BoardsMode, DiscoveryReport, Fault, Faults, FoundBoard, Layout,
    Module, Protocol,
};

const AREA: &str = "hand";
/// A bus that is busier than this has no room for a lost arbitration.
const BUSY_PERCENT: f64 = 90.0;
/// A board that leaves out more than this share of its readings is told.
const MISSED_PERCENT: f64 = 1.0;
/// A module is called broken when more than this share of its taxels is.
const BROKEN_SHARE: f64 = 0.25;

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
    /// Frames that are nothing of this hand's, by id (extended ones with [`EXTENDED_FLAG`]).
    pub(super) unclaimed: BTreeMap<u32, Unclaimed>,
    /// Id of a frame that was heard before anything was sent.
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
    pub(super) boards: Vec<BoardCounters>,
    pub(super) discovery: Option<DiscoveryReport>,
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
pub(super) fn check(layout: &Layout, boards: &BoardsConfig, facts: &HandFacts) -> Vec<Check> {
    let mut checks = Vec::new();
    for (index, bus) in facts.buses.iter().enumerate() {
        let index = index as u8;
        checks.extend(capacity::check(layout, index, boards, bus.bitrate, &bus.name));
        if bus.link != LinkState::Up {
            let found = format!("{} is {}: nothing to listen to", bus.source, bus.link);
            checks.push(Check::error(AREA, "traffic", &bus.name, found).wanted("up"));
            continue;
        }
        checks.extend(check_traffic(bus, facts.seconds));
        checks.extend(check_boards(layout, index, boards, facts));
        checks.extend(check_discovery(layout, index, facts));
        checks.extend(check_unclaimed(layout, index, bus));
    }
    checks.extend(check_taxels(layout, facts));
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
fn object(layout: &Layout, module: &Module) -> String {
    let bus = layout
        .buses
        .get(usize::from(module.bus))
        .map_or("", String::as_str);
    let place = format!("{bus} board {}", module.board);
    match module.name == place {
        true => place,
        false => format!("{} ({place})", module.name),
    }
}

fn check_boards(layout: &Layout, bus: u8, boards: &BoardsConfig, facts: &HandFacts) -> Vec<Check> {
    let mut checks = Vec::new();
    let of_bus = &facts.buses[usize::from(bus)];
    for (index, module) in layout.modules.iter().enumerate() {
        let Some(counters) = facts.boards.get(index).filter(|_| module.bus == bus) else {
            continue;
        };
        if module.protocol == Protocol::Offline {
            continue;
        }
        let object = object(layout, module);
        match counters.state {
            BoardState::Unheard if of_bus.frames == 0 => {
                checks.push(Check::error(AREA, "board", object, "not heard"));
            }
            BoardState::Unheard => {
                checks.push(unheard(object, module, boards, of_bus, found_of(facts, index)))
            }
            BoardState::Silent => checks.push(
                Check::error(AREA, "board", object, "spoke and fell silent").advise(
                    "its supply or its plug; taxeld starts it again and again, see `restarts` in its status",
                ),
            ),
            BoardState::Settling | BoardState::Living => checks.extend(check_living(object, counters)),
        }
    }
    checks
}

fn found_of(facts: &HandFacts, module: usize) -> Option<&FoundBoard> {
    let discovery = facts.discovery.as_ref()?;
    discovery.boards.iter().find(|b| b.module == Some(module as u16))
}

fn unheard(
    object: String,
    module: &Module,
    boards: &BoardsConfig,
    bus: &BusFacts,
    found: Option<&FoundBoard>,
) -> Check {
    if let Some(found) = found {
        let check = Check::error(AREA, "board", object, "answers and sends no taxels");
        return match found.in_bootloader {
            true => check.advise("it is in its bootloader: switch its power off and on, or load its firmware"),
            false => check.advise("its firmware may use another id layout than the layout file says: `taxel doctor --scan` tells"),
        };
    }
    let check = Check::error(AREA, "board", object, "not heard");
    let may_speak = bus.spoken_to || !module.protocol.takes_commands();
    if may_speak {
        return check.advise(
            "its supply, its plug, its address (`taxel doctor --scan` shows which addresses speak), or another bus",
        );
    }
    match boards.mode {
        BoardsMode::Passive => {
            check.advise("[boards] mode is \"passive\": whoever controls the boards has not started it")
        }
        _ => check.advise(
            "nothing was sent to it (--listen-only, or others speak on the bus), and it waits for a start command",
        ),
    }
}

fn check_living(object: String, counters: &BoardCounters) -> Vec<Check> {
    let mut checks = Vec::new();
    let rate = counters
        .period_ns
        .map_or("heard".into(), |ns| format!("{:.1} Hz", 1e9 / ns as f64));
    let due = (counters.used + counters.missed) as f64;
    let missed = 100.0 * counters.missed as f64 / due.max(1.0);
    checks.push(match missed > MISSED_PERCENT {
        false => Check::ok(AREA, "board", &object, rate),
        true => Check::warning(
            AREA,
            "board",
            &object,
            format!("{rate}, {missed:.1} % of its readings missing"),
        )
        .wanted(format!("up to {MISSED_PERCENT} %"))
        .advise("a bus at its limit, or frames lost on the way: see bus capacity, traffic and lost frames"),
    });
    if counters.queue_overflows > 0 {
        checks.push(
            Check::warning(
                AREA,
                "transmit queue",
                &object,
                format!("thrown away {}", times(counters.queue_overflows)),
            )
            .wanted("never")
            .advise("the bus is too busy for it: see bus capacity"),
        );
    }
    if counters.malformed > 0 {
        checks.push(
            Check::warning(
                AREA,
                "frames",
                &object,
                format!(
                    "{} with the board's ids and another length or content",
                    counters.malformed
                ),
            )
            .wanted("none")
            .advise("another node with ids of this board, or another protocol than the layout says"),
        );
    }
    checks
}

fn times(n: u64) -> String {
    if n == 1 {
        "once".into()
    } else {
        format!("{n} times")
    }
}

fn check_discovery(layout: &Layout, bus: u8, facts: &HandFacts) -> Vec<Check> {
    let Some(discovery) = &facts.discovery else {
        return Vec::new();
    };
    let name = &facts.buses[usize::from(bus)].name;
    let mut checks = Vec::new();
    if let Some(busy) = discovery.busy.iter().find(|b| b.bus == bus) {
        checks.push(Check::skipped(
            AREA,
            "firmware",
            name,
            format!("not asked for: somebody sends on the bus (id {:X})", busy.id),
        ));
        return checks;
    }
    let mismatches: Vec<(u16, Protocol)> = discovery.mismatches(layout).map(|(m, p, _)| (m, p)).collect();
    for found in discovery.boards.iter().filter(|b| b.bus == bus) {
        let what = describe(found);
        let Some(module) = found.module else {
            let object = format!("{name} board {}", found.address);
            checks.push(
                Check::warning(AREA, "unexpected board", object, format!("answers: {what}"))
                    .wanted("no board there, or a [[module]] in the layout file")
                    .run(format!(
                        "taxel doctor --scan {}",
                        facts.buses[usize::from(bus)].source
                    )),
            );
            continue;
        };
        let object = object(layout, &layout.modules[usize::from(module)]);
        if found.answers > 1 {
            checks.push(
                Check::error(
                    AREA,
                    "address",
                    &object,
                    format!("{} boards answer", found.answers),
                )
                .wanted("one board per address")
                .advise(
                    "take one of them off the bus and give it an address of its own (SET_BOARD_ADX, 0x32)",
                ),
            );
        }
        checks.push(match mismatches.iter().find(|(m, _)| *m == module) {
            Some((_, protocol)) => Check::error(AREA, "firmware", &object, what)
                .wanted(format!("a board that speaks {}", protocol.name()))
                .advise("write the protocol that it speaks into the layout file, or mount the other board"),
            None if found.in_bootloader => Check::error(AREA, "firmware", &object, what)
                .advise("switch its power off and on, or load its firmware"),
            None => Check::ok(AREA, "firmware", &object, what),
        });
    }
    checks
}

fn describe(found: &FoundBoard) -> String {
    let kind = match found.kind {
        taxel_skin::BoardKind::Mtb3 => "MTB3".into(),
        taxel_skin::BoardKind::Mtb4 => "MTB4".into(),
        taxel_skin::BoardKind::Mtb4w => "MTB4W".into(),
        taxel_skin::BoardKind::Mtb4c => "MTB4C".into(),
        taxel_skin::BoardKind::Other(number) => format!("board type {number}"),
    };
    let firmware = found.firmware;
    let build = firmware.build.map_or(String::new(), |build| format!(".{build}"));
    let part = if found.in_bootloader {
        "bootloader"
    } else {
        "firmware"
    };
    let protocol = match found.protocol_version {
        Some([major, minor]) => format!(", protocol {major}.{minor}"),
        None => String::new(),
    };
    format!(
        "{kind} {part} {}.{}{build}{protocol}",
        firmware.major, firmware.minor
    )
}

/// Frames that are nothing of this hand's: boards of the same protocol at other addresses, an Allegro hand, others.
fn check_unclaimed(layout: &Layout, bus: u8, facts: &BusFacts) -> Vec<Check> {
    let mut checks = Vec::new();
    let mut rest: Vec<(u32, Unclaimed)> = facts.unclaimed.iter().map(|(id, u)| (*id, *u)).collect();
    for version in [3, 4] {
        let Ok(mut allegro) = AllegroDecoder::new(&AllegroConfig::new(version)) else {
            continue;
        };
        let mut fingers = [0u64; 4];
        for (_, unclaimed) in &rest {
            if let AllegroFrame::Position { finger } = allegro.push(&unclaimed.last, 0) {
                fingers[finger] += unclaimed.count;
            }
        }
        if fingers.iter().all(|n| *n > 1) {
            rest.retain(|(_, u)| !matches!(allegro.push(&u.last, 0), AllegroFrame::Position { .. }));
            let version = if version == 4 { "4" } else { "1 to 3" };
            checks.push(
                Check::error(
                    AREA,
                    "Allegro hand",
                    &facts.name,
                    format!("an Allegro hand (version {version}) speaks on the bus of the skin"),
                )
                .wanted("a bus of its own: its ids and those of the boards overlap"),
            );
        }
    }
    let modules = || layout.modules.iter().filter(|m| m.bus == bus);
    for protocol in Protocol::BOARDS {
        if !modules().any(|m| m.protocol == protocol) {
            continue;
        }
        let mut boards: BTreeMap<u8, (usize, u64)> = BTreeMap::new();
        for (id, unclaimed) in &rest {
            let of = board_of(protocol, *id).filter(|_| unclaimed.last.dlc() == 8);
            if let Some(board) = of {
                let entry = boards.entry(board).or_default();
                entry.0 += 1;
                entry.1 += unclaimed.count;
            }
        }
        // One id may be anybody's; several are a board.
        boards.retain(|_, (ids, count)| *ids > 1 && *count > *ids as u64);
        rest.retain(|(id, u)| {
            u.last.dlc() != 8 || !board_of(protocol, *id).is_some_and(|board| boards.contains_key(&board))
        });
        for (board, (ids, count)) in boards {
            let known = modules().any(|m| m.board == board && m.protocol == protocol);
            let object = format!("{} board {board}", facts.name);
            checks.push(
                match known {
                    true => Check::warning(
                        AREA,
                        "unexpected ids",
                        object,
                        format!("sends {} that the layout leaves out", plural(ids, "id")),
                    ),
                    false => Check::warning(
                        AREA,
                        "unexpected board",
                        object,
                        format!(
                            "sends {count} frames of {} and is not in the layout ({})",
                            plural(ids, "id"),
                            protocol.name()
                        ),
                    ),
                }
                .run(format!("taxel doctor --scan {}", facts.source)),
            );
        }
    }
    if !rest.is_empty() {
        let ids: Vec<String> = rest.iter().take(8).map(|(id, _)| id_text(*id)).collect();
        let more = if rest.len() > ids.len() { ", ..." } else { "" };
        let frames: u64 = rest.iter().map(|(_, u)| u.count).sum();
        checks.push(
            Check::warning(
                AREA,
                "unknown ids",
                &facts.name,
                format!(
                    "{frames} frames of {}: {}{more}",
                    plural(rest.len(), "id"),
                    ids.join(", ")
                ),
            )
            .wanted("only boards of the hand on the bus"),
        );
    }
    checks
}

/// The address of the board that would send this id.
fn board_of(protocol: Protocol, id: u32) -> Option<u8> {
    let id = u16::try_from(id).ok().filter(|id| *id < 0x800)?;
    match protocol {
        Protocol::IcubMtb3 | Protocol::IcubMtb4 => (id >> 8 == 4).then_some((id >> 4 & 15) as u8),
        protocol => protocol.taxel_of(id).map(|(board, _)| board),
    }
}

fn id_text(id: u32) -> String {
    match id & EXTENDED_FLAG {
        0 => format!("{id:03X}"),
        _ => format!("{:08X}", id & !EXTENDED_FLAG),
    }
}

fn check_taxels(layout: &Layout, facts: &HandFacts) -> Vec<Check> {
    let speaks = |module: usize| {
        facts
            .boards
            .get(module)
            .is_some_and(|b| matches!(b.state, BoardState::Living | BoardState::Settling))
    };
    if !(0..layout.modules.len()).any(speaks) {
        return Vec::new();
    }
    if facts.faults.is_empty() {
        return vec![
            Check::skipped(
                AREA,
                "taxels",
                "",
                format!("no baseline in the {:.1} s that were listened to", facts.seconds),
            )
            .advise("give --seconds more"),
        ];
    }
    let mut checks = Vec::new();
    if facts.touched > 0 {
        checks.push(
            Check::warning(
                AREA,
                "touch",
                "",
                format!(
                    "{} moved while the baseline was measured",
                    plural(facts.touched as usize, "taxel")
                ),
            )
            .wanted("an untouched hand: faults of touched taxels are doubtful"),
        );
    }
    for (index, module) in layout.modules.iter().enumerate().filter(|(i, _)| speaks(*i)) {
        let first = usize::from(module.first_taxel);
        let range = first..first + usize::from(module.taxels);
        let mut words = Vec::new();
        let mut bad = 0;
        for taxel in range {
            let reasons: Vec<&str> = match facts.dead[taxel] {
                // Whatever else is wrong with it follows from that.
                true => vec!["dead"],
                false => facts.faults[taxel]
                    .iter()
                    .filter(|f| *f != Fault::Masked)
                    .map(Fault::name)
                    .chain(facts.saturated[taxel].then_some("saturated"))
                    .collect(),
            };
            if !reasons.is_empty() {
                bad += 1;
                words.push(format!("k {} {}", layout.taxels[taxel].k, reasons.join(" and ")));
            }
        }
        let object = object(layout, &layout.modules[index]);
        let broken = bad as f64 > BROKEN_SHARE * f64::from(module.taxels);
        checks.push(match (bad, broken) {
            (0, _) => Check::ok(AREA, "taxels", object, format!("{} healthy", module.taxels)),
            (_, false) => Check::warning(
                AREA,
                "taxels",
                object,
                format!("{bad} of {}: {}", module.taxels, words.join(", ")),
            ),
            _ => Check::error(
                AREA,
                "taxels",
                object,
                format!("{bad} of {}: {}", module.taxels, words.join(", ")),
            )
            .advise("the module, its I2C cable, or its supply"),
        });
    }
    // What is wrong first; the rest is then told in one.
    checks.sort_by_key(|c| c.state == State::Ok);
    checks
}

#[cfg(test)]
mod tests {
    use super::super::finding::Mend;
    use super::*;
    use taxel_skin::{BoardKind, BusTraffic, Firmware};

    fn layout() -> Layout {
        Layout::builtin("allegro-uskin-15").unwrap()
    }

    fn living() -> BoardCounters {
        BoardCounters {
            used: 1000,
            period_ns: Some(20_000_000),
            state: BoardState::Living,
            ..BoardCounters::default()
        }
    }

    fn healthy() -> HandFacts {
        let bus = |name: &str| BusFacts {
            name: name.into(),
            source: format!("can:{name}"),
            link: LinkState::Up,
            bitrate: 1_000_000,
            frames: 4000,
            bits: [4000 * 111, 4000 * 135],
            spoken_to: true,
            ..BusFacts::default()
        };
        HandFacts {
            seconds: 2.0,
            buses: vec![bus("can0"), bus("can1")],
            boards: vec![living(); 15],
            discovery: None,
            faults: vec![Faults::NONE; 240],
            dead: vec![false; 240],
            saturated: vec![false; 240],
            touched: 0,
        }
    }

    fn triggered() -> BoardsConfig {
        BoardsConfig {
            mode: BoardsMode::Triggered,
            ..BoardsConfig::default()
        }
    }

    fn found(change: impl FnOnce(&mut HandFacts)) -> Vec<Check> {
        let mut facts = healthy();
        change(&mut facts);
        check(&layout(), &triggered(), &facts)
    }

    fn board(address: u8, module: Option<u16>) -> FoundBoard {
        FoundBoard {
            bus: 0,
            address,
            kind: BoardKind::Mtb3,
            firmware: Firmware {
                major: 2,
                minor: 17,
                build: Some(0),
            },
            in_bootloader: false,
            protocol_version: Some([1, 0]),
            answers: 1,
            module,
        }
    }

    fn discovered(boards: Vec<FoundBoard>) -> Option<DiscoveryReport> {
        Some(DiscoveryReport {
            boards,
            ..DiscoveryReport::default()
        })
    }

    fn unclaimed(ids: &[u32]) -> BTreeMap<u32, Unclaimed> {
        ids.iter()
            .map(|id| {
                let last = CanFrame::standard(*id as u16, &[0; 8]).unwrap();
                (*id, Unclaimed { count: 9, last })
            })
            .collect()
    }

    #[test]
    fn a_healthy_hand_is_told_so() {
        let checks = found(|_| {});
        assert!(checks.iter().all(|c| c.state == State::Ok), "{checks:?}");
        let boards = checks
            .iter()
            .filter(|c| c.name == "board" && c.found == "50.0 Hz");
        assert_eq!(boards.count(), 15);
    }

    #[test]
    fn each_thing_that_is_wrong_is_found_where_it_is() {
        let fault = |fault: Fault, taxels: usize| {
            move |f: &mut HandFacts| f.faults[..taxels].iter_mut().for_each(|set| set.insert(fault))
        };
        let cases: [(Vec<Check>, State, &str, &str, &str); 18] = [
            (
                found(|f| f.boards[3].state = BoardState::Unheard),
                State::Error,
                "board",
                "index proximal (can0 board 3)",
                "not heard",
            ),
            (
                found(|f| f.boards[3].state = BoardState::Silent),
                State::Error,
                "board",
                "index proximal (can0 board 3)",
                "fell silent",
            ),
            (
                found(|f| f.boards[0].missed = 100),
                State::Warning,
                "board",
                "index tip (can0 board 0)",
                "9.1 % of its readings missing",
            ),
            (
                found(|f| f.boards[0].queue_overflows = 2),
                State::Warning,
                "transmit queue",
                "index tip (can0 board 0)",
                "2 times",
            ),
            (
                found(|f| f.boards[0].malformed = 3),
                State::Warning,
                "frames",
                "index tip (can0 board 0)",
                "3 with the board's ids",
            ),
            (
                found(|f| f.buses[1].link = LinkState::Down),
                State::Error,
                "traffic",
                "can1",
                "can:can1 is down",
            ),
            (
                found(|f| f.buses[1].frames = 0),
                State::Error,
                "traffic",
                "can1",
                "nothing is heard on can:can1",
            ),
            (
                found(|f| f.buses[0].bits = [1_560_000, 1_900_000]),
                State::Warning,
                "traffic",
                "can0",
                "78 to 95 %",
            ),
            (
                found(|f| {
                    (
                        f.buses[0].counters.errors.frames,
                        f.buses[0].counters.errors.protocol,
                    ) = (5, 5)
                }),
                State::Warning,
                "error frames",
                "can0",
                "5 error frames (protocol violations 5)",
            ),
            (
                found(|f| {
                    (
                        f.buses[0].counters.errors.frames,
                        f.buses[0].counters.errors.bus_off,
                    ) = (1, 1)
                }),
                State::Error,
                "error frames",
                "can0",
                "bus-off 1",
            ),
            (
                found(|f| f.buses[0].counters.lost_in_kernel = 7),
                State::Warning,
                "lost frames",
                "can0",
                "7 frames lost",
            ),
            (
                found(|f| f.touched = 4),
                State::Warning,
                "touch",
                "",
                "4 taxels moved",
            ),
            (
                found(fault(Fault::Dead, 1)),
                State::Warning,
                "taxels",
                "index tip (can0 board 0)",
                "1 of 16: k 0 dead",
            ),
            (
                found(fault(Fault::Stuck, 5)),
                State::Error,
                "taxels",
                "index tip (can0 board 0)",
                "5 of 16: k 0 stuck",
            ),
            (
                found(|f| f.saturated[2] = true),
                State::Warning,
                "taxels",
                "index tip (can0 board 0)",
                "k 2 saturated",
            ),
            (
                found(|f| f.buses[1].unclaimed = unclaimed(&[0x700, 0x701, 0x702, 0x703])),
                State::Warning,
                "unexpected board",
                "can1 board 7",
                "36 frames of 4 ids and is not in the layout (uskin-l2)",
            ),
            (
                found(|f| f.buses[0].unclaimed = unclaimed(&[0x3D3, 0x3D4, 0x3D5, 0x3D6])),
                State::Error,
                "Allegro hand",
                "can0",
                "version 1 to 3",
            ),
            (
                found(|f| f.buses[0].unclaimed = unclaimed(&[0x5C8])),
                State::Warning,
                "unknown ids",
                "can0",
                "9 frames of 1 id: 5C8",
            ),
        ];
        for (checks, state, name, object, words) in &cases {
            let check = checks
                .iter()
                .find(|c| c.name == *name && c.object == *object)
                .unwrap_or_else(|| panic!("{name} {object}: {checks:?}"));
            assert_eq!(check.state, *state, "{check:?}");
            assert!(check.found.contains(words), "{check:?}");
        }
    }

    #[test]
    fn what_the_boards_say_of_themselves_is_compared_with_the_layout() {
        let checks = found(|f| f.discovery = discovered(vec![board(0, Some(0)), board(9, None)]));
        let firmware = checks.iter().find(|c| c.name == "firmware").unwrap();
        assert_eq!(
            (firmware.state, firmware.found.as_str()),
            (State::Ok, "MTB3 firmware 2.17.0, protocol 1.0")
        );
        let stranger = checks.iter().find(|c| c.name == "unexpected board").unwrap();
        assert_eq!(stranger.object, "can0 board 9");
        assert_eq!(stranger.mend, [Mend::Run("taxel doctor --scan can:can0".into())]);

        let change = |change: fn(&mut FoundBoard)| {
            found(|f| {
                let mut other = board(0, Some(0));
                change(&mut other);
                f.discovery = discovered(vec![other]);
            })
        };
        for (checks, name) in [
            (change(|b| b.kind = BoardKind::Mtb4), "firmware"),
            (change(|b| b.in_bootloader = true), "firmware"),
            (change(|b| b.answers = 2), "address"),
        ] {
            assert!(
                checks.iter().any(|c| c.name == name && c.state == State::Error),
                "{checks:?}"
            );
        }
        let silent = found(|f| {
            f.boards[0].state = BoardState::Unheard;
            f.discovery = discovered(vec![board(0, Some(0))]);
        });
        assert!(silent.iter().any(|c| c.found == "answers and sends no taxels"));
    }

    #[test]
    fn a_bus_on_which_others_speak_was_not_asked() {
        let checks = found(|f| {
            f.discovery = Some(DiscoveryReport {
                busy: vec![BusTraffic { bus: 1, id: 0x123 }],
                ..DiscoveryReport::default()
            });
        });
        let firmware = checks.iter().find(|c| c.name == "firmware").unwrap();
        assert_eq!(firmware.state, State::Skipped);
        assert!(firmware.found.contains("id 123"), "{}", firmware.found);
    }

    #[test]
    fn a_silent_board_that_nobody_started_is_no_riddle() {
        let checks = found(|f| {
            f.boards[3].state = BoardState::Unheard;
            f.buses[0].spoken_to = false;
        });
        let board = checks.iter().find(|c| c.found == "not heard").unwrap();
        assert!(matches!(&board.mend[0], Mend::Do(text) if text.contains("--listen-only")));
    }

    #[test]
    fn too_short_a_time_is_no_verdict_on_taxels() {
        let checks = found(|f| f.faults.clear());
        let taxels = checks.iter().find(|c| c.name == "taxels").unwrap();
        assert_eq!(taxels.state, State::Skipped);
    }

    #[test]
    fn the_drawing_marks_faults_before_saturation() {
        let mut facts = healthy();
        facts.faults[1].insert(Fault::Stuck);
        facts.saturated[1] = true;
        facts.saturated[2] = true;
        facts.faults[3].insert(Fault::Status);
        facts.dead[3] = true;
        assert_eq!(&marks(&facts)[..4], [None, Some('S'), Some('X'), Some('D')]);
    }
}
