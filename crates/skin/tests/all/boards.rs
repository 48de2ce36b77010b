//! What boards are told, and when: start, triggers, restarts with growing pauses, stop.

use std::collections::HashMap;
use taxel_skin::{BoardSupervisor, BoardsConfig, BoardsMode, Layout, OutgoingCommand, TxMode};

const MS: u64 = 1_000_000;
const START: u64 = 3_000 * MS;

fn hand() -> Layout {
    Layout::builtin("allegro-uskin-15").unwrap()
}

fn config(mode: BoardsMode) -> BoardsConfig {
    BoardsConfig {
        mode,
        ..BoardsConfig::default()
    }
}

/// Plays time from `from` to `to` as the daemon would: sleeps until the supervisor is due, sends all it has.
/// `hear` says when a board was last heard, given the time and what was sent so far.
fn play(
    supervisor: &mut BoardSupervisor,
    from: u64,
    to: u64,
    hear: impl Fn(u16, u64, &[(u64, OutgoingCommand)]) -> Option<u64>,
) -> Vec<(u64, OutgoingCommand)> {
    let mut sent: Vec<(u64, OutgoingCommand)> = Vec::new();
    let mut now = from;
    while now <= to {
        while let Some(command) = supervisor.poll_command(now, |board| hear(board, now, &sent)) {
            sent.push((now, command));
        }
        let Some(next) = supervisor.poll_due_ns() else {
            break;
        };
        assert!(next > now, "a supervisor without a command is not due at once");
        now = next;
    }
    sent
}

fn times_ms(sent: &[(u64, OutgoingCommand)], board: u16) -> Vec<u64> {
    sent.iter()
        .filter(|(_, c)| c.board == board)
        .map(|(t, _)| (t - START) / MS)
        .collect()
}

fn assert_spaced(sent: &[(u64, OutgoingCommand)], bus_gap_ns: u64) {
    let mut by_bus: HashMap<u8, u64> = HashMap::new();
    let mut by_board: HashMap<(u8, u16), u64> = HashMap::new();
    for (t, command) in sent {
        if let Some(before) = by_bus.insert(command.bus, *t) {
            assert!(
                t - before >= bus_gap_ns,
                "{command:?} {} ns after another on its bus",
                t - before
            );
        }
        if let Some(before) = by_board.insert((command.bus, command.board), *t) {
            assert!(
                t - before >= 2 * MS,
                "{command:?} {} ns after another to it",
                t - before
            );
        }
    }
}

#[test]
fn free_running_boards_that_answer_are_started_once_each() {
    let mut supervisor = BoardSupervisor::new(&hand(), &config(BoardsMode::FreeRunning));
    let sent = play(&mut supervisor, START, START + 2_000 * MS, |_, now, _| {
        Some(now - 3 * MS)
    });
    let frames: Vec<(u8, String)> = sent.iter().map(|(_, c)| (c.bus, c.frame().to_string())).collect();
    for (bus, boards) in [(0, 8), (1, 7)] {
        let on_bus: Vec<&str> = frames
            .iter()
            .filter(|(b, _)| *b == bus)
            .map(|(_, f)| f.as_str())
            .collect();
        let expected: Vec<String> = (0..boards).map(|b| format!("20{b}#0700")).collect();
        assert_eq!(on_bus, expected, "bus {bus}");
    }
    assert_spaced(&sent, MS / 2);
    assert!((0..15).all(|board| supervisor.restarts(board) == 0));
}

#[test]
fn a_silent_board_is_started_again_after_growing_pauses_and_the_others_are_left_alone() {
    let config = BoardsConfig {
        restart_longest_ms: 5000.0,
        ..config(BoardsMode::FreeRunning)
    };
    let mut supervisor = BoardSupervisor::new(&hand(), &config);
    let sent = play(&mut supervisor, START, START + 22_000 * MS, |board, now, _| {
        (board != 0).then_some(now)
    });
    assert_eq!(
        times_ms(&sent, 0),
        [0, 100, 200, 400, 800, 1600, 3200, 6400, 11400, 16400, 21400],
        "100 ms of silence, then pauses of 100 ms doubling to 5 s"
    );
    assert_eq!(supervisor.restarts(0), 10);
    assert_eq!(sent.len(), 15 + 10);
    assert!(sent.iter().skip(15).all(|(_, c)| c.restart));
}

