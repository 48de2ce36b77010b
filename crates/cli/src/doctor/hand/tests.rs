//! Every kind of trouble with a hand, as a table.

use super::super::finding::{Mend, State};
use super::*;
use taxel_diagnose::{DaemonView, HandSetup, HandView, Problems};
use taxel_hand::Fault;
use taxel_skin::{BoardKind, BusTraffic, Firmware};
use taxel_skin::{BoardState, BoardsMode, FoundBoard, Movement};

fn layout() -> Layout {
    Layout::builtin("allegro-uskin-15").unwrap()
}

fn living() -> BoardStatus {
    BoardStatus {
        used: 1000,
        period_ns: Some(20_000_000),
        state: BoardState::Streaming,
        ..BoardStatus::default()
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
        readings: (0..240).map(|taxel| 1000 - 3 * (taxel % 2)).collect(),
        discovery: None,
        findings: Vec::new(),
        problems: Vec::new(),
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
    facts.problems = judged(&facts);
    check(&layout(), &triggered(), &facts)
}

/// What is wrong by these facts, as a daemon that looks at them would say.
fn judged(facts: &HandFacts) -> Vec<NotedProblem> {
    let layout = layout();
    let sources: Vec<_> = facts.buses.iter().map(|b| b.source.parse().unwrap()).collect();
    let setup = HandSetup {
        layout: &layout,
        sources: &sources,
        silence_ns: 100_000_000,
        stale_ns: None,
        joints: None,
        joints_share_bus: false,
    };
    let buses: Vec<_> = facts.buses.iter().map(BusFacts::view).collect();
    let view = HandView {
        now_ns: 1_000_000_000,
        buses: &buses,
        boards: &facts.boards,
        findings: &facts.findings,
        moved: Movement::None,
        faults: &[],
        unchanging: &vec![false; layout.len()],
        joints: None,
        boards_due: true,
        daemon: DaemonView::default(),
    };
    let mut problems = Problems::default();
    let _ = problems.handle_view(&setup, &view);
    let noted = problems.current().iter().map(|current| NotedProblem {
        problem: current.problem.clone(),
        is_over: false,
    });
    noted.collect()
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
    let cases: [(Vec<Check>, State, &str, &str, &str); 20] = [
        (
            found(|f| f.boards[3].state = BoardState::NeverSeen),
            State::Error,
            "board-unheard",
            "index proximal (can0 board 3)",
            "was not heard since the start",
        ),
        (
            found(|f| f.boards[3].state = BoardState::Silent),
            State::Error,
            "board-silent",
            "index proximal (can0 board 3)",
            "index proximal (can0 board 3) is silent",
        ),
        (
            found(|f| f.boards[0].missed = 100),
            State::Warning,
            "board",
            "index tip (can0 board 0)",
            "9.1 % of its readings missing",
        ),
        (
            found(|f| (f.boards[0].missed, f.boards[0].duplicate) = (100, 95)),
            State::Warning,
            "board",
            "index tip (can0 board 0)",
            "8.6 % of its readings a sweep late; none is missing",
        ),
        (
            found(|f| {
                f.boards[0].missed = 100;
                f.readings[..16].fill(999);
                f.readings[3] = 1000;
            }),
            State::Warning,
            "board",
            "index tip (can0 board 0)",
            "9.1 % of its readings a sweep late; none is missing",
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
            "link-down",
            "can1",
            "the interface can1 is down",
        ),
        (
            found(|f| {
                f.boards[8..]
                    .iter_mut()
                    .for_each(|b| b.state = BoardState::NeverSeen)
            }),
            State::Error,
            "bus-silent",
            "can1",
            "can1: no board speaks",
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
            "5 of 16: k 0-4 stuck",
        ),
        (
            found(|f| {
                (f.saturated[2], f.saturated[3], f.dead[9]) = (true, true, true);
            }),
            State::Warning,
            "taxels",
            "index tip (can0 board 0)",
            "3 of 16: k 2, 3 saturated; k 9 dead",
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
    // What the doctor has started is silent when the scan listens.
    let scan = "taxel doctor --scan --start can:can0";
    assert_eq!(stranger.mend, [Mend::Run(scan.into())]);
    for (spoken_to, scan) in [
        (true, "taxel doctor --scan --start can:can1"),
        (false, "taxel doctor --scan can:can1"),
    ] {
        let checks = found(|f| {
            f.buses[1].spoken_to = spoken_to;
            f.buses[1].unclaimed = unclaimed(&[0x700, 0x701]);
        });
        let stranger = checks.iter().find(|c| c.name == "unexpected board").unwrap();
        assert_eq!(stranger.mend, [Mend::Run(scan.into())]);
    }

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
        f.boards[0].state = BoardState::NeverSeen;
        f.discovery = discovered(vec![board(0, Some(0))]);
    });
    assert!(silent.iter().any(|c| {
        c.found
            .contains("was not heard since the start; it answers when it is asked and sends no taxels")
    }));
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
        f.boards[3].state = BoardState::NeverSeen;
        f.buses[0].spoken_to = false;
    });
    let board = checks.iter().find(|c| c.name == "board-unheard").unwrap();
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

