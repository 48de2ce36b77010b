//! The messages that every reader is checked against.
#![allow(dead_code, reason = "each test binary uses its part")]

use taxel_hand::{Actuator, Fault, Faults, ForceFrame, Freshness, TactileFrame, TactileImage};
use taxel_wire::{
    Clock, Event, EventKind, Flags, Header, Hello, HelloModule, HelloProfile, HelloProtocol, HelloRate,
    HelloTaxel, Kind, MAX_MESSAGE, Subscribe, encode_image_payload, encode_raw_payload, split_text,
};

/// One message, good or bad.
pub(crate) struct Vector {
    /// Name of its files.
    pub(crate) name: &'static str,
    /// What it shows.
    pub(crate) description: &'static str,
    /// The bytes.
    pub(crate) packet: Vec<u8>,
}

/// Every vector.
pub(crate) fn all() -> Vec<Vector> {
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
            raw_packet(),
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
    let raw = raw_packet();
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
        .map(|(name, description, packet)| Vector {
            name,
            description,
            packet,
        })
        .collect()
}

/// Packets made from the vectors by changing, cutting and lengthening them; the same ones each time.
pub(crate) fn mutations(count: usize) -> Vec<(String, Vec<u8>)> {
    let vectors = all();
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    // xorshift64
    let mut below = move |n: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % n as u64) as usize
    };
    (0..count)
        .map(|number| {
            let vector = &vectors[below(vectors.len())];
            let mut packet = vector.packet.clone();
            for _ in 0..=below(3) {
                if packet.is_empty() {
                    break;
                }
                // Behind the magic; half of the time among the lengths and counts.
                let end = if below(2) == 0 {
                    packet.len().min(100)
                } else {
                    packet.len()
                };
                let at = (4 + below(end)).min(packet.len() - 1);
                packet[at] = match below(4) {
                    0 => 0,
                    1 => 0xff,
                    2 => packet[at].wrapping_add(1),
                    _ => below(256) as u8,
                };
            }
            match below(8) {
                0 => packet.truncate(below(packet.len() + 1)),
                1 => packet.extend_from_slice(&[0; 3][..below(4)]),
                2 if packet.len() >= 40 => {
                    // Cut, and say so, to get at the checks behind the header's.
                    packet.truncate(40 + below(packet.len() - 39));
                    let payload_len = packet.len() as u32 - 40;
                    packet[12..16].copy_from_slice(&payload_len.to_le_bytes());
                }
                _ => {}
            }
            (format!("mutation {number} of {}", vector.name), packet)
        })
        .collect()
}

/// The image that docs/wire.md explains byte by byte.
pub(crate) fn example() -> TactileImage {
    let mut pixels = vec![0; 12];
    pixels[5] = 128;
    pixels[6] = 255;
    TactileImage {
        seq: 1234,
        t_ns: 5_000_000_000,
        width: 4,
        height: 3,
        pixels,
        levels: vec![100.0, 250.5],
        actuators: vec![
            Actuator {
                id: 0,
                x: 1,
                y: 1,
                level: 1,
                force: 100.0,
            },
            Actuator {
                id: 1,
                x: 2,
                y: 1,
                level: 2,
                force: 250.5,
            },
        ],
        contacts: 2,
        faulty: 0,
        missing: 1,
        calibrating: false,
        repaired: false,
        joints: vec![0.5],
    }
}

/// A packet of an image.
pub(crate) fn image_packet(image: &TactileImage, skipped: u32) -> Vec<u8> {
    let mut payload = Vec::new();
    encode_image_payload(image, &mut payload).unwrap();
    let header = Header::of_image(image, payload.len()).with_skipped(skipped);
    [&header.to_bytes()[..], &payload].concat()
}

/// The description of a hand with two modules of two taxels and two absent pixels.
pub(crate) fn hello() -> Hello {
    let module = |name: &str, part: &str, first_taxel| HelloModule {
        name: name.into(),
        part: part.into(),
        first_taxel,
        taxels: 2,
    };
    let taxel = |taxel, x, y, module, position_mm| HelloTaxel {
        taxel,
        x,
        y,
        module,
        position_mm,
    };
    Hello {
        joints: Vec::new(),
        protocol: HelloProtocol { major: 1, minor: 0 },
        daemon: "taxeld 0.1.0".into(),
        layout: "two-fingers".into(),
        width: 2,
        height: 3,
        modules: vec![module("index tip", "index", 0), module("thumb tip", "thumb", 2)],
        taxels: vec![
            taxel(0, 0, 0, 0, Some([1.5, -2.0, 30.25])),
            taxel(1, 0, 1, 0, Some([1.5, 2.0, 30.25])),
            taxel(2, 1, 0, 1, None),
            taxel(3, 1, 1, 1, None),
        ],
        absent: vec![[0, 2], [1, 2]],
        profile: HelloProfile {
            levels: 8,
            actuators: 16,
            method: "paper".into(),
            grey: "level".into(),
        },
        region: None,
        rate: HelloRate {
            mode: "timer".into(),
            hz: Some(30.0),
        },
        force_unit: "counts".into(),
        clock: Clock::Monotonic,
    }
}

/// A tactile frame of two taxels and what conditioning made of it.
pub(crate) fn frame() -> (TactileFrame, ForceFrame) {
    let mut missing = Faults::NONE;
    missing.insert(Fault::Missing);
    let frame = TactileFrame {
        seq: 99,
        t_ns: 3_000_000,
        counts: vec![[33_000, 31_000, 65_535], [0; 3]],
        status: vec![0x13, 0],
        age_ns: vec![1_500_999, u64::MAX],
        freshness: vec![Freshness::Fresh, Freshness::Missing],
        joints: vec![-1.25, f32::NAN],
        joint_age_ns: vec![1_000_000, u64::MAX],
    };
    let force = ForceFrame {
        seq: 99,
        t_ns: 3_000_000,
        force: vec![1234.5, 0.0],
        contact: vec![true, false],
        faults: vec![Faults::NONE, missing],
        repaired: vec![true, false],
        threshold: 40.0,
        calibrating: false,
    };
    (frame, force)
}

fn raw_packet() -> Vec<u8> {
    let (frame, force) = frame();
    let mut payload = Vec::new();
    encode_raw_payload(&frame, &force, &mut payload).unwrap();
    [
        &Header::of_frame(&frame, &force, payload.len()).to_bytes()[..],
        &payload,
    ]
    .concat()
}

fn longer_record() -> Vec<u8> {
    let raw = raw_packet();
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
        joints: (0..16).map(|joint| joint as f32 * 0.1 - 0.7).collect(),
    };
    let mut payload = Vec::new();
    encode_image_payload(&image, &mut payload).unwrap();
    let mut header = Header::of_image(&image, payload.len()).with_skipped(3);
    header.flags |= Flags::SATURATED;
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

fn text_packet(kind: Kind, text: &[u8]) -> Vec<u8> {
    [&Header::new(kind, text.len()).to_bytes()[..], text].concat()
}

fn payload_of(message: usize) -> [u8; 4] {
    (message as u32 - 40).to_le_bytes()
}

fn put(packet: &[u8], at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut packet = packet.to_vec();
    packet[at..at + bytes.len()].copy_from_slice(bytes);
    packet
}
