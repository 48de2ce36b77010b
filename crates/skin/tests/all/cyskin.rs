//! CySkin packets: assembly over frames, what is refused, and what has to be configured.

use crate::support::{CYSKIN, cyskin, cyskin_text};
use proptest::prelude::*;
use taxel_can::CanFrame;
use taxel_skin::{BoardStatus, Decoded, Decoder, Layout, Readings, STATUS_ERROR, cyskin_frames};

const SENSOR_DATA: u8 = 0x43;
const FIRST: u32 = 0x0400_0000;
const MIDDLE: u32 = 0x0800_0000;
const LAST: u32 = 0x1000_0000;
const SINGLE: u32 = 0x1400_0000;

fn extended(id: u32, data: &[u8]) -> CanFrame {
    CanFrame::extended(id, data).unwrap()
}

/// Taxel name (module name and sensor) and value of each reading of the last frame.
fn play(decoder: &mut Decoder, layout: &Layout, frames: &[CanFrame]) -> (Vec<Decoded>, Vec<(String, u16)>) {
    let mut readings = Readings::new();
    let mut decoded = Vec::new();
    let mut values = Vec::new();
    for frame in frames {
        decoded.push(decoder.decode(frame, &mut readings));
        values = readings
            .iter()
            .map(|r| {
                let taxel = r.taxel as usize;
                let name = format!("{}.{}", layout.module_of(taxel).name, layout.k[taxel]);
                (name, r.counts[2])
            })
            .collect();
    }
    (decoded, values)
}

#[test]
fn a_single_frame_carries_a_whole_packet() {
    let layout = cyskin(CYSKIN, 3);
    let mut decoder = Decoder::new(&layout, 0);
    // Module 2, from sensor 4: one value, 0x1234; the sum of all before is 0x43 + 4 + 2 + 4 + 0x12 + 0x34.
    let packet = [SENSOR_DATA, 4, 2, 4, 0x12, 0x34, 0x93];
    let (decoded, values) = play(&mut decoder, &layout, &[extended(SINGLE | 0x124, &packet)]);
    assert_eq!(decoded, [Decoded::Readings]);
    assert_eq!(values, [("b2.4".to_string(), 0x1234)]);
    assert_eq!(
        cyskin_frames(layout.cyskin.as_ref().unwrap(), 0x124, SENSOR_DATA, &packet[2..6]).unwrap(),
        [extended(SINGLE | 0x124, &packet)]
    );
}

#[test]
fn values_run_over_sensors_and_modules_and_temperatures_are_kept_apart() {
    let layout = cyskin(CYSKIN, 3);
    let setup = layout.cyskin.as_ref().unwrap();
    let mut decoder = Decoder::new(&layout, 0);
    // From sensor 6 of module 0 to sensor 2 of module 1: 6 to 11, then 0, 1, 2.
    let mut data = vec![0, 6];
    for value in 100..109u16 {
        data.extend(value.to_be_bytes());
    }
    let frames = cyskin_frames(setup, 0x123, SENSOR_DATA, &data).unwrap();
    assert_eq!(
        frames.len(),
        4,
        "8 + 7 + 7 + 1 bytes, since 20 data bytes are numbered"
    );
    let (decoded, values) = play(&mut decoder, &layout, &frames);
    assert_eq!(
        decoded,
        [
            Decoded::Partial,
            Decoded::Partial,
            Decoded::Partial,
            Decoded::Readings
        ]
    );
    let named = |name: &str, value| (name.to_string(), value);
    assert_eq!(
        values,
        [
            named("a0.6", 100),
            named("a0.7", 101),
            named("a1.1", 107),
            named("a1.2", 108)
        ]
    );
    assert_eq!(decoder.auxiliary(1, 0), Some(106), "temperature of module a1");
    assert_eq!([0, 2, 3].map(|board| decoder.auxiliary(board, 0)), [None; 3]);
}