#[test]
fn a_board_that_comes_back_is_started_within_a_quarter_of_a_second_however_long_it_was_away() {
    let mut supervisor = BoardSupervisor::new(&hand(), &config(BoardsMode::FreeRunning));
    let sent = play(&mut supervisor, START, START + 60_000 * MS, |board, now, _| {
        (board != 0).then_some(now)
    });
    let times = times_ms(&sent, 0);
    assert!(times.windows(2).all(|t| t[1] - t[0] <= 250), "{times:?}");
}

#[test]
fn a_board_that_was_never_heard_is_looked_for_on_buses_that_have_none_of_its_address() {
    let hand = hand();
    // Board 7 of the first bus and board 6 of both: only the first can be told on the other bus.
    let missing: Vec<u16> = (0u16..)
        .zip(&hand.wiring)
        .filter(|(_, m)| m.board == 7 || m.board == 6)
        .map(|(i, _)| i)
        .collect();
    assert_eq!(missing.len(), 3);
    let mut supervisor = BoardSupervisor::new(&hand, &config(BoardsMode::FreeRunning));
    supervisor.allow_search(0, true);
    supervisor.allow_search(1, true);
    let mut sent = play(&mut supervisor, START, START + 5_000 * MS, |board, now, _| {
        (!missing.contains(&board)).then_some(now)
    });
    let elsewhere = |sent: &[(u64, OutgoingCommand)]| -> Vec<(u64, u8, String)> {
        let on_other = sent
            .iter()
            .filter(|(_, c)| c.bus != hand.wiring[usize::from(c.board)].bus);
        on_other
            .map(|(t, c)| ((t - START) / MS, c.bus, c.frame().to_string()))
            .collect()
    };
    let starts = elsewhere(&sent);
    assert!(starts.len() >= 2 && starts[0].0 <= 1000, "{starts:?}");
    assert!(
        starts
            .iter()
            .all(|(_, bus, frame)| (*bus, frame.as_str()) == (1, "207#0700")),
        "{starts:?}"
    );
    assert_spaced(&sent, MS / 2);

    // What was started there is stopped there.
    supervisor.stop();
    sent.clear();
    for ms in 5_001..5_200 {
        while let Some(command) = supervisor.poll_command(START + ms * MS, |_| None) {
            sent.push((START + ms * MS, command));
        }
    }
    assert!(supervisor.is_stopped() && supervisor.poll_due_ns().is_none());
    let stops: Vec<String> = elsewhere(&sent).into_iter().map(|(_, _, frame)| frame).collect();
    assert_eq!(stops, ["207#0701"]);
}

#[test]
fn a_hub_that_was_never_heard_is_looked_for_with_all_its_commands() {
    let text = r#"
name = "hubs"
image = { width = 7, height = 2 }
buses = ["left", "right"]
[cyskin]
byte_order = "big"
checksum = "sum"
sequence_bytes_above = 5
sensors_per_module = 12
start = [{ command = 0x38, data = [50] }, { command = 0x37, data = [1] }]
stop = [{ command = 0x37, data = [0] }]
[[cyskin.hub]]
name = "a"
bus = "left"
address = 1
[[cyskin.hub]]
name = "b"
bus = "right"
address = 2
[[module]]
name = "ma"
part = "p"
bus = "left"
hub = "a"
board = 0
protocol = "cyskin"
at = [0, 0]
order = [[1, 2, 3, 4, 5, 6, 7]]
[[module]]
name = "mb"
part = "p"
bus = "right"
hub = "b"
board = 0
protocol = "cyskin"
at = [0, 1]
order = [[1, 2, 3, 4, 5, 6, 7]]
"#;
    let layout = Layout::parse(text, "hubs").unwrap_or_else(|e| panic!("{e}"));
    let mut supervisor = BoardSupervisor::new(&layout, &config(BoardsMode::FreeRunning));
    supervisor.allow_search(0, true);
    supervisor.allow_search(1, true);
    let sent = play(&mut supervisor, START, START + 2_000 * MS, |board, now, _| {
        (board == 1).then_some(now)
    });
    let of_a: Vec<(u8, String)> = (sent.iter().filter(|(_, c)| c.board == 0))
        .map(|(_, c)| (c.bus, c.frame().to_string()))
        .collect();
    let on = |bus: u8| -> Vec<&str> {
        let there = of_a.iter().filter(|(b, _)| *b == bus);
        there.map(|(_, frame)| frame.as_str()).collect()
    };
    let (own, other) = (on(0), on(1));
    assert!(other.len() >= 2 && other.len().is_multiple_of(2), "{other:?}");
    for there in other.chunks(2) {
        assert_eq!(there, &own[..2], "the commands in their order");
    }
    assert_spaced(&sent, MS / 2);
}

