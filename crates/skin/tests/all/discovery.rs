//! Who is on the bus: asked only where nobody streams.

use taxel_can::{CanFrame, Received};
use taxel_skin::{
    BoardKind, BoardSupervisor, BoardsConfig, BoardsMode, Discovery, Firmware, FoundBoard, Layout, Protocol,
};

const MS: u64 = 1_000_000;

fn frame(id: u16, data: &[u8]) -> CanFrame {
    CanFrame::standard(id, data).unwrap()
}

/// Runs a discovery against `bus`, which sees each frame that is sent and gives the frames that
/// come back. Returns what was sent.
fn run<T>(
    discovery: &mut Discovery<T>,
    mut answers: impl FnMut(u8, &str) -> Vec<CanFrame>,
    mut noise: impl FnMut(u64) -> Option<(u8, CanFrame)>,
) -> Vec<(u64, u8, String)> {
    let mut sent = Vec::new();
    let mut now = 0;
    for _ in 0..100_000 {
        let Some(next) = discovery.poll_due_ns() else {
            return sent;
        };
        // Time goes on by at most a millisecond, so that noise gets its chance.
        now = next.min(now + MS).max(now);
        if let Some((bus, frame)) = noise(now) {
            discovery.handle_frame(bus, &Received { t_ns: now, frame });
        }
        while let Some(command) = discovery.poll_command(now) {
            let text = command.frame.to_string();
            for answer in answers(command.bus, &text) {
                let t_ns = now + MS / 2;
                discovery.handle_frame(command.bus, &Received { t_ns, frame: answer });
            }
            sent.push((now / MS, command.bus, text));
        }
    }
    panic!("a discovery ends");
}

fn supervisor(layout: &Layout) -> BoardSupervisor {
    BoardSupervisor::new(layout, &BoardsConfig::default())
}

#[test]
fn boards_are_silenced_then_asked_and_reported_with_type_and_firmware() {
    let layout = Layout::builtin("uskin-fingertip").unwrap();
    let mut discovery = supervisor(&layout).discover(&layout).unwrap();
    let sent = run(
        &mut discovery,
        |_, text| match text {
            "70F#FF" => vec![
                frame(0x740, &[0xFF, 5, 2, 17, 0]),
                // An MTB4 in its bootloader, and a board of another kind that the layout does not have.
                frame(0x750, &[0xFF, 11, 3, 1]),
                frame(0x790, &[0xFF, 6, 1, 2, 3]),
                // What is no answer: another host's, too long, a taxel.
                frame(0x741, &[0xFF, 5, 9, 9, 9]),
                frame(0x760, &[0xFF, 5, 2, 17, 0, 0]),
                frame(0x710, &[0xFF; 8]),
            ],
            "204#1C0100" => vec![frame(0x240, &[0x1C, 5, 2, 17, 4, 1, 0, 1])],
            _ => vec![],
        },
        |_| None,
    );
    let texts: Vec<&str> = sent.iter().map(|(_, _, text)| text.as_str()).collect();
    assert_eq!(
        texts,
        ["204#0701", "205#0701", "70F#FF", "204#1C0100", "209#1C0100"]
    );
    assert!(sent[2].0 - sent[1].0 >= 250, "{sent:?}");
    let (report, mut supervisor) = discovery.finish();
    let board = |address, kind, firmware: [u8; 2], build, in_bootloader, module| FoundBoard {
        bus: 0,
        address,
        kind,
        firmware: Firmware {
            major: firmware[0],
            minor: firmware[1],
            build,
        },
        in_bootloader,
        protocol_version: None,
        answers: 1,
        module,
    };
    assert_eq!(
        report.boards,
        [
            FoundBoard {
                protocol_version: Some([1, 0]),
                ..board(4, BoardKind::Mtb3, [2, 17], Some(4), false, Some(0))
            },
            board(5, BoardKind::Mtb4, [3, 1], None, true, Some(1)),
            board(9, BoardKind::Other(6), [1, 2], Some(3), false, None),
        ]
    );
    assert!(report.missing.is_empty() && report.busy.is_empty());
    let mismatches: Vec<(u16, Protocol)> = report.mismatches(&layout).map(|(m, p, _)| (m, p)).collect();
    assert_eq!(
        mismatches,
        [(1, Protocol::USKIN_L2)],
        "an MTB4 has no uSkin firmware"
    );
    assert_eq!(
        supervisor
            .poll_command(10_000 * MS, |_| None)
            .unwrap()
            .frame()
            .to_string(),
        "204#0700"
    );
}

