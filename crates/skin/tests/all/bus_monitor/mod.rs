//! What the traffic on the buses shows: babbling nodes, two boards with one address, boards on the wrong bus.

mod shared_ids;
mod two_boards;
mod wrong_bus;

use taxel_can::{CanFrame, Received};
use taxel_skin::{BusMonitor, Decoded, Decoder, Finding, Layout, Readings, Wiring};

const MS: u64 = 1_000_000;

/// Frames with the bus they come on.
type Traffic = Vec<(u8, Received)>;

fn hand() -> Layout {
    Layout::builtin("allegro-uskin-15").expect("built in")
}

/// The sweeps of a board that speaks as `address` on `bus`, from `from_ms` to `to_ms`; its taxels
/// rest around `rest`.
fn board(module: &Wiring, bus: u8, address: u8, rate_hz: u64, span_ms: [u64; 2], rest: u16) -> Traffic {
    let period_ns = 1_000_000_000 / rate_hz;
    let phase_ns = u64::from(rest) * 7919 % period_ns;
    let mut traffic = Traffic::new();
    for sweep in 0u16.. {
        let start_ns = span_ms[0] * MS + phase_ns + u64::from(sweep) * period_ns;
        if start_ns >= span_ms[1] * MS {
            return traffic;
        }
        for k in 0..16 {
            let z = rest + k * 50 + sweep * 7 % 11;
            let frame = (module.protocol)
                .frame(address, k, [0x8000, 0x8000, z], 0)
                .expect("it has 16 taxels");
            let t_ns = start_ns + u64::from(k) * 100_000;
            traffic.push((bus, Received { t_ns, frame }));
        }
    }
    traffic
}

/// Every board of the hand as the layout has it, but for those left out.
fn healthy(hand: &Layout, span_ms: [u64; 2], without: &[usize]) -> Traffic {
    let boards = (hand.wiring.iter().enumerate()).filter(|(i, _)| !without.contains(i));
    boards
        .flat_map(|(i, m)| board(m, m.bus, m.board, 50, span_ms, 9_000 + 613 * i as u16))
        .collect()
}

fn repeated(bus: u8, frame: CanFrame, rate_hz: u64, span_ms: [u64; 2]) -> Traffic {
    let period_ns = 1_000_000_000 / rate_hz;
    let times = (span_ms[0] * MS..span_ms[1] * MS).step_by(period_ns as usize);
    times.map(|t_ns| (bus, Received { t_ns, frame })).collect()
}

/// Shows all traffic to a monitor as the pipeline does, and returns what it found at the end of each 50 ms.
fn found(hand: &Layout, mut traffic: Traffic, until_ms: u64) -> Vec<(u64, Vec<Finding>)> {
    traffic.sort_by_key(|(_, r)| r.t_ns);
    let mut decoders: Vec<Decoder> = (0..hand.buses.len())
        .map(|b| Decoder::new(hand, b as u8))
        .collect();
    let mut monitor = BusMonitor::new(hand);
    let mut readings = Readings::new();
    let mut traffic = traffic.into_iter().peekable();
    let mut all = Vec::new();
    for ms in (50..=until_ms).step_by(50) {
        while let Some((bus, received)) = traffic.next_if(|(_, r)| r.t_ns < ms * MS) {
            monitor.handle_frame(bus, &received);
            if let Decoded::Readings = decoders[usize::from(bus)].decode(&received.frame, &mut readings) {
                readings
                    .iter()
                    .for_each(|reading| monitor.handle_reading(reading));
            }
        }
        monitor.advance(ms * MS);
        all.push((ms, monitor.findings().to_vec()));
    }
    all
}

/// When findings that pass came first and when they went, ms; fails if they came twice.
fn span(found: &[(u64, Vec<Finding>)], is: impl Fn(&Finding) -> bool) -> Option<[u64; 2]> {
    let there: Vec<u64> = (found.iter().filter(|(_, f)| f.iter().any(&is)))
        .map(|(ms, _)| *ms)
        .collect();
    let (first, last) = (*there.first()?, *there.last()?);
    assert_eq!(
        there.len() as u64,
        (last - first) / 50 + 1,
        "it came and went and came"
    );
    Some([first, last])
}

fn last(found: &[(u64, Vec<Finding>)]) -> &[Finding] {
    &found.last().expect("some").1
}

#[test]
fn a_healthy_hand_has_no_findings_at_any_rate() {
    let hand = hand();
    for rate_hz in [10, 30, 50, 100] {
        let traffic: Traffic = (hand.wiring.iter().enumerate())
            .flat_map(|(i, m)| board(m, m.bus, m.board, rate_hz, [0, 2000], 9_000 + 613 * i as u16))
            .collect();
        let found = found(&hand, traffic, 2500);
        assert!(found.iter().all(|(_, f)| f.is_empty()), "{rate_hz} Hz: {found:?}");
    }
}

