//! What is said of boards by what they are: those that are never told to start, pressure arrays.

use super::{Bench, Known, MS, sentence};
use taxel_skin::{BoardState, BoardStatus, Layout};

#[test]
fn only_of_boards_that_are_told_to_start_it_is_said() {
    let sources = ["can:can0", "can:can1", "can:can2", "can:can3", "can:can4"];
    for (layout, is_told) in [("allegro-uskin-15", true), ("allegro-xela-18", false)] {
        let layout = Layout::builtin(layout).expect("built in");
        let sources = &sources[..layout.buses.len()];
        let boards = layout.modules.len();
        for silent in [1, boards] {
            let mut bench = Bench::of(layout.clone(), sources);
            bench.pass(1000, |s| {
                for board in &mut s.boards[..silent] {
                    board.state = BoardState::Silent;
                }
            });
            let said: Vec<&str> = bench.said.iter().map(sentence).collect();
            assert!(!said.is_empty());
            for said in said {
                assert_eq!(said.contains("told to start again and again"), is_told, "{said}");
                assert_eq!(said.contains("from power-up on"), !is_told, "{said}");
            }
        }
    }
}

#[test]
fn of_boards_that_are_not_in_a_recording_nothing_is_said_to_be_done() {
    let module = || Layout::builtin("uskin-module").expect("built in");
    let hand = || Layout::builtin("allegro-uskin-15").expect("built in");
    let (one, two) = (&["log:a.log"][..], &["log:a.log", "log:b.log"]);
    for (layout, sources, boards, state, words) in [
        (module(), one, 1, BoardState::NeverSeen, "is not in log:a.log"),
        (hand(), two, 1, BoardState::NeverSeen, "is not in log:a.log"),
        (hand(), two, 1, BoardState::Silent, "is silent in log:a.log"),
        (hand(), two, 8, BoardState::NeverSeen, "what is in log:a.log"),
    ] {
        let mut bench = Bench::of(layout, sources);
        bench.pass(1000, |s| {
            for board in &mut s.boards[..boards] {
                board.state = state;
            }
        });
        let said: Vec<&str> = bench.said.iter().map(sentence).collect();
        assert_eq!(said.len(), 1, "{said:#?}");
        let is_told = |words| said[0].contains(words);
        assert!(
            is_told(words) && !is_told("start") && !is_told("power"),
            "{said:#?}"
        );
    }
}

#[test]
fn of_an_unsteady_pressure_array_its_program_is_named_and_no_supply() {
    let text = "name = \"t\"\nbuses = [\"mat\"]\nimage = { width = 5, height = 3 }\n[[module]]\nname = \"mat\"\n\
        part = \"p\"\nbus = \"mat\"\nprotocol = \"pressure-array\"\nrows = 3\ncolumns = 5\nat = [0, 0]\n";
    let layout = Layout::parse(text, "t.toml").unwrap_or_else(|e| panic!("{e}"));
    let mut bench = Bench::of(layout, &["pressure:/run/mat.sock"]);
    bench.pass(9000, |s| s.boards[0].silences = s.now_ns / (1500 * MS));
    assert_eq!(bench.kinds(), ["board-unsteady"]);
    let said = sentence(&bench.said[0]);
    assert!(
        said.contains("the program of its sensor") && !said.contains("supply"),
        "{said}"
    );
}

