//! Boards as they behave on a bus: bursts and their phase, free running, rates that must be measured.

use crate::support::boards_on_a_bus as layout;
use taxel_hand::{Freshness, TactileFrame};
use taxel_skin::{BoardState, BoardStatus, SweepAssembler, SweepConfig, TaxelReading};

const MS: u64 = 1_000_000;
/// Not zero, as a monotonic clock never is.
const START: u64 = 5_000 * MS;
const TAXELS: u64 = 16;

/// Why a frame was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cause {
    Complete,
    Overtaken,
    Deadline,
}
use Cause::{Complete, Deadline, Overtaken};

#[derive(Debug)]
struct Taken {
    t_ns: u64,
    cause: Cause,
    /// Taxels without a fresh value.
    missing: Vec<u16>,
    /// Age of the oldest fresh value.
    oldest_ns: u64,
}

/// Takes frames as the daemon does in `sweep` mode.
struct Hand {
    assembler: SweepAssembler,
    frame: TactileFrame,
    taken: Vec<Taken>,
}

impl Hand {
    fn new(boards: usize) -> Self {
        Self::with(boards, SweepConfig::default())
    }

    /// All that is sent counts from the first reading on.
    fn settled(boards: usize) -> Self {
        let config = SweepConfig {
            settle_ms: 0.0,
            ..SweepConfig::default()
        };
        Self::with(boards, config)
    }

    fn with(boards: usize, config: SweepConfig) -> Self {
        let layout = layout(boards);
        Self {
            assembler: SweepAssembler::new(&layout, &config, true),
            frame: TactileFrame::new(layout.len()),
            taken: Vec::new(),
        }
    }

    fn take(&mut self, t_ns: u64, cause: Cause) {
        self.assembler.take(t_ns, &mut self.frame);
        let fresh = |taxel: &usize| self.frame.freshness[*taxel] == Freshness::Fresh;
        let taxels = 0..self.frame.freshness.len();
        self.taken.push(Taken {
            t_ns,
            cause,
            missing: taxels.clone().filter(|t| !fresh(t)).map(|t| t as u16).collect(),
            oldest_ns: taxels
                .filter(fresh)
                .map(|t| self.frame.age_ns[t])
                .max()
                .unwrap_or(0),
        });
    }

    fn push(&mut self, t_ns: u64, taxel: u16) {
        if let Some(deadline) = self.assembler.deadline_ns().filter(|d| *d < t_ns) {
            self.take(deadline, Deadline);
        }
        let reading = TaxelReading {
            taxel,
            counts: [1, 2, 3],
            status: 0x82,
        };
        if self.assembler.overtaken_by(&reading, t_ns) {
            self.take(t_ns, Overtaken);
        }
        self.assembler.push(&reading, t_ns);
        if self.assembler.is_complete() {
            self.take(t_ns, Complete);
        }
    }

    fn play(&mut self, arrivals: impl IntoIterator<Item = (u64, u16)>) {
        for (t_ns, taxel) in arrivals {
            self.push(t_ns, taxel);
        }
    }

    fn counters(&self, board: u16) -> BoardStatus {
        self.assembler.board(board)
    }

    fn causes(&self) -> Vec<Cause> {
        self.taken.iter().map(|t| t.cause).collect()
    }
}

/// Sweeps `sweeps` of boards that are triggered together every 10 ms and send a taxel every `4 ms /
/// boards / 16`.
fn bursts(boards: u64, sweeps: std::ops::Range<u64>) -> Vec<(u64, u16)> {
    let taxels = boards * TAXELS;
    sweeps
        .flat_map(|sweep| (0..taxels).map(move |i| (burst_at(boards, sweep, i), i as u16)))
        .collect()
}

fn burst_at(boards: u64, sweep: u64, taxel: u64) -> u64 {
    START + sweep * 10 * MS + taxel * 4 * MS / (boards * TAXELS)
}

/// When a burst is through.
fn burst_end(boards: u64, sweep: u64) -> u64 {
    burst_at(boards, sweep, boards * TAXELS - 1)
}

