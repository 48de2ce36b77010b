//! The messages as version 1.0 made them: what later versions have to read, and what its readers
//! were checked against.
//!
//! Their files never change. What is encoded here is what a newer encoder makes of the same values,
//! with 1.0's number in the header; RAW, which has grown, is the file itself.

use super::*;
use taxel_wire::{Event, EventKind, MAX_MESSAGE, MINOR, Subscribe, split_text};

pub(super) fn vectors() -> Vec<Named> {
    let good = vec![
        (
            "image_example",
            "the example of docs/wire.md: 4x3 pixels, two levels, two actuators, one joint",
            image_packet(&example(), 0),
        ),
        (
            "image_calibrating",
            "no contact while the baseline is measured",
            image_packet(&calibrating(), 0),
        ),
        (
            "image_hand",
            "16x16 pixels, 8 levels, 16 actuators, 16 joints, faults, 3 images skipped",
            hand(),
        ),
        (
            "image_odd",
            "3x3 pixels, so that three zeros pad the payload",
            image_packet(&odd(), 0),
        ),
        (
            "image_extremes",
            "largest seq, t_ns and skipped; a joint that could not be read",
            extremes(),
        ),
        (
            "image_newer_minor",
            "minor 3 with a longer header, a longer fixed part and a section behind the pixels",
            newer_minor(),
        ),
        (
            "image_no_pixels",
            "width 0: nothing but the fixed part",
            image_packet(&TactileImage::default(), 0),
        ),
        (
            "raw_two_taxels",
            "a fresh taxel in contact and a missing one, two joints",
            raw_two_taxels(),
        ),
        (
            "raw_longer_record",
            "a newer minor with 24 bytes per taxel",
            longer_record(),
        ),
        (
            "hello",
            "a small hand, whole",
            hello().to_packets(7, 1_000).concat(),
        ),
        ("hello_part", "the first part of a HELLO: flag MORE", hello_part()),
        (
            "event_disconnect",
            "why the daemon closes the connection",
            event(),
        ),
        (
            "status",
            "a status report",
            text_packet(Kind::Status, b"{\"uptime_s\":12}"),
        ),
        (
            "subscribe",
            "a viewer wants raw counts at 30 Hz",
            Subscribe {
                raw: true,
                max_rate_hz: Some(30.0),
                ..Subscribe::default()
            }
            .to_packet(),
        ),
        (
            "hello_region",
            "the same hand for a display of four levels and five actuators on the thumb",
            Hello {
                profile: HelloProfile {
                    levels: 4,
                    actuators: 5,
                    method: "optimal".into(),
                    grey: "centroid".into(),
                },
                region: Some(vec!["thumb".into()]),
                ..hello()
            }
            .to_packets(9, 2_000)
            .concat(),
        ),
        (
            "subscribe_profile",
            "a display of four levels and five actuators on the thumb, at most 60 Hz; absent keys take their defaults",
            text_packet(
                Kind::Subscribe,
                br#"{"profile":{"levels":4,"actuators":5,"method":"optimal","grey":"centroid"},"region":["thumb"],"max_rate_hz":60}"#,
            ),
        ),
        (
            "unknown_type",
            "a type of a later version, to be skipped",
            text_packet(Kind::Other(0x8001), &[1, 2, 3]),
        ),
    ];
    let example = image_packet(&example(), 0);
    let raw = raw_two_taxels();
    let broken = vec![
        ("bad_empty", "no bytes at all", Vec::new()),
        ("bad_short_header", "39 bytes", example[..39].to_vec()),
        ("bad_magic", "another file", put(&example, 0, b"RIFF")),
        ("bad_major", "major version 2", put(&example, 4, &[2])),
        ("bad_header_len", "header_len 32", put(&example, 6, &[32, 0])),
        (
            "bad_header_len_beyond",
            "header_len 65535 in a short packet",
            put(&example, 6, &[0xff, 0xff]),
        ),
        (
            "bad_too_long",
            "one byte above the largest message",
            put(&example, 12, &payload_of(MAX_MESSAGE + 1)),
        ),
        (
            "bad_too_long_wraps",
            "payload_len that wraps around 32 bits when the header is added",
            put(&example, 12, &[0xff; 4]),
        ),
        (
            "bad_truncated",
            "the last byte is missing",
            example[..example.len() - 1].to_vec(),
        ),
        (
            "bad_truncated_largest",
            "the largest payload_len in a short packet",
            put(&example, 12, &payload_of(MAX_MESSAGE)),
        ),
        (
            "bad_trailing",
            "a byte behind the message",
            [&example[..], &[0]].concat(),
        ),
        (
            "bad_image_no_payload",
            "an image without payload",
            Header::new(Kind::Image, 0).to_bytes().to_vec(),
        ),
        ("bad_image_fixed_len", "fixed_len 20", put(&example, 50, &[20, 0])),
        (
            "bad_image_fixed_len_odd",
            "fixed_len 26, not a multiple of 4",
            put(&example, 50, &[26, 0]),
        ),
        ("bad_image_width", "width 65535", put(&example, 40, &[0xff, 0xff])),
        (
            "bad_image_everything_huge",
            "every count 65535",
            put(&example, 40, &[0xff; 10]),
        ),
        (
            "bad_image_levels",
            "one level more than there is room for",
            put(&example, 44, &[3, 0]),
        ),
        (
            "bad_level_nan",
            "a level that is not a number",
            put(&example, 64, &f32::NAN.to_le_bytes()),
        ),
        (
            "bad_level_negative",
            "a negative level",
            put(&example, 68, &(-1f32).to_le_bytes()),
        ),
        (
            "bad_actuator_x",
            "an actuator right of the image",
            put(&example, 74, &[4, 0]),
        ),
        (
            "bad_actuator_y",
            "an actuator below the image",
            put(&example, 76, &[3, 0]),
        ),
        (
            "bad_actuator_level_0",
            "an actuator with level 0",
            put(&example, 78, &[0, 0]),
        ),
        (
            "bad_actuator_level_3",
            "an actuator with a level outside the codebook",
            put(&example, 90, &[3, 0]),
        ),
        (
            "bad_actuator_force",
            "an actuator with an infinite force",
            put(&example, 92, &f32::INFINITY.to_le_bytes()),
        ),
        (
            "bad_raw_no_payload",
            "raw counts without payload",
            Header::new(Kind::Raw, 0).to_bytes().to_vec(),
        ),
        ("bad_raw_taxels", "4294967295 taxels", put(&raw, 40, &[0xff; 4])),
        (
            "bad_raw_record_len",
            "16 bytes per taxel",
            put(&raw, 44, &[16, 0]),
        ),
        ("bad_raw_fixed_len", "fixed_len 18", put(&raw, 46, &[18, 0])),
        (
            "bad_raw_joints",
            "more joints than there is room for",
            put(&raw, 52, &[3, 0]),
        ),
    ];
    good.into_iter()
        .chain(broken)
        .map(|(name, description, packet)| (name, description, of_1_0(packet)))
        .collect()
}