#[test]
fn nothing_is_sent_to_other_buses_where_that_was_not_allowed() {
    let hand = hand();
    let mut supervisor = BoardSupervisor::new(&hand, &config(BoardsMode::FreeRunning));
    supervisor.allow_search(1, true);
    supervisor.allow_search(1, false);
    let sent = play(&mut supervisor, START, START + 5_000 * MS, |_, _, _| None);
    assert!(
        sent.iter()
            .all(|(_, c)| c.bus == hand.wiring[usize::from(c.board)].bus)
    );
}

#[test]
fn a_board_that_was_heard_is_not_looked_for_elsewhere() {
    let hand = hand();
    let mut supervisor = BoardSupervisor::new(&hand, &config(BoardsMode::FreeRunning));
    supervisor.allow_search(0, true);
    supervisor.allow_search(1, true);
    let sent = play(&mut supervisor, START, START + 5_000 * MS, |_, _, _| Some(START));
    assert!(
        sent.iter()
            .all(|(_, c)| c.bus == hand.wiring[usize::from(c.board)].bus)
    );
}

#[test]
fn a_board_that_was_heard_begins_with_the_first_pause_again() {
    let config = BoardsConfig {
        restart_longest_ms: 5000.0,
        ..config(BoardsMode::FreeRunning)
    };
    let mut supervisor = BoardSupervisor::new(&hand(), &config);
    // Board 0 answers the fourth command for 300 ms, and then falls silent for good.
    let hear = |board: u16, now: u64, sent: &[(u64, OutgoingCommand)]| {
        if board != 0 {
            return Some(now);
        }
        let fourth = sent.iter().filter(|(_, c)| c.board == 0).nth(3)?.0;
        Some(now.min(fourth + 300 * MS))
    };
    let sent = play(&mut supervisor, START, START + 1_700 * MS, hear);
    assert_eq!(times_ms(&sent, 0), [0, 100, 200, 400, 800, 900, 1100, 1500]);
}

#[test]
fn a_board_that_each_start_wakes_for_one_sweep_is_kept_awake() {
    // The class-7 hazard of L1: another board's taxel 15 stops this one after each sweep.
    let mut supervisor = BoardSupervisor::new(&hand(), &config(BoardsMode::FreeRunning));
    let hear = |board: u16, now: u64, sent: &[(u64, OutgoingCommand)]| {
        let last = sent.iter().rfind(|(_, c)| c.board == board)?.0;
        Some((last + 5 * MS).min(now))
    };
    let sent = play(&mut supervisor, START, START + 1_000 * MS, hear);
    let times = times_ms(&sent, 0);
    assert!(times.windows(2).all(|t| t[1] - t[0] <= 110), "{times:?}");
}

#[test]
fn triggered_boards_are_started_for_every_sweep_on_one_grid() {
    let mut config = config(BoardsMode::Triggered);
    config.trigger_hz = 50.0;
    let mut supervisor = BoardSupervisor::new(&hand(), &config);
    let sent = play(&mut supervisor, START, START + 995 * MS, |_, now, _| Some(now));
    assert_spaced(&sent, MS / 2);
    for board in 0..15 {
        let times = times_ms(&sent, board);
        assert_eq!(times.len(), 50, "board {board}");
        let place = if board < 8 { board as u64 } else { board as u64 - 8 };
        for (i, t) in times.iter().enumerate() {
            let expected = 20 * i as u64 + place / 2;
            assert_eq!(
                *t, expected,
                "board {board} is started within a few ms of its trigger"
            );
        }
        assert_eq!(supervisor.restarts(board), 0);
    }
}

