//! iCub and CPM-finger frames, as the protocol's worked examples have them.

use taxel_can::CanFrame;
use taxel_hand::{Fault, ForceFrame, Freshness, TactileFrame};
use taxel_skin::{
    BoardStatus, ConditionConfig, Conditioner, Decoded, Decoder, ICUB_NO_ACK, ICUB_NOT_CONNECTED,
    ICUB_OUT_OF_RANGE, Layout, Readings, STATUS_ERROR, SweepAssembler, SweepConfig, icub_triangle_data,
};

fn frame(text: &str) -> CanFrame {
    let (id, data) = text.split_once('#').unwrap();
    let bytes: Vec<u8> = (0..data.len() / 2)
        .map(|i| u8::from_str_radix(&data[2 * i..2 * i + 2], 16).unwrap())
        .collect();
    CanFrame::standard(u16::from_str_radix(id, 16).unwrap(), &bytes).unwrap()
}

/// What a decoder makes of a frame: `k` of the taxel, z and status.
fn decode(decoder: &mut Decoder, layout: &Layout, text: &str) -> (Decoded, Vec<(u16, u16, u8)>) {
    let mut readings = Readings::new();
    let decoded = decoder.decode(&frame(text), &mut readings);
    let values = readings
        .iter()
        .map(|r| {
            assert_eq!(r.counts[..2], [0, 0]);
            (layout.k[r.taxel as usize], r.counts[2], r.status)
        })
        .collect();
    (decoded, values)
}

const fn z(value: u16) -> u16 {
    16 * value + 8
}

#[test]
fn a_triangle_comes_in_two_frames_and_its_thermal_pads_are_no_taxels() {
    let layout = crate::support::icub("icub-mtb3", "");
    let mut decoder = Decoder::new(&layout, 0);
    let (decoded, values) = decode(&mut decoder, &layout, "410#40F5F4F3F2F1F0EF");
    assert_eq!(decoded, Decoded::Readings);
    let first: Vec<(u16, u16, u8)> = (0..6).map(|k| (k, z(0xF5 - k), 0)).collect();
    assert_eq!(values, first, "pad 6 is thermal");
    let (decoded, values) = decode(&mut decoder, &layout, "413#C000010203040000");
    assert_eq!(decoded, Decoded::Readings);
    assert_eq!(
        values,
        [(43, z(0), 0), (44, z(1), 0), (45, z(2), 0), (47, z(4), 0)]
    );

    let thermal = [
        (6, Some(0xEF)),
        (10, None),
        (42, None),
        (46, Some(3)),
        (0, Some(0xF5)),
        (200, None),
    ];
    for (k, value) in thermal {
        assert_eq!(decoder.auxiliary(0, k), value, "pad {k}");
    }
    assert_eq!(decoder.auxiliary(1, 6), None);
}

#[test]
fn which_pads_of_a_board_are_taxels_depends_on_what_is_mounted() {
    let tip = |skin_type: u8, order: &str| {
        format!(
            "name = \"tip\"\nimage = {{ width = 12, height = 1 }}\nbuses = [\"can0\"]\n[[module]]\nname = \"tip\"\n\
             part = \"p\"\nbus = \"can0\"\nboard = 14\nprotocol = \"icub-mtb3\"\nicub = {{ skin_type = {skin_type} }}\n\
             at = [0, 0]\norder = [[{order}]]\n"
        )
    };
    // All twelve pads of a fingertip feel, and of a palm those that are no thermal pads.
    let fingertip = Layout::parse(&tip(1, "0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11"), "tip.toml").unwrap();
    let mut decoder = Decoder::new(&fingertip, 0);
    let (_, values) = decode(&mut decoder, &fingertip, "4E0#C0F5F5F5F5800000");
    assert_eq!(values.iter().map(|v| v.0).collect::<Vec<_>>(), [7, 8, 9, 10, 11]);
    let palm = Layout::parse(&tip(1, "132, 133, 137, 138, 140, 141, 142, 143"), "tip.toml").unwrap();
    let mut decoder = Decoder::new(&palm, 0);
    let (_, values) = decode(&mut decoder, &palm, "4EB#C080F5F5F5F50000");
    assert_eq!(
        values.iter().map(|v| v.0).collect::<Vec<_>>(),
        [140, 141, 142, 143]
    );
    assert_eq!(decoder.auxiliary(0, 139), Some(0x80));
    // Compensation, second version of it, none, a test; a hand's fingertips come first.
    for (skin_type, order, refused) in [
        (0, "5, 6", Some(6)),
        (8, "9, 10", Some(10)),
        (2, "5, 6, 10", None),
        (7, "5, 6, 10", None),
        (3, "54, 58", None),
        (3, "65, 66", Some(66)),
    ] {
        match (Layout::parse(&tip(skin_type, order), "tip.toml"), refused) {
            (Ok(layout), None) => assert_eq!(layout.k_of(&layout.modules[0]).len(), order.split(',').count()),
            (Err(error), Some(k)) => {
                let wanted = format!("its order has {k}, which measures temperature");
                assert!(error.to_string().contains(&wanted), "{error}");
            }
            (parsed, _) => panic!("skin_type {skin_type}, {order}: {parsed:?}"),
        }
    }
}

