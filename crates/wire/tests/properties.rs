//! What is encoded decodes to the same; whatever comes is either decoded or refused.

mod vectors;

use proptest::collection::vec;
use proptest::prelude::*;
use taxel_hand::{Actuator, Fault, Faults, ForceFrame, Freshness, TactileFrame, TactileImage};
use taxel_wire::{
    Body, EncodeError, Flags, HEADER_LEN, Header, Kind, MAX_MESSAGE, RawTaxel, RawView, decode,
    decode_packet, encode_image_payload, encode_raw_payload, image_payload_len, raw_payload_len, split_text,
};

/// Forces that survive a 32-bit float.
fn force() -> impl Strategy<Value = f64> {
    (0.0f32..1e9).prop_map(f64::from)
}

fn image() -> impl Strategy<Value = TactileImage> {
    (1u16..20, 1u16..20, vec(force(), 1..9), vec(-3.0f32..3.0, 0..20)).prop_flat_map(
        |(width, height, levels, joints)| {
            let count = levels.len() as u16;
            let actuator = (any::<u16>(), 0..width, 0..height, 1..=count, force()).prop_map(
                |(id, x, y, level, force)| Actuator {
                    id,
                    x,
                    y,
                    level,
                    force,
                },
            );
            let pixels = vec(any::<u8>(), usize::from(width) * usize::from(height));
            let counts = (any::<u64>(), any::<u64>(), any::<[u16; 3]>(), any::<[bool; 3]>());
            (pixels, vec(actuator, 0..17), counts).prop_map(
                move |(
                    pixels,
                    actuators,
                    (seq, t_ns, [contacts, faulty, missing], [calibrating, repaired, saturated]),
                )| {
                    TactileImage {
                        seq,
                        t_ns,
                        width,
                        height,
                        pixels,
                        levels: levels.clone(),
                        actuators,
                        contacts,
                        faulty,
                        missing,
                        calibrating,
                        repaired,
                        saturated,
                        joints: joints.clone(),
                    }
                },
            )
        },
    )
}