#[test]
fn an_id_of_nobody_at_full_bus_load_is_named_with_its_rate_and_share_and_forgotten_when_it_ends() {
    let hand = hand();
    let babble = CanFrame::standard(0x005, &[0xBA; 8]).unwrap();
    let mut traffic = healthy(&hand, [0, 4000], &[]);
    traffic.extend(repeated(1, babble, 4000, [1000, 2500]));
    let found = found(&hand, traffic, 4000);
    let [from, to] = span(&found, |f| matches!(f, Finding::IdBabbles { .. })).expect("found");
    assert!(
        (1250..=1750).contains(&from) && (2500..=3250).contains(&to),
        "{from} to {to} ms"
    );
    let (_, at_2s) = &found[2000 / 50];
    let [
        Finding::IdBabbles {
            bus: 1,
            id: 0x005,
            extended: false,
            module: None,
            rate_hz,
            share,
        },
    ] = at_2s[..]
    else {
        panic!("{at_2s:?}");
    };
    assert!(
        (rate_hz - 4000.0).abs() < 20.0 && (share - 0.444).abs() < 0.005,
        "{rate_hz} {share}"
    );
}

#[test]
fn extended_ids_babble_too() {
    let hand = hand();
    let babble = CanFrame::extended(0x1ABC_DEF0, &[0; 8]).unwrap();
    let found = found(&hand, repeated(0, babble, 3000, [0, 1000]), 900);
    assert!(
        matches!(
            last(&found),
            [Finding::IdBabbles {
                bus: 0,
                id: 0x1ABC_DEF0,
                extended: true,
                module: None,
                ..
            }]
        ),
        "{found:?}"
    );
}

#[test]
fn a_known_boards_id_that_repeats_is_named_with_its_module() {
    let hand = hand();
    let module = &hand.wiring[2];
    let frame = module.protocol.frame(module.board, 5, [1, 2, 3], 0).unwrap();
    for (rate_hz, babbles) in [(3000, true), (500, true), (100, false)] {
        let mut traffic = healthy(&hand, [0, 1500], &[]);
        traffic.extend(repeated(module.bus, frame, rate_hz, [0, 1500]));
        let found = found(&hand, traffic, 1400);
        let of_module = |f: &Finding| matches!(f, Finding::IdBabbles { module: Some(2), .. });
        assert_eq!(
            last(&found).iter().any(of_module),
            babbles,
            "{rate_hz} Hz: {:?}",
            last(&found)
        );
        assert!(last(&found).len() <= 1, "{:?}", last(&found));
    }
}

#[test]
fn a_board_that_sweeps_without_pause_is_named() {
    let hand = hand();
    let m = &hand.wiring[4];
    let mut traffic = healthy(&hand, [0, 1500], &[4]);
    traffic.extend(board(m, m.bus, m.board, 400, [0, 1500], 10_000));
    let found = found(&hand, traffic, 1400);
    let [
        Finding::BoardBabbles {
            module: 4,
            rate_hz,
            share,
            sweeps_hz,
        },
    ] = last(&found)[..]
    else {
        panic!("{:?}", last(&found));
    };
    assert!(
        (rate_hz - 6400.0).abs() < 100.0 && share > 0.6,
        "{rate_hz} {share}"
    );
    assert!(
        (sweeps_hz[0] - 400.0).abs() < 10.0 && (sweeps_hz[1] - 50.0).abs() < 5.0,
        "{sweeps_hz:?}"
    );
}

#[test]
fn a_pressure_array_sends_at_any_rate() {
    let text = "name = \"t\"\nbuses = [\"mat\"]\nimage = { width = 5, height = 3 }\n[[module]]\nname = \"mat\"\n\
        part = \"p\"\nbus = \"mat\"\nprotocol = \"pressure-array\"\nrows = 3\ncolumns = 5\nat = [0, 0]\n";
    let layout = Layout::parse(text, "t.toml").unwrap_or_else(|e| panic!("{e}"));
    let mut traffic = Traffic::new();
    let mut t_ns = 0;
    for message in 0..6000u32 {
        // At 50 Hz for a second, then at 2000 Hz.
        t_ns += if message < 50 { 20 * MS } else { MS / 2 };
        // Values that swing, as those of two boards would.
        let counts = [[900; 15], [100; 15]][message as usize % 2];
        let frames = taxel_can::pressure_frames([3, 5], message, &counts);
        traffic.extend(frames.into_iter().map(|frame| (0, Received { t_ns, frame })));
    }
    let found = found(&layout, traffic, t_ns / MS);
    assert!(found.iter().all(|(_, findings)| findings.is_empty()), "{found:?}");
}

#[test]
fn a_time_without_frames_ends_every_finding_at_once_however_long_it_was() {
    let hand = hand();
    let mut monitor = BusMonitor::new(&hand);
    let babble = CanFrame::standard(0, &[0; 8]).unwrap();
    for n in 0..4000u64 {
        let t_ns = n * 250_000;
        monitor.handle_frame(0, &Received { t_ns, frame: babble });
    }
    assert_eq!(monitor.findings().len(), 1);
    assert!(monitor.load(0).share > 0.4);
    monitor.advance(3_600_000 * MS);
    assert_eq!(monitor.findings(), []);
    monitor.advance(u64::MAX);
    assert_eq!(monitor.load(0).frames_hz, 0.0);
}
