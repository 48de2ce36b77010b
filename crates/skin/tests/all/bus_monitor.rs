//! What the traffic on the buses shows: babbling nodes, two boards with one address, boards on the wrong bus.

use taxel_can::{CanFrame, Received};
use taxel_skin::{BusMonitor, Decoded, Decoder, Finding, Layout, Protocol, Readings, Wiring};

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

/// A hand of two buses, with these boards on them.
fn two_buses(boards: [&[u8]; 2]) -> Layout {
    let mut text =
        "name = \"two\"\nbuses = [\"left\", \"right\"]\nimage = { width = 40, height = 8 }\n".to_string();
    for (bus, addresses) in boards.iter().enumerate() {
        for (n, address) in addresses.iter().enumerate() {
            text += &format!(
                "[[module]]\nname = \"m{bus}{address}\"\npart = \"p{bus}{address}\"\nbus = \"{}\"\nboard = {address}\n\
                 protocol = \"uskin-l2\"\nat = [{}, {}]\n",
                ["left", "right"][bus],
                4 * n,
                4 * bus
            );
        }
    }
    Layout::parse(&text, "two.toml").unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The boards of `layout` as if its buses were swapped where `on_other` says so.
fn displaced(layout: &Layout, on_other: impl Fn(&Wiring) -> bool) -> Traffic {
    (layout.wiring.iter().enumerate())
        .flat_map(|(i, m)| {
            let bus = if on_other(m) { 1 - m.bus } else { m.bus };
            board(m, bus, m.board, 50, [0, 1500], 9_000 + 613 * i as u16)
        })
        .collect()
}

#[test]
fn swapped_buses_are_told_where_their_boards_differ() {
    type Boards = [&'static [u8]; 2];
    let cases: [(Boards, Option<u16>); 4] = [
        ([&[0, 1], &[2, 3]], Some(4)),
        ([&[0, 1, 2], &[0, 1]], Some(1)),
        ([&[0], &[1]], Some(2)),
        // Nothing tells these buses apart.
        ([&[0, 1], &[0, 1]], None),
    ];
    for (boards, telling) in cases {
        let layout = two_buses(boards);
        let found = found(&layout, displaced(&layout, |_| true), 1400);
        match (telling, last(&found)) {
            (
                Some(telling),
                [
                    Finding::BusesSwapped {
                        buses: [0, 1],
                        boards: n,
                        ..
                    },
                ],
            ) => assert_eq!(*n, telling),
            (None, []) => {}
            (_, other) => panic!("{boards:?}: {other:?}"),
        }
    }
}

#[test]
fn the_default_hand_has_one_board_that_tells_its_buses_apart() {
    let hand = hand();
    let found = found(&hand, displaced(&hand, |_| true), 1400);
    let [
        Finding::BusesSwapped {
            buses: [0, 1],
            module,
            boards: 1,
        },
    ] = last(&found)[..]
    else {
        panic!("{:?}", last(&found));
    };
    let module = &hand.wiring[usize::from(module)];
    assert_eq!((module.bus, module.board), (0, 7));
}

#[test]
fn one_board_of_several_on_the_other_bus_is_not_called_a_swap() {
    let layout = two_buses([&[0, 1], &[2, 3]]);
    let found = found(&layout, displaced(&layout, |m| m.board == 1), 1400);
    assert_eq!(last(&found), [Finding::OnOtherBus { module: 1, bus: 1 }]);
}

/// Two buses with a hub each, or with more; the hub of a module is its index.
fn two_buses_of_hubs(hubs: [&[u32]; 2]) -> Layout {
    let mut text =
        "name = \"hubs\"\nbuses = [\"left\", \"right\"]\nimage = { width = 40, height = 8 }\n[cyskin]\n\
         ids = \"extended\"\nbyte_order = \"big\"\nchecksum = \"sum\"\nsequence_bytes_above = 5\nsensors_per_module = 12\n"
            .to_string();
    let mut modules = String::new();
    for (bus, addresses) in hubs.iter().enumerate() {
        for (n, address) in addresses.iter().enumerate() {
            let (name, side) = (format!("h{bus}{n}"), ["left", "right"][bus]);
            text += &format!("[[cyskin.hub]]\nname = \"{name}\"\nbus = \"{side}\"\naddress = {address}\n");
            modules += &format!(
                "[[module]]\nname = \"m{name}\"\npart = \"p\"\nbus = \"{side}\"\nhub = \"{name}\"\nboard = 2\n\
                 protocol = \"cyskin\"\nat = [{}, {bus}]\norder = [[1, 2, 3, 4, 5, 6, 7]]\n",
                7 * n
            );
        }
    }
    text += &modules;
    Layout::parse(&text, "hubs.toml").unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The packets of values of a hub on a bus, fifty times a second.
fn hub(layout: &Layout, bus: u8, address: u32, command: u8) -> Traffic {
    let setup = layout.cyskin.as_ref().expect("hubs");
    let mut data = vec![2, 1];
    data.extend((0..7).flat_map(|k| [0x20, k]));
    let frames = taxel_skin::cyskin_frames(setup, address, command, &data).expect("a packet");
    let sent = (0..75u64).flat_map(|sweep| (0u64..).zip(&frames).map(move |(i, frame)| (sweep, i, *frame)));
    sent.map(|(sweep, i, frame)| {
        let t_ns = 20 * MS * sweep + u64::from(bus) * MS + 100_000 * i + u64::from(address % 7) * 1_000_000;
        (bus, Received { t_ns, frame })
    })
    .collect()
}

#[test]
fn cyskin_hubs_on_the_wrong_bus_are_told_by_their_addresses() {
    type Hubs = [&'static [u32]; 2];
    type Speak = &'static [(u8, u32, u8)];
    const VALUES: u8 = 0x43;
    let foreign = |bus, address| Finding::NotInLayout {
        bus,
        protocol: Protocol::CYSKIN,
        address,
    };
    let (of_no_layout, two_of_no_layout) = ([foreign(0, 9)], [foreign(0, 0x1234), foreign(1, 9)]);
    let cases: [(&str, Hubs, Speak, &[Finding]); 9] = [
        (
            "of no layout",
            [&[1], &[2]],
            &[(0, 9, VALUES), (1, 2, VALUES)],
            &of_no_layout,
        ),
        (
            "two of no layout",
            [&[1], &[2]],
            &[
                (0, 1, VALUES),
                (1, 2, VALUES),
                (0, 0x1234, VALUES),
                (1, 9, VALUES),
            ],
            &two_of_no_layout,
        ),
        (
            "a node with extended ids that says other things",
            [&[1], &[2]],
            &[(0, 1, VALUES), (1, 2, VALUES), (0, 9, 0x51), (0, 9, VALUES)],
            &[],
        ),
        ("well", [&[1], &[2]], &[(0, 1, VALUES), (1, 2, VALUES)], &[]),
        (
            "swapped",
            [&[1], &[2]],
            &[(1, 1, VALUES), (0, 2, VALUES)],
            &[Finding::BusesSwapped {
                buses: [0, 1],
                module: 1,
                boards: 2,
            }],
        ),
        (
            "one of two",
            [&[1, 3], &[2]],
            &[(0, 1, VALUES), (1, 3, VALUES), (1, 2, VALUES)],
            &[Finding::OnOtherBus { module: 1, bus: 1 }],
        ),
        (
            "here and there",
            [&[1], &[2]],
            &[(0, 1, VALUES), (1, 2, VALUES), (1, 1, VALUES)],
            &[Finding::NotInLayout {
                bus: 1,
                protocol: Protocol::CYSKIN,
                address: 1,
            }],
        ),
        (
            "the same addresses",
            [&[1], &[1]],
            &[(0, 1, VALUES), (1, 1, VALUES)],
            &[],
        ),
        (
            "told to start",
            [&[1], &[2]],
            &[(1, 2, VALUES), (1, 1, 0x44)],
            &[],
        ),
    ];
    for (what, hubs, speak, wanted) in cases {
        let layout = two_buses_of_hubs(hubs);
        let traffic = speak
            .iter()
            .flat_map(|(bus, address, command)| hub(&layout, *bus, *address, *command));
        assert_eq!(last(&found(&layout, traffic.collect(), 1400)), wanted, "{what}");
    }
}

#[test]
fn a_board_that_the_layout_does_not_have_is_named_by_its_address() {
    let layout = two_buses([&[0, 1], &[2, 3]]);
    let mut traffic = displaced(&layout, |_| false);
    traffic.extend(board(&layout.wiring[1], 0, 6, 50, [0, 1500], 9_000));
    let stray = Finding::NotInLayout {
        bus: 0,
        protocol: Protocol::USKIN_L2,
        address: 6,
    };
    assert_eq!(last(&found(&layout, traffic, 1400)), [stray]);

    // A few ids alike are not a board: joints, replies of other nodes.
    let mut traffic = displaced(&layout, |_| false);
    for k in 0..4 {
        let frame = Protocol::USKIN_L2.frame(6, k, [0; 3], 0).expect("a frame");
        traffic.extend(repeated(0, frame, 300, [0, 1500]));
    }
    assert_eq!(last(&found(&layout, traffic, 1400)), []);
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

#[test]
fn what_could_not_be_a_board_of_the_hand_is_a_stranger() {
    let layout = two_buses([&[0, 1], &[2, 3]]);
    let heard = |frame: CanFrame| {
        let mut monitor = BusMonitor::new(&layout);
        monitor.handle_frame(0, &Received { t_ns: 0, frame });
        monitor.advance(300 * MS);
        assert!(!monitor.strangers(1));
        monitor.strangers(0)
    };
    let standard = |id| CanFrame::standard(id, &[0; 8]).expect("11 bits");
    // Boards of this bus, of the other, of none; a command.
    for id in [0x000, 0x133, 0x210, 0x301, 0x700, 0x204] {
        assert!(!heard(standard(id)), "{id:03X}");
    }
    // Positions of an Allegro hand, v4 and v3; a servo of another kind.
    for frame in [
        standard(0x080),
        standard(0x3D3),
        CanFrame::extended(0x100, &[]).expect("29 bits"),
    ] {
        assert!(heard(frame), "{frame}");
    }
}
