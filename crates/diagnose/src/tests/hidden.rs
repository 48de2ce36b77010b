//! What nobody can know of while something else is wrong is not said to be over.

use super::joints::JointsBench;
use super::potentiometers::{line, with_potentiometers};
use super::*;
use crate::joints::test_views::{away, open, servo};
use taxel_can::BusState;

impl Bench {
    /// What was said of late, each with whether something is over.
    fn told(&mut self) -> Vec<(bool, String)> {
        let told = |news: News| (matches!(news, News::Over { .. }), sentence(&news).to_owned());
        self.said.drain(..).map(told).collect()
    }

    /// What was said to be over of late.
    fn over(&mut self) -> Vec<String> {
        let over = self.told().into_iter().filter(|(is_over, _)| *is_over);
        over.map(|(_, sentence)| sentence).collect()
    }

    fn since_ns(&self, kind: Kind) -> Vec<u64> {
        let of_kind = self.problems.current().iter().filter(|p| p.problem.kind == kind);
        of_kind.map(|p| p.since_ns).collect()
    }
}

/// The boards of the first bus, or all but the first of them, are silent; the others speak.
fn silent(known: &mut Known, layout: &Layout, but_one: bool) {
    let boards = known.boards.iter_mut().zip(&layout.wiring);
    for (n, (board, _)) in boards.filter(|(_, wiring)| wiring.bus == 0).enumerate() {
        board.state = if but_one && n == 0 {
            BoardState::Streaming
        } else {
            BoardState::Silent
        };
    }
}

#[test]
fn a_silent_board_does_not_speak_when_its_bus_falls_silent_or_is_lost_too() {
    type Lose = fn(&mut Known, bool);
    let lose: [(&str, Lose); 3] = [
        ("bus-silent", |s, lost| {
            silent(s, &Layout::builtin("allegro-uskin-15").expect("built in"), !lost)
        }),
        ("link-down", |s, lost| {
            s.buses[0].link = if lost { LinkState::Down } else { LinkState::Up }
        }),
        ("bus-off", |s, lost| {
            s.buses[0].counters.bus_state = if lost {
                BusState::BusOff
            } else {
                BusState::ErrorActive
            };
        }),
    ];
    for (kind, lose) in lose {
        let mut bench = Bench::new();
        let layout = bench.layout.clone();
        bench.pass(1000, |s| silent(s, &layout, true));
        let (since_ns, silent_boards) = (bench.since_ns(Kind::BoardSilent), bench.kinds().len());
        assert_eq!(
            (bench.told().len(), since_ns.len()),
            (silent_boards, silent_boards)
        );

        bench.pass(3000, |s| lose(s, true));
        assert_eq!(bench.kinds(), [kind]);
        assert!(matches!(&bench.told()[..], [(false, _)]), "{kind}");
        // What is back says nothing of the boards that are still silent, and they were so all the time.
        bench.pass(3000, |s| lose(s, false));
        assert_eq!(bench.over().len(), 1, "{kind}");
        assert_eq!(bench.since_ns(Kind::BoardSilent), since_ns, "{kind}");

        bench.pass(3000, |s| lose(s, true));
        bench.pass(3000, |s| {
            lose(s, false);
            s.boards
                .iter_mut()
                .for_each(|board| board.state = BoardState::Streaming);
        });
        let over = bench.over();
        assert_eq!(bench.kinds(), [""; 0], "{kind}");
        let speak = over
            .iter()
            .filter(|said| said.contains(" speaks (after 1"))
            .count();
        assert_eq!(
            (speak, over.len()),
            (silent_boards, silent_boards + 1),
            "{kind}: {over:#?}"
        );
    }
}

#[test]
fn a_board_that_is_found_elsewhere_or_cannot_be_read_does_not_speak_again() {
    type Change = fn(&mut Known);
    let (swapped, moved) = (
        Finding::BusesSwapped {
            buses: [0, 1],
            module: 1,
            boards: 2,
        },
        Finding::OnOtherBus { module: 1, bus: 1 },
    );
    let one: Change = |s| s.boards[1].state = BoardState::Silent;
    let bus: Change = |s| silent(s, &Layout::builtin("allegro-uskin-15").expect("built in"), false);
    for (before, change, finding, kind) in [
        ("board-silent", one, Some(swapped), "buses-swapped"),
        ("bus-silent", bus, Some(swapped), "buses-swapped"),
        ("board-silent", one, Some(moved), "board-on-other-bus"),
        ("bus-silent", bus, None, "board-malformed"),
    ] {
        let mut bench = Bench::new();
        let of_bus: Vec<usize> = (0..bench.layout.wiring.len())
            .filter(|m| bench.layout.wiring[*m].bus == 0)
            .collect();
        bench.pass(1500, change);
        assert_eq!(bench.kinds(), [before]);
        bench.told();
        bench.pass(1500, |s| match &finding {
            Some(finding) => s.findings = vec![*finding],
            None => of_bus.iter().for_each(|m| {
                s.boards[*m].state = BoardState::Streaming;
                s.boards[*m].malformed += 20;
            }),
        });
        // What is wrong instead is told by the monitor; here the board that is elsewhere is not silent any more.
        bench.pass(3000, |s| {
            s.boards
                .iter_mut()
                .for_each(|board| board.state = BoardState::Streaming);
            if finding.is_none() {
                of_bus.iter().for_each(|m| s.boards[*m].malformed += 20);
            }
        });
        assert_eq!(bench.kinds(), [kind], "{before}");
        assert_eq!(bench.over(), [""; 0], "{before}, {kind}");
        bench.pass(4000, |s| s.findings.clear());
        let over = bench.over();
        assert!(
            over.iter().any(|said| said.contains("speak")),
            "{before}, {kind}: {over:?}"
        );
    }
}

