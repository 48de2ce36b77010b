//! What each kind of frame is decoded to, and in which count it ends.

use taxel_can::CanFrame;
use taxel_skin::{Decoded, Decoder, Layout, Protocol, Readings, TaxelReading};

/// Boards 0 and 5 in L2, an L1 board 1 on a bus of its own, an L3 controller 3 on a third.
fn layout() -> Layout {
    let text = r#"
        name = "mixed"
        image = { width = 16, height = 4 }
        buses = ["l2", "l1", "l3"]
        [[module]]
        name = "a"
        part = "a"
        bus = "l2"
        board = 0
        protocol = "uskin-l2"
        at = [0, 0]
        [[module]]
        name = "b"
        part = "b"
        bus = "l2"
        board = 5
        protocol = "uskin-l2"
        at = [4, 0]
        [[module]]
        name = "c"
        part = "c"
        bus = "l1"
        board = 1
        protocol = "uskin-l1"
        at = [8, 0]
        [[module]]
        name = "d"
        part = "d"
        bus = "l3"
        board = 3
        protocol = "uskin-l3"
        at = [12, 0]
        order = [[0, 1], [16, 17]]
    "#;
    Layout::parse(text, "mixed.toml").unwrap()
}

fn frame(id: u16, data: &[u8]) -> CanFrame {
    CanFrame::standard(id, data).unwrap()
}

const VALUE: [u8; 8] = [0x82, 0x80, 0x01, 0x7F, 0xFE, 0x30, 0x39, 1];

#[test]
fn every_taxel_of_every_protocol_is_read_back_from_its_frame() {
    let layout = layout();
    let mut readings = Readings::new();
    for i in 0..layout.len() {
        let (module, k) = (layout.wiring_of(i), layout.k[i]);
        let counts = [i as u16, 0x8000 + i as u16, 0xFFFF - i as u16];
        let frame = module.protocol.frame(module.board, k, counts, 0x93).unwrap();
        for bus in 0..3 {
            let mut decoder = Decoder::new(&layout, bus);
            let decoded = decoder.decode(&frame, &mut readings);
            if bus != module.bus {
                assert!(
                    readings.iter().all(|r| r.taxel != i as u16),
                    "{frame} is not of bus {bus}"
                );
                continue;
            }
            assert_eq!(decoded, Decoded::Readings, "{frame}");
            // XELA's controllers do not use the status byte, so it cannot report an error there.
            let status = if module.protocol == Protocol::USKIN_L3 {
                0
            } else {
                0x93
            };
            let taxel = i as u16;
            assert_eq!(
                *readings,
                [TaxelReading {
                    taxel,
                    counts,
                    status
                }]
            );
        }
    }
}