/// Bytes that look like a message of some type for as long as possible.
fn almost_a_message() -> impl Strategy<Value = Vec<u8>> {
    (0u16..18, vec(any::<u8>(), 0..200), 0u32..400).prop_map(|(kind, mut payload, other_len)| {
        if kind == 5 && payload.len() >= 60 {
            // Few taxels and joints, and any sections.
            payload[..8].copy_from_slice(&[1, 0, 0, 0, 20, 0, 20, 0]);
            payload[12..14].copy_from_slice(&[2, 0]);
        }
        let payload_len = if other_len < 200 {
            other_len as usize
        } else {
            payload.len()
        };
        let header = Header::new(Kind::from_number(kind), payload_len);
        [&header.to_bytes()[..], &payload].concat()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn an_image_comes_back_as_it_was(image in image(), skipped: u32) {
        let packet = vectors::image_packet(&image, skipped);
        let message = decode_packet(&packet).unwrap();
        prop_assert_eq!(message.header.skipped, skipped);
        prop_assert_eq!(message.header.flags.contains(Flags::GAP), skipped > 0);
        let Body::Image(view) = message.body else { panic!("not an image") };
        prop_assert_eq!(view.to_image(&message.header), image);
    }

    #[test]
    fn messages_on_a_stream_come_back_one_by_one(images in vec(image(), 1..5), cut: prop::sample::Index) {
        let mut stream: Vec<u8> = images.iter().flat_map(|image| vectors::image_packet(image, 0)).collect();
        stream.truncate(cut.index(stream.len() + 1));
        let mut rest = &stream[..];
        for image in &images {
            match decode(rest) {
                Ok((message, len)) => {
                    let Body::Image(view) = message.body else { panic!("not an image") };
                    prop_assert_eq!(&view.to_image(&message.header), image);
                    rest = &rest[len..];
                }
                Err(error) => {
                    prop_assert!(error.needs_more(), "{}", error);
                    return Ok(());
                }
            }
        }
        prop_assert!(rest.is_empty());
    }

    #[test]
    fn any_bytes_are_decoded_or_refused(bytes in prop_oneof![vec(any::<u8>(), 0..200), almost_a_message()]) {
        if let Ok((message, len)) = decode(&bytes) {
            prop_assert!(len <= bytes.len());
            prop_assert_eq!(message.header.message_len(), len);
            match message.body {
                Body::Image(image) => {
                    let pixels = usize::from(image.width) * usize::from(image.height);
                    prop_assert_eq!(image.pixels().len(), pixels);
                    for actuator in image.actuators() {
                        prop_assert!(image.pixel(actuator.x, actuator.y).is_some());
                    }
                }
                Body::Raw(raw) => {
                    let (taxels, joints) = (raw.taxels().len(), raw.joints().len());
                    let of_joints = 1
                        + usize::from(raw.joint_ages_us().is_some_and(|ages| ages.len() == joints))
                        + usize::from(raw.joint_velocities_rad_s().is_some_and(|v| v.len() == joints))
                        + usize::from(raw.joint_currents_a().is_some_and(|c| c.len() == joints));
                    let baselines = raw.baselines().map_or(0, |baselines| baselines.len());
                    prop_assert!(baselines == 0 || baselines == taxels);
                    prop_assert!(56 + 20 * taxels + 4 * joints * of_joints + 12 * baselines <= len);
                }
                _ => {}
            }
        }
    }

    #[test]
    fn a_text_in_parts_is_put_together_again(text in vec(any::<u8>(), 0..500), part_len in 0usize..600) {
        let parts: Vec<_> = split_text(Kind::Status, &text, part_len, 5, 6).collect();
        let whole: Vec<u8> = parts.iter().flat_map(|(_, part)| part.iter().copied()).collect();
        prop_assert_eq!(&whole, &text);
        for (number, (header, part)) in parts.iter().enumerate() {
            prop_assert_eq!(header.payload_len as usize, part.len());
            prop_assert_eq!(header.flags.contains(Flags::MORE), number + 1 < parts.len());
        }
    }
}

#[test]
fn an_image_that_contradicts_itself_is_refused_and_leaves_nothing() {
    let good = vectors::example();
    let broken = |change: &dyn Fn(&mut TactileImage)| {
        let mut image = good.clone();
        change(&mut image);
        let mut out = vec![1, 2, 3];
        let error = encode_image_payload(&image, &mut out).unwrap_err();
        assert!(out.is_empty());
        error
    };
    assert!(matches!(
        broken(&|i| i.width = 5),
        EncodeError::Length {
            len: 12,
            expected: 15,
            ..
        }
    ));
    assert!(matches!(
        broken(&|i| i.levels[0] = f64::NAN),
        EncodeError::Force { index: 0, .. }
    ));
    assert!(matches!(
        broken(&|i| i.levels[1] = 1e39),
        EncodeError::Force { index: 1, .. }
    ));
    assert!(matches!(
        broken(&|i| i.actuators[1].x = 4),
        EncodeError::Actuator { index: 1, x: 4, .. }
    ));
    assert!(matches!(
        broken(&|i| i.actuators[0].level = 3),
        EncodeError::Actuator { index: 0, .. }
    ));
    assert!(matches!(
        broken(&|i| i.actuators[0].force = -1.0),
        EncodeError::Force { .. }
    ));
    assert!(matches!(
        broken(&|i| i.joints = vec![0.0; 65536]),
        EncodeError::TooMany { len: 65536, .. }
    ));
    assert!(matches!(
        broken(&|i| (i.width, i.height, i.pixels) = (1000, 1000, vec![0; 1_000_000])),
        EncodeError::TooLong { .. }
    ));
}

/// The frame, with velocities and currents.
fn known(frame: TactileFrame) -> TactileFrame {
    TactileFrame {
        joint_velocity_rad_s: vec![1.0; frame.joints.len()],
        joint_current_a: vec![2.0; frame.joints.len()],
        ..frame
    }
}

#[test]
fn encoding_again_needs_no_new_memory() {
    let image = vectors::example();
    let (frame, force) = vectors::frame();
    let (mut out, mut raw) = (Vec::new(), Vec::new());
    encode_image_payload(&image, &mut out).unwrap();
    encode_raw_payload(&frame, &force, None, &mut raw).unwrap();
    assert_eq!(out.len(), image_payload_len(4, 3, 2, 2, 1));
    let memory = (out.as_ptr(), out.capacity(), raw.as_ptr(), raw.capacity());
    encode_image_payload(&image, &mut out).unwrap();
    // What was unknown at first is known now: velocities, currents and baselines.
    let frame = known(frame);
    encode_raw_payload(&frame, &force, Some(&[[1.0; 3]; 2]), &mut raw).unwrap();
    assert_eq!(raw.len(), raw_payload_len(2, 2));
    assert_eq!(
        memory,
        (out.as_ptr(), out.capacity(), raw.as_ptr(), raw.capacity())
    );
}

#[test]
fn a_hand_of_a_thousand_modules_fits() {
    assert!(HEADER_LEN + image_payload_len(128, 128, 255, 1024, 100) <= MAX_MESSAGE);
    assert!(HEADER_LEN + raw_payload_len(16_000, 100) <= MAX_MESSAGE);
}

#[test]
fn sections_are_left_out_where_the_message_would_be_too_long_and_the_bits_tell() {
    for (taxels, joints, expected) in [
        (12_784, 27, [true, true]),
        (12_785, 27, [true, false]),
        (16_000, 27, [true, false]),
        (20_450, 27, [true, false]),
        (20_471, 27, [false, false]),
    ] {
        let frame = TactileFrame {
            joints: vec![0.5; joints],
            joint_age_ns: vec![7000; joints],
            ..TactileFrame::new(taxels)
        };
        let (frame, force) = (known(frame), ForceFrame::new(taxels));
        let mut payload = Vec::new();
        encode_raw_payload(&frame, &force, Some(&vec![[3.0; 3]; taxels]), &mut payload).unwrap();
        assert_eq!(payload.len(), raw_payload_len(taxels, joints));
        assert!(HEADER_LEN + payload.len() <= MAX_MESSAGE);
        let raw = RawView::decode(&payload).unwrap();
        let ages = raw.joint_ages_us().map(|ages| ages.collect());
        assert_eq!(ages, expected[0].then(|| vec![7; joints]), "{taxels}");
        let velocities = raw.joint_velocities_rad_s().map(|v| v.collect());
        assert_eq!(velocities, expected[0].then(|| vec![1.0; joints]), "{taxels}");
        let currents = raw.joint_currents_a().map(|c| c.collect());
        assert_eq!(currents, expected[0].then(|| vec![2.0; joints]), "{taxels}");
        let baselines = raw.baselines().map(|mut b| b.all(|b| b == [3.0; 3]));
        assert_eq!(baselines, expected[1].then_some(true), "{taxels}");
    }
    let (frame, force) = (TactileFrame::new(20_477), ForceFrame::new(20_477));
    assert!(encode_raw_payload(&frame, &force, None, &mut Vec::new()).is_ok());
    let (frame, force) = (TactileFrame::new(20_478), ForceFrame::new(20_478));
    let error = encode_raw_payload(&frame, &force, None, &mut Vec::new()).unwrap_err();
    assert_eq!(error, EncodeError::TooLong { len: 409_620 });
}

#[test]
fn the_press_is_signed_and_wraps_with_the_counts() {
    let taxel = |counts: u16| RawTaxel {
        counts: [counts; 3],
        faults: 0,
        force: 0.0,
        age_us: 0,
        freshness: Freshness::Fresh,
        status: 0,
        contact: false,
        repaired: false,
    };
    for (counts, baseline, press) in [
        (1000, 900.5, 99.5),
        (900, 1000.0, -100.0),
        (65_535, 0.0, -1.0),
        (0, 65_535.0, 1.0),
        (3, 65_540.5, -1.5),
        (65_530, -2.0, -4.0),
        (40_000, 7_232.0, -32_768.0),
        (40_000, 7_232.5, 32_767.5),
        (10, 131_072.0, 10.0),
    ] {
        assert_eq!(
            taxel(counts).press([baseline; 3]),
            [press; 3],
            "{counts} - {baseline}"
        );
    }
    for none in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
        assert!(
            taxel(7).press([none; 3]).iter().all(|press| press.is_nan()),
            "{none}"
        );
    }
}

#[test]
fn a_frame_whose_parts_differ_in_length_is_refused() {
    let (frame, force) = vectors::frame();
    let refused = |frame: &TactileFrame, force: &ForceFrame, baseline: Option<&[[f32; 3]]>| {
        let mut out = vec![1, 2, 3];
        let error = encode_raw_payload(frame, force, baseline, &mut out).unwrap_err();
        assert!(out.is_empty());
        error
    };
    let length = |section, len| EncodeError::Length {
        section,
        len,
        expected: 2,
    };
    let mut shorter = force.clone();
    shorter.repaired.pop();
    assert_eq!(refused(&frame, &shorter, None), length("repaired", 1));
    assert_eq!(
        refused(&frame, &force, Some(&[[0.0; 3]; 3])),
        length("baseline", 3)
    );
    for section in ["joint_age_ns", "joint_velocity_rad_s", "joint_current_a"] {
        let mut shorter = known(frame.clone());
        match section {
            "joint_age_ns" => drop(shorter.joint_age_ns.pop()),
            "joint_velocity_rad_s" => drop(shorter.joint_velocity_rad_s.pop()),
            _ => drop(shorter.joint_current_a.pop()),
        }
        assert_eq!(refused(&shorter, &force, None), length(section, 1));
    }
}

#[test]
fn the_flags_of_a_frame_tell_what_is_remarkable() {
    let flags = |change: &dyn Fn(&mut taxel_hand::ForceFrame)| {
        let (_, mut force) = vectors::frame();
        force.repaired = vec![false; 2];
        force.saturated = vec![false; 2];
        force.faults = vec![Faults::NONE; 2];
        change(&mut force);
        Flags::of_frame(&force)
    };
    assert_eq!(flags(&|_| {}), Flags::NONE);
    assert_eq!(
        flags(&|force| force.faults[1].insert(Fault::Missing)),
        Flags::MISSING
    );
    assert_eq!(flags(&|force| force.faults[0].insert(Fault::Dead)), Flags::FAULTY);
    assert_eq!(flags(&|force| force.repaired[0] = true), Flags::REPAIRED);
    assert_eq!(flags(&|force| force.calibrating = true), Flags::CALIBRATING);
    assert_eq!(flags(&|force| force.saturated[0] = true), Flags::SATURATED);
}
