//! What becomes of a subscriber that asks for what it cannot have.

use crate::stage::{PATIENCE, on_stage, on_stage_for};
use taxel_hand::{Method, Profile};
use taxel_serve::ProfilesConfig;
use taxel_wire::{Event, EventKind, Received, Subscribe, Subscriber};

/// What a subscription is answered with; none where it is taken.
fn answer(subscriber: &mut Subscriber, wants: &Subscribe) -> Option<(EventKind, String)> {
    subscriber.subscribe(wants).unwrap();
    loop {
        match subscriber.next_timeout(PATIENCE).unwrap().expect("an answer") {
            Received::Hello(_) => return None,
            Received::Event(_, event) => return Some((event.event, event.message)),
            _ => {}
        }
    }
}

#[test]
fn who_is_refused_too_often_in_a_row_is_told_so_and_let_go_and_nobody_else() {
    on_stage(async |stage| {
        let path = stage.path.clone();
        let (done, is_done) = tokio::sync::oneshot::channel();
        let client = std::thread::spawn(move || {
            let mut subscriber = Subscriber::connect(&path).unwrap();
            while !matches!(
                subscriber.next_timeout(PATIENCE).unwrap(),
                Some(Received::Hello(_))
            ) {}
            // These contradict each other.
            let refused = Subscribe {
                every: true,
                max_rate_hz: Some(1.0),
                ..Subscribe::default()
            };
            // Months of a display that is now and then refused something.
            for _ in 0..5 {
                for _ in 0..8 {
                    let (kind, text) = answer(&mut subscriber, &refused).unwrap();
                    assert_eq!(kind, EventKind::Refused, "{text}");
                }
                assert_eq!(answer(&mut subscriber, &Subscribe::default()), None);
            }
            for _ in 0..8 {
                answer(&mut subscriber, &refused).unwrap();
            }
            let (kind, text) = answer(&mut subscriber, &refused).unwrap();
            assert_eq!(kind, EventKind::Disconnect, "{text}");
            assert!(
                text.contains("too often") && text.contains("max_rate_hz"),
                "{text}"
            );
            done.send(()).unwrap();
        });
        assert!(is_done.await.is_ok(), "{:?}", client.join());
    });
}

#[test]
fn a_profile_with_a_refused_value_is_refused_also_where_it_would_make_no_difference() {
    on_stage(async |stage| {
        let paper = Profile {
            method: Method::Paper,
            ..Profile::default()
        };
        for (in_force, refused, key) in [
            (
                Profile::default(),
                Profile {
                    jnd: Some(0.07),
                    ..Profile::default()
                },
                "jnd",
            ),
            (
                paper.clone(),
                Profile {
                    history: -5.0,
                    ..paper
                },
                "history",
            ),
        ] {
            stage.handle.set_own_profile(in_force).await.unwrap();
            let reason = stage.handle.set_own_profile(refused.clone()).await.unwrap_err();
            assert!(reason.contains(key), "{reason}");

            let path = stage.path.clone();
            let asked = tokio::task::spawn_blocking(move || {
                let mut subscriber = Subscriber::connect(&path).unwrap();
                while !matches!(
                    subscriber.next_timeout(PATIENCE).unwrap(),
                    Some(Received::Hello(_))
                ) {}
                let wants = Subscribe {
                    profile: Some(refused),
                    ..Subscribe::default()
                };
                answer(&mut subscriber, &wants)
            });
            let (kind, reason) = asked.await.unwrap().expect("it is refused");
            assert_eq!(kind, EventKind::Refused);
            assert!(reason.contains(key), "{reason}");
        }
    });
}

#[test]
fn a_profile_that_is_one_too_many_is_given_once_another_has_made_room_that_had_one() {
    let profiles = ProfilesConfig {
        max: 2,
        ..ProfilesConfig::default()
    };
    on_stage_for(1, profiles, async |stage| {
        let path = stage.path.clone();
        let (done, is_done) = tokio::sync::oneshot::channel();
        let client = std::thread::spawn(move || {
            let connect = || {
                let mut subscriber = Subscriber::connect(&path).unwrap();
                let first = subscriber.next_timeout(PATIENCE).unwrap();
                assert!(matches!(first, Some(Received::Hello(_))), "{first:?}");
                subscriber
            };
            let of_levels = |levels| Subscribe {
                profile: Some(Profile {
                    levels,
                    ..Profile::default()
                }),
                ..Subscribe::default()
            };
            let mut onlooker = connect();
            let wants = Subscribe {
                image: false,
                ..of_levels(3)
            };
            assert_eq!(answer(&mut onlooker, &wants), None);
            let mut display = connect();
            assert_eq!(answer(&mut display, &of_levels(4)), None);
            let gone = onlooker.next_timeout(PATIENCE).unwrap();
            let is_told = |event: &Event| event.event == EventKind::Disconnect;
            assert!(
                matches!(&gone, Some(Received::Event(_, event)) if is_told(event)),
                "{gone:?}"
            );
            done.send(()).unwrap();
        });
        assert!(is_done.await.is_ok(), "{:?}", client.join());
    });
}