#[test]
fn each_kind_of_frame_is_told_apart() {
    let layout = layout();
    let cases = [
        (0, frame(0x000, &VALUE), Decoded::Readings),
        (0, frame(0x533, &VALUE), Decoded::Readings),
        // No such chip (4 and 5 are those of a 4x6 module), SDA line or board.
        (0, frame(0x004, &VALUE), Decoded::Unknown),
        (0, frame(0x006, &VALUE), Decoded::Unknown),
        (0, frame(0x040, &VALUE), Decoded::Unknown),
        (0, frame(0x100, &VALUE), Decoded::Unknown),
        (0, frame(0x500, &VALUE[..7]), Decoded::Malformed { board: 1 }),
        (0, frame(0x000, &[]), Decoded::Malformed { board: 0 }),
        (0, frame(0x004, &[]), Decoded::Unknown),
        // Queue overflow: id 0x700 | board << 4 | 5 without data, in both MTB layouts.
        (0, frame(0x755, &[]), Decoded::QueueOverflow { board: 1 }),
        (0, frame(0x705, &[]), Decoded::QueueOverflow { board: 0 }),
        (0, frame(0x715, &[]), Decoded::Unknown),
        (1, frame(0x715, &[]), Decoded::QueueOverflow { board: 2 }),
        (1, frame(0x715, &VALUE), Decoded::Readings),
        (1, frame(0x715, &VALUE[..1]), Decoded::Malformed { board: 2 }),
        (1, frame(0x714, &[]), Decoded::Malformed { board: 2 }),
        (1, frame(0x725, &[]), Decoded::Unknown),
        // A discovery reply of board 1 to host 0, which in L1 has the id of taxel 0.
        (
            1,
            frame(0x710, &[0xFF, 5, 1, 2, 3]),
            Decoded::Malformed { board: 2 },
        ),
        // Somebody else starts board 0 and stops board 5; with other data or length it is not that.
        (0, frame(0x200, &[7, 0]), Decoded::Command),
        (0, frame(0x205, &[7, 1]), Decoded::Command),
        (0, frame(0x205, &[7, 2]), Decoded::Unknown),
        (0, frame(0x205, &[7, 0, 0]), Decoded::Unknown),
        (2, frame(0x003, &VALUE), Decoded::Readings),
        (2, frame(0x113, &VALUE), Decoded::Readings),
        (2, frame(0x023, &VALUE), Decoded::Unknown),
        (2, frame(0x403, &VALUE), Decoded::Unknown),
        (2, frame(0x735, &[]), Decoded::Unknown),
        (0, CanFrame::extended(0x000, &VALUE).unwrap(), Decoded::Unknown),
        (0, CanFrame::remote(0x000, false, 8).unwrap(), Decoded::NotData),
        (0, CanFrame::remote(0x705, false, 0).unwrap(), Decoded::NotData),
        (0, CanFrame::error(0x40, VALUE), Decoded::NotData),
    ];
    let mut readings = Readings::new();
    for (bus, frame, expected) in cases {
        let mut decoder = Decoder::new(&layout, bus);
        let decoded = decoder.decode(&frame, &mut readings);
        assert_eq!(decoded, expected, "bus {bus}, {frame}");
        assert_eq!(readings.len(), (expected == Decoded::Readings) as usize);

        let counters = *decoder.counters();
        let mut boards = [0, 0];
        for board in 0..4 {
            let mut c = Default::default();
            decoder.add_to(board, &mut c);
            boards[0] += c.malformed;
            boards[1] += c.queue_overflows;
        }
        let counts = [
            counters.readings,
            counters.unknown,
            counters.not_data,
            counters.commands,
            boards[0],
            boards[1],
        ];
        let place = match expected {
            Decoded::Readings => 0,
            Decoded::Unknown => 1,
            Decoded::NotData => 2,
            Decoded::Command => 3,
            Decoded::Malformed { .. } => 4,
            Decoded::Partial => unreachable!("no packets here"),
            Decoded::QueueOverflow { .. } => 5,
        };
        let mut only = [0; 6];
        only[place] = 1;
        assert_eq!(counts, only, "{frame} is counted once, as {expected:?}");
        assert_eq!(counters.frames, 1);
    }
}

#[test]
fn the_kernel_filters_pass_what_is_decoded_and_little_else() {
    let layout = layout();
    let mut readings = Readings::new();
    // Of L2 on bus 0 also those of four chips more on each line: a 4x6 module has two of them.
    for (bus, passed_without_use) in [(0, 0x100 + 2 * 16), (1, 0x100 - 16), (2, 64 - 4)] {
        let mut decoder = Decoder::new(&layout, bus);
        let filters = decoder.filters().to_vec();
        let mut useless = 0;
        for id in 0..0x800 {
            for data in [&VALUE[..], &[]] {
                let frame = frame(id, data);
                let used = !matches!(decoder.decode(&frame, &mut readings), Decoded::Unknown);
                let passes = filters.iter().any(|f| f.passes(&frame));
                assert!(passes || !used, "bus {bus} needs {frame}");
                useless += (passes && !used && data.len() == 8) as usize;
            }
        }
        assert_eq!(useless, passed_without_use, "bus {bus}");
        let extended = CanFrame::extended(0x500, &VALUE).unwrap();
        assert!(filters.iter().all(|f| !f.passes(&extended)));
    }
}

#[test]
fn a_bus_that_the_layout_does_not_have_decodes_to_nothing() {
    let mut decoder = Decoder::new(&layout(), 9);
    assert_eq!(
        decoder.decode(&frame(0, &VALUE), &mut Readings::new()),
        Decoded::Unknown
    );
    assert!(decoder.filters().is_empty());
}
