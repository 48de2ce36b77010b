//! What boards other than uSkin's are sent to start, wake and stop them, and when.

use crate::support::{CYSKIN, cyskin, cyskin_text, icub};
use taxel_can::{CanFrame, Received};
use taxel_skin::{BoardSupervisor, BoardsConfig, BoardsMode, BusMonitor, Finding, Layout, TxMode};

const MS: u64 = 1_000_000;

/// Commands handed out from 0 to `until_ms` as (ms, frame), with `hear` saying when a board was
/// last heard, given the time and the commands so far. Questions are answered.
fn play(
    supervisor: &mut BoardSupervisor,
    from_ms: u64,
    until_ms: u64,
    hear: impl Fn(u16, u64, &[(u64, String)]) -> Option<u64>,
) -> Vec<(u64, String)> {
    play_with(supervisor, from_ms, until_ms, |_| true, hear)
}

/// The same; questions are answered at once at the times, ms, that `answers` says.
fn play_with(
    supervisor: &mut BoardSupervisor,
    from_ms: u64,
    until_ms: u64,
    answers: impl Fn(u64) -> bool,
    hear: impl Fn(u16, u64, &[(u64, String)]) -> Option<u64>,
) -> Vec<(u64, String)> {
    let mut sent: Vec<(u64, String)> = Vec::new();
    let mut now = from_ms * MS;
    while now <= until_ms * MS {
        while let Some(command) = supervisor.poll_command(now, |board| hear(board, now, &sent)) {
            let frame = command.frame();
            let is_harmless = frame
                .standard_id()
                .is_none_or(|id| id & 0x7F0 == 0x200 || id & 0x700 == 0x500);
            assert!(is_harmless, "{frame} must not be sent while boards stream");
            sent.push((now / MS, frame.to_string()));
            if frame.data()[0] == 0x1C && answers(now / MS) {
                let id = 0x200 | (frame.id() as u16 & 15) << 4;
                let answer = CanFrame::standard(id, &[0x1C, 5, 2, 17, 4, 1, 0, 1]).unwrap();
                supervisor.handle_frame(
                    command.bus,
                    &Received {
                        t_ns: now,
                        frame: answer,
                    },
                );
            }
        }
        let Some(next) = supervisor.poll_due_ns() else {
            break;
        };
        assert!(next > now, "a supervisor without a command is not due at once");
        now = next;
    }
    sent
}

fn text(sent: &[(u64, String)]) -> Vec<(u64, &str)> {
    sent.iter().map(|(t, f)| (*t, f.as_str())).collect()
}

const QUESTION: &str = "201#1C0100";
const CONFIGURATION: [(u64, &str); 6] = [
    (0, QUESTION),
    (10, "201#4D0032F5"),
    (20, "201#50000F02000022"),
    (30, "201#50000002010022"),
    (40, "201#50030302010022"),
    (540, "201#0700"),
];

/// The configuration without its question, so many ms later.
fn configuration_after(ms: u64) -> Vec<(u64, &'static str)> {
    CONFIGURATION[1..].iter().map(|(t, f)| (ms + t, *f)).collect()
}

#[test]
fn an_icub_board_is_configured_in_order_with_pauses_and_started_last() {
    for mode in [BoardsMode::FreeRunning, BoardsMode::Triggered] {
        let layout = icub("icub-mtb3", "");
        let config = BoardsConfig {
            mode,
            ..BoardsConfig::default()
        };
        let mut supervisor = BoardSupervisor::new(&layout, &config);
        let sent = play(&mut supervisor, 0, 3_000, |_, now, sent| {
            (sent.len() >= 6).then_some(now)
        });
        assert_eq!(text(&sent), CONFIGURATION, "{mode:?}: it sends on its own timer");
        assert_eq!(supervisor.restarts(0), 0);
        supervisor.stop();
        let sent = play(&mut supervisor, 3_001, 4_000, |_, now, _| Some(now));
        assert_eq!(text(&sent), [(3_001, "201#0701")]);
        assert!(supervisor.is_stopped());
    }
}

