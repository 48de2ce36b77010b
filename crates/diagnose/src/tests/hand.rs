//! Problems of buses, boards and contacts, as they come and go.

use super::*;
use crate::{Place, Severity, Starting};
use taxel_can::SourceCounters;

#[test]
fn a_board_whose_silences_are_over_before_each_look_is_unsteady_until_it_was_steady_for_a_while() {
    let mut bench = Bench::new();
    bench.pass(3000, |s| s.boards[3].silences = s.now_ns / (1500 * MS));
    assert_eq!(bench.kinds(), [""; 0], "two of three");
    bench.pass(2000, |s| s.boards[3].silences = s.now_ns / (1500 * MS));
    assert_eq!(bench.kinds(), ["board-unsteady"]);
    assert_eq!(bench.problems.current()[0].problem.modules, [3]);
    bench.pass(9000, |_| {});
    assert_eq!(bench.kinds(), ["board-unsteady"]);
    bench.pass(2000, |_| {});
    assert_eq!(bench.kinds(), [""; 0]);
}

#[test]
fn silences_of_most_boards_of_a_bus_together_are_not_the_boards() {
    let mut bench = Bench::new();
    bench.pass(20_000, |s| {
        // Five of eight, as a stalled machine is seen: some a look later than others, and one twice.
        for (n, board) in s.boards[..5].iter_mut().enumerate() {
            board.silences = (s.now_ns + n as u64 % 2 * 100 * MS) / (1500 * MS);
        }
        s.boards[0].silences *= 2;
    });
    assert_eq!(bench.kinds(), [""; 0]);
}

#[test]
fn boards_that_fall_silent_together_though_few_may_be_those_of_a_busy_machine() {
    for (boards, is_busy) in [(1, false), (3, true)] {
        let mut bench = Bench::new();
        bench.pass(9000, |s| {
            for board in &mut s.boards[..boards] {
                board.silences = s.now_ns / (1500 * MS);
            }
        });
        assert_eq!(bench.kinds(), vec!["board-unsteady"; boards]);
        for news in &bench.said {
            assert_eq!(sentence(news).contains("a busy machine"), is_busy, "{news:?}");
        }
    }
}

#[test]
fn a_board_that_never_holds_is_unsteady_and_one_of_two_that_send_as_one_is_not() {
    let mut bench = Bench::new();
    bench.pass(5000, |s| s.boards[3].silences += 1);
    assert_eq!(bench.kinds(), ["board-unsteady"]);
    let mut bench = Bench::new();
    bench.pass(5000, |s| {
        let sweeps_hz = [50.0, 25.0];
        s.findings = vec![Finding::TwoBoards { module: 3, sweeps_hz }];
        s.boards[3].silences += 1;
    });
    assert_eq!(bench.kinds(), ["two-boards-one-address"]);
}

#[test]
fn a_hub_that_falls_silent_again_and_again_is_one_board_however_many_modules_it_has() {
    let mut bench = Bench::of(two_hubs(), &["can:can0"]);
    bench.pass(9000, |s| {
        for board in &mut s.boards[..5] {
            board.silences = s.now_ns / (1500 * MS);
        }
    });
    assert_eq!(bench.kinds(), ["board-unsteady"]);
    assert_eq!(bench.problems.current()[0].problem.modules.len(), 5);
}

#[test]
fn a_bus_that_is_lost_is_told_once_and_its_boards_are_not() {
    for (link, kind) in [(LinkState::Absent, "link-absent"), (LinkState::Down, "link-down")] {
        let mut bench = Bench::new();
        bench.pass(3000, |s| {
            s.buses[0].link = link;
            for board in &mut s.boards[..8] {
                board.state = BoardState::Silent;
            }
        });
        assert_eq!(bench.kinds(), [kind]);
        assert_eq!(bench.said.len(), 1);
    }
}

#[test]
fn a_recording_that_ends_before_another_is_not_waited_for() {
    let mut bench = Bench::of(
        Layout::builtin("uskin-module").expect("built in"),
        &["log:grasp.log"],
    );
    bench.pass(3000, |s| s.buses[0].link = LinkState::Down);
    let said = bench.problems.current()[0].problem.sentence();
    assert!(
        said.contains("log:grasp.log is at its end") && !said.contains("waiting"),
        "{said}"
    );
    assert_eq!(bench.kinds(), ["recording-ended"]);
    assert_eq!(bench.problems.current()[0].problem.severity(), Severity::Warning);
}