#[test]
fn the_status_of_the_second_frame_says_which_values_must_not_be_used() {
    // out-of-range mask (bit per pad), error bits, value of every pad, status of pad 0 and of pad 7
    let error = STATUS_ERROR;
    let cases = [
        (0x000, 0, 245, 0, 0),
        (0x000, 1, 245, error | ICUB_NO_ACK, error | ICUB_NO_ACK),
        (
            0x000,
            2,
            245,
            error | ICUB_NOT_CONNECTED,
            error | ICUB_NOT_CONNECTED,
        ),
        // Bits that are not described are errors all the same.
        (0x000, 8, 245, error | 8, error | 8),
        // Pressed beyond the range: the strongest touch, and no fault.
        (0x001, 0, 0, ICUB_OUT_OF_RANGE, 0),
        (0x080, 0, 0, 0, ICUB_OUT_OF_RANGE),
        // Beyond the range on the other side.
        (0x001, 0, 255, error | ICUB_OUT_OF_RANGE, 0),
    ];
    let layout = crate::support::icub("icub-mtb3", "");
    for (mask, errors, value, of_pad_0, of_pad_7) in cases {
        let mut decoder = Decoder::new(&layout, 0);
        let mut readings = Readings::new();
        let [first, second] = icub_triangle_data([value; 12], mask, errors);
        // An MTB3 may send the second frame first.
        for data in [second, first] {
            decoder.decode(&CanFrame::standard(0x410, &data).unwrap(), &mut readings);
            for reading in readings.iter() {
                let expected = match layout.k[reading.taxel as usize] {
                    0 => of_pad_0,
                    7 => of_pad_7,
                    _ => continue,
                };
                assert_eq!(
                    reading.status, expected,
                    "{mask:#x} {errors} {value}: {reading:?}"
                );
            }
        }
    }
}

#[test]
fn the_status_word_is_laid_out_as_the_document_says() {
    // b6 = (mask & 0x0ff0) >> 4, b7 = (mask & 0xf) << 4 | err
    for (mask, error) in [(0x000, 0), (0xABC, 1), (0xFFF, 3), (0x801, 2)] {
        let [_, second] = icub_triangle_data([0; 12], mask, error);
        let expected = [((mask & 0x0FF0) >> 4) as u8, ((mask & 0xF) << 4) as u8 | error];
        assert_eq!(second[6..], expected, "{mask:#x}");
    }
}