#[test]
fn a_frame_lost_in_a_burst_leaves_its_image_to_the_next_burst_and_the_phase_as_it_is() {
    for boards in [1, 3] {
        for lost in 0..boards * TAXELS {
            let mut hand = Hand::settled(boards as usize);
            let sent = bursts(boards, 0..12);
            hand.play(
                sent.into_iter()
                    .filter(|a| *a != (burst_at(boards, 6, lost), lost as u16)),
            );
            let expected: Vec<u64> = (0..12)
                .map(|sweep| match sweep {
                    // The first reading of the next burst: taxel 0.
                    6 => burst_at(boards, 7, if lost == 0 { 1 } else { 0 }),
                    _ => burst_end(boards, sweep),
                })
                .collect();
            if lost == 0 {
                // It leads the next burst, as if it were the missing one: that image is complete.
                let times: Vec<u64> = hand.taken.iter().map(|t| t.t_ns).collect();
                assert_eq!(times[..6], expected[..6]);
                assert_eq!(times[6], burst_at(boards, 7, 0));
                assert_eq!(
                    times[times.len() - 4..],
                    expected[8..],
                    "in phase after one burst"
                );
            } else {
                let times: Vec<u64> = hand.taken.iter().map(|t| t.t_ns).collect();
                assert_eq!(times, expected, "lost {lost}");
                assert_eq!(hand.taken[6].cause, Overtaken);
                assert_eq!(hand.taken[6].missing, [lost as u16]);
                assert!(
                    hand.taken
                        .iter()
                        .enumerate()
                        .all(|(i, t)| i == 6 || t.missing.is_empty())
                );
            }
            let counters = hand.counters((lost / TAXELS) as u16);
            assert_eq!((counters.missed, counters.sweeps), (1, 11), "lost {lost}");
            assert_eq!((counters.late, counters.duplicate), (0, 0));
        }
    }
}

#[test]
fn a_taxel_that_dies_holds_up_three_images_by_the_gap_and_no_more() {
    let mut hand = Hand::settled(2);
    let died = burst_at(2, 5, 0);
    hand.play(
        bursts(2, 0..14)
            .into_iter()
            .filter(|(t, taxel)| *t < died || *taxel != 20),
    );
    let mut expected = vec![Complete; 5];
    expected.extend([Overtaken; 3]);
    expected.extend([Complete; 6]);
    assert_eq!(hand.causes(), expected);
    assert_eq!(
        hand.counters(1).missed,
        8,
        "nine bursts, of which the last has not ended"
    );
}

#[test]
fn a_delayed_frame_does_not_shift_the_phase() {
    // Taxel 9 of burst 6 comes this much later than it should.
    for delay_us in [300, 1_000, 3_000, 5_000, 6_000, 7_000, 8_000, 9_000] {
        let mut hand = Hand::settled(1);
        let mut sent = bursts(1, 0..14);
        sent[6 * 16 + 9].0 += delay_us * 1000;
        sent.sort();
        hand.play(sent);
        let in_phase = |sweep: u64| {
            hand.taken
                .iter()
                .any(|t| t.t_ns == burst_end(1, sweep) && t.cause == Complete)
        };
        for sweep in (0..6).chain(9..14) {
            assert!(
                in_phase(sweep),
                "burst {sweep}, delay {delay_us} us: {:#?}",
                hand.taken
            );
        }
        assert!((13..=14).contains(&hand.taken.len()), "delay {delay_us} us");
        let counters = hand.counters(0);
        assert_eq!(counters.frames(), 14 * 16);
        assert!(counters.missed + counters.duplicate <= 2, "{counters:?}");
    }
}

#[test]
fn after_a_start_in_the_middle_of_a_burst_images_are_complete_at_its_end() {
    for boards in [1u64, 2, 8] {
        for skipped in [1, 5, 15, 16 * boards as usize - 1] {
            let mut hand = Hand::settled(boards as usize);
            hand.play(bursts(boards, 0..8).into_iter().skip(skipped));
            let late: Vec<(u64, Cause)> = hand
                .taken
                .iter()
                .rev()
                .take(5)
                .map(|t| (t.t_ns, t.cause))
                .collect();
            let expected: Vec<(u64, Cause)> =
                (3..8).rev().map(|s| (burst_end(boards, s), Complete)).collect();
            assert_eq!(
                late, expected,
                "{boards} boards, {skipped} skipped: {:?}",
                hand.taken
            );
            assert!(hand.taken.iter().rev().take(5).all(|t| t.oldest_ns <= 4 * MS));
        }
    }
}

#[test]
fn boards_whose_bursts_alternate_are_never_starved() {
    // Board 1 sends 5 ms after board 0; between their bursts is a gap of 3 ms. The start is anywhere.
    for skipped in 0..32 {
        let mut hand = Hand::settled(2);
        let mut sent: Vec<(u64, u16)> = (0..20u64)
            .flat_map(|sweep| {
                (0..32).map(move |i| (START + (2 * sweep + i / 16) * 5 * MS + i % 16 * MS / 8, i as u16))
            })
            .collect();
        sent.drain(..skipped);
        hand.play(sent);
        let causes = hand.causes();
        assert!(causes.len() >= 18, "skipped {skipped}: {causes:?}");
        assert!(
            causes[2..].iter().all(|c| *c == Complete),
            "skipped {skipped}: {causes:?}"
        );
        let steady = hand.taken[2..]
            .windows(2)
            .all(|pair| pair[1].t_ns - pair[0].t_ns == 10 * MS);
        assert!(steady, "skipped {skipped}: {:?}", hand.taken);
    }
}

