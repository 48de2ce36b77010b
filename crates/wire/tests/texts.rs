//! HELLO, SUBSCRIBE and EVENT: what they say, and what is refused.

mod vectors;

use taxel_hand::{Geometry, Module, Pose, Profile, Taxel};
use taxel_wire::{
    Body, Clock, DecodeError, Event, EventKind, HEADER_LEN, Hello, HelloRate, MAX_SUBSCRIBE, Subscribe,
    SubscribeError, decode_packet,
};

/// Two modules of two taxels, and a padded pixel between them.
fn hand() -> Geometry {
    let module = |name: &str, first_taxel| Module {
        name: name.into(),
        part: name.into(),
        first_taxel,
        taxels: 2,
        pose: (first_taxel == 2).then_some(Pose {
            position_mm: [0.0, 1.5, -2.0],
            orientation: [1.0, 0.0, 0.0, 0.0],
        }),
        joint: (first_taxel == 2).then(|| "thumb 3".into()),
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
    for (said, module) in hello.modules.iter().zip(&layout.modules) {
        assert_eq!((said.pose, &said.joint), (module.pose, &module.joint));
    }
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
        every: false,
        max_rate_hz: Some(0.5),
        profile: Some(Profile {
            levels: 4,
            ..Profile::default()
        }),
        region: Some(vec!["index".into(), "thumb".into()]),
    };
    assert_eq!(Subscribe::from_packet(&all.to_packet()).unwrap(), all);
    for list in ["[]", "[true, true]"] {
        let error = parse(list).unwrap_err().to_string();
        assert!(
            error.contains("an object in { } is wanted here, not a list"),
            "{list}: {error}"
        );
    }
    for (text, wanted) in [
        (
            r#"{"region": "index"}"#,
            "a list in [ ] is wanted here, not the text \"index\"",
        ),
        (r#"{"image": 1}"#, "true or false is wanted here, not 1"),
    ] {
        let error = parse(text).unwrap_err().to_string();
        assert!(error.contains(wanted), "{text}: {error}");
    }
    let unknown = parse(r#"{"raw": true, "rawr": true}"#).unwrap_err().to_string();
    assert!(unknown.contains("rawr"), "{unknown}");
    for rate in ["0", "-1", "1e-300", "1e999"] {
        assert!(parse(&format!(r#"{{"max_rate_hz": {rate}}}"#)).is_err(), "{rate}");
    }
    let every = Subscribe {
        every: true,
        ..Subscribe::default()
    };
    assert_eq!(Subscribe::from_packet(&every.to_packet()).unwrap(), every);
    assert_eq!(parse(r#"{"every": true, "max_rate_hz": null}"#).unwrap(), every);
    assert_eq!(parse(r#"{"every": false}"#).unwrap(), Subscribe::default());
    let both = parse(r#"{"every": true, "max_rate_hz": 30}"#).unwrap_err();
    assert!(
        both.to_string().contains("leave one of them out"),
        "every frame, and at most 30 a second: {both}"
    );
    let old_daemon = String::from_utf8(Subscribe::default().to_packet().split_off(HEADER_LEN)).unwrap();
    assert!(
        !old_daemon.contains("every"),
        "daemons of 1.0 refuse the key: {old_daemon}"
    );
    let image = vectors::image_packet(&vectors::example(), 0);
    assert!(matches!(
        Subscribe::from_packet(&image),
        Err(SubscribeError::WrongKind { number: 2 })
    ));
    let short = [&image[..12], &2u32.to_le_bytes(), &image[16..HEADER_LEN], &[0; 2]].concat();
    assert!(matches!(
        Subscribe::from_packet(&short),
        Err(SubscribeError::WrongKind { number: 2 })
    ));
    assert!(matches!(
        Subscribe::from_packet(b"GET / HTTP/1.1\r\nHost: localhost\r\nAccept: */*\r\n\r\n"),
        Err(SubscribeError::Decode(DecodeError::BadMagic { .. }))
    ));
    // Whoever receives it may have no room for more, so that its length is not told.
    let too_long = Subscribe::from_packet(&[0; MAX_SUBSCRIBE + 1]).unwrap_err();
    assert!(matches!(too_long, SubscribeError::TooLong { len } if len == MAX_SUBSCRIBE + 1));
    assert!(
        too_long
            .to_string()
            .ends_with("may have 32768 bytes; this one has more"),
        "{too_long}"
    );
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
        ("[]", "an object in { } is wanted here, not a list"),
        (r#"["paper", 3]"#, "an object in { } is wanted here, not a list"),
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
fn a_number_is_read_as_the_nearest_double_and_is_the_same_when_it_is_sent_on() {
    for text in [
        "91.6666666666666666665",
        "22222222222222222222222722222222222222222222222222",
    ] {
        let subscribe = Subscribe::parse(format!("{{\"max_rate_hz\":{text}}}").as_bytes()).unwrap();
        assert_eq!(subscribe.max_rate_hz, text.parse().ok());
        assert_eq!(Subscribe::from_packet(&subscribe.to_packet()).unwrap(), subscribe);
    }
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