#[test]
fn other_frames_of_an_icub_bus_are_told_apart() {
    let layout = crate::support::icub("icub-mtb3", "");
    let cases = [
        ("413#40F5F5F5F5F5F5F5", Decoded::Readings),
        // Class 3, from a board set up by obsolete commands; old firmware sends no status.
        ("310#40F5F5F5F5F5F5F5", Decoded::Readings),
        ("310#C0F5F5F5F5F5", Decoded::Readings),
        // A triangle or a board that the layout does not have.
        ("411#40F5F5F5F5F5F5F5", Decoded::Unknown),
        ("420#40F5F5F5F5F5F5F5", Decoded::Unknown),
        ("410#41F5F5F5F5F5F5F5", Decoded::Malformed { board: 0 }),
        ("410#40F5F5F5F5F5F5", Decoded::Malformed { board: 0 }),
        ("410#C0F5F5F5F5F500", Decoded::Malformed { board: 0 }),
        ("410#", Decoded::Malformed { board: 0 }),
        ("715#", Decoded::QueueOverflow { board: 0 }),
        ("201#0700", Decoded::Command),
        ("201#4D0032F5", Decoded::Command),
        ("201#50000F02000022", Decoded::Command),
        ("20F#0701", Decoded::Command),
        ("203#50000F02000022", Decoded::Unknown),
        // Debug and inertial frames of the board are not its skin.
        ("100#0000000000000000", Decoded::Unknown),
        ("510#000000000000", Decoded::Unknown),
    ];
    for (text, expected) in cases {
        let mut decoder = Decoder::new(&layout, 0);
        let filters = decoder.filters().to_vec();
        let (decoded, values) = decode(&mut decoder, &layout, text);
        assert_eq!(decoded, expected, "{text}");
        assert!(decoded == Decoded::Readings || values.is_empty());
        let needed = matches!(
            decoded,
            Decoded::Readings | Decoded::Malformed { .. } | Decoded::QueueOverflow { .. }
        );
        assert!(
            !needed || filters.iter().any(|f| f.passes(&frame(text))),
            "{text} must pass the filter"
        );
    }
}

#[test]
fn of_commands_of_another_program_those_that_a_board_obeys_are_counted_and_questions_are_not() {
    let layout = crate::support::icub("icub-mtb3", "");
    let cases = [
        ("201#0700", 1),
        ("20F#0701", 1),
        ("201#4D0032F5", 1),
        ("201#50000F02000022", 1),
        // Who is there, and that it is board 1.
        ("201#1C0100", 0),
        ("210#1C02110001000000", 0),
        ("413#40F5F5F5F5F5F5F5", 0),
    ];
    for (text, obeyed) in cases {
        let mut decoder = Decoder::new(&layout, 0);
        let (decoded, _) = decode(&mut decoder, &layout, text);
        let counters = decoder.counters();
        assert_eq!(counters.obeyed, obeyed, "{text}");
        assert_eq!(counters.commands, (decoded == Decoded::Command) as u64, "{text}");
    }
}

#[test]
fn an_mtb4_that_calibrates_itself_anew_is_reported_and_an_mtb3_does_not() {
    for (protocol, expected) in [("icub-mtb4", 2), ("icub-mtb3", 0)] {
        let layout = crate::support::icub(protocol, "");
        let mut decoder = Decoder::new(&layout, 0);
        // Four errors and a good one; then five, and more of the same run; then five again.
        let runs = [(4, false), (1, true), (9, false), (1, true), (5, false)];
        for (count, good) in runs {
            for _ in 0..count {
                let text = if good {
                    "410#C0F5F5F5F5F50000"
                } else {
                    "410#C0F5F5F5F5F50001"
                };
                decode(&mut decoder, &layout, text);
            }
        }
        assert_eq!(decoder.recalibrations(0), expected, "{protocol}");
        let mut counters = BoardStatus::default();
        decoder.add_to(0, &mut counters);
        assert_eq!(counters.recalibrations, expected);
    }
}

#[test]
fn a_press_on_the_icub_skin_is_felt_even_where_it_is_beyond_the_range() {
    let layout = crate::support::icub("icub-mtb3", "");
    let mut decoder = Decoder::new(&layout, 0);
    let config = SweepConfig {
        board_period_ms: Some(50.0),
        settle_ms: 0.0,
        ..SweepConfig::default()
    };
    let mut sweep = SweepAssembler::new(&layout, &config, true);
    let mut conditioner = Conditioner::for_layout(&layout, ConditionConfig::robust()).unwrap();
    let mut readings = Readings::new();
    let (mut tactile, mut force) = (TactileFrame::new(layout.len()), ForceFrame::new(layout.len()));
    for n in 0..200u64 {
        // At rest every pad keeps one value, as eight bits do. Then pad 2 is pressed lightly, pad 3
        // as hard as can be.
        let mut pads = [245; 12];
        let pressed = n >= 100;
        if pressed {
            (pads[2], pads[3]) = (225, 0);
        }
        for triangle in [0, 3] {
            let mask = if pressed && triangle == 0 { 1 << 3 } else { 0 };
            let pads = if triangle == 0 { pads } else { [245; 12] };
            for data in icub_triangle_data(pads, mask, 0) {
                let frame = CanFrame::standard(0x410 + triangle, &data).unwrap();
                decoder.decode(&frame, &mut readings);
                for reading in readings.iter() {
                    sweep.push(reading, 1_000_000_000 + n * 50_000_000);
                }
            }
        }
        sweep.take(1_000_000_000 + n * 50_000_000 + 5_000_000, &mut tactile);
        assert!(tactile.freshness.iter().all(|f| *f == Freshness::Fresh));
        conditioner.process(&tactile, &mut force);
    }
    assert!(force.faults.iter().all(|f| f.is_empty()), "{:?}", force.faults);
    let contacts: Vec<usize> = (0..20).filter(|i| force.contact[*i]).collect();
    assert_eq!(contacts, [2, 3]);
    assert_eq!((force.force[2], force.force[3]), (320.0, 3920.0));
}

