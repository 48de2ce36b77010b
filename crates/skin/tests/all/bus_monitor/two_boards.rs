//! Two boards with one address, and what is like them.

use super::{MS, Traffic, board, found, hand, healthy, last, span};
use taxel_can::Received;
use taxel_skin::{Finding, Layout, Wiring};

fn is_two(finding: &Finding) -> bool {
    matches!(finding, Finding::TwoBoards { .. })
}

/// The sweeps of a board that begin at such times, nanoseconds, with the z of each taxel.
fn sweeps(module: &Wiring, times: impl IntoIterator<Item = u64>, z: impl Fn(u64, u16) -> f64) -> Traffic {
    let of_sweep = |start_ns: u64| {
        let z = &z;
        (0..16u16).map(move |k| {
            let t_ns = start_ns + u64::from(k) * 100_000;
            let counts = [0x8000, 0x8000, z(t_ns, k) as u16];
            let frame = module
                .protocol
                .frame(module.board, k, counts, 0)
                .expect("a taxel");
            (module.bus, Received { t_ns, frame })
        })
    };
    times.into_iter().flat_map(of_sweep).collect()
}

/// Times with such a period in so many seconds, each up to `jitter` of it late.
fn times(period_us: u64, phase_us: u64, seconds: u64, jitter: f64) -> impl Iterator<Item = u64> {
    (0..seconds * 1_000_000 / period_us).map(move |n| {
        let dice = (n.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / f64::from(1 << 24);
        (n * period_us + phase_us) * 1000 + (dice * jitter * period_us as f64 * 1000.0) as u64
    })
}

fn rest(of: u64) -> impl Fn(u64, u16) -> f64 {
    move |t_ns, k| (12_000 + 700 * of + u64::from(k * 37) * of + t_ns / 1000 % 11) as f64
}

#[test]
fn two_boards_with_one_address_are_told_from_one_that_is_fast_or_noisy() {
    let hand = hand();
    // Board 5 of the first bus answers as board 3 from one second on.
    let (wrong, right) = (&hand.wiring[5], &hand.wiring[3]);
    assert_eq!((wrong.bus, right.bus), (0, 0));
    let mut traffic = healthy(&hand, [0, 4000], &[5]);
    traffic.extend(board(wrong, 0, wrong.board, 50, [0, 1000], 12_065));
    traffic.extend(board(wrong, 0, right.board, 50, [1000, 2500], 12_065));
    traffic.extend(board(wrong, 0, wrong.board, 50, [2500, 4000], 12_065));
    let doubled = found(&hand, traffic, 4000);
    let [from, to] = span(&doubled, |f| matches!(f, Finding::TwoBoards { module: 3, .. })).expect("found");
    assert!(
        (1250..=1750).contains(&from) && (2500..=3250).contains(&to),
        "{from} to {to} ms"
    );
    let (_, at_2s) = &doubled[2000 / 50];
    let [Finding::TwoBoards { sweeps_hz, .. }] = at_2s[..] else {
        panic!("{at_2s:?}")
    };
    assert!(
        (sweeps_hz[0] - 100.0).abs() < 10.0 && (sweeps_hz[1] - 50.0).abs() < 5.0,
        "{sweeps_hz:?}"
    );

    // One board at the double rate.
    let mut traffic = healthy(&hand, [0, 1500], &[3]);
    traffic.extend(board(right, 0, right.board, 100, [0, 1500], 10_000));
    assert_eq!(last(&found(&hand, traffic, 1400)), []);
}

#[test]
fn a_hand_of_one_board_is_compared_with_what_it_used_to_send() {
    let hand = Layout::builtin("uskin-module").expect("built in");
    let m = &hand.wiring[0];
    let mut traffic = board(m, 0, m.board, 50, [0, 3000], 9_000);
    traffic.extend(board(m, 0, m.board, 50, [1500, 3000], 12_000));
    let found = found(&hand, traffic, 3000);
    let [from, _] = span(&found, |f| matches!(f, Finding::TwoBoards { module: 0, .. })).expect("found");
    assert!((1500..=2250).contains(&from), "{from} ms");
}

#[test]
fn two_hands_with_the_same_ids_on_one_bus_are_told_though_all_boards_send_the_same() {
    let hand = hand();
    let mut traffic = healthy(&hand, [0, 4000], &[]);
    for (i, m) in hand.wiring.iter().enumerate() {
        traffic.extend(board(
            m,
            m.bus,
            m.board,
            50,
            [2000, 4000],
            13_500 + 413 * i as u16,
        ));
    }
    let found = found(&hand, traffic, 4000);
    for module in 0..hand.modules.len() as u16 {
        let of = |f: &Finding| matches!(f, Finding::TwoBoards { module: m, .. } if *m == module);
        let [from, to] = span(&found, of).unwrap_or_else(|| panic!("module {module}"));
        assert!((2250..=3000).contains(&from) && to == 4000, "{from} to {to} ms");
    }
}

#[test]
fn two_single_boards_are_told_from_the_start_by_their_uneven_sweeps_or_in_time_by_their_values() {
    let hand = Layout::builtin("uskin-module").expect("built in");
    let m = &hand.wiring[0];
    // How far the second board is behind the first, of 20 ms, and when it is told.
    for (phase_us, told_ms) in [
        (50, 500..=1000),
        (1600, 500..=1000),
        (17_000, 500..=1000),
        (10_000, 20_000..=21_000),
    ] {
        for jitter in [0.0, 0.03] {
            let mut traffic = sweeps(m, times(20_000, 0, 24, jitter), rest(0));
            traffic.extend(sweeps(m, times(20_000, phase_us, 24, jitter), rest(1)));
            let found = found(&hand, traffic, 24_000);
            let [from, to] = span(&found, is_two).unwrap_or_else(|| panic!("{phase_us} us"));
            assert!(
                told_ms.contains(&from) && to == 24_000,
                "{phase_us} us: {from} to {to} ms"
            );
        }
    }
}

#[test]
fn one_board_is_never_two_whatever_its_rate_and_its_way() {
    let hand = Layout::builtin("uskin-module").expect("built in");
    let m = &hand.wiring[0];
    // What shakes it swings between two values, if it is in step with the sweeps.
    let shaken = |amplitude: f64, hz: f64| {
        move |t_ns: u64, k: u16| {
            let phase = std::f64::consts::TAU * hz * (t_ns - u64::from(k) * 100_000) as f64 / 1e9;
            rest(1)(t_ns, k) + amplitude * phase.cos()
        }
    };
    // A touch that comes and goes ten times a second.
    let tapped = |t_ns: u64, k: u16| rest(1)(t_ns, k) + f64::from(k) * 300.0 * (t_ns / 50_000_000 % 2) as f64;
    let mut cases = Vec::new();
    for period_us in [3_003, 10_000, 13_700, 20_000, 142_857] {
        for jitter in [0.0, 0.3] {
            let times = || times(period_us, 0, 30, jitter);
            cases.push((format!("{period_us} us, {jitter}"), sweeps(m, times(), rest(1))));
            cases.push((
                format!("{period_us} us, {jitter}, tapped"),
                sweeps(m, times(), tapped),
            ));
        }
    }
    // A gateway that sends all it hears a second time, at once or later.
    for late_us in [0, 300, 10_000, 25_000] {
        let mut traffic = sweeps(m, times(20_000, 0, 30, 0.1), tapped);
        let again = traffic.iter().map(|(bus, r)| {
            let t_ns = r.t_ns + late_us * 1000;
            (*bus, Received { t_ns, ..*r })
        });
        let again: Traffic = again.collect();
        traffic.extend(again);
        cases.push((format!("again {late_us} us later"), traffic));
    }
    // An adapter that keeps frames back for 16 ms.
    let mut kept = sweeps(m, times(10_000, 0, 30, 0.0), tapped);
    for (_, received) in &mut kept {
        received.t_ns = received.t_ns.next_multiple_of(16_000_000);
    }
    cases.push(("kept back".into(), kept));
    // It restarts at twice its rate, and at half of it.
    let mut restarted = sweeps(m, times(20_000, 0, 10, 0.0), tapped);
    for (period_us, after_ms) in [(10_000, 11_000), (20_000, 22_500)] {
        let later = times(period_us, 0, 10, 0.0).map(|t_ns| t_ns + after_ms * MS);
        restarted.extend(sweeps(m, later, tapped));
    }
    cases.push(("restarted".into(), restarted));
    for (amplitude, hz) in [
        (100.0, 50.1),
        (100.0, 49.95),
        (2000.0, 50.1),
        (2000.0, 49.95),
        (2000.0, 25.0),
    ] {
        let traffic = sweeps(m, times(10_000, 0, 90, 0.0), shaken(amplitude, hz));
        cases.push((format!("shaken by {amplitude} at {hz} Hz"), traffic));
    }
    // A motor that hums from the fourth second on, nearly in step, and an adapter that sends two sweeps at once.
    for (hz, kept_ms) in [(50.01, 0), (49.99, 0), (49.7, 20), (50.0, 20)] {
        let hum = move |t_ns: u64, k: u16| match t_ns < 4_000 * MS {
            true => rest(1)(t_ns, k),
            false => shaken(100.0, hz)(t_ns, k),
        };
        let mut traffic = sweeps(m, times(10_000, 0, 90, 0.0), hum);
        for (_, received) in &mut traffic {
            received.t_ns = received.t_ns.next_multiple_of((kept_ms * MS).max(1));
        }
        cases.push((format!("hum of {hz} Hz, kept for {kept_ms} ms"), traffic));
    }
    for (what, traffic) in cases {
        let found = found(&hand, traffic, 90_000);
        assert!(!found.iter().any(|(_, f)| f.iter().any(is_two)), "{what}");
    }
}

#[test]
fn a_touch_of_one_of_two_boards_does_not_hide_that_they_are_two() {
    let hand = Layout::builtin("uskin-module").expect("built in");
    let m = &hand.wiring[0];
    let touched = |t_ns: u64, k: u16| {
        let pressed = (3_000_000_000..5_000_000_000).contains(&t_ns) && k < 6;
        rest(1)(t_ns, k) + f64::from(u8::from(pressed)) * 3000.0
    };
    let mut traffic = sweeps(m, times(20_000, 0, 30, 0.0), rest(0));
    traffic.extend(sweeps(m, times(20_000, 10_000, 30, 0.0), touched));
    let found = found(&hand, traffic, 30_000);
    let [from, _] = span(&found, is_two).expect("found");
    assert!((20_000..=26_000).contains(&from), "{from} ms");
}

#[test]
fn two_boards_stay_two_while_their_sweeps_drift_past_each_other() {
    let hand = Layout::builtin("uskin-module").expect("built in");
    let m = &hand.wiring[0];
    // Their periods differ by 2 %, so that they are in step each second, and half a period apart between.
    let mut traffic = sweeps(m, times(20_000, 0, 20, 0.0), rest(0));
    traffic.extend(sweeps(m, times(20_400, 100, 20, 0.0), rest(1)));
    let found = found(&hand, traffic, 20_000);
    let [from, to] = span(&found, is_two).expect("found");
    assert!((500..=1500).contains(&from) && to >= 19_950, "{from} to {to} ms");
}
