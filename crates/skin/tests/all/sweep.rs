//! When a tactile frame is complete, late or due, and what is fresh in it.

use crate::support::boards_on_a_bus as layout;
use taxel_hand::{Freshness, TactileFrame};
use taxel_skin::{BoardState, Push, SweepAssembler, SweepConfig, TaxelReading};

const MS: u64 = 1_000_000;
/// Not zero, as a monotonic clock never is.
const START: u64 = 5_000 * MS;

/// Boards with a period of 10 ms whose first readings count.
fn unsettled() -> SweepConfig {
    SweepConfig {
        board_period_ms: Some(10.0),
        settle_ms: 0.0,
        ..SweepConfig::default()
    }
}

fn reading(taxel: u16, value: u16) -> TaxelReading {
    TaxelReading {
        taxel,
        counts: [value, value + 1, value + 2],
        status: 0x82,
    }
}

struct Bench {
    assembler: SweepAssembler,
    frame: TactileFrame,
}

impl Bench {
    fn new(boards: usize, config: &SweepConfig, sweep_mode: bool) -> Self {
        let layout = layout(boards);
        Self {
            assembler: SweepAssembler::new(&layout, config, sweep_mode),
            frame: TactileFrame::new(layout.len()),
        }
    }

    fn push(&mut self, taxel: u16, t_ns: u64) -> Push {
        self.assembler.push(&reading(taxel, (t_ns / MS) as u16), t_ns)
    }

    fn push_all(&mut self, taxels: impl IntoIterator<Item = u16>, t_ns: u64) -> Vec<Push> {
        taxels.into_iter().map(|taxel| self.push(taxel, t_ns)).collect()
    }

    fn take(&mut self, now_ns: u64) -> &TactileFrame {
        self.assembler.take(now_ns, &mut self.frame);
        &self.frame
    }

    fn freshness(&self, freshness: Freshness) -> Vec<usize> {
        (0..self.frame.freshness.len())
            .filter(|i| self.frame.freshness[*i] == freshness)
            .collect()
    }
}

#[test]
fn a_sweep_is_complete_when_every_taxel_came_in_whatever_order() {
    // A permutation of 0..32, in which the boards and their lines are well mixed.
    let order: Vec<u16> = (0..32).map(|i| (i * 11 + 5) % 32).collect();
    let mut bench = Bench::new(2, &unsettled(), true);
    for sweep in 0..3 {
        let start = START + sweep * 10 * MS;
        for (i, &taxel) in order.iter().enumerate() {
            assert!(
                !bench.assembler.is_complete(),
                "sweep {sweep}, before reading {i}"
            );
            assert_eq!(bench.push(taxel, start + i as u64 * 1000), Push::Used);
        }
        assert!(bench.assembler.is_complete());
        let frame = bench.take(start + 40_000);
        assert_eq!(
            (frame.seq, frame.t_ns, frame.missing()),
            (sweep, start + 31_000, 0)
        );
        for (i, &taxel) in order.iter().enumerate() {
            let value = ((start + i as u64 * 1000) / MS) as u16;
            assert_eq!(frame.counts[taxel as usize], [value, value + 1, value + 2]);
            assert_eq!(frame.age_ns[taxel as usize], (31 - i as u64) * 1000);
            assert_eq!(frame.status[taxel as usize], 0x82);
        }
        assert!(!bench.assembler.is_complete());
        assert_eq!(bench.assembler.deadline_ns(), None);
    }
    for board in 0..2 {
        let counters = bench.assembler.board(board);
        assert_eq!((counters.used, counters.missed, counters.sweeps), (48, 0, 2));
    }
}