#[test]
fn an_icub_triangle_without_chip_is_a_status_fault_and_nothing_else() {
    let layout = crate::support::icub("icub-mtb3", "");
    let mut conditioner = Conditioner::for_layout(&layout, ConditionConfig::robust()).unwrap();
    let (mut tactile, mut force) = (TactileFrame::new(20), ForceFrame::new(20));
    tactile.freshness.fill(Freshness::Fresh);
    tactile.age_ns.fill(0);
    for n in 0..100 {
        tactile.t_ns = n * 50_000_000;
        tactile.counts.fill([0, 0, z(245)]);
        tactile.status[0] = STATUS_ERROR | ICUB_NOT_CONNECTED;
        conditioner.process(&tactile, &mut force);
    }
    assert!(force.faults[0].contains(Fault::Status));
    assert!(force.faults[1..].iter().all(|f| f.is_empty()));
}

#[test]
fn the_published_finger_has_four_frames_of_four_channels_and_two_proximity_values() {
    let layout = Layout::builtin("cpm-finger").unwrap();
    let mut decoder = Decoder::new(&layout, 0);
    let cases = [
        ("405#0100020003000400", [(11, 1), (15, 2), (14, 3), (12, 4)]),
        (
            "407#0001000200030004",
            [(9, 256), (13, 512), (8, 768), (10, 1024)],
        ),
        ("409#FFFF000001000200", [(6, 65535), (7, 0), (4, 1), (5, 2)]),
        ("40B#3930000000000000", [(2, 12345), (0, 0), (3, 0), (1, 0)]),
    ];
    for (text, expected) in cases {
        let (decoded, values) = decode(&mut decoder, &layout, text);
        assert_eq!(decoded, Decoded::Readings);
        assert_eq!(values, expected.map(|(k, value)| (k, value, 0)), "{text}");
    }
    let (decoded, values) = decode(&mut decoder, &layout, "601#39300200");
    assert_eq!((decoded, values.len()), (Decoded::Readings, 0));
    assert_eq!(
        [15, 16, 17, 18].map(|k| decoder.auxiliary(0, k)),
        [None, Some(12345), Some(2), None]
    );
    for text in ["405#01", "40B#", "601#0000"] {
        assert_eq!(
            decode(&mut decoder, &layout, text).0,
            Decoded::Malformed { board: 0 },
            "{text}"
        );
    }
    assert_eq!(
        decode(&mut decoder, &layout, "406#0100020003000400").0,
        Decoded::Unknown
    );
}

