//! The boards of the layout: whether they speak, how fast, and what they say they are.

use super::{AREA, BusFacts, HandFacts, findings, object};
use crate::doctor::finding::Check;
use taxel_skin::{
    BoardKind, BoardState, BoardStatus, BoardsConfig, BoardsMode, FoundBoard, Layout, Protocol, Wiring,
};

/// A board that leaves out more than this share of its readings is told.
const MISSED_PERCENT: f64 = 1.0;

pub(super) fn check(layout: &Layout, bus: u8, boards: &BoardsConfig, facts: &HandFacts) -> Vec<Check> {
    let mut checks = Vec::new();
    let of_bus = &facts.buses[usize::from(bus)];
    for (index, wiring) in layout.wiring.iter().enumerate() {
        let Some(counters) = facts.boards.get(index).filter(|_| wiring.bus == bus) else {
            continue;
        };
        if !wiring.protocol.has_board() {
            continue;
        }
        let object = object(layout, index);
        let other = findings::elsewhere(layout, facts, index);
        if let (Some(other), BoardState::NeverSeen) = (other, counters.state) {
            let found = format!("not heard; it speaks on {}", layout.buses[usize::from(other)]);
            checks.push(Check::error(AREA, "board", object, found));
            continue;
        }
        match counters.state {
            BoardState::NeverSeen if of_bus.frames == 0 => {
                checks.push(Check::error(AREA, "board", object, "not heard"));
            }
            BoardState::NeverSeen => {
                checks.push(unheard(object, wiring, boards, of_bus, found_of(facts, index)))
            }
            BoardState::Silent => checks.push(
                Check::error(AREA, "board", object, "spoke and fell silent").advise(
                    "its supply or its plug; taxeld starts it again and again, see `restarts` in its status",
                ),
            ),
            BoardState::Settling | BoardState::Streaming => checks.extend(check_living(object, counters)),
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
    wiring: &Wiring,
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
    let may_speak = bus.spoken_to || wiring.protocol.mtb().is_none();
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

fn check_living(object: String, counters: &BoardStatus) -> Vec<Check> {
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

pub(super) fn check_discovery(layout: &Layout, bus: u8, facts: &HandFacts) -> Vec<Check> {
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
        let object = object(layout, module.into());
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
        BoardKind::Mtb3 => "MTB3".into(),
        BoardKind::Mtb4 => "MTB4".into(),
        BoardKind::Mtb4w => "MTB4W".into(),
        BoardKind::Mtb4c => "MTB4C".into(),
        BoardKind::Other(number) => format!("board type {number}"),
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