/// Numbers that look random, -1 to 1.
fn noise(a: u64, b: u64) -> f64 {
    let mut x = (a << 32 ^ b).wrapping_add(0x9E37_79B9_7F4A_7C15);
    x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ x >> 31) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A board on its own clock.
#[derive(Clone, Copy)]
struct Clock {
    board: u64,
    phase_ns: u64,
    period_ns: f64,
    /// Each sweep begins up to this part of a period early or late.
    jitter: f64,
    /// Part of a period that a sweep takes.
    spread: f64,
}

impl Clock {
    fn arrivals(self, sweeps: u64) -> impl Iterator<Item = (u64, u16)> {
        (0..sweeps).flat_map(move |sweep| {
            let late = 0.2 + self.jitter * noise(self.board, sweep);
            (0..TAXELS).map(move |k| {
                let t = (sweep as f64 + late + k as f64 / TAXELS as f64 * self.spread) * self.period_ns;
                (START + self.phase_ns + t as u64, (self.board * TAXELS + k) as u16)
            })
        })
    }
}

/// What boards send in this time that run freely, by time.
fn free_running(clocks: &[Clock], seconds: u64) -> Vec<(u64, u16)> {
    let mut sent: Vec<(u64, u16)> = (clocks.iter())
        .flat_map(|clock| clock.arrivals((seconds as f64 * 1.02e9 / clock.period_ns) as u64))
        .filter(|(t_ns, _)| *t_ns < START + seconds * 1000 * MS)
        .collect();
    sent.sort();
    sent
}

/// Eight boards, out of step and up to 0.5 % off, with jitter.
fn eight(period_ms: f64, jitter: f64, spread: f64) -> Vec<Clock> {
    (0..8)
        .map(|board| Clock {
            board,
            phase_ns: ((noise(99, board) + 1.0) * period_ms / 2.0 * 1e6) as u64,
            period_ns: period_ms * 1e6 * (1.0 + 0.005 * noise(98, board)),
            jitter,
            spread,
        })
        .collect()
}

#[test]
fn boards_that_run_freely_with_jitter_and_drift_lose_nothing_for_minutes() {
    for (period_ms, jitter, spread, seconds) in [
        (10.0, 0.2, 0.4, 120),
        (20.0, 0.1, 0.8, 120),
        (20.0, 0.02, 0.95, 60),
    ] {
        let mut hand = Hand::new(8);
        hand.play(free_running(&eight(period_ms, jitter, spread), seconds));
        let case = format!("{period_ms} ms, jitter {jitter}, spread {spread}");
        // The boards settle one by one; from then on every image is whole.
        let steady = &hand.taken[20..];
        for taken in steady {
            assert_eq!(
                (taken.cause, taken.missing.len()),
                (Complete, 0),
                "{case}: {taken:?}"
            );
        }
        let images = seconds as f64 * 1000.0 / period_ms;
        let rate = hand.taken.len() as f64 / images;
        assert!((0.75..1.001).contains(&rate), "{case}: {rate} images per period");
        for board in 0..8 {
            let counters = hand.counters(board);
            assert_eq!(counters.duplicate, 0, "{case}: {counters:?}");
            // Settling may end within a sweep, whose beginning is then missed, or in its middle an
            // image is cut.
            assert!(counters.missed + counters.late < TAXELS, "{case}: {counters:?}");
            let came = (counters.used + counters.missed) / TAXELS;
            assert!(
                came - counters.sweeps <= 1,
                "{case}: the last sweep has not ended: {counters:?}"
            );
            let period = counters.period_ns.unwrap() as f64 / 1e6;
            assert!(
                (period / period_ms - 1.0).abs() < 0.02 + jitter / 2.0,
                "{case}: measured {period} ms"
            );
        }
    }
}

#[test]
fn losses_of_boards_that_run_freely_are_counted_to_the_frame() {
    let mut hand = Hand::new(8);
    let sent = free_running(&eight(20.0, 0.05, 0.6), 60);
    // The last sweeps have not ended when the test has.
    let (first, last) = (START + 1_000 * MS, START + 59_000 * MS);
    let mut lost = 0;
    for (i, (t_ns, taxel)) in sent.into_iter().enumerate() {
        if (first..last).contains(&t_ns) && noise(97, i as u64) > 0.98 {
            lost += 1;
        } else {
            hand.push(t_ns, taxel);
        }
    }
    let before: u64 = 8 * (TAXELS - 1);
    let missed: u64 = (0..8).map(|b| hand.counters(b).missed).sum();
    assert!(lost > 2000);
    assert!(
        (lost..=lost + before).contains(&missed),
        "{missed} missed of {lost} lost"
    );
    assert!((0..8).all(|b| hand.counters(b).duplicate + hand.counters(b).late <= 40));
}

