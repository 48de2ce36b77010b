//! Boards and hubs on another bus than the layout has them on, and those that it does not have.

use super::*;
use taxel_can::{CanFrame, Received};
use taxel_skin::{BusMonitor, Finding, Layout, Protocol, Wiring};

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
fn boards_that_change_their_bus_within_a_window_are_never_told_as_others() {
    let layout = two_buses([&[0, 1], &[2, 3]]);
    // From one edge of a window to the next. The second board of each bus may be slow.
    for phase_ms in (0..250).step_by(25) {
        let [away_ms, back_ms] = [1000 + phase_ms, 3240 - phase_ms];
        for late_hz in [10, 50] {
            let traffic = (layout.wiring.iter().enumerate()).flat_map(|(i, m)| {
                let hz = if i % 2 == 1 { late_hz } else { 50 };
                let spans = [
                    (m.bus, [0, away_ms]),
                    (1 - m.bus, [away_ms, back_ms]),
                    (m.bus, [back_ms, 4500]),
                ];
                spans
                    .into_iter()
                    .flat_map(move |(bus, span)| board(m, bus, m.board, hz, span, 9_000))
            });
            let found = found(&layout, traffic.collect(), 4400);
            let is_swapped = |finding: &Finding| matches!(finding, Finding::BusesSwapped { .. });
            let Some([first, last]) = span(&found, is_swapped) else {
                panic!("back at {back_ms} ms, {late_hz} Hz: {found:?}")
            };
            assert!(
                first <= away_ms + 800 && (back_ms..=back_ms + 500).contains(&last),
                "{first} to {last}"
            );
            let others: Vec<_> = (found.iter())
                .filter(|(_, found)| !found.iter().all(is_swapped))
                .collect();
            assert!(
                others.is_empty(),
                "back at {back_ms} ms, {late_hz} Hz: {others:?}"
            );
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

/// The packets of values of module 2 of a hub on a bus, fifty times a second.
pub(super) fn hub(layout: &Layout, bus: u8, address: u32, command: u8) -> Traffic {
    hub_module(layout, bus, address, command, 2)
}

fn hub_module(layout: &Layout, bus: u8, address: u32, command: u8, number: u8) -> Traffic {
    let setup = layout.cyskin.as_ref().expect("hubs");
    let mut data = vec![number, 1];
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
fn modules_that_the_layout_does_not_have_on_a_hub_are_named() {
    let strange = |number, modules| Finding::ModulesNotInLayout {
        hub: 1,
        number,
        modules,
    };
    // What hub 7 of the second bus sends, beside hub 3 of the first.
    let cases: [(&[u8], &[Finding]); 4] = [
        (&[2], &[]),
        (&[9], &[strange(9, 1)]),
        (&[2, 200, 9], &[strange(9, 2)]),
        (&[], &[]),
    ];
    for (sent, wanted) in cases {
        let layout = two_buses_of_hubs([&[3], &[7]]);
        let mut traffic = hub(&layout, 0, 3, 0x43);
        for number in sent {
            traffic.extend(hub_module(&layout, 1, 7, 0x43, *number));
        }
        assert_eq!(last(&found(&layout, traffic, 1400)), wanted, "{sent:?}");
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
fn what_could_not_be_a_board_of_the_hand_is_a_stranger() {
    let layout = two_buses([&[0, 1], &[2, 3]]);
    const MINUTE: u64 = 60_000 * MS;
    let heard = |frame: CanFrame| {
        let mut monitor = BusMonitor::new(&layout);
        monitor.handle_frame(0, &Received { t_ns: 0, frame });
        monitor.advance(300 * MS);
        assert!(!monitor.strangers(1));
        let is_stranger = monitor.strangers(0);
        monitor.advance(9 * MINUTE);
        assert_eq!(monitor.strangers(0), is_stranger);
        // One that was sent once, by hand, is not on the bus for ever; one that speaks again is.
        monitor.advance(11 * MINUTE);
        assert!(!monitor.strangers(0));
        monitor.handle_frame(
            0,
            &Received {
                t_ns: 12 * MINUTE,
                frame,
            },
        );
        monitor.advance(12 * MINUTE + 300 * MS);
        assert_eq!(monitor.strangers(0), is_stranger);
        is_stranger
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