#[test]
fn what_a_daemon_that_was_stopped_has_not_heard_is_no_silence_and_what_it_does_not_hear_then_is() {
    const STOPPED_NS: u64 = 5000 * MS;
    let of_one_board = "name = \"t\"\nbuses = [\"can0\"]\nimage = { width = 4, height = 4 }\n[[module]]\nname = \"pad\"\n\
        part = \"p\"\nbus = \"can0\"\nboard = 0\nprotocol = \"uskin-l2\"\nat = [0, 0]\n";
    let of_one_board = Layout::parse(of_one_board, "t.toml").unwrap_or_else(|e| panic!("{e}"));
    let of_a_hand = Layout::builtin("allegro-uskin-15").expect("built in");
    for (layout, sources) in [
        (of_one_board, &["can:can0"][..]),
        (of_a_hand, &["can:can0", "can:can1"]),
    ] {
        let buses = layout.buses.len();
        let mut bench = Bench::of(layout, &sources[..buses]);
        let speaks = |s: &mut Known| {
            for board in &mut s.boards {
                (board.state, board.last_ns) = (BoardState::Streaming, Some(s.now_ns));
            }
        };
        let is_silent = |s: &mut Known| {
            for board in &mut s.boards {
                board.silences += u64::from(board.state == BoardState::Streaming);
                board.state = BoardState::Silent;
            }
        };
        // The kernel has kept the oldest frames, those of just after the stop. Boards that fall silent so often by
        // themselves would be unsteady.
        for _ in 0..4 {
            bench.pass(1000, speaks);
            bench.known.now_ns += STOPPED_NS;
            bench.pass(100, is_silent);
            bench.pass(1000, speaks);
        }
        assert_eq!(bench.said, []);
        bench.known.now_ns += STOPPED_NS;
        bench.pass(100, is_silent);
        assert_eq!(bench.said, []);
        bench.pass(100, is_silent);
        assert_eq!(bench.kinds().len(), buses);
    }
}

#[test]
fn frames_of_an_array_that_are_stale_when_they_come_are_late_and_have_not_stopped() {
    let text = "name = \"t\"\nbuses = [\"mat\"]\nimage = { width = 5, height = 3 }\n[[module]]\nname = \"mat\"\n\
        part = \"p\"\nbus = \"mat\"\nprotocol = \"pressure-array\"\nrows = 3\ncolumns = 5\nat = [0, 0]\n";
    // How late, and how long after the look before; 50 a second are stale after 60 ms.
    for (age_ms, words) in [
        (30, None),
        (70, Some("come 70 ms after")),
        (1200, Some("come 1200 ms after")),
    ] {
        let layout = Layout::parse(text, "t.toml").unwrap_or_else(|e| panic!("{e}"));
        let mut bench = Bench::of(layout, &["pressure:/run/mat.sock"]);
        bench.pass(9000, |s| {
            let array = &mut s.buses[0].counters.array;
            array.taken += 5;
            array.timed += 5;
            array.aged_ns += 5 * age_ms * MS;
            array.late += 5 * u64::from(age_ms > 250);
            let board = &mut s.boards[0];
            board.period_ns = Some(20 * MS);
            if age_ms > 60 {
                board.silences = s.now_ns / (1500 * MS);
                (board.state, board.last_ns) =
                    (BoardState::Silent, Some(s.now_ns.saturating_sub(age_ms * MS)));
            }
        });
        let said: Vec<&str> = bench.said.iter().map(sentence).collect();
        assert_eq!(said.len(), usize::from(words.is_some()), "{said:#?}");
        for said in said {
            let is_told = words.is_some_and(|words| said.contains(words));
            assert!(
                is_told && said.contains("stale after 60 ms") && said.contains("`stale_after_ms`"),
                "{said}"
            );
        }
    }
}

#[test]
fn frames_of_an_array_that_begin_to_come_late_are_told_with_the_age_that_they_have_then() {
    let text = "name = \"t\"\nbuses = [\"mat\"]\nimage = { width = 5, height = 3 }\n[[module]]\nname = \"mat\"\n\
        part = \"p\"\nbus = \"mat\"\nprotocol = \"pressure-array\"\nrows = 3\ncolumns = 5\nat = [0, 0]\n";
    let layout = Layout::parse(text, "t.toml").unwrap_or_else(|e| panic!("{e}"));
    let mut bench = Bench::of(layout, &["pressure:/run/mat.sock"]);
    for age_ms in [10, 100] {
        bench.pass(1000, |s| {
            let array = &mut s.buses[0].counters.array;
            array.timed += 5;
            array.aged_ns += 5 * age_ms * MS;
            array.newest_age_ns = age_ms * MS;
            s.boards[0].period_ns = Some(20 * MS);
        });
    }
    assert_eq!(bench.said.len(), 1);
    let said = sentence(&bench.said[0]);
    assert!(said.contains("come 100 ms after"), "{said}");
}