#[test]
fn a_bus_on_which_nobody_speaks_is_one_problem_and_one_silent_board_another() {
    let mut bench = Bench::new();
    bench.pass(1000, |s| {
        for board in &mut s.boards[..8] {
            board.state = BoardState::Silent;
        }
        s.boards[9].state = BoardState::Silent;
    });
    assert_eq!(bench.kinds(), ["bus-silent", "board-silent"]);
    let problem = &bench.problems.current()[1].problem;
    assert_eq!(problem.bus(&bench.layout), Some(1));
    assert_eq!(problem.modules, [9]);
}

#[test]
fn a_bus_of_other_boards_than_the_layout_has_points_to_the_layout() {
    for (layout, starting, scan) in [
        (
            "uskin-module",
            Starting::Repeated,
            "`taxel doctor --scan --start can:can0`",
        ),
        (
            "allegro-uskin-15",
            Starting::Repeated,
            "`taxel doctor --scan --start can:can0`",
        ),
        (
            "allegro-uskin-15",
            Starting::ByOthers,
            "`taxel doctor --scan can:can0`",
        ),
        (
            "allegro-uskin-15",
            Starting::NotAllowed,
            "`taxel doctor --scan can:can0`",
        ),
    ] {
        let mut bench = Bench::of(
            Layout::builtin(layout).expect("built in"),
            &["can:can0", "can:can1"],
        );
        bench.pass(1000, |s| {
            for bus in &mut s.buses {
                bus.unknown += 100;
                bus.starting = starting;
            }
            s.boards.fill(BoardStatus::default());
        });
        assert_eq!(bench.kinds(), vec!["bus-silent"; bench.layout.buses.len()]);
        let said = sentence(&bench.said[0]);
        let layout = format!("no board of layout {layout} speaks");
        for words in [&layout, "100 frames have ids of nobody", scan] {
            assert!(said.contains(words), "{words}: {said}");
        }
        // A board that has spoken is of this layout, whoever else is on the bus.
        bench.pass(1000, |s| {
            (s.boards.iter_mut()).for_each(|board| board.state = BoardState::Silent)
        });
        let sentences = bench.problems.current().iter().map(|p| p.problem.sentence());
        sentences.for_each(|now| assert!(!now.contains("--scan"), "{now}"));
    }
}

