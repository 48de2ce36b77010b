//! From traffic to a layout file: every hand is recognised by what its boards send, and the
//! proposed file takes every frame.

mod cyskin;

use proptest::prelude::*;
use std::collections::BTreeSet;
use taxel_can::{CanFrame, EXTENDED_FLAG, Received};
use taxel_skin::{
    Decoded, Decoder, Layout, Protocol, Readings, Recogniser, Recognition, cyskin_frames, icub_triangle_data,
};

const SWEEPS: u64 = 6;

/// Frames of one sweep of a hand, with small noise in the low byte.
fn sweep(layout: &Layout, round: u64) -> Vec<(u8, CanFrame)> {
    let mut frames = Vec::new();
    let mut triangles = BTreeSet::new();
    for n in 0..layout.len() {
        let (module, k) = (layout.wiring_of(n), layout.k[n]);
        let value = 12_000 + (n as u64 * 37 + round * 7) as u16 % 200;
        match module.protocol.name() {
            "icub-mtb3" | "icub-mtb4" => {
                triangles.insert((module.bus, module.board, k as u8 / 12));
            }
            "cyskin" => {
                let setup = layout.cyskin.as_ref().unwrap();
                let [high, low] = value.to_be_bytes();
                let address = setup.hubs[usize::from(module.hub.unwrap())].address;
                let packet =
                    cyskin_frames(setup, address, 0x43, &[module.board, k as u8, high, low]).unwrap();
                frames.extend(packet.into_iter().map(|frame| (module.bus, frame)));
            }
            "cpm-finger" => {
                let id = module.protocol.frame_id(module.board, k).unwrap();
                if k < 4 {
                    let id = 0x405 + 2 * k;
                    frames.push((
                        module.bus,
                        CanFrame::standard(id, &[7, 1, 7, 1, 7, 1, 7, 1]).unwrap(),
                    ));
                }
                assert!((0x405..=0x40B).contains(&id));
            }
            _ => {
                let frame = module
                    .protocol
                    .frame(module.board, k, [0x8000, 0x8000, value], 0x83);
                frames.push((module.bus, frame.unwrap()));
            }
        }
    }
    for (bus, board, triangle) in triangles {
        let id = 0x400 | u16::from(board) << 4 | u16::from(triangle);
        for data in icub_triangle_data([240 + round as u8; 12], 0, 0) {
            frames.push((bus, CanFrame::standard(id, &data).unwrap()));
        }
    }
    frames
}

pub(crate) fn traffic(layout: &Layout) -> Vec<(u8, u64, CanFrame)> {
    (0..SWEEPS)
        .flat_map(|round| {
            let frames = sweep(layout, round).into_iter().enumerate();
            frames.map(move |(i, (bus, frame))| (bus, round * 20_000_000 + i as u64 * 10_000, frame))
        })
        .collect()
}

pub(crate) fn recognise(buses: usize, traffic: &[(u8, u64, CanFrame)]) -> Recognition {
    let mut recogniser = Recogniser::new(buses);
    for (bus, t_ns, frame) in traffic {
        recogniser.handle_frame(
            *bus,
            &Received {
                t_ns: *t_ns,
                frame: *frame,
            },
        );
    }
    recogniser.finish()
}

fn names(layout: &Layout) -> Vec<&str> {
    layout.buses.iter().map(String::as_str).collect()
}

