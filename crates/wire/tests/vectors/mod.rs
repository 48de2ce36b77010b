//! The messages that every reader is checked against.
#![allow(dead_code, reason = "each test binary uses its part")]

mod version_1_0;
mod version_1_1;

use taxel_hand::{Actuator, Fault, Faults, ForceFrame, Freshness, Pose, TactileFrame, TactileImage};
use taxel_wire::{
    Clock, Header, Hello, HelloModule, HelloProfile, HelloProtocol, HelloRate, HelloTaxel, Kind,
    encode_image_payload,
};

/// One message, good or bad.
pub(crate) struct Vector {
    /// Name of its files.
    pub(crate) name: &'static str,
    /// What it shows.
    pub(crate) description: &'static str,
    /// The bytes.
    pub(crate) packet: Vec<u8>,
    /// Whether version 1.0 made it: its files never change.
    pub(crate) is_1_0: bool,
}

/// Name, description and bytes of a vector.
type Named = (&'static str, &'static str, Vec<u8>);

/// Every vector.
pub(crate) fn all() -> Vec<Vector> {
    let vector = |is_1_0| {
        move |(name, description, packet)| Vector {
            name,
            description,
            packet,
            is_1_0,
        }
    };
    let first = version_1_0::vectors().into_iter().map(vector(true));
    first
        .chain(version_1_1::vectors().into_iter().map(vector(false)))
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
        saturated: false,
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

/// The description of a hand with two modules of two taxels and two absent pixels; where one module
/// sits is known.
pub(crate) fn hello() -> Hello {
    let module = |name: &str, part: &str, first_taxel| HelloModule {
        name: name.into(),
        part: part.into(),
        first_taxel,
        taxels: 2,
        pose: None,
        joint: None,
    };
    let index_tip = HelloModule {
        pose: Some(Pose {
            position_mm: [1.5, -2.0, 30.25],
            orientation: [0.6, 0.0, 0.8, 0.0],
        }),
        joint: Some("index 3".into()),
        ..module("index tip", "index", 0)
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
        protocol: HelloProtocol { major: 1, minor: 1 },
        daemon: "taxeld 0.1.0".into(),
        layout: "two-fingers".into(),
        width: 2,
        height: 3,
        modules: vec![index_tip, module("thumb tip", "thumb", 2)],
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
        subscription: None,
        rate: HelloRate {
            mode: "timer".into(),
            hz: Some(30.0),
        },
        force_unit: "counts".into(),
        clock: Clock::Monotonic,
    }
}

/// A tactile frame of two taxels and what conditioning made of it; of the joints only the angles
/// and their ages are known.
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
        joint_velocity_rad_s: Vec::new(),
        joint_current_a: Vec::new(),
    };
    let force = ForceFrame {
        seq: 99,
        t_ns: 3_000_000,
        force: vec![1234.5, 0.0],
        contact: vec![true, false],
        faults: vec![Faults::NONE, missing],
        repaired: vec![true, false],
        saturated: vec![true, false],
        threshold: 40.0,
        calibrating: false,
    };
    (frame, force)
}

fn text_packet(kind: Kind, text: &[u8]) -> Vec<u8> {
    [&Header::new(kind, text.len()).to_bytes()[..], text].concat()
}

fn put(packet: &[u8], at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut packet = packet.to_vec();
    packet[at..at + bytes.len()].copy_from_slice(bytes);
    packet
}
