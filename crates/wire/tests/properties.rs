//! What is encoded decodes to the same; whatever comes is either decoded or refused.

mod vectors;

use proptest::collection::vec;
use proptest::prelude::*;
use taxel_hand::{Actuator, Fault, Faults, Freshness, Geometry, Module, Profile, TactileImage, Taxel};
use taxel_wire::{
    Body, Clock, DecodeError, EncodeError, Event, EventKind, Flags, HEADER_LEN, Header, Hello, HelloRate,
    Kind, MAX_MESSAGE, MAX_SUBSCRIBE, Subscribe, SubscribeError, decode, decode_packet, encode_image_payload,
    encode_raw_payload, image_payload_len, raw_payload_len, split_text,
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
            let counts = (any::<u64>(), any::<u64>(), any::<[u16; 3]>(), any::<[bool; 2]>());
            (pixels, vec(actuator, 0..17), counts).prop_map(
                move |(
                    pixels,
                    actuators,
                    (seq, t_ns, [contacts, faulty, missing], [calibrating, repaired]),
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
                        joints: joints.clone(),
                    }
                },
            )
        },
    )
}

/// Bytes that look like a message of some type for as long as possible.
fn almost_a_message() -> impl Strategy<Value = Vec<u8>> {
    (0u16..18, vec(any::<u8>(), 0..200), 0u32..400).prop_map(|(kind, payload, other_len)| {
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
                Body::Raw(raw) => prop_assert!(raw_payload_len(raw.taxels().len(), raw.joints().len()) <= len),
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

#[test]
fn encoding_again_needs_no_new_memory() {
    let image = vectors::example();
    let (frame, force) = vectors::frame();
    let (mut out, mut raw) = (Vec::new(), Vec::new());
    encode_image_payload(&image, &mut out).unwrap();
    encode_raw_payload(&frame, &force, &mut raw).unwrap();
    assert_eq!(out.len(), image_payload_len(4, 3, 2, 2, 1));
    assert_eq!(raw.len(), raw_payload_len(2, 2));
    let memory = (out.as_ptr(), out.capacity(), raw.as_ptr(), raw.capacity());
    encode_image_payload(&image, &mut out).unwrap();
    encode_raw_payload(&frame, &force, &mut raw).unwrap();
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
fn a_frame_whose_parts_differ_in_length_is_refused() {
    let (frame, mut force) = vectors::frame();
    force.repaired.pop();
    let error = encode_raw_payload(&frame, &force, &mut Vec::new()).unwrap_err();
    assert_eq!(
        error,
        EncodeError::Length {
            section: "repaired",
            len: 1,
            expected: 2
        }
    );
}

#[test]
fn the_flags_of_a_frame_tell_what_is_remarkable() {
    let flags = |change: &dyn Fn(&mut taxel_hand::TactileFrame, &mut taxel_hand::ForceFrame)| {
        let (mut frame, mut force) = vectors::frame();
        frame.counts[0] = [30_000; 3];
        force.repaired = vec![false; 2];
        force.faults = vec![Faults::NONE; 2];
        change(&mut frame, &mut force);
        Flags::of_frame(&frame, &force)
    };
    let dead = |faults: &mut Faults| faults.insert(Fault::Dead);
    assert_eq!(flags(&|_, _| {}), Flags::NONE);
    assert_eq!(
        flags(&|_, force| force.faults[1].insert(Fault::Missing)),
        Flags::MISSING
    );
    assert_eq!(flags(&|_, force| dead(&mut force.faults[0])), Flags::FAULTY);
    assert_eq!(flags(&|_, force| force.repaired[0] = true), Flags::REPAIRED);
    assert_eq!(flags(&|_, force| force.calibrating = true), Flags::CALIBRATING);
    assert_eq!(flags(&|frame, _| frame.counts[0][2] = 65535), Flags::SATURATED);
    assert_eq!(
        flags(&|frame, force| {
            frame.counts[0] = [0; 3];
            dead(&mut force.faults[0]);
        }),
        Flags::FAULTY
    );
    assert_eq!(
        flags(&|frame, _| {
            frame.counts[0] = [0; 3];
            frame.freshness[0] = Freshness::Stale;
        }),
        Flags::NONE
    );
}

/// Two modules of two taxels, and a padded pixel between them.
fn hand() -> Geometry {
    let module = |name: &str, first_taxel| Module {
        name: name.into(),
        part: name.into(),
        first_taxel,
        taxels: 2,
    };
    let taxel = |(x, module)| Taxel {
        module,
        x,
        y: 0,
        position_mm: (module == 1).then_some([f32::from(x), 0.0, 2.5]),
    };
    let taxels = [(0, 0), (1, 0), (3, 1), (4, 1)].map(taxel).to_vec();
    let modules = vec![module("index", 0), module("thumb", 2)];
    Geometry::new("two", [5, 1], modules, taxels).unwrap()
}

#[test]
fn a_hello_describes_the_hand() {
    let layout = hand();
    let rate = HelloRate {
        mode: "sweep".into(),
        hz: None,
    };
    let profile = Profile {
        levels: 5,
        ..Profile::default()
    };
    let hello = Hello::new("taxeld 9", &layout, &profile, rate, Clock::Recording);
    assert_eq!(Hello::parse(&hello.to_json()).unwrap(), hello);
    assert_eq!((hello.width, hello.height), (5, 1));
    assert_eq!(hello.profile.levels, 5);
    assert_ne!(hello.profile.method, "unknown");
    assert_eq!(hello.profile.grey, "level");
    let mut pixels: Vec<[u16; 2]> = hello.absent.clone();
    for (number, taxel) in hello.taxels.iter().enumerate() {
        let place = &layout.taxels[number];
        assert_eq!(usize::from(taxel.taxel), number);
        assert_eq!((taxel.x, taxel.y), (place.x, place.y));
        let module = &hello.modules[usize::from(taxel.module)];
        assert_eq!(module.name, layout.modules[usize::from(place.module)].name);
        assert!((module.first_taxel..module.first_taxel + module.taxels).contains(&taxel.taxel));
        pixels.push([taxel.x, taxel.y]);
    }
    pixels.sort();
    pixels.dedup();
    assert_eq!(pixels.len(), 5, "every pixel has a taxel or is absent");
    assert_eq!(hello.absent.len() + hello.taxels.len(), 5);
}

#[test]
fn a_hello_of_a_later_version_is_read() {
    let hello = vectors::hello();
    let mut json: serde_json::Value = serde_json::from_slice(&hello.to_json()).unwrap();
    assert_eq!(
        json["taxels"][0],
        serde_json::json!([0, 0, 0, 0, [1.5, -2.0, 30.25]])
    );
    assert_eq!(json["taxels"][3], serde_json::json!([3, 1, 1, 1, null]));
    json["of_a_later_version"] = 1.into();
    json["clock"] = "CLOCK_TAI".into();
    let newer = Hello::parse(json.to_string().as_bytes()).unwrap();
    assert_eq!(newer.clock, Clock::Unknown);
}

#[test]
fn a_subscription_says_what_it_wants_or_is_refused() {
    let parse = |text: &str| Subscribe::parse(text.as_bytes());
    assert_eq!(parse("{}").unwrap(), Subscribe::default());
    assert!(Subscribe::default().image);
    let all = Subscribe {
        image: false,
        raw: true,
        status: true,
        max_rate_hz: Some(0.5),
        every: false,
        profile: Some(Profile {
            levels: 4,
            ..Profile::default()
        }),
        region: Some(vec!["index".into(), "thumb".into()]),
    };
    assert_eq!(Subscribe::from_packet(&all.to_packet()).unwrap(), all);
    let unknown = parse(r#"{"raw": true, "rawr": true}"#).unwrap_err().to_string();
    assert!(unknown.contains("rawr"), "{unknown}");
    for rate in ["0", "-1", "1e999"] {
        assert!(parse(&format!(r#"{{"max_rate_hz": {rate}}}"#)).is_err(), "{rate}");
    }
    let image = vectors::image_packet(&vectors::example(), 0);
    assert!(matches!(
        Subscribe::from_packet(&image),
        Err(SubscribeError::WrongKind { number: 2 })
    ));
    assert!(matches!(
        Subscribe::from_packet(b"GET / HTTP/1.1\r\nHost: localhost\r\nAccept: */*\r\n\r\n"),
        Err(SubscribeError::Decode(DecodeError::BadMagic { .. }))
    ));
    assert!(matches!(
        Subscribe::from_packet(&[0; MAX_SUBSCRIBE + 1]),
        Err(SubscribeError::TooLong { len: 65_537 })
    ));
}

#[test]
fn the_profile_of_a_subscription_is_checked_and_absent_keys_take_their_defaults() {
    let parse = |text: &str| Subscribe::parse(text.as_bytes());
    let few = parse(r#"{"profile": {"levels": 4}, "region": null}"#).unwrap();
    let expected = Profile {
        levels: 4,
        ..Profile::default()
    };
    assert_eq!((few.profile, few.region), (Some(expected), None));
    assert_eq!(parse(r#"{"profile": null}"#).unwrap(), Subscribe::default());
    for (profile, complaint) in [
        (r#"{"levels": 0}"#, "levels = 0"),
        (r#"{"levels": 4, "codebook": [2, 1]}"#, "codebook entry 1"),
        (r#"{"colours": 3}"#, "colours"),
        (r#""fine""#, "fine"),
    ] {
        let error = parse(&format!(r#"{{"profile": {profile}}}"#)).unwrap_err();
        assert!(error.to_string().contains(complaint), "{error}");
    }
    let long = Subscribe {
        profile: Some(Profile {
            levels: 255,
            codebook: (1..=255).map(|force| f64::from(force) + 0.123_456_789).collect(),
            ..Profile::default()
        }),
        ..Subscribe::default()
    };
    assert_eq!(Subscribe::from_packet(&long.to_packet()).unwrap(), long);
}

#[test]
fn an_event_of_any_length_fits_one_packet() {
    for message in ["short".to_owned(), "\u{1}".repeat(9999), "é".repeat(9999)] {
        let packet = Event::new(EventKind::Notice, &message).to_packet(1, 2);
        assert!(packet.len() < 8192);
        let Body::Event(text) = decode_packet(&packet).unwrap().body else {
            panic!("not an event")
        };
        let event = Event::parse(text).unwrap();
        assert!(message.starts_with(&event.message) && !event.message.is_empty());
    }
    let newer = Event::parse(br#"{"event": "melted", "message": "m", "more": 1}"#).unwrap();
    assert_eq!(newer.event, EventKind::Other);
}