#[test]
fn a_value_that_was_not_renewed_is_stale_and_one_that_never_came_is_missing() {
    let mut bench = Bench::new(1, &unsettled(), true);
    bench.push_all(0..15, START);
    assert_eq!(bench.assembler.deadline_ns(), Some(START + 15 * MS));
    let frame = bench.take(START + 15 * MS);
    assert_eq!(
        (frame.freshness[15], frame.counts[15], frame.age_ns[15]),
        (Freshness::Missing, [0; 3], u64::MAX)
    );
    assert_eq!(bench.freshness(Freshness::Fresh), (0..15).collect::<Vec<_>>());

    // The next sweep lacks taxel 3; its old value is shown with its age, and not as new.
    bench.push_all((0..16).filter(|t| *t != 3), START + 20 * MS);
    bench.take(START + 35 * MS);
    assert_eq!(bench.freshness(Freshness::Stale), [3]);
    assert_eq!(bench.freshness(Freshness::Missing), [0usize; 0]);
    assert_eq!(bench.frame.age_ns[3], 20 * MS);
    assert_eq!(bench.frame.counts[3][0], 5000);
    assert_eq!(bench.frame.t_ns, START + 20 * MS);
}

#[test]
fn a_reading_after_its_sweeps_deadline_is_late_and_does_not_begin_a_sweep() {
    let config = SweepConfig {
        deadline_ms: Some(5.0),
        ..unsettled()
    };
    let mut bench = Bench::new(1, &config, true);
    bench.push_all(0..14, START);
    bench.take(START + 5 * MS);
    assert_eq!(bench.push(14, START + 6 * MS), Push::Late);
    assert_eq!(
        bench.assembler.deadline_ns(),
        None,
        "a late reading is not the next sweep's first"
    );
    // Too long after the sweep's start to belong to it: the next sweep begins.
    assert_eq!(bench.push(15, START + 10 * MS), Push::Used);
    bench.push_all(0..14, START + 11 * MS);
    assert!(!bench.assembler.is_complete());
    bench.take(START + 15 * MS);
    assert_eq!(bench.freshness(Freshness::Stale), [14]);
    assert_eq!(bench.frame.counts[14][0], 5006, "the late value is kept");
    let counters = bench.assembler.board(0);
    assert_eq!((counters.used, counters.late, counters.missed), (29, 1, 1));
}

#[test]
fn a_reading_that_comes_twice_counts_once_and_its_newest_value_stays() {
    for sweep_mode in [false, true] {
        let mut bench = Bench::new(1, &unsettled(), sweep_mode);
        bench.push_all(0..16, START);
        bench.take(START + 100);
        assert_eq!(bench.push(15, START + MS), Push::Duplicate);
        assert_eq!(bench.assembler.deadline_ns(), None);
        bench.take(START + 2 * MS);
        assert_eq!(bench.frame.counts[15][0], 5001);
        let counters = bench.assembler.board(0);
        assert_eq!((counters.used, counters.duplicate, counters.sweeps), (16, 1, 0));
    }
}

#[test]
fn a_reading_older_than_its_taxels_value_is_late_and_not_kept() {
    let mut bench = Bench::new(1, &unsettled(), false);
    assert_eq!(bench.push(0, START + 20 * MS), Push::Used);
    assert_eq!(bench.push(0, START), Push::Late);
    bench.take(START + 21 * MS);
    assert_eq!(
        (bench.frame.counts[0][0], bench.frame.t_ns),
        (5020, START + 20 * MS)
    );
}

#[test]
fn a_lost_taxel_is_missed_even_if_it_comes_first_in_the_next_sweep() {
    let mut bench = Bench::new(1, &unsettled(), false);
    for sweep in 0..10 {
        let start = START + sweep * 10 * MS;
        // Taxel 7 is lost in every second sweep and leads the others.
        if sweep % 2 == 1 {
            bench.push(7, start);
        }
        bench.push_all((0..16).filter(|t| *t != 7), start + MS);
    }
    let counters = bench.assembler.board(0);
    assert_eq!(counters.sweeps, 9, "the tenth has not ended yet");
    assert_eq!(counters.missed, 5);
    assert_eq!(counters.used + counters.missed, 160);
}