#[test]
fn a_bus_on_which_boards_stream_is_not_asked() {
    let layout = Layout::builtin("allegro-uskin-15").unwrap();
    let mut discovery = supervisor(&layout).discover(&layout).unwrap();
    // Bus 1 goes on sending, whatever it is told; bus 0 falls silent after 300 ms.
    let sent = run(
        &mut discovery,
        |bus, text| match (bus, text) {
            (0, "70F#FF") => vec![frame(0x700, &[0xFF, 5, 2, 17, 0])],
            _ => vec![],
        },
        |now| match now / MS % 10 {
            0 => Some((1, frame(0x133, &[0x82; 8]))),
            5 if now < 300 * MS => Some((0, frame(0x010, &[0x82; 8]))),
            _ => None,
        },
    );
    let class_7: Vec<(u64, u8)> = sent
        .iter()
        .filter(|(_, _, t)| t.starts_with('7'))
        .map(|(t, b, _)| (*t, *b))
        .collect();
    assert_eq!(class_7.len(), 1, "{class_7:?}");
    assert!(class_7[0].0 >= 540 && class_7[0].1 == 0, "{class_7:?}");
    let (report, _) = discovery.finish();
    assert_eq!(
        report.busy.iter().map(|b| (b.bus, b.id)).collect::<Vec<_>>(),
        [(1, 0x133)]
    );
    assert_eq!(
        report.missing,
        [1, 2, 3, 4, 5, 6, 7],
        "boards of a busy bus are not called missing"
    );
}

#[test]
fn two_boards_with_one_address_answer_twice() {
    let mut discovery = Discovery::scan(1);
    let answer = frame(0x750, &[0xFF, 5, 2, 17, 0]);
    run(
        &mut discovery,
        |_, text| if text == "70F#FF" { vec![answer; 2] } else { vec![] },
        |_| None,
    );
    let (report, ()) = discovery.finish();
    assert_eq!(report.boards[0].answers, 2);
    assert_eq!(report.boards[0].module, None);
}

#[test]
fn a_scan_stops_nobody() {
    let mut discovery = Discovery::scan(2);
    let sent = run(
        &mut discovery,
        |_, _| vec![],
        |now| Some((1, frame(0x410, &[now as u8; 8]))),
    );
    let texts: Vec<(u8, &str)> = sent.iter().map(|(_, bus, text)| (*bus, text.as_str())).collect();
    assert_eq!(texts, [(0, "70F#FF")]);
}

#[test]
fn a_scan_asks_nobody_where_something_speaks_once_a_second() {
    let mut discovery = Discovery::scan(1);
    let sent = run(
        &mut discovery,
        |_, _| vec![],
        |now| (now % (1_000 * MS) == 100 * MS).then(|| (0, frame(0x701, &[5]))),
    );
    assert_eq!(sent, []);
    let busy = discovery.finish().0.busy;
    assert_eq!(
        busy.iter().map(|b| (b.bus, b.id)).collect::<Vec<_>>(),
        [(0, 0x701)]
    );
}

#[test]
fn a_supervisor_that_has_spoken_is_not_given_to_a_discovery() {
    let layout = crate::support::icub("icub-mtb3", "");
    let mut started = supervisor(&layout);
    started.poll_command(0, |_| None).unwrap();
    let refused = started.discover(&layout).unwrap_err();
    assert!(refused.to_string().contains("discover first"));
    let mut back = *refused.0;
    assert!(
        back.poll_command(20 * MS, |_| None).is_some(),
        "it goes on where it was"
    );
}

#[test]
fn where_there_is_nobody_to_ask_nothing_is_sent() {
    let passive = BoardsConfig {
        mode: BoardsMode::Passive,
        ..BoardsConfig::default()
    };
    let cases = [
        (Layout::builtin("allegro-uskin-15").unwrap(), passive),
        (
            Layout::builtin("allegro-xela-18").unwrap(),
            BoardsConfig::default(),
        ),
        (Layout::builtin("schunk-sdh").unwrap(), BoardsConfig::default()),
    ];
    for (layout, config) in cases {
        let mut discovery = BoardSupervisor::new(&layout, &config).discover(&layout).unwrap();
        assert!(discovery.is_done());
        assert_eq!(discovery.poll_command(0), None);
        assert_eq!(discovery.finish().0, Default::default());
    }
}