/// Protocol, address, hub and taxel numbers of each board, by bus.
type Boards = BTreeSet<(u8, &'static str, u8, Option<u32>, Vec<u8>)>;

fn boards(layout: &Layout) -> Boards {
    let each = layout.boards().map(|(_, module, wiring)| {
        let hub = wiring
            .hub
            .map(|hub| layout.cyskin.as_ref().unwrap().hubs[usize::from(hub)].address);
        let numbers = layout.k_of(module).iter().map(|k| *k as u8).collect();
        (wiring.bus, wiring.protocol.name(), wiring.board, hub, numbers)
    });
    each.collect()
}

/// The way there and back: traffic, recognition, file, layout, and again the traffic.
fn comes_back(layout: &Layout) {
    let traffic = traffic(layout);
    let found = recognise(layout.buses.len(), &traffic);
    let text = found
        .layout_file("found", &names(layout))
        .unwrap_or_else(|| panic!("nothing was recognised of {}", layout.name));
    let proposed = Layout::parse(&text, "found.toml").unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert_eq!(boards(&proposed), boards(layout), "{text}");
    assert_eq!(proposed.buses, layout.buses);
    assert!(
        found
            .buses
            .iter()
            .all(|bus| bus.others.is_empty() && bus.allegro.is_none())
    );
    let mut decoders: Vec<Decoder> = (0..proposed.buses.len())
        .map(|bus| Decoder::new(&proposed, bus as u8))
        .collect();
    let mut readings = Readings::new();
    let mut seen = BTreeSet::new();
    for (bus, t_ns, frame) in &traffic {
        let decoded = decoders[usize::from(*bus)].decode_at(*t_ns, frame, &mut readings);
        assert!(
            matches!(decoded, Decoded::Readings | Decoded::Partial),
            "{frame}: {decoded:?}"
        );
        seen.extend(readings.iter().map(|r| r.taxel));
    }
    assert_eq!(
        seen.len(),
        layout.len(),
        "every taxel of {} was read",
        layout.name
    );
}

#[test]
fn every_built_in_hand_with_boards_comes_back_from_its_traffic() {
    let mut hands = 0;
    for name in Layout::builtin_names() {
        let layout = Layout::builtin(name).unwrap();
        // What a program sends to a pressure array's socket is not looked for on a bus.
        if layout.buses.is_empty() || layout.array_on(0).is_some() {
            continue;
        }
        comes_back(&layout);
        let found = recognise(layout.buses.len(), &traffic(&layout));
        assert_eq!(found.builtin(), Some((name, 0)));
        hands += 1;
    }
    assert_eq!(hands, 6);
}

#[test]
fn a_recorded_pressure_array_is_told_by_its_size_and_all_of_its_frames() {
    let heard = |sizes: &[[u16; 2]], stranger: Option<u16>| {
        let mut recogniser = Recogniser::new(1);
        for (message, size) in (0u32..).zip(sizes) {
            let counts = vec![7; usize::from(size[0]) * usize::from(size[1])];
            let mut frames = taxel_can::pressure_frames(*size, message, &counts);
            frames.extend(stranger.map(|id| CanFrame::standard(id, &[0; 8]).unwrap()));
            for frame in frames {
                let t_ns = u64::from(message) * 20_000_000;
                recogniser.handle_frame(0, &Received { t_ns, frame });
            }
        }
        let bus = recogniser.finish().buses.remove(0);
        (bus.array, bus.others.is_empty() && bus.boards.is_empty())
    };
    assert_eq!(heard(&[[3, 5]; 9], None), (Some([3, 5]), true));
    assert_eq!(heard(&[[28, 50]; 9], None), (Some([28, 50]), true));
    assert_eq!(heard(&[[3, 5]; 9], Some(5)).0, None);
    assert_eq!(heard(&[[3, 5], [5, 3], [3, 5]], None).0, None);
    assert_eq!(heard(&[[3, 5]], None).0, None);
}

#[test]
fn extended_ids_of_nobody_are_named_as_they_are_on_the_bus() {
    let ids = [0x0CFE_F100, 0x18FE_F100, 0x1BFF_1234, 0x1CFE_F100];
    let mut recogniser = Recogniser::new(1);
    for t_ns in 0..5 {
        for id in ids {
            let frame = CanFrame::extended(id, &[0; 8]).unwrap();
            recogniser.handle_frame(0, &Received { t_ns, frame });
        }
    }
    let others = &recogniser.finish().buses[0].others;
    assert!(others.iter().eq(&ids.map(|id| id | EXTENDED_FLAG)), "{others:x?}");
}

/// So many frames of these taxels of a board; `last` replaces byte 7.
pub(crate) fn board(protocol: Protocol, board: u8, ks: &[u8], last: Option<u8>) -> Vec<(u8, u64, CanFrame)> {
    (0..SWEEPS)
        .flat_map(|round| {
            ks.iter().map(move |k| {
                let frame = protocol.frame(board, (*k).into(), [0x8000; 3], 0x83).unwrap();
                let mut data: [u8; 8] = frame.data().try_into().unwrap();
                data[7] = last.unwrap_or(data[7]);
                let frame = CanFrame::standard(frame.standard_id().unwrap(), &data).unwrap();
                (0, round * 20_000_000, frame)
            })
        })
        .collect()
}

#[test]
fn what_the_frames_do_not_decide_is_named() {
    // Eight L2 boards are by their ids eight L3 controllers, too: byte 7 decides, and without it
    // nothing does.
    let hand = |last| -> Vec<_> {
        let ks: Vec<u8> = (0..16).collect();
        (0..8)
            .flat_map(|b| board(Protocol::USKIN_L2, b, &ks, last))
            .collect()
    };
    let decided = recognise(1, &hand(None));
    assert!(
        decided.buses[0]
            .boards
            .iter()
            .all(|b| b.protocol == Protocol::USKIN_L2)
    );
    assert!(
        decided.buses[0].doubts[0].contains("decides"),
        "{:?}",
        decided.buses[0].doubts
    );
    let guessed = recognise(1, &hand(Some(0)));
    assert_eq!(guessed.buses[0].boards.len(), 8);
    assert!(
        guessed.buses[0].doubts[0].contains("is a guess"),
        "{:?}",
        guessed.buses[0].doubts
    );
    let text = guessed.layout_file("h", &["can0"]).unwrap();
    assert!(
        text.contains("# DOUBT, can0: the ids are those of 8 boards of uskin-l2"),
        "{text}"
    );
}

#[test]
fn xela_controllers_whose_last_byte_is_unused_are_not_taken_for_mtbs() {
    let four: Vec<u8> = (0..4).flat_map(|sda| (0..4).map(move |t| sda << 4 | t)).collect();
    let traffic: Vec<_> = (1..4)
        .flat_map(|c| board(Protocol::USKIN_L3, c, &four, Some(0)))
        .collect();
    let found = recognise(1, &traffic);
    let addresses: Vec<(Protocol, u8)> = found.buses[0]
        .boards
        .iter()
        .map(|b| (b.protocol, b.board))
        .collect();
    assert_eq!(addresses, [1, 2, 3].map(|c| (Protocol::USKIN_L3, c)));
}

#[test]
fn xela_modules_of_four_by_six_on_ids_of_the_second_layout_come_back_with_all_their_taxels() {
    let order = "order = [[0, 1, 2, 3, 16, 17], [4, 5, 6, 7, 18, 19], [8, 9, 10, 11, 20, 21], [12, 13, 14, 15, 22, 23]]";
    for boards in [&[1u8][..], &[1, 4], &[0, 1, 2, 3, 4, 5, 6, 7]] {
        let mut text =
            "name = \"tips\"\nbuses = [\"can0\"]\nimage = { width = 48, height = 4 }\n".to_string();
        for (place, board) in boards.iter().enumerate() {
            text += &format!(
                "[[module]]\nname = \"m{board}\"\npart = \"p\"\nbus = \"can0\"\nboard = {board}\nprotocol = \"uskin-l2\"\n\
                 at = [{}, 0]\n{order}\n",
                6 * place
            );
        }
        let layout = Layout::parse(&text, "tips.toml").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(layout.len(), 24 * boards.len());
        comes_back(&layout);
        let found = recognise(1, &traffic(&layout));
        let text = found.layout_file("found", &["can0"]).unwrap();
        assert!(text.contains("  [ 0,  1,  2,  3, 16, 17],\n"), "{text}");
    }
}

#[test]
fn a_taxel_that_never_speaks_and_one_that_speaks_once_are_told_from_a_board() {
    let ks: Vec<u8> = (0..16).filter(|k| *k != 5).collect();
    let mut traffic = board(Protocol::USKIN_L1, 3, &ks, None);
    traffic.push((0, 0, CanFrame::standard(0x123, &[1; 8]).unwrap()));
    let found = recognise(1, &traffic);
    let bus = &found.buses[0];
    assert_eq!(bus.boards[0].taxels.len(), 15);
    assert!(bus.doubts.iter().any(|d| d.contains("k = 5")), "{:?}", bus.doubts);
    assert_eq!(bus.others, [0x123]);
    let text = found.layout_file("l", &["can0"]).unwrap();
    assert_eq!(Layout::parse(&text, "l.toml").unwrap().len(), 15);
}

#[test]
fn a_board_whose_first_taxel_never_speaks_is_proposed_without_it() {
    for (protocol, taxels) in [(Protocol::USKIN_L1, 16), (Protocol::USKIN_L2, 8)] {
        let ks: Vec<u8> = (1..taxels).collect();
        let found = recognise(1, &board(protocol, 5, &ks, None));
        let text = found.layout_file("l", &["can0"]).unwrap();
        let layout = Layout::parse(&text, "l.toml").unwrap_or_else(|e| panic!("{e}\n{text}"));
        let mut proposed = layout.k;
        proposed.sort_unstable();
        assert!(proposed.into_iter().eq(1..u16::from(taxels)));
    }
}

#[test]
fn of_two_boards_with_one_address_the_one_with_more_taxels_is_proposed() {
    let triangle = "name = \"t\"\nbuses = [\"can0\"]\nimage = { width = 4, height = 3 }\n\
        [[module]]\nname = \"l\"\npart = \"p\"\nbus = \"can0\"\nboard = 1\nprotocol = \"icub-mtb3\"\nat = [0, 0]\n\
        order = [[50, 51, 48, 49], [52, 53, 55, 56], [57, 59, -1, -1]]\n";
    let triangle = Layout::parse(triangle, "t.toml").unwrap_or_else(|e| panic!("{e}"));
    for (taxels, stays, goes) in [(16, "uskin-l1", "icub-mtb3"), (8, "icub-mtb3", "uskin-l1")] {
        let ks: Vec<u8> = (0..taxels).collect();
        let mut traffic = traffic(&triangle);
        traffic.extend(board(Protocol::USKIN_L1, 1, &ks, None));
        let found = recognise(1, &traffic);
        let bus = &found.buses[0];
        let names: Vec<&str> = bus.boards.iter().map(|b| b.protocol.name()).collect();
        assert_eq!(names, [stays]);
        let told = format!("{goes} board 1 is left out, since {stays} board 1 has the same address");
        assert!(
            bus.doubts.iter().any(|d| d.starts_with(&told)),
            "{:?}",
            bus.doubts
        );
        let text = found.layout_file("both", &["can0"]).unwrap();
        Layout::parse(&text, "both.toml").unwrap_or_else(|e| panic!("{e}\n{text}"));
    }
}

#[test]
fn an_allegro_hand_is_recognised_and_is_no_skin() {
    for (version, ids) in [
        (3, [0x3D3, 0x3D4, 0x3D5, 0x3D6]),
        (4, [0x080, 0x084, 0x088, 0x08C]),
    ] {
        let mut recogniser = Recogniser::new(1);
        for round in 0..50u64 {
            for id in ids {
                let frame = CanFrame::standard(id, &[0, 1, 2, 3, 4, 5, 6, 7]).unwrap();
                let t_ns = round * 3_000_000;
                recogniser.handle_frame(0, &Received { t_ns, frame });
            }
        }
        let found = recogniser.finish();
        assert_eq!(found.buses[0].allegro, Some(version));
        assert!(found.buses[0].boards.is_empty() && found.buses[0].others.is_empty());
        assert_eq!(found.layout_file("a", &["can0"]), None);
    }
}

#[test]
fn commands_and_answers_of_boards_are_no_strangers() {
    let mut traffic = board(Protocol::USKIN_L1, 1, &(0..16).collect::<Vec<u8>>(), None);
    for (id, data) in [
        (0x201, &[0x07, 0x00][..]),
        (0x70F, &[0xFF]),
        (0x710, &[0xFF, 5, 2, 17, 0]),
        (0x201, &[0x1C, 1, 0]),
        (0x210, &[0x1C, 5, 2, 17, 0, 1, 0, 1]),
        (0x230, &[0x1C, 11, 2, 9, 0, 1, 0, 1]),
    ] {
        traffic.insert(0, (0, 0, CanFrame::standard(id, data).unwrap()));
    }
    let found = recognise(1, &traffic);
    assert_eq!(found.buses[0].boards.len(), 1);
    assert!(found.buses[0].others.is_empty(), "{:?}", found.buses[0].others);
    // Other frames of that id are somebody's.
    traffic.push((0, 0, CanFrame::standard(0x230, &[0x1D; 8]).unwrap()));
    assert_eq!(recognise(1, &traffic).buses[0].others, [0x230]);
}

#[test]
fn starts_of_sweeps_are_no_sweeps_of_the_board_whose_taxels_have_their_ids() {
    let layout = Layout::builtin("allegro-uskin-15").unwrap();
    let sweeps = traffic(&layout);
    let start = |address: u16| CanFrame::standard(0x200 + address, &[0x07, 0x00]).unwrap();
    // One of each sweep, and some before that nobody hears.
    let mut with_starts = Vec::new();
    for round in 0..SWEEPS + 3 {
        let t_ns = round * 20_000_000;
        for address in 0..8 {
            with_starts.extend([0, 1].map(|bus| (bus, t_ns, start(address))));
        }
        let of_round = sweeps.iter().filter(|(_, at, _)| at / 20_000_000 + 3 == round);
        with_starts.extend(of_round.map(|(bus, at, frame)| (*bus, at + 60_000_000, *frame)));
    }
    let (alone, found) = (recognise(2, &sweeps), recognise(2, &with_starts));
    for (alone, found) in alone.buses.iter().zip(&found.buses) {
        assert_eq!(found.boards.len(), alone.boards.len());
        for (alone, found) in alone.boards.iter().zip(&found.boards) {
            assert_eq!((found.board, &found.taxels), (alone.board, &alone.taxels));
            let rate_hz = found.rate_hz.unwrap();
            assert!((rate_hz - 50.0).abs() < 0.1, "board {}: {rate_hz}", found.board);
        }
        assert_eq!((&found.others, &found.doubts), (&alone.others, &alone.doubts));
    }
}

#[test]
fn the_answer_to_a_discovery_tells_an_mtb4_from_an_mtb3() {
    let layout = crate::support::icub("icub-mtb4", "");
    let mut with_answer = traffic(&layout);
    assert!(recognise(1, &with_answer).buses[0].doubts[0].contains("MTB4"));
    with_answer.insert(
        0,
        (0, 0, CanFrame::standard(0x710, &[0xFF, 11, 1, 2, 3]).unwrap()),
    );
    assert_eq!(
        recognise(1, &with_answer).buses[0].boards[0].protocol,
        Protocol::ICUB_MTB4
    );
}

fn any_frame() -> impl Strategy<Value = CanFrame> {
    let data = prop::collection::vec(any::<u8>(), 0..=8);
    (any::<bool>(), 0u32..0x2000_0000, data).prop_map(|(extended, id, data)| {
        let frame = match extended {
            true => CanFrame::extended(id, &data),
            false => CanFrame::standard((id % 0x800) as u16, &data),
        };
        frame.unwrap()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever is heard, a proposed file is a layout.
    #[test]
    fn no_traffic_makes_a_file_that_is_refused(
        frames in prop::collection::vec((0u8..3, any_frame(), 1usize..6), 0..400),
        name in "[^\u{0}]{1,8}",
    ) {
        let mut recogniser = Recogniser::new(2);
        for (t, (bus, frame, times)) in frames.iter().enumerate() {
            for n in 0..*times {
                let t_ns = (t + n) as u64 * 1000;
                recogniser.handle_frame(*bus, &Received { t_ns, frame: *frame });
            }
        }
        let found = recogniser.finish();
        if let Some(text) = found.layout_file(&name, &["a", "b"]) {
            prop_assert!(Layout::parse(&text, "any.toml").is_ok(), "{}", text);
        }
    }

    /// Frames of real boards in any order, with strangers in between.
    #[test]
    fn strangers_do_not_hide_a_board(noise in prop::collection::vec(any_frame(), 0..60), address in 0u8..8) {
        let ks: Vec<u8> = (0..16).collect();
        let mut traffic = board(Protocol::USKIN_L2, address, &ks, None);
        traffic.extend(noise.iter().map(|frame| (0, 0, *frame)));
        let found = recognise(1, &traffic);
        prop_assert!(found.buses[0].boards.iter().any(|b| b.board == address && b.taxels == ks));
    }
}