#[test]
fn a_dead_board_is_waited_for_three_times_and_again_once_it_speaks() {
    let mut bench = Bench::new(2, &unsettled(), true);
    bench.push_all(0..32, START);
    bench.take(START);
    let mut waited = Vec::new();
    for sweep in 1..=6 {
        let start = START + sweep * 20 * MS;
        bench.push_all(0..16, start);
        let complete = bench.assembler.is_complete();
        waited.push(!complete);
        bench.take(if complete { start } else { start + 15 * MS });
        assert_eq!(bench.freshness(Freshness::Stale), (16..32).collect::<Vec<_>>());
    }
    assert_eq!(waited, [true, true, true, false, false, false]);
    assert_eq!(bench.assembler.board(1).state, BoardState::Silent);
    assert_eq!(bench.assembler.board(0).state, BoardState::Streaming);

    let start = START + 200 * MS;
    bench.push(20, start);
    assert_eq!(bench.assembler.board(1).state, BoardState::Streaming);
    bench.push_all(0..16, start);
    assert!(!bench.assembler.is_complete(), "board 1 speaks and is waited for");
    bench.push_all((16..32).filter(|t| *t != 20), start);
    assert!(bench.assembler.is_complete());
}

#[test]
fn a_dead_taxel_does_not_hold_up_its_board_for_ever() {
    let mut bench = Bench::new(1, &unsettled(), true);
    let mut waited = Vec::new();
    for sweep in 0..6 {
        let start = START + sweep * 20 * MS;
        bench.push_all((0..16).filter(|t| *t != 9), start);
        waited.push(!bench.assembler.is_complete());
        bench.take(start + 15 * MS);
        assert_eq!(bench.freshness(Freshness::Missing), [9]);
    }
    assert_eq!(waited, [true, true, true, false, false, false]);
    assert_eq!(bench.assembler.board(0).missed, 5);
    // It comes back, which does not stand for another taxel, and from the next sweep on is waited for.
    bench.push_all([9].into_iter().chain(0..9).chain(10..15), START + 200 * MS);
    assert!(!bench.assembler.is_complete(), "taxel 15 is missing");
    bench.push(15, START + 200 * MS);
    assert!(bench.assembler.is_complete());
    bench.take(START + 200 * MS);
    bench.push_all((0..16).filter(|t| *t != 9), START + 210 * MS);
    assert!(!bench.assembler.is_complete());
}

#[test]
fn with_every_board_dead_there_is_no_deadline_and_a_frame_shows_nothing_as_fresh() {
    let mut bench = Bench::new(1, &unsettled(), true);
    bench.push_all(0..16, START);
    bench.take(START);
    assert_eq!(bench.assembler.deadline_ns(), None);
    for heartbeat in 1..=3 {
        let now = START + heartbeat * 1000 * MS;
        bench.take(now);
        assert_eq!(bench.frame.t_ns, now);
        assert_eq!(bench.freshness(Freshness::Stale).len(), 16);
        assert_eq!(bench.frame.age_ns[0], now - START);
    }
    assert_eq!(bench.assembler.board(0).state, BoardState::Silent);
}

#[test]
fn boards_that_run_out_of_step_give_one_frame_per_period() {
    let mut bench = Bench::new(4, &unsettled(), true);
    // Board b begins its sweeps 2.3 ms after board b - 1 and sends a taxel every 0.3 ms.
    let mut arrivals: Vec<(u64, u16)> = (0..40u64)
        .flat_map(|sweep| {
            (0..64u16).map(move |taxel| {
                let (board, k) = (taxel as u64 / 16, taxel as u64 % 16);
                (START + sweep * 10 * MS + board * 2_300_000 + k * 300_000, taxel)
            })
        })
        .collect();
    arrivals.sort();
    let mut taken = Vec::new();
    for (t_ns, taxel) in arrivals {
        assert_eq!(bench.push(taxel, t_ns), Push::Used);
        assert!(
            bench.assembler.deadline_ns().is_none_or(|d| t_ns < d),
            "no deadline passes"
        );
        if bench.assembler.is_complete() {
            bench.take(t_ns);
            assert_eq!(bench.frame.missing(), 0);
            taken.push(t_ns);
        }
    }
    // A frame holds the beginning of board 0's next sweep, which the last of 40 sweeps does not have.
    assert_eq!(taken.len(), 39);
    assert!(taken.windows(2).all(|pair| pair[1] - pair[0] == 10 * MS));
}