#[test]
fn a_board_whose_frames_cannot_be_read_is_told_so_and_not_as_silent() {
    type Wrong = fn(&mut Known);
    // Per look of 100 ms, where 80 readings are due.
    let cases: [(&str, Wrong, &[&str]); 6] = [
        (
            "never read",
            |s| unread(s, 3, 80, BoardState::NeverSeen),
            &["board-malformed"],
        ),
        (
            "no longer read",
            |s| unread(s, 3, 80, BoardState::Silent),
            &["board-malformed"],
        ),
        (
            "half of its frames",
            |s| {
                unread(s, 3, 40, BoardState::Streaming);
                s.boards[3].used += 40;
            },
            &["board-malformed"],
        ),
        (
            "one frame in forty",
            |s| {
                unread(s, 3, 2, BoardState::Streaming);
                s.boards[3].used += 78;
            },
            &[],
        ),
        (
            "one frame of a board that is silent",
            |s| unread(s, 3, u64::from(s.now_ns == 1500 * MS), BoardState::Silent),
            &["board-silent"],
        ),
        (
            "a whole bus",
            |s| (0..8).for_each(|m| unread(s, m, 80, BoardState::NeverSeen)),
            &["board-malformed"],
        ),
    ];
    for (what, wrong, kinds) in cases {
        let mut bench = Bench::new();
        bench.pass(2000, wrong);
        assert_eq!(bench.kinds(), kinds, "{what}");
        for said in bench.said.iter().map(sentence) {
            let is_silent = kinds[0] == "board-silent";
            assert_eq!(
                said.contains("are none of uskin-l2"),
                !is_silent,
                "{what}: {said}"
            );
            assert_eq!(said.contains("power"), is_silent, "{what}: {said}");
        }
    }
    let mut bench = Bench::new();
    bench.pass(2000, |s| unread(s, 3, 80, BoardState::NeverSeen));
    let said = sentence(&bench.said[0]);
    assert!(
        said.starts_with("index proximal (can0 board 3): ")
            && said.contains(" frames a second have its ids")
            && said.contains("`taxel doctor --scan can:can0`"),
        "{said}"
    );
    // A few that are damaged from then on, of a board that is read, are no reason to go on with it.
    bench.pass(2000, |s| {
        unread(s, 3, 2, BoardState::Streaming);
        s.boards[3].used += 78;
    });
    assert!(sentence(bench.said.last().unwrap()).contains("its frames can be read"));
}

#[test]
fn a_board_that_dies_beside_a_few_frames_of_somebody_else_is_silent_and_not_unread() {
    // A few of a board's frames a second; a burst of them makes a board unread before it dies.
    for burst in [false, true] {
        let mut bench = Bench::new();
        let mut looks = 0;
        let mut few = |s: &mut Known, state| {
            looks += 1;
            unread(s, 3, looks % 2, state);
        };
        bench.pass(1000, |s| {
            few(s, BoardState::Streaming);
            s.boards[3].period_ns = Some(20 * MS);
            s.boards[3].used += 80;
            s.boards[3].malformed += if burst { 80 } else { 0 };
        });
        assert_eq!(bench.kinds(), &["board-malformed"][..usize::from(burst)]);
        bench.pass(2000, |s| few(s, BoardState::Silent));
        assert_eq!(bench.kinds(), ["board-silent"], "{burst}");
    }
}

#[test]
fn a_bus_on_which_about_a_fifth_of_all_frames_is_damaged_is_told_of_once_and_not_as_of_another_protocol() {
    let mut bench = Bench::new();
    let mut looks = 0;
    bench.pass(5000, |s| {
        looks += 1;
        for m in 0..8 {
            // Some boards are above a fifth at each look, and others below it.
            let damaged = 10 + (7 * m as u64 + looks / 8) % 10;
            unread(s, m, damaged, BoardState::Streaming);
            s.boards[m].used += 80 - damaged;
        }
    });
    let said: Vec<_> = bench.said.iter().map(sentence).collect();
    assert_eq!(said.len(), 1, "{said:#?}");
    assert!(
        said[0].starts_with("can0: ") && said[0].contains(" % of what comes"),
        "{said:?}"
    );
    assert!(
        said[0].contains("termination") && !said[0].contains("`protocol`"),
        "{said:?}"
    );
}

/// A board sends frames that cannot be read.
fn unread(known: &mut Known, module: usize, frames: u64, state: BoardState) {
    known.boards[module].malformed += frames;
    known.boards[module].state = state;
}