#[test]
fn a_pressure_array_has_its_taxels_row_by_row_behind_a_head_of_its_size() {
    let layout = Layout::builtin("tekscan-6077").unwrap();
    assert_eq!(layout.array_on(0), Some([28, 50]));
    assert_eq!(
        (layout.taxels[51].x, layout.taxels[51].y, layout.k[1399]),
        (1, 1, 1399)
    );
    assert_eq!(layout.frames_per_sweep(0), 351);
    let counts: Vec<u16> = (0..1400).map(|k| k % 256).collect();
    let mut decoder = Decoder::new(&layout, 0);
    let mut read = Vec::new();
    for frame in taxel_can::pressure_frames([28, 50], 9, &counts) {
        let (decoded, values) = decode(&mut decoder, &layout, &frame.to_string());
        assert_eq!(decoded, Decoded::Readings, "{frame}");
        read.extend(values.into_iter().map(|(_, value, _)| value));
    }
    assert_eq!(read, counts);
    // Of a recording of another array nothing is taken, whatever its ids.
    for frame in taxel_can::pressure_frames([50, 28], 9, &counts) {
        let (decoded, _) = decode(&mut decoder, &layout, &frame.to_string());
        assert_eq!(decoded, Decoded::Malformed { board: 0 }, "{frame}");
    }
    let (decoded, _) = decode(&mut decoder, &layout, "000#1C00320001000000");
    assert_eq!(decoded, Decoded::Readings);
    for text in ["001#010002000300", "15E#01000200030004", "000#1C0032"] {
        let (decoded, _) = decode(&mut decoder, &layout, text);
        assert_eq!(decoded, Decoded::Malformed { board: 0 }, "{text}");
    }
    assert_eq!(decode(&mut decoder, &layout, "15F#0100").0, Decoded::Unknown);
}

#[test]
fn a_pressure_array_is_alone_on_its_bus_and_says_how_large_it_is() {
    let file = |keys: &str, more: &str| {
        format!(
            "name = \"a\"\nimage = {{ width = 9, height = 9 }}\nbuses = [\"t\"]\n[[module]]\nname = \"m\"\npart = \"p\"\n\
             bus = \"t\"\nprotocol = \"pressure-array\"\nat = [0, 0]\n{keys}\n{more}"
        )
    };
    let other = |protocol: &str| {
        format!(
            "[[module]]\nname = \"o\"\npart = \"p\"\nbus = \"t\"\nboard = 0\nprotocol = \"{protocol}\"\nat = [5, 5]\n{}",
            if protocol == "pressure-array" {
                "rows = 1\ncolumns = 2"
            } else {
                ""
            }
        )
    };
    let size = "rows = 2\ncolumns = 3";
    let layout = Layout::parse(&file(size, ""), "a.toml").unwrap();
    assert_eq!((layout.len(), layout.array_on(0)), (6, Some([2, 3])));
    let turned = Layout::parse(&file(&format!("{size}\nrotation = 90"), ""), "a.toml").unwrap();
    assert_eq!(turned.array_on(0), Some([2, 3]), "the array sends as before");
    assert_eq!((turned.taxels[1].x, turned.taxels[1].y), (1, 1));
    for (text, problem) in [
        (file("rows = 2", ""), "needs the key `columns`"),
        (file("rows = 0\ncolumns = 3", ""), "has 1 to 8188 rows, not 0"),
        (
            file("rows = 100\ncolumns = 100", ""),
            "10000 taxels in 100 rows of 100; an array has 8188 at most",
        ),
        (
            file(&format!("{size}\norder = [[0]]"), ""),
            "no use for the key `order`",
        ),
        (
            file(size, &other("uskin-l2")),
            "cannot share bus \"t\" with module \"m\" (line 4)",
        ),
        (file(size, &other("pressure-array")), "board 0"),
        (
            file(size, "").replace("pressure-array", "uskin-l2\"\nboard = 1#"),
            "no use for the key `rows`",
        ),
    ] {
        let error = Layout::parse(&text, "a.toml").unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
}

#[test]
fn an_array_at_rest_reads_nothing_and_is_not_out_of_order() {
    let layout = Layout::builtin("tekscan-6077").unwrap();
    let mut conditioner = Conditioner::for_layout(&layout, ConditionConfig::robust()).unwrap();
    let (mut tactile, mut force) = (TactileFrame::new(1400), ForceFrame::new(1400));
    tactile.freshness.fill(Freshness::Fresh);
    tactile.age_ns.fill(0);
    for n in 0..100 {
        tactile.t_ns = n * 100_000_000;
        tactile.counts[30] = [0, 0, if n < 80 { 0 } else { 60 }];
        conditioner.process(&tactile, &mut force);
    }
    assert!(!force.calibrating && force.faults.iter().all(|faults| faults.is_empty()));
    let felt: Vec<usize> = (0..1400).filter(|n| force.contact[*n]).collect();
    assert_eq!((felt, force.force[30]), (vec![30], 60.0));
}