#[test]
fn the_commands_carry_what_the_layout_says() {
    let setup = "icub = { period_ms = 100, noload = 240, skin_type = 8, shift = 3, cdc_offset = 0x1234 }";
    let mut supervisor = BoardSupervisor::new(&icub("icub-mtb4", setup), &BoardsConfig::default());
    let sent = play(&mut supervisor, 0, 540, |_, _, _| None);
    let frames: Vec<&str> = sent.iter().map(|(_, f)| f.as_str()).collect();
    assert_eq!(
        frames[1..4],
        ["201#4D0864F0", "201#50000F03003412", "201#50000003013412"]
    );

    for (setup, problem) in [
        (
            "icub = { period_ms = 210 }",
            "icub.period_ms = 210 is not 1 to 209",
        ),
        ("icub = { period_ms = 0 }", "icub.period_ms = 0"),
        ("icub = { skin_type = 16 }", "icub.skin_type = 16"),
        ("icub = { shift = 16 }", "icub.shift = 16"),
        ("icub = { noload = 256 }", "256"),
        ("icub = { gain = 1 }", "unknown key `gain`"),
        ("hub = \"a\"", "has no use for the key `hub`"),
    ] {
        let text = Layout::builtin_text("icub-forearm").unwrap();
        let text: String = text
            .lines()
            .filter(|l| !l.starts_with("icub ="))
            .map(|l| format!("{l}\n"))
            .collect();
        let text = text.replace("at = [0, 0]", &format!("at = [0, 0]\n{setup}"));
        let error = Layout::parse(&text, "icub.toml").unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
}

/// Pauses are those of docs/protocols.md, "MTB commands": 10 ms between commands, half a second from the
/// triangles to the start.
#[track_caller]
fn keeps_its_pauses(sent: &[(u64, String)]) {
    let mut configured_ms = None;
    for (before, now) in sent.iter().zip(&sent[1..]) {
        assert!(now.0 >= before.0 + 10, "{before:?} {now:?}");
        if before.1.starts_with("201#50") {
            configured_ms = Some(before.0);
        }
        if now.1 == "201#0700" {
            assert!(
                configured_ms.is_none_or(|t| now.0 >= t + 500),
                "{now:?} of {sent:?}"
            );
        }
    }
}

#[test]
fn a_silent_icub_board_is_woken_first_and_configured_anew_only_if_that_does_not_help() {
    let layout = icub("icub-mtb3", "");
    let mut supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
    let sent = play(&mut supervisor, 0, 1_400, |_, _, _| None);
    assert_eq!(text(&sent)[..6], CONFIGURATION);
    // Three of its periods of 50 ms after the start.
    assert_eq!(
        text(&sent)[6..8],
        [(690, "201#0700"), (700, QUESTION)],
        "configuration would calibrate the skin, whatever touches it"
    );
    // It is there and does not speak within its period and 20 ms.
    assert_eq!(text(&sent)[8], (770, QUESTION));
    assert_eq!(text(&sent)[9..14], configuration_after(770));
    keeps_its_pauses(&sent);
    assert_eq!(supervisor.restarts(0), 2);

    // A board that answers the waking is left alone.
    let mut supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
    let sent = play(&mut supervisor, 0, 5_000, |_, now, sent| {
        (sent.len() >= 7).then_some(now)
    });
    assert_eq!(text(&sent)[6..], [(690, "201#0700"), (700, QUESTION)]);
}

#[test]
fn an_icub_board_without_power_is_asked_and_configured_as_soon_as_it_answers() {
    let layout = icub("icub-mtb4", "");
    let mut slowest_ms = 0;
    // Heard until 1 s, without power until then; power comes back in every phase of the questions.
    for back_ms in (2_000..2_300).step_by(7) {
        let mut supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
        let answers = |ms| !(1_000..back_ms).contains(&ms);
        let hear = |_, now: u64, _: &[(u64, String)]| (now > 545 * MS).then_some(now.min(1_000 * MS));
        let sent = play_with(&mut supervisor, 0, back_ms + 1_000, answers, hear);
        keeps_its_pauses(&sent);
        let away = sent.iter().filter(|(t, _)| (1_000..back_ms).contains(t));
        let questions = away.clone().filter(|(_, f)| f == QUESTION).count();
        assert_eq!(
            questions + 1,
            away.count(),
            "nothing but a waking and questions: {sent:?}"
        );
        let started = sent
            .iter()
            .find(|(t, f)| *t > back_ms && f == "201#0700")
            .unwrap();
        slowest_ms = slowest_ms.max(started.0 - back_ms);
        assert_eq!(
            supervisor.restarts(0),
            2 + u64::from(started.0 + 150 < back_ms + 1_000)
        );
    }
    // A question within 100 ms, its period and 20 ms to be heard, then the configuration.
    assert!((700..=100 + 70 + 540).contains(&slowest_ms), "{slowest_ms} ms");
}

#[test]
fn a_board_that_comes_up_while_it_is_configured_is_configured_from_the_beginning() {
    let layout = icub("icub-mtb3", "");
    for (up_ms, begin_ms) in [(5, 206), (100, 206), (300, 373)] {
        let mut supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
        let sent = play_with(&mut supervisor, 0, 1_000, |ms| ms >= up_ms, |_, _, _| None);
        let start = sent
            .iter()
            .position(|(t, f)| *t > 40 && f == "201#4D0032F5")
            .unwrap();
        let begun_ms = sent[start].0;
        assert!(begun_ms.abs_diff(begin_ms + 10) <= 1, "{up_ms}: {sent:?}");
        let again: Vec<(u64, &str)> = configuration_after(begun_ms - 10);
        assert_eq!(text(&sent)[start..start + 5], again, "{up_ms}");
        keeps_its_pauses(&sent);
    }
}

#[test]
fn a_board_that_knows_no_questions_is_started_all_the_same() {
    let layout = icub("icub-mtb3", "");
    let mut supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
    let sent = play_with(&mut supervisor, 0, 10_000, |_| false, |_, _, _| None);
    keeps_its_pauses(&sent);
    let starts: Vec<u64> = (sent.iter().filter(|(_, f)| f == "201#0700").map(|(t, _)| *t)).collect();
    assert_eq!(starts[0], 540);
    assert!(starts.len() >= 4, "{starts:?}");
}

#[test]
fn a_stop_during_the_configuration_ends_it() {
    let mut supervisor = BoardSupervisor::new(&icub("icub-mtb3", ""), &BoardsConfig::default());
    play(&mut supervisor, 0, 45, |_, _, _| None);
    supervisor.stop();
    let sent = play(&mut supervisor, 46, 2_000, |_, _, _| None);
    assert_eq!(text(&sent), [(50, "201#0701")], "10 ms after the last command");
    assert!(supervisor.is_stopped());
}

#[test]
fn a_step_that_could_not_be_sent_begins_the_configuration_again() {
    let mut supervisor = BoardSupervisor::new(&icub("icub-mtb3", ""), &BoardsConfig::default());
    assert!(supervisor.poll_command(0, |_| None).is_some());
    let second = supervisor.poll_command(10 * MS, |_| None).unwrap();
    supervisor.not_sent(&second, 10 * MS);
    let sent = play(&mut supervisor, 11, 700, |_, _, _| None);
    let again: Vec<(u64, &str)> = CONFIGURATION.iter().map(|(t, f)| (110 + t, *f)).collect();
    assert_eq!(text(&sent), again);
    assert_eq!(supervisor.restarts(0), 0);
}

#[test]
fn boards_are_configured_side_by_side() {
    let text = Layout::builtin_text("icub-forearm").unwrap();
    let (head, module) = text.split_once("[[module]]").unwrap();
    let second = module
        .replace("forearm strip", "second")
        .replace("board = 1", "board = 2")
        .replace("at = [0, 0]", "at = [0, 4]");
    let head = head.replace("height = 4", "height = 8");
    let layout = Layout::parse(
        &format!("{head}[[module]]{module}\n[[module]]{second}"),
        "two.toml",
    )
    .unwrap();
    let mut supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
    let sent = play(&mut supervisor, 0, 600, |_, _, _| None);
    for address in ["201", "202"] {
        let mine: Vec<u64> = sent
            .iter()
            .filter(|(_, f)| f.starts_with(address))
            .map(|(t, _)| *t)
            .collect();
        assert_eq!(
            mine,
            [0, 10, 20, 30, 530],
            "board {address}: all its triangles are one run"
        );
    }
}

#[test]
fn a_cyskin_hub_is_sent_what_the_layout_says_once_for_all_its_modules() {
    let parameters = CYSKIN.to_string()
        + "start = [{ command = 0x38, data = [50], pause_ms = 30 }, { command = 0x37, data = [1] }]\n\
           stop = [{ command = 0x37, data = [0] }]\n";
    let layout = cyskin(&parameters, 5);
    let mut supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
    // Only the last module of each hub is ever heard, and only until 1 s.
    let heard = |board: u16, now: u64, _: &[(u64, String)]| (board % 5 == 4).then_some(now.min(1_000 * MS));
    let sent = play(&mut supervisor, 0, 1_100, heard);
    assert_eq!(
        text(&sent),
        [
            (0, "14000123#3801326B"),
            (0, "14000124#3801326B"),
            (30, "14000123#37010139"),
            (30, "14000124#37010139"),
        ]
    );
    let sent = play(&mut supervisor, 1_101, 1_200, heard);
    assert_eq!(
        sent.len(),
        4,
        "both are silent for 150 ms and started again: {sent:?}"
    );
    assert_eq!([0, 4, 5, 9].map(|board| supervisor.restarts(board)), [1; 4]);
    supervisor.stop();
    let sent = play(&mut supervisor, 1_201, 2_000, heard);
    assert_eq!(
        text(&sent).iter().map(|(_, f)| *f).collect::<Vec<_>>(),
        ["14000123#37010038", "14000124#37010038"]
    );
    assert!(supervisor.is_stopped());
}

#[test]
fn boards_without_commands_are_left_alone() {
    let layouts = [
        Layout::builtin("allegro-xela-18").unwrap(),
        Layout::builtin("cpm-finger").unwrap(),
        Layout::builtin("schunk-sdh").unwrap(),
        Layout::parse(&cyskin_text(CYSKIN, 2), "cy.toml").unwrap(),
        cyskin("start = []\nstop = []\n", 2),
    ];
    for layout in layouts {
        let mut supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
        assert_eq!(supervisor.poll_command(0, |_| None), None, "{}", layout.name);
        assert_eq!(supervisor.poll_due_ns(), None);
        supervisor.stop();
        assert!(supervisor.is_stopped());
    }
}

#[test]
fn a_cyskin_hub_is_sent_what_genoa_s_library_sends() {
    let layout = cyskin("", 2);
    let mut supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
    let heard = |_, now: u64, _: &[(u64, String)]| Some(now);
    let sent = play(&mut supervisor, 0, 1_000, heard);
    // Each of the two hubs is started by what is for all: the library has no other way.
    let frames = [(0, "5FF#3802003280"), (10, "5FF#370101CE")];
    assert_eq!(text(&sent), [frames[0], frames[0], frames[1], frames[1]]);
    supervisor.stop();
    let sent = play(&mut supervisor, 1_001, 2_000, heard);
    assert!(
        sent.iter().all(|(_, frame)| frame == "5FF#370100C9") && sent.len() == 2,
        "{sent:?}"
    );

    let cases = [
        ("period_ms = 300\n", "5FF#3802012C", Some(900)),
        ("commands_to = \"hub\"\n", "523#3802003280", Some(150)),
        ("checksum = \"unchecked\"\n", "", None),
        ("start = []\nstop = []\n", "", None),
    ];
    for (parameters, first, silent_ms) in cases {
        let mut supervisor = BoardSupervisor::new(&cyskin(parameters, 1), &BoardsConfig::default());
        let never = |_, _, sent: &[(u64, String)]| (!sent.is_empty()).then_some(10 * MS);
        let sent = play(&mut supervisor, 0, 2_000, never);
        let Some(silent_ms) = silent_ms else {
            assert!(sent.is_empty(), "{parameters}: {sent:?}");
            continue;
        };
        assert!(sent[0].1.starts_with(first), "{parameters}: {sent:?}");
        let again = sent.iter().find(|(ms, _)| *ms > 20).map(|(ms, _)| *ms);
        assert!(again.is_some_and(|ms| ms >= silent_ms), "{parameters}: {sent:?}");
    }
}

#[test]
fn no_order_to_any_board_of_any_built_in_hand_is_of_class_7() {
    for name in Layout::builtin_names() {
        let layout = Layout::builtin(name).unwrap();
        for mode in [BoardsMode::FreeRunning, BoardsMode::Triggered] {
            let config = BoardsConfig {
                mode,
                ..BoardsConfig::default()
            };
            let mut supervisor = BoardSupervisor::new(&layout, &config);
            // `play` checks each frame.
            play(&mut supervisor, 0, 3_000, |board, now, _| {
                (board % 2 == 0).then_some(now)
            });
            supervisor.stop();
            while let Some(next) = supervisor.poll_due_ns() {
                if let Some(command) = supervisor.poll_command(next, |_| None) {
                    assert_eq!(command.mode, TxMode::Stop);
                }
            }
            assert!(supervisor.is_stopped());
        }
    }
}

/// Two buses, with one iCub board each: addresses 3 and 5.
fn icub_on_two_buses() -> Layout {
    let mut text =
        "name = \"two\"\nbuses = [\"left\", \"right\"]\nimage = { width = 5, height = 4 }\n".to_string();
    for (n, (bus, board)) in [("left", 3), ("right", 5)].into_iter().enumerate() {
        text += &format!(
            "[[module]]\nname = \"m{board}\"\npart = \"p{board}\"\nbus = \"{bus}\"\nboard = {board}\n\
             protocol = \"icub-mtb4\"\nat = [0, {}]\norder = [[0, 1, 2, 3, 4], [5, 7, 8, 9, 11]]\n",
            2 * n
        );
    }
    Layout::parse(&text, "two.toml").unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Board 5 streams on its own bus, board 3 sits on that bus too and answers questions as `kind`.
/// What is sent to the second bus for board 3, and what is found, looked at every 100 ms.
fn board_3_on_the_second_bus(kind: u8, stranger: bool) -> (Vec<String>, Vec<Vec<Finding>>) {
    let layout = icub_on_two_buses();
    let mut supervisor = BoardSupervisor::new(&layout, &BoardsConfig::default());
    let mut monitor = BusMonitor::new(&layout);
    let (mut sent, mut found) = (Vec::new(), Vec::new());
    for ms in 0..6000u64 {
        let now = ms * MS;
        monitor.advance(now);
        for bus in 0..2 {
            supervisor.allow_search(bus, !monitor.strangers(bus));
        }
        if stranger && ms % 3 == 0 {
            let frame = CanFrame::standard(0x083, &[0; 8]).unwrap();
            monitor.handle_frame(1, &Received { t_ns: now, frame });
        }
        // Until 4 s; then somebody plugs it in where it belongs, without power.
        while let Some(command) = supervisor.poll_command(now, |board| (board == 1).then_some(now)) {
            if (command.bus, command.board) != (1, 0) {
                continue;
            }
            let frame = command.frame();
            sent.push(frame.to_string());
            if frame.to_string() == "203#1C0100" && ms < 4000 {
                let answer = CanFrame::standard(0x230, &[0x1C, kind, 2, 17, 0, 1, 0, 1]).unwrap();
                let answer = Received {
                    t_ns: now,
                    frame: answer,
                };
                supervisor.handle_frame(1, &answer);
                monitor.handle_frame(1, &answer);
            }
        }
        if ms % 100 == 99 {
            found.push(monitor.findings().to_vec());
        }
    }
    supervisor.stop();
    while let Some(command) = supervisor.poll_command(7000 * MS, |_| None) {
        if (command.bus, command.board) == (1, 0) {
            sent.push(command.frame().to_string());
        }
    }
    (sent, found)
}

#[test]
fn an_icub_board_on_another_bus_is_asked_for_there_and_found_and_told_nothing_else() {
    let (sent, found) = board_3_on_the_second_bus(11, false);
    assert!(
        sent.len() > 10 && sent.iter().all(|frame| frame == "203#1C0100"),
        "{sent:?}"
    );
    let on_other_bus = vec![Finding::OnOtherBus { module: 0, bus: 1 }];
    assert!(found[20..40].iter().all(|f| *f == on_other_bus), "{found:?}");
    assert!(
        found[..3].iter().chain(&found[55..]).all(|f| f.is_empty()),
        "{found:?}"
    );

    // A board of another kind is not taken for it.
    let (_, found) = board_3_on_the_second_bus(5, false);
    assert!(found.iter().all(|f| f.is_empty()), "{found:?}");
}

#[test]
fn no_icub_board_is_asked_for_where_anything_foreign_speaks() {
    let (sent, found) = board_3_on_the_second_bus(11, true);
    assert!(
        sent.is_empty() && found.iter().all(|f| f.is_empty()),
        "{sent:?}, {found:?}"
    );
}