#[test]
fn in_timer_mode_a_value_is_fresh_until_it_is_three_periods_old() {
    let mut bench = Bench::new(1, &unsettled(), false);
    assert_eq!(bench.take(START).missing(), 16);
    bench.push_all(0..16, START + MS);
    assert_eq!(bench.assembler.deadline_ns(), None, "the caller's timer decides");
    for (now, missing) in [(START + MS, 0), (START + 31 * MS, 0), (START + 31 * MS + 1, 16)] {
        assert_eq!(bench.take(now).missing(), missing, "at {now}");
    }
    // It was shown as stale, so what comes now is late; it is fresh again all the same.
    assert_eq!(bench.push(0, START + 40 * MS), Push::Late);
    assert_eq!(bench.push(0, START + 50 * MS), Push::Used);
    bench.take(START + 50 * MS);
    assert_eq!(bench.freshness(Freshness::Fresh), [0]);
    assert_eq!(bench.assembler.board(0).late, 1);
}

#[test]
fn a_board_that_dies_is_missing_after_three_of_its_periods_and_not_of_a_slower_ones() {
    let config = SweepConfig {
        settle_ms: 0.0,
        ..SweepConfig::default()
    };
    let mut bench = Bench::new(2, &config, false);
    for sweep in 0..100 {
        let t_ns = START + sweep * 20 * MS;
        bench.push_all(0..16, t_ns);
        if sweep % 25 == 0 {
            bench.push_all(16..32, t_ns);
        }
        bench.take(t_ns);
    }
    let died_ns = START + 99 * 20 * MS;
    assert_eq!(bench.assembler.board(1).period_ns, Some(500 * MS));
    for (ms, missing) in [(60, 0), (61, 16), (1500, 32)] {
        assert_eq!(bench.take(died_ns + ms * MS).missing(), missing, "{ms} ms");
    }
}

#[test]
fn the_time_of_validity_never_goes_back() {
    let mut bench = Bench::new(1, &unsettled(), false);
    bench.push_all(0..16, START);
    assert_eq!(bench.take(START + MS).t_ns, START);
    assert_eq!(
        bench.take(START + 2 * MS).t_ns,
        START + 2 * MS,
        "nothing came: the tick's time"
    );
    // Received before the last tick, handed over after it.
    bench.push(0, START + 2 * MS - 100_000);
    assert_eq!(bench.take(START + 3 * MS).t_ns, START + 2 * MS);
    assert_eq!(bench.frame.seq, 2);
}

#[test]
fn what_a_board_sends_while_it_comes_up_is_thrown_away() {
    let mut bench = Bench::new(2, &SweepConfig::default(), false);
    let cases = [
        // (milliseconds from the start, what becomes of the reading)
        (0, Push::Settling),
        (100, Push::Settling),
        (199, Push::Settling),
        (200, Push::Used),
        // A second without a word may have been a power cut; less than that is not.
        (1199, Push::Used),
        (2199, Push::Settling),
        (2398, Push::Settling),
        (2399, Push::Used),
    ];
    for (ms, expected) in cases {
        assert_eq!(bench.push(0, START + ms * MS), expected, "at {ms} ms");
    }
    let counters = bench.assembler.board(0);
    assert_eq!((counters.settling, counters.used), (5, 3));
    assert_eq!(counters.last_ns, Some(START + 2399 * MS));
    assert_eq!(bench.assembler.board(1).state, BoardState::NeverSeen);
}