/// A bus with a hub of five modules and one of one.
fn two_hubs() -> Layout {
    let mut text = "name = \"hubs\"\nbuses = [\"can0\"]\nimage = { width = 42, height = 1 }\n[cyskin]\n\
         ids = \"extended\"\nbyte_order = \"big\"\nchecksum = \"sum\"\nsequence_bytes_above = 5\nsensors_per_module = 12\n\
         [[cyskin.hub]]\nname = \"left\"\nbus = \"can0\"\naddress = 1\n\
         [[cyskin.hub]]\nname = \"right\"\nbus = \"can0\"\naddress = 2\n"
        .to_string();
    for n in 0..6 {
        let hub = if n < 5 { "left" } else { "right" };
        text += &format!(
            "[[module]]\nname = \"m{n}\"\npart = \"p\"\nbus = \"can0\"\nhub = \"{hub}\"\nboard = {n}\n\
             protocol = \"cyskin\"\nat = [{}, 0]\norder = [[1, 2, 3, 4, 5, 6, 7]]\n",
            7 * n
        );
    }
    Layout::parse(&text, "hubs.toml").unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_silent_hub_is_one_problem_with_its_modules_named() {
    let cases: [(&[usize], &str, &str); 4] = [
        (
            &[0, 1, 2, 3, 4],
            "hub left (can0) with all its modules (m0, m1, m2 and 2 more) is silent; ",
            "hub left (can0) with all its modules (m0, m1, m2 and 2 more) speaks (",
        ),
        (
            &[1, 3],
            "a part of hub left (can0), 2 of its 5 modules (m1, m3), is silent; ",
            "a part of hub left (can0), 2 of its 5 modules (m1, m3) speaks (",
        ),
        (
            &[2],
            "m2 (can0 hub left, board 2) is silent; ",
            "m2 (can0 hub left, board 2) speaks (",
        ),
        (
            &[5],
            "m5 (can0 hub right, board 5) is silent; ",
            "m5 (can0 hub right, board 5) speaks (",
        ),
    ];
    for (silent, came, over) in cases {
        let mut bench = Bench::of(two_hubs(), &["can:can0"]);
        bench.pass(1000, |s| {
            silent
                .iter()
                .for_each(|m| s.boards[*m].state = BoardState::Silent)
        });
        assert_eq!(bench.kinds(), ["board-silent"]);
        for module in 0..6 {
            let wanted: &[Kind] = if silent.contains(&module) {
                &[Kind::BoardSilent]
            } else {
                &[]
            };
            assert_eq!(bench.problems.kinds(Place::Module(module)), wanted, "{module}");
        }
        let names: Vec<String> = silent.iter().map(|m| format!("m{m}")).collect();
        assert_eq!(bench.problems.current()[0].problem.bus(&bench.layout), Some(0));
        assert_eq!(bench.modules(0), names);
        bench.pass(1000, |s| {
            silent
                .iter()
                .for_each(|m| s.boards[*m].state = BoardState::Streaming)
        });
        let [News::Came { sentence, .. }, News::Over { sentence: end }] = &bench.said[..] else {
            panic!("{:?}", bench.said);
        };
        assert!(sentence.starts_with(came), "{sentence}");
        let is_part = came.contains("a part") || silent == [2];
        assert_eq!(
            sentence.contains("Nothing is sent to a hub that sends"),
            is_part,
            "{sentence}"
        );
        assert!(end.starts_with(over), "{end}");
    }
}

#[test]
fn a_hub_that_sends_only_modules_of_no_layout_is_not_called_silent() {
    for (state, kind) in [
        (BoardState::Silent, "board-silent"),
        (BoardState::NeverSeen, "board-unheard"),
    ] {
        let mut bench = Bench::of(two_hubs(), &["can:can0"]);
        bench.pass(1000, |s| {
            s.boards.iter_mut().for_each(|board| board.state = state);
            s.findings = vec![Finding::ModulesNotInLayout {
                hub: 1,
                number: 9,
                modules: 2,
            }];
        });
        let said: Vec<String> = (bench.problems.current().iter())
            .map(|p| p.problem.sentence())
            .collect();
        assert_eq!(bench.kinds(), ["board-not-in-layout", kind, kind], "{said:?}");
        for (said, words) in said.iter().zip([
            "can0: hub right sends values of module 9 and 1 more, which the layout does not have on it; ",
            "check its power",
            "m5 (can0 hub right, board 5) sends no values, and its hub sends those of modules",
        ]) {
            assert!(said.contains(words), "{said}");
        }
        bench.pass(1000, |s| s.findings.clear());
        assert_eq!(bench.kinds(), ["bus-silent"]);
    }
}

#[test]
fn findings_are_told_with_their_figures_and_what_to_do() {
    let cases = [
        (
            Finding::IdBabbles {
                bus: 0,
                id: 5,
                extended: false,
                module: None,
                rate_hz: 4000.0,
                share: 0.444,
            },
            "babbling",
            ["id 005", "4000 frames/s, at least 44 %"],
        ),
        (
            Finding::TwoBoards {
                module: 3,
                sweeps_hz: [100.0, 50.0],
            },
            "two-boards-one-address",
            [
                "two boards answer as board 3 of can0",
                "(can0 board 5) is silent and probably the other one",
            ],
        ),
        (
            Finding::BusesSwapped {
                buses: [0, 1],
                module: 7,
                boards: 1,
            },
            "buses-swapped",
            ["can0 and can1 look swapped", "`source = \"can:can0\"`"],
        ),
        (
            Finding::OnOtherBus { module: 7, bus: 1 },
            "board-on-other-bus",
            ["a board of its address speaks on can1", "bus = \"can1\""],
        ),
    ];
    for (finding, kind, words) in cases {
        let mut bench = Bench::new();
        bench.pass(500, |s| {
            if kind == "two-boards-one-address" {
                s.boards[5].state = BoardState::Silent;
            }
            s.findings = vec![finding];
        });
        let said: Vec<&str> = bench.said.iter().map(sentence).collect();
        assert!(bench.kinds().contains(&kind));
        assert!(words.iter().all(|w| said[0].contains(w)), "{said:?}");
    }
}

#[test]
fn errors_on_the_bus_are_told_with_what_to_look_at() {
    type Change = fn(&mut SourceCounters);
    let cases: [(Change, &str, &str); 5] = [
        (|s| s.errors.protocol += 3, "bus-errors", "termination"),
        (|s| s.errors.no_acknowledge += 1, "no-acknowledge", "no power"),
        (
            |s| s.errors.controller_overflow += 1,
            "controller-overflow",
            "USB",
        ),
        (|s| s.lost_in_kernel += 1, "frames-lost", "receive_buffer_kib"),
        (|s| s.send_failures += 1, "cannot-send", "txqueuelen"),
    ];
    for (change, kind, word) in cases {
        let mut bench = Bench::new();
        bench.pass(2000, |s| change(&mut s.buses[0].counters));
        assert_eq!(bench.kinds(), [kind]);
        assert!(
            matches!(&bench.said[..], [News::Came { sentence, .. }] if sentence.contains(word)),
            "{:?}",
            bench.said
        );
        bench.pass(1000, |_| {});
        assert_eq!(bench.kinds(), [""; 0], "{kind} is not over");
    }
}

#[test]
fn what_is_no_frame_is_told_with_where_it_may_come_from() {
    for (source, can_fd, words) in [
        (
            "udp:239.74.163.9:43113",
            0,
            ["10 datagrams a second", "another program"],
        ),
        (
            "udp:239.74.163.9:43113",
            1,
            [
                "10 datagrams a second from udp:239.74.163.9:43113 are CAN FD frames",
                "is_fd=False",
            ],
        ),
        ("log:grasp.log", 0, ["10 lines a second", "damaged"]),
        ("log:grasp.log", 1, ["10 lines a second", "are CAN FD frames"]),
        ("can:can0", 0, ["10 frames a second", "report"]),
    ] {
        let mut bench = Bench::of(Layout::builtin("uskin-module").expect("built in"), &[source]);
        bench.pass(2000, |s| {
            s.buses[0].counters.undecodable += 1;
            s.buses[0].counters.can_fd += can_fd;
        });
        assert_eq!(bench.kinds(), ["undecodable"], "{source}");
        let said = bench.problems.current()[0].problem.sentence();
        assert!(
            words.iter().chain(&[source]).all(|word| said.contains(word)),
            "{said}"
        );
        bench.pass(1000, |_| {});
        assert_eq!(bench.kinds(), [""; 0], "{source}");
    }
}

#[test]
fn contacts_that_do_not_change_are_told_once_for_all_modules_until_they_do() {
    let mut bench = Bench::new();
    bench.pass(3000, |s| s.unchanging[17..20].fill(true));
    assert_eq!(bench.kinds(), ["contact-unchanging"]);
    assert_eq!(bench.modules(0), ["index distal"]);
    let said = sentence(&bench.said[0]);
    for words in [
        "index distal: 3 of 16",
        "without a change",
        "`taxel rezero` when nothing touches",
    ] {
        assert!(said.contains(words), "{said}");
    }
    // More of them are the same problem, in newer figures.
    bench.pass(3000, |s| s.unchanging.fill(true));
    assert_eq!(bench.said.len(), 1, "{:?}", bench.said);
    assert_eq!(bench.modules(0).len(), bench.layout.modules.len());
    let now = bench.problems.current()[0].problem.sentence();
    assert!(
        now.contains("index distal: 16 of 16") && now.contains("12 more"),
        "{now}"
    );
    bench.pass(20_000, |s| s.unchanging.fill(false));
    assert_eq!(bench.kinds(), [""; 0]);
    assert_eq!(bench.said.len(), 2, "{:?}", bench.said);
}