#[test]
fn no_servo_answers_again_when_all_fall_silent_or_their_port_is_gone() {
    type Change = fn(&mut JointsView);
    let lose: [(&str, Change, Change); 2] = [
        (
            "servos-silent",
            |v| (0..4).for_each(|joint| servo(v, joint).alive = false),
            |v| {
                (0..4).for_each(|joint| servo(v, joint).alive = true);
            },
        ),
        ("serial-absent", away, |v| {
            open(v, "/dev/ttyUSB0", 1);
            (0..4).for_each(|joint| servo(v, joint).alive = true);
        }),
    ];
    // What is wrong with the second servo, look by look.
    let wrong: [(&str, Change); 5] = [
        ("servo-silent", |v| servo(v, 1).alive = false),
        ("servo-damaged", |v| servo(v, 1).counters.bad_crc += 3),
        ("servo-late", |v| servo(v, 1).counters.late += 3),
        ("two-servos-one-id", |v| servo(v, 1).counters.double += 1),
        ("servo-refuses", |v| servo(v, 1).counters.refused += 3),
    ];
    for (kind, lose, find) in lose {
        for (own, change) in wrong {
            let what = format!("{own}, {kind}");
            let mut bench = JointsBench::answering(4);
            bench.pass(1500, change);
            assert_eq!(bench.bench.kinds(), [own], "{what}");
            let since = bench.bench.problems.current()[0].since_ns;
            bench.bench.told();
            bench.pass(2000, lose);
            assert_eq!(bench.bench.kinds(), [kind], "{what}");
            assert!(matches!(&bench.bench.told()[..], [(false, _)]), "{what}");
            // It is still so, and is over at last.
            find(&mut bench.view);
            bench.pass(3000, change);
            let told = bench.bench.told();
            assert!(matches!(&told[..], [(true, _)]), "{what}: {told:#?}");
            assert_eq!(bench.bench.kinds(), [own], "{what}");
            assert_eq!(bench.bench.problems.current()[0].since_ns, since, "{what}");
            servo(&mut bench.view, 1).alive = true;
            bench.pass(3000, |_| {});
            assert_eq!(
                (bench.bench.over().len(), bench.bench.kinds().len()),
                (1, 0),
                "{what}"
            );
        }
    }
}

#[test]
fn the_answers_of_a_servo_that_falls_silent_are_not_whole() {
    let mut bench = JointsBench::answering(4);
    bench.pass(1500, |view| servo(view, 1).counters.bad_crc += 3);
    bench.bench.told();
    bench.pass(2000, |view| servo(view, 1).alive = false);
    assert_eq!(bench.bench.over(), [""; 0]);
    bench.pass(2000, |view| servo(view, 1).alive = true);
    assert_eq!(bench.bench.over().len(), 2);
}

#[test]
fn lines_of_potentiometers_that_could_never_be_read_are_not_readable_when_nothing_else_comes() {
    let mut bench = with_potentiometers();
    bench.pass(500, line);
    bench.pass(5000, |view| {
        view.analogue.as_mut().expect("potentiometers").counters.malformed += 5;
    });
    assert_eq!(bench.bench.kinds(), ["analogue-silent"]);
    let told = bench.bench.told();
    assert!(
        told.iter().all(|(is_over, _)| !is_over) && told.len() == 2,
        "{told:#?}"
    );
    bench.pass(2000, line);
    assert_eq!((bench.bench.over().len(), bench.bench.kinds().len()), (2, 0));
}

#[test]
fn frames_of_a_board_that_could_never_be_read_are_not_readable_when_it_falls_silent() {
    let mut bench = Bench::new();
    bench.pass(1000, |s| {
        s.boards[3].state = BoardState::NeverSeen;
        s.boards[3].malformed += 20;
    });
    assert_eq!(bench.kinds(), ["board-malformed"]);
    bench.pass(3000, |_| {});
    assert_eq!(bench.kinds(), ["board-unheard"]);
    bench.pass(1000, |s| s.boards[3].malformed += 20);
    assert_eq!(bench.kinds(), ["board-malformed"]);
    assert_eq!(bench.over(), [""; 0]);
    bench.pass(3000, |s| s.boards[3].state = BoardState::Streaming);
    assert_eq!((bench.over().len(), bench.kinds().len()), (2, 0));
}