#[test]
fn slow_triggers_are_not_taken_for_power_cuts() {
    let config = SweepConfig {
        board_period_ms: Some(2000.0),
        ..SweepConfig::default()
    };
    let mut bench = Bench::new(1, &config, false);
    let pushed: Vec<Push> = (0..4).map(|i| bench.push(0, START + i * 2000 * MS)).collect();
    assert_eq!(pushed, [Push::Settling, Push::Used, Push::Used, Push::Used]);
}

#[test]
fn states_follow_what_is_heard() {
    let config = SweepConfig {
        board_period_ms: Some(10.0),
        ..SweepConfig::default()
    };
    let mut bench = Bench::new(1, &config, false);
    let state = |bench: &mut Bench, now: u64| {
        bench.take(now);
        bench.assembler.board(0).state
    };
    assert_eq!(state(&mut bench, START), BoardState::NeverSeen);
    bench.push(0, START);
    assert_eq!(state(&mut bench, START + MS), BoardState::Settling);
    assert_eq!(state(&mut bench, START + 31 * MS), BoardState::Silent);
    bench.push(0, START + 250 * MS);
    assert_eq!(state(&mut bench, START + 251 * MS), BoardState::Streaming);
    assert_eq!(state(&mut bench, START + 281 * MS), BoardState::Silent);
    assert_eq!(bench.assembler.board(0).silences, 2);
}

#[test]
fn a_fast_board_that_is_kept_back_for_some_periods_did_not_fall_silent_and_one_that_stops_did() {
    let config = SweepConfig {
        board_period_ms: Some(3.0),
        ..unsettled()
    };
    for sweep_mode in [false, true] {
        // How often a frame is taken meanwhile: each millisecond, or hardly ever.
        for take_ms in [1, 70] {
            let mut bench = Bench::new(1, &config, sweep_mode);
            for ms in 0..2000 {
                let kept_back = ms % 100 < 16;
                let stopped = (1000..1200).contains(&ms) || (1500..1540).contains(&ms);
                if ms % 3 == 0 && !kept_back && !stopped {
                    bench.push_all(0..16, START + ms * MS);
                }
                if ms % take_ms == 0 {
                    bench.take(START + ms * MS);
                }
            }
            assert_eq!(bench.assembler.board(0).silences, 2, "{sweep_mode}, {take_ms} ms");
        }
    }
}

#[test]
fn a_silence_that_is_over_before_the_next_frame_is_taken_is_counted() {
    let mut bench = Bench::new(1, &unsettled(), false);
    for (at_ms, silences, newest_ms) in [(0, 0, 0), (30, 0, 0), (61, 1, 31), (62, 1, 31), (300, 2, 238)] {
        bench.push(0, START + at_ms * MS);
        bench.take(START + at_ms * MS);
        let board = bench.assembler.board(0);
        assert_eq!(
            (board.silences, board.silence_ns, board.state),
            (silences, newest_ms * MS, BoardState::Streaming),
            "{at_ms} ms"
        );
    }
}

#[test]
fn status_errors_are_counted_and_the_reading_is_delivered_with_its_status() {
    let mut bench = Bench::new(1, &unsettled(), false);
    for (taxel, status) in [(0, 0x82), (1, 0x92), (2, 0xFF)] {
        let reading = TaxelReading {
            status,
            ..reading(taxel, 7)
        };
        assert_eq!(bench.assembler.push(&reading, START), Push::Used);
    }
    assert_eq!(bench.assembler.board(0).status_errors, 2);
    assert_eq!(bench.take(START).status[..3], [0x82, 0x92, 0xFF]);
}

#[test]
fn a_reading_of_another_layout_is_refused() {
    let mut bench = Bench::new(1, &unsettled(), false);
    assert_eq!(bench.push(16, START), Push::NoSuchTaxel);
    assert_eq!(bench.take(START).missing(), 16);
}
