//! The Rust reader against a daemon that sends what it should and what it should not.

mod fake_daemon;
mod vectors;

use fake_daemon::{Client, FakeDaemon};
use std::time::Duration;
use taxel_hand::TactileImage;
use taxel_wire::{
    DecodeError, Event, EventKind, Flags, Header, Kind, ReadError, Received, Subscribe, Subscriber,
    split_text,
};

const LONG: Duration = Duration::from_secs(200);

fn connected() -> (Subscriber, Client) {
    let daemon = FakeDaemon::new();
    let subscriber = Subscriber::connect(daemon.path()).unwrap();
    (subscriber, daemon.accept())
}

fn image(seq: u64) -> TactileImage {
    TactileImage {
        seq,
        ..vectors::example()
    }
}

fn hello_in_parts(part_len: usize) -> Vec<Vec<u8>> {
    let text = vectors::hello().to_json();
    split_text(Kind::Hello, &text, part_len, 1, 1)
        .map(|(header, part)| [&header.to_bytes()[..], part].concat())
        .collect()
}

#[test]
fn hello_comes_first_then_images_with_the_count_of_those_skipped() {
    let (mut subscriber, client) = connected();
    assert!(subscriber.hello().is_none());
    let parts = hello_in_parts(50);
    assert!(parts.len() > 3);
    for part in &parts {
        client.send(part);
    }
    client.send(&vectors::image_packet(&image(1), 0));
    client.send(&vectors::image_packet(&image(5), 3));
    match subscriber.next().unwrap() {
        Received::Hello(hello) => assert_eq!(*hello, vectors::hello()),
        other => panic!("{other:?}"),
    }
    assert!(subscriber.packet().is_empty(), "a text has several");
    for (seq, skipped) in [(1, 0), (5, 3)] {
        match subscriber.next_timeout(LONG).unwrap().unwrap() {
            Received::Image(header, view) => {
                assert_eq!((header.seq, header.skipped), (seq, skipped));
                assert_eq!(header.flags.contains(Flags::GAP), skipped > 0);
                assert_eq!(view.to_image(&header), image(seq));
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(
            subscriber.packet(),
            vectors::image_packet(&image(seq), skipped),
            "to be kept"
        );
    }
    assert_eq!(subscriber.hello(), Some(&vectors::hello()));
    assert!(subscriber.next_timeout(Duration::ZERO).unwrap().is_none());
    assert!(
        subscriber
            .next_timeout(Duration::from_micros(1500))
            .unwrap()
            .is_none()
    );
    drop(client);
    assert!(matches!(subscriber.next(), Err(ReadError::Closed)));
    assert!(matches!(subscriber.next_timeout(LONG), Err(ReadError::Closed)));
}

#[test]
fn who_wants_images_only_passes_over_the_rest() {
    let (mut subscriber, client) = connected();
    client.send(&hello_in_parts(10_000)[0]);
    client.send(&Event::new(EventKind::Calibrating, "keep off").to_packet(0, 0));
    client.send(&Header::new(Kind::Other(0x8001), 0).to_bytes());
    client.send(&vectors::image_packet(&image(9), 0));
    let (header, view) = subscriber.next_image().unwrap();
    assert_eq!((header.seq, view.width), (9, 4));
    assert!(subscriber.hello().is_some());
}

#[test]
fn the_latency_is_told_on_the_clock_of_the_hello() {
    let (mut subscriber, client) = connected();
    let header = Header::new(Kind::Image, 0);
    assert_eq!(subscriber.latency_ns(&header), None);
    client.send(&hello_in_parts(10_000)[0]);
    subscriber.next().unwrap();
    let first = subscriber.latency_ns(&header).unwrap();
    let later = subscriber.latency_ns(&header).unwrap();
    assert!(first > 0 && later >= first, "{first} {later}");
    let ahead = Header {
        t_ns: later as u64 + 3_600_000_000_000,
        ..header
    };
    assert!(subscriber.latency_ns(&ahead).unwrap() < 0);
    let absurd = Header {
        t_ns: u64::MAX,
        ..header
    };
    assert_eq!(subscriber.latency_ns(&absurd), None);
}

#[test]
fn a_subscription_reaches_the_daemon() {
    let (mut subscriber, client) = connected();
    let wanted = Subscribe {
        raw: true,
        max_rate_hz: Some(12.5),
        ..Subscribe::default()
    };
    subscriber.subscribe(&wanted).unwrap();
    assert_eq!(Subscribe::from_packet(&client.receive()).unwrap(), wanted);
    drop(subscriber);
    assert!(client.receive().is_empty());
}

#[test]
fn who_was_turned_away_before_it_could_subscribe_is_told_why() {
    for (said, wanted) in [
        (
            true,
            "taxeld closed the connection: 128 subscribers are connected already",
        ),
        (false, "taxeld closed the connection"),
    ] {
        let (mut subscriber, client) = connected();
        client.send(&hello_in_parts(10_000)[0]);
        if said {
            let why = "128 subscribers are connected already";
            client.send(&Event::new(EventKind::Disconnect, why).to_packet(0, 0));
        }
        drop(client);
        let error = subscriber.subscribe(&Subscribe::default()).unwrap_err();
        assert!(error.is_end());
        assert_eq!(error.to_string(), wanted);
    }
}

#[test]
fn who_is_let_go_while_its_subscription_is_unread_is_told_why() {
    let (mut subscriber, client) = connected();
    subscriber.subscribe(&Subscribe::default()).unwrap();
    let why = "128 subscribers are connected already";
    client.send(&Event::new(EventKind::Disconnect, why).to_packet(0, 0));
    drop(client);
    match subscriber.next().unwrap() {
        Received::Event(_, event) => assert_eq!(event.message, why),
        other => panic!("{other:?}"),
    }
    assert!(matches!(subscriber.next(), Err(ReadError::Closed)));
}

#[test]
fn raw_counts_status_and_events_come_decoded() {
    let (mut subscriber, client) = connected();
    let names = [
        "raw_two_taxels",
        "status",
        "event_disconnect",
        "raw_sections",
        "event_mark",
        "touch",
        "estimate",
    ];
    for name in names {
        let all = vectors::all();
        client.send(&all.iter().find(|v| v.name == name).unwrap().packet);
    }
    match subscriber.next().unwrap() {
        Received::Raw(_, raw) => {
            let taxels: Vec<_> = raw.taxels().collect();
            assert_eq!(taxels[0].counts, [33_000, 31_000, 65_535]);
            assert_eq!(taxels[0].age_us, 1500);
            assert_eq!(taxels[1].age_us, u32::MAX);
            let faults: Vec<_> = taxels[1].faults().collect();
            assert_eq!(faults, [taxel_hand::Fault::Missing]);
        }
        other => panic!("{other:?}"),
    }
    match subscriber.next().unwrap() {
        Received::Status(_, status) => assert_eq!(status["uptime_s"], 12),
        other => panic!("{other:?}"),
    }
    match subscriber.next().unwrap() {
        Received::Event(_, event) => assert_eq!(event.event, EventKind::Disconnect),
        other => panic!("{other:?}"),
    }
    match subscriber.next().unwrap() {
        Received::Raw(_, raw) => {
            assert_eq!(raw.joint_ages_us().unwrap().collect::<Vec<_>>(), [1000, u32::MAX]);
            assert_eq!(raw.joint_velocities_rad_s().unwrap().next(), Some(-0.5));
            assert_eq!(raw.joint_currents_a().unwrap().next(), Some(0.125));
            let (taxel, rest) = (
                raw.taxels().next().unwrap(),
                raw.baselines().unwrap().next().unwrap(),
            );
            // A press of -33000 is beyond half a turn and reads as 32536.
            assert_eq!(taxel.press(rest), [1000.5, 32_536.0, -5.25]);
        }
        other => panic!("{other:?}"),
    }
    match subscriber.next().unwrap() {
        Received::Event(header, event) => {
            assert_eq!(event, Event::new(EventKind::Mark, "squeeze 3 begins"));
            assert_eq!((header.seq, header.t_ns), (1300, 5_123_456_789));
        }
        other => panic!("{other:?}"),
    }
    match subscriber.next().unwrap() {
        Received::Touch(header, touch) => assert_eq!((header.seq, &touch["category"]), (75, &2.into())),
        other => panic!("{other:?}"),
    }
    match subscriber.next().unwrap() {
        Received::Estimate(_, estimate) => assert_eq!(estimate["source"], "fused"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_bad_message_is_an_error_and_the_next_is_read() {
    let (mut subscriber, client) = connected();
    let good = vectors::image_packet(&image(2), 0);
    client.send(b"nonsense, and quite a lot of it, more than a header has");
    client.send(&good[..60]);
    let mut actuator_off_the_image = good.clone();
    actuator_off_the_image[74] = 200;
    client.send(&actuator_off_the_image);
    client.send(&[&Header::new(Kind::Hello, 2).to_bytes()[..], b"{]"].concat());
    client.send(&good);
    assert!(matches!(
        subscriber.next(),
        Err(ReadError::Decode(DecodeError::BadMagic { .. }))
    ));
    assert!(matches!(
        subscriber.next(),
        Err(ReadError::Decode(DecodeError::Truncated {
            len: 60,
            expected: 112
        }))
    ));
    assert!(matches!(
        subscriber.next(),
        Err(ReadError::Decode(DecodeError::BadActuator {
            index: 0,
            x: 200,
            ..
        }))
    ));
    assert!(matches!(
        subscriber.next(),
        Err(ReadError::Json {
            kind: Kind::Hello,
            ..
        })
    ));
    assert!(matches!(subscriber.next(), Ok(Received::Image(..))));
}

#[test]
fn a_touch_in_parts_comes_as_one_with_the_header_of_its_last() {
    let (mut subscriber, client) = connected();
    let text = br#"{"category": 0, "label": null, "distances": [1.5]}"#;
    for (header, part) in split_text(Kind::Touch, text, 20, 8, 9) {
        client.send(&[&header.to_bytes()[..], part].concat());
    }
    match subscriber.next().unwrap() {
        Received::Touch(header, touch) => {
            assert_eq!(touch["distances"], serde_json::json!([1.5]));
            assert_eq!((header.seq, header.t_ns, header.flags), (8, 9, Flags::NONE));
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_text_that_breaks_off_is_an_error_and_the_next_is_read() {
    let (mut subscriber, client) = connected();
    client.send(&hello_in_parts(50)[0]);
    client.send(&vectors::image_packet(&image(2), 0));
    client.send(&hello_in_parts(10_000)[0]);
    assert!(matches!(
        subscriber.next(),
        Err(ReadError::BrokenText {
            kind: Kind::Hello,
            len: 50
        })
    ));
    assert!(matches!(subscriber.next(), Ok(Received::Hello(_))));
}

#[test]
fn no_daemon_is_an_error_that_names_the_socket() {
    let error = Subscriber::connect("/nowhere/images.sock").unwrap_err();
    assert!(error.to_string().contains("/nowhere/images.sock"), "{error}");
    let too_long = "x".repeat(200);
    assert!(matches!(
        Subscriber::connect(too_long),
        Err(ReadError::Connect { .. })
    ));
}