#[test]
fn what_the_traffic_shows_is_told_once_and_explains_the_silent_boards() {
    let babble = Finding::IdBabbles {
        bus: 0,
        id: 5,
        extended: false,
        module: None,
        rate_hz: 4000.0,
        share: 0.44,
    };
    let two = Finding::TwoBoards {
        module: 2,
        sweeps_hz: [100.0, 50.0],
    };
    for (finding, state, name, object, words) in [
        (
            babble,
            State::Warning,
            "babbling",
            "can0",
            "id 005, which is nobody's in the layout, babbles: 4000 frames/s",
        ),
        (
            two,
            State::Error,
            "two-boards-one-address",
            "index middle (can0 board 2)",
            "100 sweeps/s where one board sends 50",
        ),
    ] {
        let checks = found(|f| f.findings.push(finding));
        let bad: Vec<_> = checks.iter().filter(|c| c.state != State::Ok).collect();
        let [check] = bad[..] else { panic!("{bad:?}") };
        assert_eq!(
            (check.state, check.name.as_ref(), check.object.as_str()),
            (state, name, object)
        );
        assert!(check.found.contains(words), "{check:?}");
    }
    // Board 7 of the first bus is the only one that tells the two buses apart.
    let swapped = found(|f| {
        f.boards[7].state = BoardState::NeverSeen;
        f.buses[1].unclaimed = unclaimed(&[0x700, 0x701, 0x702, 0x703]);
        f.findings.push(Finding::BusesSwapped {
            buses: [0, 1],
            module: 7,
            boards: 1,
        });
    });
    let bad: Vec<_> = swapped.iter().filter(|c| c.state != State::Ok).collect();
    let names: Vec<&str> = bad.iter().map(|c| c.name.as_ref()).collect();
    assert_eq!(names, ["buses-swapped"], "{bad:?}");
    assert!(bad[0].found.contains("board 7) speaks on can1"), "{bad:?}");
}

#[test]
fn a_babbling_id_is_not_among_the_unknown_ids_too_and_what_is_over_says_so() {
    let checks = found(|f| {
        f.buses[0].unclaimed = unclaimed(&[0x005]);
        f.findings.push(Finding::IdBabbles {
            bus: 0,
            id: 5,
            extended: false,
            module: None,
            rate_hz: 4000.0,
            share: 0.44,
        });
    });
    let names: Vec<&str> = checks
        .iter()
        .filter(|c| c.state != State::Ok)
        .map(|c| c.name.as_ref())
        .collect();
    assert_eq!(names, ["babbling"]);

    let mut facts = healthy();
    facts.boards[3].state = BoardState::Silent;
    facts.problems = judged(&facts);
    facts.problems[0].is_over = true;
    facts.boards[3].state = BoardState::Streaming;
    let checks = check(&layout(), &triggered(), &facts);
    let silent = checks.iter().find(|c| c.name == "board-silent").unwrap();
    assert!(
        silent
            .found
            .ends_with("is silent (no longer when the listening ended)"),
        "{silent:?}"
    );
}