#[test]
fn the_period_is_measured_while_boards_settle() {
    for hz in [1000.0, 100.0, 83.0, 50.0, 30.0, 10.0] {
        let period_ms = 1000.0 / hz;
        let clocks: Vec<Clock> = eight(period_ms, 0.01, 0.4)[..2].to_vec();
        let mut hand = Hand::new(2);
        // The first image is of the sweep that was under way when the boards had settled.
        hand.play(free_running(&clocks, 3));
        for board in 0..2 {
            let measured = hand.counters(board).period_ns.unwrap() as f64 / 1e6;
            assert!(
                (measured / period_ms - 1.0).abs() < 0.03,
                "{hz} Hz: measured {measured} ms"
            );
            assert_eq!(hand.counters(board).duplicate, 0, "{hz} Hz");
        }
        let causes = hand.causes();
        assert!(causes[2..].iter().all(|c| *c == Complete), "{hz} Hz: {causes:?}");
        let images = (3_000.0 - 200.0) / period_ms;
        assert!(
            (causes.len() as f64 - images).abs() <= 3.0,
            "{hz} Hz: {} images",
            causes.len()
        );
    }
}

#[test]
fn boards_that_are_set_to_another_rate_are_followed_within_a_few_sweeps() {
    for (from_ms, to_ms) in [(10, 20), (20, 10), (10, 100), (100, 10), (1, 33), (33, 1)] {
        let mut hand = Hand::new(1);
        let burst =
            |start: u64, period_ms: u64| (0..16).map(move |k| (start + k * period_ms * MS / 40, k as u16));
        let mut t_ns = START;
        while t_ns < START + 400 * MS + 10 * from_ms * MS {
            hand.play(burst(t_ns, from_ms));
            t_ns += from_ms * MS;
        }
        let changed = hand.taken.len();
        assert!(hand.causes()[changed - 5..].iter().all(|c| *c == Complete));
        for _ in 0..60 {
            hand.play(burst(t_ns, to_ms));
            t_ns += to_ms * MS;
        }
        let case = format!("{from_ms} to {to_ms} ms");
        let measured = hand.counters(0).period_ns.unwrap();
        assert!(
            measured.abs_diff(to_ms * MS) < to_ms * MS / 50,
            "{case}: {measured}"
        );
        // One image at the end of each of the last 45 bursts.
        let ends: Vec<u64> = (1..=45)
            .rev()
            .map(|i| t_ns - i * to_ms * MS + 15 * to_ms * MS / 40)
            .collect();
        let last: Vec<u64> = hand.taken[hand.taken.len() - 45..]
            .iter()
            .map(|t| t.t_ns)
            .collect();
        assert_eq!(last, ends, "{case}");
        let counters = hand.counters(0);
        let astray = counters.missed + counters.duplicate + counters.late;
        assert!(astray <= 20 * TAXELS, "{case}: {counters:?}");
    }
}

#[test]
fn the_hands_period_is_that_of_its_slowest_living_board() {
    let mut clocks: Vec<Clock> = eight(10.0, 0.01, 0.4)[..3].to_vec();
    clocks[2].period_ns = 50e6;
    let sent = free_running(&clocks, 10);
    let mut hand = Hand::new(3);
    let died = START + 3_000 * MS;
    let mut at_death = None;
    for (t_ns, taxel) in sent {
        if t_ns < died || taxel < 32 {
            hand.push(t_ns, taxel);
        }
        if t_ns >= died && at_death.is_none() {
            at_death = Some((hand.assembler.hand_period_ns(), hand.taken.len()));
        }
    }
    let (period_ns, images) = at_death.unwrap();
    assert!(period_ns.abs_diff(50 * MS) < MS, "{period_ns}");
    assert!((50..70).contains(&images), "{images}: one per 50 ms");
    assert_eq!(hand.counters(2).state, BoardState::Silent);
    assert!(hand.assembler.hand_period_ns().abs_diff(10 * MS) < MS / 2);
    let after = hand.taken.len() - images;
    assert!(
        (650..=700).contains(&after),
        "{after}: one per 10 ms, but for the first three"
    );
    assert!(
        hand.taken[images + 10..]
            .iter()
            .all(|t| t.cause == Complete && t.missing.len() == 16)
    );
}