#[test]
fn a_triggered_board_that_is_silent_is_tried_less_and_less_often_and_then_triggered_again() {
    let mut config = config(BoardsMode::Triggered);
    config.trigger_hz = 100.0;
    config.restart_longest_ms = 5000.0;
    let mut supervisor = BoardSupervisor::new(&hand(), &config);
    let back = START + 1_250 * MS;
    let sent = play(&mut supervisor, START, START + 2_000 * MS, |board, now, sent| {
        if board != 0 {
            return Some(now);
        }
        // From `back` on it answers each start.
        let last = sent.iter().rfind(|(_, c)| c.board == 0)?.0;
        (last >= back).then_some(last + 2 * MS)
    });
    let times = times_ms(&sent, 0);
    let silent: Vec<u64> = times
        .iter()
        .copied()
        .filter(|t| (100..1600).contains(t))
        .collect();
    assert_eq!(silent, [100, 200, 400, 800]);
    let after: Vec<u64> = times.iter().copied().filter(|t| *t >= 1600).collect();
    assert_eq!(after[..4], [1600, 1610, 1620, 1630]);
    assert_eq!(supervisor.restarts(0), 5);
}

#[test]
fn triggers_that_were_slept_over_are_skipped() {
    let mut supervisor = BoardSupervisor::new(&hand(), &config(BoardsMode::Triggered));
    play(&mut supervisor, START, START + 20 * MS, |_, now, _| Some(now));
    let late = START + 10_005 * MS;
    let sent = play(&mut supervisor, late, late + 20 * MS, |_, now, _| Some(now));
    assert_eq!(sent.len(), 15, "one trigger each, not three hundred");
}

#[test]
fn passive_and_xela_boards_are_told_nothing() {
    let l3 = "name = \"x\"\nimage = { width = 4, height = 4 }\nbuses = [\"can0\"]\n[[module]]\nname = \"m\"\n\
              part = \"p\"\nbus = \"can0\"\nboard = 1\nprotocol = \"uskin-l3\"\nat = [0, 0]\norder = [[0, 1]]\n";
    let l3 = Layout::parse(l3, "x.toml").unwrap();
    let cases = [
        (hand(), BoardsMode::Passive),
        (l3.clone(), BoardsMode::FreeRunning),
        (l3, BoardsMode::Triggered),
        (Layout::grid(4, 4).unwrap(), BoardsMode::FreeRunning),
    ];
    for (layout, mode) in cases {
        let mut supervisor = BoardSupervisor::new(&layout, &config(mode));
        assert_eq!(supervisor.poll_due_ns(), None);
        assert_eq!(supervisor.poll_command(START, |_| None), None);
        supervisor.stop();
        assert_eq!(supervisor.poll_command(START, |_| None), None);
        assert!(supervisor.is_stopped());
    }
}

#[test]
fn stopping_tells_every_board_once_and_then_nothing() {
    for mode in [BoardsMode::FreeRunning, BoardsMode::Triggered] {
        let mut supervisor = BoardSupervisor::new(&hand(), &config(mode));
        let mut sent = play(&mut supervisor, START, START + MS, |_, _, _| None);
        assert!(!supervisor.is_stopped());
        supervisor.stop();
        let stops = play(&mut supervisor, START + MS, START + 10_000 * MS, |_, _, _| None);
        assert!(stops.iter().all(|(_, c)| c.mode == TxMode::Stop));
        let mut frames: Vec<(u8, String)> = stops
            .iter()
            .map(|(_, c)| (c.bus, c.frame().to_string()))
            .collect();
        frames.sort();
        let expected: Vec<(u8, String)> = hand()
            .wiring
            .iter()
            .map(|m| (m.bus, format!("20{}#0701", m.board)))
            .collect();
        assert_eq!(frames, expected);
        assert!(supervisor.is_stopped());
        assert_eq!(supervisor.poll_due_ns(), None);
        sent.extend(stops);
        assert_spaced(&sent, MS / 2);
    }
}

