//! The boards of the layout: what is wrong with them, how fast they send, and what they say they are.

use super::{AREA, BusFacts, HandFacts, NotedProblem, board_name};
use crate::doctor::finding::{Check, State};
use taxel_diagnose::{Kind, Place, Problem};
use taxel_skin::{BoardKind, BoardState, BoardStatus, FoundBoard, Layout, Protocol};

/// A board that leaves out more than this share of its readings is told.
const MISSED_PERCENT: f64 = 1.0;

/// What is to be said of a problem of a bus or of its boards, with what only who asked the boards knows.
pub(super) fn of_problem(layout: &Layout, bus: &BusFacts, facts: &HandFacts, noted: &NotedProblem) -> Check {
    let Problem {
        kind, modules, place, ..
    } = &noted.problem;
    let object = match modules.first() {
        Some(module) if !matches!(place, Place::Bus(_)) => board_name(layout, *module),
        _ => bus.name.clone(),
    };
    let mut check = Check::of_problem(AREA, object, &noted.problem);
    if noted.is_over {
        check.found += " (no longer when the listening ended)";
    }
    let answers = modules.iter().find_map(|module| found_of(facts, *module));
    match (kind, answers) {
        (Kind::BoardUnheard, Some(found)) => {
            check.found += "; it answers when it is asked and sends no taxels";
            check.without_mend().advise(match found.in_bootloader {
                true => "it is in its bootloader: switch its power off and on, or load its firmware",
                false => {
                    "its firmware may use another id layout than the layout file says: `taxel doctor --scan --start` tells"
                }
            })
        }
        (Kind::BoardUnheard | Kind::BoardNotInLayout, None) if !bus.is_array() => check.run(bus.scan()),
        _ => check,
    }
}

/// What is to be said of boards that speak.
pub(super) fn check(layout: &Layout, bus: u8, facts: &HandFacts) -> Vec<Check> {
    let mut checks = Vec::new();
    for (index, wiring) in layout.wiring.iter().enumerate() {
        let Some(counters) = facts.boards.get(index).filter(|_| wiring.bus == bus) else {
            continue;
        };
        if !wiring.protocol.has_board() || counters.state == BoardState::NeverSeen {
            continue;
        }
        let is_told = facts.has_of_board(index) || facts.has(bus, &[Kind::BusSilent, Kind::BusOff]);
        let module = &layout.modules[index];
        let taxels = module.first_taxel as usize..(module.first_taxel + module.taxels) as usize;
        let readings = facts.readings.get(taxels).unwrap_or_default();
        let speaks = check_living(board_name(layout, index), counters, readings);
        checks.extend(speaks.into_iter().filter(|c| !is_told || c.state != State::Ok));
    }
    checks
}

fn found_of(facts: &HandFacts, module: usize) -> Option<&FoundBoard> {
    let discovery = facts.discovery.as_ref()?;
    discovery.boards.iter().find(|b| b.module == Some(module as u16))
}

/// `readings`: how many each of its taxels had.
fn check_living(object: String, counters: &BoardStatus, readings: &[u32]) -> Vec<Check> {
    let mut checks = Vec::new();
    let rate = counters
        .period_ns
        .map_or("heard".into(), |ns| format!("{:.1} Hz", 1e9 / ns as f64));
    // A reading that is not in its own sweep and comes twice in the one behind was late, and not lost. Nor was anything where
    // every taxel came as often as the others: sweeps that are drawn out were taken for two.
    let (least, most) = (readings.iter().min(), readings.iter().max());
    let is_whole = least.zip(most).is_some_and(|(least, most)| most - least <= 1);
    let late = match is_whole {
        true => counters.missed,
        false => counters.missed.min(counters.duplicate),
    };
    let due = (counters.used + counters.missed) as f64;
    let share = |readings: u64| 100.0 * readings as f64 / due.max(1.0);
    let missing = share(counters.missed - late);
    let wanted = format!("up to {MISSED_PERCENT} %");
    checks.push(if missing > MISSED_PERCENT {
        let found = format!("{rate}, {missing:.1} % of its readings missing");
        Check::warning(AREA, "board", &object, found)
            .wanted(wanted)
            .advise(
                "a bus at its limit, or frames lost on the way: see bus capacity, traffic and lost frames",
            )
    } else if share(late) > MISSED_PERCENT {
        let found = format!(
            "{rate} where its sweeps come evenly, {:.1} % of its readings a sweep late; none is missing",
            share(late)
        );
        Check::warning(AREA, "board", &object, found)
            .wanted(wanted)
            .advise("its sweeps come in bursts, or drawn out: this machine is busy, or whatever sends them")
    } else {
        Check::ok(AREA, "board", &object, rate)
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
        let what = firmware_text(found);
        let Some(module) = found.module else {
            if facts.is_told_stranger(bus, found.address.into()) {
                continue;
            }
            let object = format!("{name} board {}", found.address);
            checks.push(
                Check::warning(AREA, "unexpected board", object, format!("answers: {what}"))
                    .wanted("no board there, or a [[module]] in the layout file")
                    .run(facts.buses[usize::from(bus)].scan()),
            );
            continue;
        };
        let object = board_name(layout, module.into());
        let is_told = facts.problems.iter().any(|noted| {
            noted.problem.kind == Kind::TwoBoards && noted.problem.is_of(Place::Module(module.into()))
        });
        if found.answers > 1 && !is_told {
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

/// What a board says it is, and with which firmware.
pub(crate) fn firmware_text(found: &FoundBoard) -> String {
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