/// Two buses with a fast board and two slow ones each, the fast one first.
fn fast_and_slow() -> Layout {
    let mut text =
        "name = \"t\"\nimage = { width = 12, height = 8 }\nbuses = [\"can0\", \"can1\"]\n".to_string();
    for (bus, y) in [("can0", 0), ("can1", 4)] {
        for board in 0..3 {
            let protocol = ["uskin-l2", "icub-mtb3", "icub-mtb3"][board];
            text += &format!(
                "[[module]]\nname = \"{bus} m{board}\"\npart = \"p\"\nbus = \"{bus}\"\nboard = {}\n\
                 protocol = \"{protocol}\"\nat = [{}, {y}]\n{}",
                board + 6,
                4 * board,
                ["", "order = [[0, 1, 2, 3]]\n"][board.min(1)],
            );
        }
    }
    Layout::parse(&text, "t.toml").unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_silence_that_slow_boards_do_not_notice_is_compared_with_that_of_fast_ones() {
    // The modules that fall silent together, for how long, those that are told to be unsteady, and whether others are named.
    type Case = (&'static str, &'static [usize], u64, &'static [usize], bool);
    let cases: [Case; 6] = [
        ("the hand stands still", &[0, 3], 45, &[], false),
        ("for longer", &[0, 1, 2, 3, 4, 5], 300, &[], false),
        ("a bus of two is lost", &[3, 4, 5], 2000, &[], false),
        ("a fast board has a loose plug", &[3], 45, &[3], false),
        ("a slow one has", &[4], 2000, &[4], false),
        ("two fast ones reboot", &[0, 3], 2000, &[0, 3], true),
    ];
    for (what, fallen, lasts_ms, unsteady, with_others) in cases {
        let mut bench = Bench::of(fast_and_slow(), &["can:can0", "can:can1"]);
        bench.pass(9000, |s| {
            for (module, board) in s.boards.iter_mut().enumerate() {
                board.period_ns = Some([10, 50, 50][module % 3] * MS);
                if fallen.contains(&module) {
                    board.silences = s.now_ns / (1500 * MS);
                    board.silence_ns = lasts_ms * MS;
                }
            }
        });
        let told: Vec<usize> = (bench.problems.current().iter())
            .map(|now| now.problem.modules[0])
            .collect();
        assert_eq!(told, unsteady, "{what}: {:#?}", bench.said);
        assert_eq!(bench.kinds(), vec!["board-unsteady"; told.len()]);
        for said in bench.said.iter().map(sentence) {
            assert_eq!(
                said.contains("Others fell silent at the same moment"),
                with_others,
                "{said}"
            );
        }
    }
}

#[test]
fn boards_that_do_not_speak_do_not_go_on_where_all_others_fall_silent() {
    let mut bench = Bench::new();
    bench.pass(9000, |s| {
        s.boards[4..8].fill(BoardStatus::default());
        for board in &mut s.boards[..4] {
            board.silences = s.now_ns / (1500 * MS);
        }
    });
    assert_eq!(bench.kinds(), ["board-unheard"; 4]);
}

#[test]
fn a_module_without_a_board_is_no_board_that_is_silent() {
    let text = "name = \"mix\"\nimage = { width = 8, height = 4 }\nbuses = [\"can0\"]\n\
        [[module]]\nname = \"b\"\npart = \"p\"\nprotocol = \"offline\"\nat = [4, 0]\norder = [[0, 1], [2, 3]]\n\
        [[module]]\nname = \"a\"\npart = \"p\"\nbus = \"can0\"\nboard = 1\nprotocol = \"uskin-l1\"\nat = [0, 0]\n";
    let mut bench = Bench::of(Layout::parse(text, "mix.toml").unwrap(), &["can:can0"]);
    bench.pass(1000, |s| s.boards[0].state = BoardState::NeverSeen);
    assert_eq!(bench.kinds(), [""; 0]);
    bench.pass(1000, |s| s.boards[1].state = BoardState::NeverSeen);
    assert_eq!(bench.kinds(), ["board-unheard"], "not as one bus of two boards");
    assert_eq!(bench.modules(0), ["a"]);
}
