//! What is said of boards by what they are: those that are never told to start, pressure arrays.

use super::{Bench, Known, MS, sentence};
use taxel_skin::{BoardState, Layout};

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