#[test]
fn byte_order_and_invalid_values_are_as_configured_and_published() {
    for (order, value) in [("big", 0x0102), ("little", 0x0201)] {
        let layout = cyskin(&CYSKIN.replace("big", order), 1);
        let setup = layout.cyskin.as_ref().unwrap();
        let mut decoder = Decoder::new(&layout, 0);
        let frames = cyskin_frames(setup, 0x123, SENSOR_DATA, &[0, 1, 1, 2]).unwrap();
        assert_eq!(play(&mut decoder, &layout, &frames).1[0].1, value, "{order}");
        for (bytes, status) in [([0, 0], STATUS_ERROR), ([0xFF, 0xFF], STATUS_ERROR), ([0, 1], 0)] {
            let frames = cyskin_frames(setup, 0x123, SENSOR_DATA, &[0, 1, bytes[0], bytes[1]]).unwrap();
            let mut readings = Readings::new();
            decoder.decode(&frames[0], &mut readings);
            assert_eq!(readings[0].status, status, "{bytes:?}");
        }
    }
}

#[test]
fn hubs_interleave_and_what_breaks_a_packet_is_counted() {
    let layout = cyskin(CYSKIN, 2);
    let setup = layout.cyskin.as_ref().unwrap();
    let frames = |hub| {
        let mut data = vec![0, 1];
        data.extend([9; 14]);
        cyskin_frames(setup, hub, SENSOR_DATA, &data).unwrap()
    };
    let (a, b) = (frames(0x123), frames(0x124));
    assert_eq!(a.len(), 3);
    let malformed = Decoded::Malformed { board: 0 };
    let p = Decoded::Partial;
    let r = Decoded::Readings;
    let f = |frame: &CanFrame, change: fn(&mut Vec<u8>)| {
        let mut data = frame.data().to_vec();
        change(&mut data);
        extended(frame.id(), &data)
    };
    type Case = (&'static str, Vec<CanFrame>, Vec<Decoded>, u64);
    let cases: Vec<Case> = vec![
        (
            "interleaved",
            vec![a[0], b[0], a[1], b[1], b[2], a[2]],
            vec![p, p, p, p, r, r],
            0,
        ),
        (
            "first lost",
            vec![a[1], a[2], a[0], a[1], a[2]],
            vec![malformed, malformed, p, p, r],
            0,
        ),
        (
            "middle lost",
            vec![a[0], a[2], a[0], a[1], a[2]],
            vec![p, malformed, p, p, r],
            1,
        ),
        (
            "last lost",
            vec![a[0], a[1], a[0], a[1], a[2]],
            vec![p, p, p, p, r],
            1,
        ),
        (
            "repeated",
            vec![a[0], a[1], a[1], a[2]],
            vec![p, p, malformed, malformed],
            1,
        ),
        (
            "checksum",
            vec![a[0], a[1], f(&a[2], |d| *d.last_mut().unwrap() ^= 1)],
            vec![p, p, malformed],
            0,
        ),
        (
            "too long",
            vec![a[0], a[1], f(&a[2], |d| d.push(0))],
            vec![p, p, malformed],
            1,
        ),
        (
            "too short",
            vec![a[0], a[1], f(&a[2], |d| d.truncate(d.len() - 1))],
            vec![p, p, malformed],
            0,
        ),
        (
            "no data",
            vec![extended(FIRST | 0x123, &[]), extended(SINGLE | 0x123, &[])],
            vec![malformed; 2],
            0,
        ),
        (
            "a number first",
            vec![extended(SINGLE | 0x123, &[0x0F, 0, 0x0F])],
            vec![malformed],
            0,
        ),
        (
            "no assembly bits",
            vec![extended(0x123, &[SENSOR_DATA, 0, 0x43])],
            vec![malformed],
            0,
        ),
        (
            "bits that mean nothing",
            vec![extended(MIDDLE | LAST | 0x123, &[1])],
            vec![malformed],
            0,
        ),
        (
            "odd number of bytes",
            cyskin_frames(setup, 0x123, SENSOR_DATA, &[0, 1, 5]).unwrap(),
            vec![malformed],
            0,
        ),
        (
            "no module",
            cyskin_frames(setup, 0x123, SENSOR_DATA, &[]).unwrap(),
            vec![malformed],
            0,
        ),
        (
            "no such module",
            cyskin_frames(setup, 0x123, SENSOR_DATA, &[248, 1]).unwrap(),
            vec![malformed],
            0,
        ),
        (
            "beyond the last module",
            cyskin_frames(setup, 0x123, SENSOR_DATA, &[247, 11, 0, 1, 0, 1]).unwrap(),
            vec![p, malformed],
            0,
        ),
        (
            "no such sensor",
            cyskin_frames(setup, 0x123, SENSOR_DATA, &[0, 12]).unwrap(),
            vec![malformed],
            0,
        ),
        (
            "a module that is not in the layout",
            cyskin_frames(setup, 0x123, SENSOR_DATA, &[200, 1, 0, 5]).unwrap(),
            vec![Decoded::Unknown],
            0,
        ),
        (
            "nothing but a temperature of a module that is",
            cyskin_frames(setup, 0x123, SENSOR_DATA, &[0, 0, 0, 5]).unwrap(),
            vec![r],
            0,
        ),
        (
            "something else",
            cyskin_frames(setup, 0x123, 0x3E, &[1]).unwrap(),
            vec![Decoded::Command],
            0,
        ),
        (
            "another hub",
            vec![extended(SINGLE | 0x125, &[0x43, 0, 0x43])],
            vec![Decoded::Unknown],
            0,
        ),
        (
            "broadcast",
            vec![extended(SINGLE | 0x03FF_FFFF, &[0x3B, 0, 0x3B])],
            vec![Decoded::Unknown],
            0,
        ),
        (
            "standard id where they are extended",
            vec![CanFrame::standard(0x123, &[0x43, 0, 0x43]).unwrap()],
            vec![Decoded::Unknown],
            0,
        ),
    ];
    for (name, frames, expected, abandoned) in cases {
        let mut decoder = Decoder::new(&layout, 0);
        let (decoded, _) = play(&mut decoder, &layout, &frames);
        assert_eq!(decoded, expected, "{name}");
        let bus = *decoder.counters();
        let mut board = BoardStatus::default();
        decoder.add_to(0, &mut board);
        assert_eq!(bus.abandoned, abandoned, "{name}: packets given up");
        assert_eq!(bus.frames, frames.len() as u64);
        assert_eq!(
            bus.readings + bus.partial + bus.commands + bus.unknown + board.malformed,
            bus.frames,
            "{name}: every frame is in one count"
        );
    }
}

#[test]
fn a_packet_whose_next_frame_does_not_come_in_time_is_given_up() {
    let layout = cyskin(&(CYSKIN.to_string() + "timeout_ms = 20\n"), 1);
    let setup = layout.cyskin.as_ref().unwrap();
    let frames = cyskin_frames(setup, 0x123, SENSOR_DATA, &[0, 1, 0, 5, 0, 6]).unwrap();
    assert_eq!(frames.len(), 2);
    for (pause_ms, expected, abandoned) in [
        (20, Decoded::Readings, 0),
        (21, Decoded::Malformed { board: 0 }, 1),
    ] {
        let mut decoder = Decoder::new(&layout, 0);
        let mut readings = Readings::new();
        decoder.decode_at(1_000_000_000, &frames[0], &mut readings);
        let decoded = decoder.decode_at(1_000_000_000 + pause_ms * 1_000_000, &frames[1], &mut readings);
        assert_eq!(
            (decoded, decoder.counters().abandoned),
            (expected, abandoned),
            "{pause_ms} ms"
        );
    }
}

#[test]
fn what_is_not_public_of_extended_ids_has_no_default_and_is_asked_for_by_name() {
    let keys = [
        "byte_order",
        "checksum",
        "sequence_bytes_above",
        "sensors_per_module",
    ];
    for missing in keys {
        let parameters: String = CYSKIN
            .lines()
            .filter(|l| !l.starts_with(missing))
            .map(|l| format!("{l}\n"))
            .collect();
        let error = Layout::parse(&cyskin_text(&parameters, 1), "cy.toml")
            .unwrap_err()
            .to_string();
        for key in keys {
            assert_eq!(error.contains(&format!("{key} (")), key == missing, "{error}");
        }
        assert!(
            error.starts_with("cy.toml:4:") && error.contains("not public"),
            "{error}"
        );
    }
    let text = cyskin_text(CYSKIN, 1);
    let without_table: String = {
        let head = text.split("[cyskin]").next().unwrap();
        let module = text.split("[[module]]").nth(1).unwrap();
        format!("{head}[[module]]{module}")
    };
    let without_hubs = {
        let (head, rest) = text.split_once("[[cyskin.hub]]").unwrap();
        format!("{head}[[module]]{}", rest.split_once("[[module]]").unwrap().1)
    };
    let cases = [
        (without_table, vec!["cy.toml:4:", "[cyskin] lacks hub (a list"]),
        (without_hubs, vec!["hub (a list"]),
        (
            text.replace("address = 0x124\n", ""),
            vec!["hub \"b\" lacks its address", "0x3FFFFFF"],
        ),
        (
            text.replace("hub]]\nname = \"a\"", "hub]]\nname = \"a\\n\""),
            vec!["hub \"a\\n\" is no name: it has a line break"],
        ),
        (
            text.replace("0x124", "0x123"),
            vec!["hubs \"a\" and \"b\" have one address"],
        ),
        (
            text.replace("0x124", "0x3FFFFFF"),
            vec!["0x3FFFFFF is not 1 to 0x3FFFFFE"],
        ),
        (
            text.replace("hub = \"b\"", "hub = \"c\""),
            vec!["names hub \"c\"", "a, b"],
        ),
        (text.replace("hub = \"b\"\n", ""), vec!["needs the key `hub`"]),
        (
            text.replace("checksum = \"sum\"", "checksum = \"md5\""),
            vec!["unknown word `md5`"],
        ),
        (
            text.replace("order = [[1,", "order = [[0,"),
            vec!["has 0, which measures temperature"],
        ),
        (
            text.replace("order = [[1,", "order = [[12,"),
            vec!["taxel 12", "0 to 11"],
        ),
        (
            text.replace(
                "[[cyskin.hub]]\nname = \"a\"",
                "start = [{ command = 0x30 }]\n[[cyskin.hub]]\nname = \"a\"",
            ),
            vec!["command 0x30"],
        ),
        (
            text.replace("\"sum\"", "\"unchecked\"\nstop = [{ command = 0x37 }]"),
            vec!["\"unchecked\" nothing can be sent"],
        ),
    ];
    for (text, parts) in cases {
        let error = Layout::parse(&text, "cy.toml").unwrap_err().to_string();
        for part in parts {
            assert!(error.contains(part), "{error:?} does not say {part:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever the parameters, what is encoded with them is decoded with them, in every length.
    #[test]
    fn packets_of_every_length_come_through(
        values in prop::collection::vec(any::<u16>(), 0..=126),
        checksum in prop::sample::select(vec!["sum", "sum-to-zero", "inverted-sum", "xor", "crc8"]),
        above in any::<u8>(),
        per_module in 1u8..=12,
        order in prop::sample::select(vec!["big", "little"]),
        module in 0u8..=120,
    ) {
        let parameters = format!(
            "ids = \"extended\"\nbyte_order = \"{order}\"\nchecksum = \"{checksum}\"\nsequence_bytes_above = {above}\nsensors_per_module = {per_module}\n"
        );
        let layout = cyskin(&parameters, 248);
        let setup = layout.cyskin.as_ref().unwrap();
        let mut data = vec![module, 0];
        for value in &values {
            data.extend(if order == "big" { value.to_be_bytes() } else { value.to_le_bytes() });
        }
        let frames = cyskin_frames(setup, 0x123, SENSOR_DATA, &data).unwrap();
        let mut decoder = Decoder::new(&layout, 0);
        let mut readings = Readings::new();
        for (i, frame) in frames.iter().enumerate() {
            let decoded = decoder.decode(frame, &mut readings);
            let last = i + 1 == frames.len();
            prop_assert_eq!(decoded, if last { Decoded::Readings } else { Decoded::Partial });
        }
        let expected: Vec<(u8, u8, u16)> = values
            .iter()
            .enumerate()
            .map(|(i, value)| (module + i as u8 / per_module, i as u8 % per_module, *value))
            .filter(|(_, sensor, _)| (1..=7).contains(sensor))
            .collect();
        let read: Vec<(u8, u8, u16)> = readings
            .iter()
            .map(|r| (layout.wiring_of(r.taxel.into()).board, layout.k[r.taxel as usize] as u8, r.counts[2]))
            .collect();
        prop_assert_eq!(read, expected);
    }
}
