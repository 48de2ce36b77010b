//! What version 1.1 added.

use super::*;
use taxel_wire::{
    Event, EventKind, Flags, HelloText, Subscribe, Subscription, encode_raw_payload, split_text,
};

/// Where the sections of the example start: behind header, fixed part, two taxels and two joints.
const SECTIONS_AT: usize = 40 + 20 + 2 * 20 + 2 * 4;

pub(super) fn vectors() -> Vec<Named> {
    let whole = raw_sections();
    let touch = br#"{"category":2,"label":"sponge","distances":[4.5,3.25,0.75],"confidence":0.875,"unknown":false,"start_ns":1000000000,"end_ns":2500000000}"#;
    let estimate = br#"{"location_percent":41.5,"low":33.0,"high":50.0,"source":"fused"}"#;
    let (part_header, part) = split_text(Kind::Touch, touch, 100, 75, 2_500_000_000)
        .next()
        .unwrap();
    vec![
        (
            "image_minor_1",
            "the example of docs/wire.md: 4x3 pixels, two levels, two actuators, one joint",
            image_packet(&example(), 0),
        ),
        (
            "raw_no_sections",
            "a frame without joints whose baselines are not sent: no section is there",
            raw_packet(&without_joints(), None),
        ),
        (
            "raw_joint_ages",
            "of the joints only the ages are known beside the angles",
            raw_packet(&frame().0, None),
        ),
        (
            "raw_sections",
            "every section; the press of the first taxel wraps around, the second taxel's baseline is unknown",
            whole.clone(),
        ),
        (
            "raw_sections_1_and_3",
            "velocities and baselines, but neither ages nor currents",
            raw_packet(
                &TactileFrame {
                    joint_age_ns: Vec::new(),
                    joint_current_a: Vec::new(),
                    ..known()
                },
                Some(&baselines()),
            ),
        ),
        (
            "raw_calibrating",
            "while calibrating no baseline is known",
            calibrating(),
        ),
        (
            "raw_newer_minor",
            "minor 2 with a longer fixed part, a longer record, and two sections more behind the known ones",
            newer_minor(),
        ),
        (
            "hello_pose",
            "the small hand again; it is known where one module sits, and which joint moves it",
            hello().to_packets(7, 1_000).concat(),
        ),
        (
            "hello_subscription",
            "the small hand for one who asked for raw frames alone, at most 60 a second",
            HelloText::new(&hello())
                .to_packets(
                    &Subscription {
                        image: false,
                        raw: true,
                        max_rate_hz: Some(60.0),
                        ..Subscription::default()
                    },
                    8,
                    1_500,
                )
                .concat(),
        ),
        (
            "event_mark",
            "a mark, with its own time",
            Event::new(EventKind::Mark, "squeeze 3 begins").to_packet(1300, 5_123_456_789),
        ),
        (
            "touch",
            "a completed touch, of the third category",
            put(&text_packet(Kind::Touch, touch), 16, &75u64.to_le_bytes()),
        ),
        (
            "touch_part",
            "the first part of a TOUCH: flag MORE",
            [&part_header.to_bytes()[..], part].concat(),
        ),
        (
            "estimate",
            "where on the forearm, by both senses",
            text_packet(Kind::Estimate, estimate),
        ),
        (
            "subscribe_every",
            "a recorder wants every raw frame and no images",
            Subscribe {
                image: false,
                raw: true,
                every: true,
                ..Subscribe::default()
            }
            .to_packet(),
        ),
        (
            "bad_raw_sections",
            "the last four bytes of the baselines are missing",
            shortened(&whole, whole.len() - 4),
        ),
        (
            "bad_raw_sections_none",
            "every section is announced and none is there",
            shortened(&whole, SECTIONS_AT),
        ),
        (
            "bad_raw_sections_first",
            "of the joints' ages only one of two is there",
            put(&shortened(&whole, SECTIONS_AT + 4), 56, &[1, 0, 0, 0]),
        ),
        (
            "bad_raw_sections_beyond",
            "fixed_len is 20 in a payload of 16 bytes, which ends before the bits of the sections",
            shortened(&whole, 40 + 16),
        ),
        (
            "bad_raw_sections_huge",
            "as many taxels and joints as can be counted, with every section",
            put(&put(&whole, 40, &[0xff; 4]), 52, &[0xff; 2]),
        ),
    ]
}

/// The frame of two taxels and two joints of which everything is known that can be.
fn known() -> TactileFrame {
    TactileFrame {
        joint_velocity_rad_s: vec![-0.5, f32::NAN],
        joint_current_a: vec![0.125, f32::NAN],
        ..frame().0
    }
}

fn without_joints() -> TactileFrame {
    TactileFrame {
        joints: Vec::new(),
        joint_age_ns: Vec::new(),
        ..frame().0
    }
}

/// Of counts 33000, 31000 and 65535: a press of 1000.5, one beyond half a turn, and one around the
/// border, whose baseline lies on the next turn.
fn baselines() -> [[f32; 3]; 2] {
    [[31_999.5, 64_000.0, 65_540.25], [f32::NAN; 3]]
}

fn raw_packet(frame: &TactileFrame, baseline: Option<&[[f32; 3]]>) -> Vec<u8> {
    with_force(frame, &super::frame().1, baseline)
}

fn with_force(frame: &TactileFrame, force: &ForceFrame, baseline: Option<&[[f32; 3]]>) -> Vec<u8> {
    let mut payload = Vec::new();
    encode_raw_payload(frame, force, baseline, &mut payload).unwrap();
    let header = Header::of_frame(frame, force, payload.len());
    [&header.to_bytes()[..], &payload].concat()
}

fn raw_sections() -> Vec<u8> {
    raw_packet(&known(), Some(&baselines()))
}

fn calibrating() -> Vec<u8> {
    let force = ForceFrame {
        calibrating: true,
        ..frame().1
    };
    let packet = with_force(&known(), &force, Some(&baselines()));
    assert_ne!(packet[10] & Flags::CALIBRATING.0 as u8, 0);
    packet
}

/// Behind the bits four bytes more, behind each record four more, and sections 4 and 5 behind the known ones.
fn newer_minor() -> Vec<u8> {
    let mut packet = raw_sections();
    packet[5] = 2;
    (packet[44], packet[46], packet[56]) = (24, 24, 0x3f);
    for behind in [100, 80, 60] {
        packet.splice(behind..behind, [0xaa; 4]);
    }
    packet.extend_from_slice(&[0xcc; 24]);
    let len = packet.len();
    shortened(&packet, len)
}

/// The first `len` bytes as a message of this length.
fn shortened(packet: &[u8], len: usize) -> Vec<u8> {
    put(&packet[..len], 12, &(len as u32 - 40).to_le_bytes())
}