/// The same message with 1.0's number; messages of other versions stay as they are.
fn of_1_0(mut packet: Vec<u8>) -> Vec<u8> {
    if let Some(minor) = packet.get_mut(5).filter(|minor| **minor == MINOR) {
        *minor = 0;
    }
    packet
}

/// The small hand as 1.0 described it.
fn hello() -> Hello {
    let mut hello = super::hello();
    hello.protocol.minor = 0;
    for module in &mut hello.modules {
        (module.pose, module.joint) = (None, None);
    }
    hello
}

fn raw_two_taxels() -> Vec<u8> {
    include_bytes!("../../vectors/raw_two_taxels.bin").to_vec()
}

fn longer_record() -> Vec<u8> {
    let raw = raw_two_taxels();
    let mut packet = put(&raw, 44, &[24, 0]);
    packet.splice(96..96, [0xaa; 4]);
    packet.splice(76..76, [0xaa; 4]);
    put(&packet, 12, &72u32.to_le_bytes())
}

fn calibrating() -> TactileImage {
    TactileImage {
        seq: 3,
        t_ns: 100_000_000,
        width: 16,
        height: 16,
        pixels: vec![0; 256],
        calibrating: true,
        ..TactileImage::default()
    }
}

fn odd() -> TactileImage {
    TactileImage {
        width: 3,
        height: 3,
        pixels: (1..10).collect(),
        ..TactileImage::default()
    }
}

fn hand() -> Vec<u8> {
    let levels: Vec<f64> = (1..=8).map(|level| f64::from(level) * 812.25).collect();
    let image = TactileImage {
        seq: 40_000,
        t_ns: 1_333_333_333_333,
        width: 16,
        height: 16,
        pixels: (0..=255).map(|pixel: u8| pixel / 32 * 36).collect(),
        actuators: (0..16)
            .map(|id| {
                let level = id % 8 + 1;
                Actuator {
                    id,
                    x: id,
                    y: 15 - id,
                    level,
                    force: levels[usize::from(level) - 1],
                }
            })
            .collect(),
        levels,
        contacts: 224,
        faulty: 2,
        missing: 5,
        calibrating: false,
        repaired: true,
        saturated: true,
        joints: (0..16).map(|joint| joint as f32 * 0.1 - 0.7).collect(),
    };
    let mut payload = Vec::new();
    encode_image_payload(&image, &mut payload).unwrap();
    let header = Header::of_image(&image, payload.len()).with_skipped(3);
    [&header.to_bytes()[..], &payload].concat()
}

fn extremes() -> Vec<u8> {
    let image = TactileImage {
        seq: u64::MAX,
        t_ns: u64::MAX,
        joints: vec![f32::NAN, 3.0],
        ..odd()
    };
    image_packet(&image, u32::MAX)
}

fn newer_minor() -> Vec<u8> {
    let mut packet = image_packet(&example(), 0);
    packet[5] = 3;
    packet[6] = 48;
    packet[50] = 32;
    packet.splice(64..64, [0xbb; 8]);
    packet.splice(40..40, [0xaa; 8]);
    packet.extend_from_slice(&[0xcc; 16]);
    let payload_len = packet.len() as u32 - 48;
    put(&packet, 12, &payload_len.to_le_bytes())
}

fn hello_part() -> Vec<u8> {
    let text = hello().to_json();
    let (header, part) = split_text(Kind::Hello, &text, 100, 7, 1_000).next().unwrap();
    [&header.to_bytes()[..], part].concat()
}

fn event() -> Vec<u8> {
    Event::new(EventKind::Disconnect, "nothing was read for 5 s").to_packet(1300, 5_100_000_000)
}

fn payload_of(message: usize) -> [u8; 4] {
    (message as u32 - 40).to_le_bytes()
}