#[test]
fn boards_of_a_bus_that_came_back_are_started_at_once() {
    let mut supervisor = BoardSupervisor::new(&hand(), &config(BoardsMode::FreeRunning));
    play(&mut supervisor, START, START + 10_000 * MS, |_, _, _| None);
    let back = START + 10_001 * MS;
    supervisor.bus_restored(1, back);
    let sent = play(&mut supervisor, back, back + 10 * MS, |_, _, _| None);
    let boards: Vec<u16> = sent
        .iter()
        .filter(|(_, c)| !c.restart)
        .map(|(_, c)| c.board)
        .collect();
    assert_eq!(boards, (8..15).collect::<Vec<u16>>());
}

#[test]
fn a_command_that_could_not_be_sent_is_tried_again_and_not_counted() {
    let mut supervisor = BoardSupervisor::new(&hand(), &config(BoardsMode::FreeRunning));
    let mut now = START;
    for _ in 0..5 {
        let command = supervisor
            .poll_command(now, |board| (board != 0).then_some(now))
            .unwrap();
        assert_eq!(command.board, 0);
        supervisor.not_sent(&command, now);
        while supervisor.poll_command(now, |_| Some(now)).is_some() {}
        for step in 1..100 {
            let t = now + step * MS;
            while let Some(c) = supervisor.poll_command(t, |board| (board != 0).then_some(t)) {
                assert_ne!(c.board, 0, "only after the first pause");
            }
        }
        now += 100 * MS;
    }
    assert_eq!(supervisor.restarts(0), 0);
}

#[test]
fn no_command_is_of_class_7_on_any_board_of_any_layout() {
    let mut text = "name = \"t\"\nimage = { width = 64, height = 4 }\nbuses = [\"can0\"]\n".to_string();
    for b in 0..15 {
        text += &format!(
            "[[module]]\nname = \"m{b}\"\npart = \"p\"\nbus = \"can0\"\nboard = {b}\nprotocol = \"uskin-l1\"\nat = [{}, 0]\n",
            4 * b
        );
    }
    let layout = Layout::parse(&text, "t.toml").unwrap();
    let mut supervisor = BoardSupervisor::new(&layout, &config(BoardsMode::Triggered));
    let mut sent = play(&mut supervisor, START, START + 1000 * MS, |_, _, _| None);
    supervisor.stop();
    sent.extend(play(
        &mut supervisor,
        START + 1000 * MS,
        START + 2000 * MS,
        |_, _, _| None,
    ));
    for (_, command) in sent {
        let frame = command.frame();
        let board = layout.wiring[command.board as usize].board as u16;
        assert_eq!(frame.standard_id(), Some(0x200 | board));
        assert_eq!(frame.data(), [7, (command.mode == TxMode::Stop) as u8]);
    }
}

#[test]
fn settings_outside_their_range_are_named_with_their_limits() {
    BoardsConfig::default().check().unwrap();
    type Change = fn(&mut BoardsConfig);
    let cases: [(Change, &str); 5] = [
        (
            |c| c.trigger_hz = 0.0,
            "boards: trigger_hz = 0 is outside 1 to 200",
        ),
        (
            |c| c.silence_ms = 1.0,
            "boards: silence_ms = 1 is outside 20 to 60000",
        ),
        (
            |c| c.restart_first_ms = f64::INFINITY,
            "boards: restart_first_ms = inf is outside 10 to 60000",
        ),
        (
            |c| c.restart_longest_ms = 50.0,
            "boards: restart_longest_ms = 50 is outside 100 to 600000 ms, from restart_first_ms on",
        ),
        (
            |c| c.command_gap_ms = 0.0,
            "boards: command_gap_ms = 0 is outside 0.1 to 100",
        ),
    ];
    for (change, message) in cases {
        let mut config = BoardsConfig::default();
        change(&mut config);
        assert_eq!(config.check().unwrap_err().to_string(), message);
    }
    let config: BoardsConfig = toml::from_str("mode = \"free-running\"").unwrap();
    assert_eq!(config, BoardsConfig::default());
    let error = toml::from_str::<BoardsConfig>("trigger = 3")
        .unwrap_err()
        .to_string();
    assert!(error.contains("unknown field `trigger`"), "{error}");
}
