//! Displays whose profile is still being measured.

use crate::{Told, config, connect, control, eventually, next, next_image, of, profiles, state};
use serde_json::json;
use taxel_hand::{Method, Profile};
use taxel_wire::{Subscribe, Subscriber};
use taxeld::Daemon;

/// Displays that take long to measure and are unlike each other.
fn slow_to_measure(nth: u16) -> Profile {
    Profile {
        method: Method::Optimal,
        ..of(16, 100 + nth)
    }
}

#[test]
fn who_waits_for_a_profile_is_not_let_go_when_the_daemons_own_changes_meanwhile() {
    let (_folder, config) = config("sim:worst-case");
    let _daemon = Daemon::start(config.clone()).unwrap();
    let mut holder = connect(&config);
    state(&mut holder, Some(of(3, 5)), None).unwrap();
    // All of these wait for their turn, and are shown the daemon's own profile until then.
    let mut waiting: Vec<Subscriber> = (0..6)
        .map(|nth| {
            let mut subscriber = connect(&config);
            let wanted = Subscribe {
                profile: Some(slow_to_measure(nth)),
                ..Subscribe::default()
            };
            subscriber.subscribe(&wanted).unwrap();
            subscriber
        })
        .collect();
    // That one is there already, so the one before it goes at once.
    let reply = control(&config, json!({ "cmd": "profile", "profile": of(3, 5) }));
    assert_eq!(reply, json!({ "ok": true }));
    eventually("the profile at the start is gone", || {
        profiles(&config).iter().all(|profile| profile["id"] != 0)
    });
    for subscriber in &mut waiting {
        loop {
            match next(subscriber) {
                Told::Hello(_) | Told::Refused(_) => break,
                Told::Gone => panic!("let go while it waited for its profile"),
                Told::Image { .. } | Told::Other => {}
            }
        }
        next_image(subscriber);
    }
}

#[test]
fn who_left_before_its_profile_was_measured_is_in_nobodys_way() {
    let (_folder, mut config) = config("sim:worst-case");
    // Who leaves while its profile is measured is missed at the next image: soon, or a fast machine
    // measures many of them before.
    config.tick.rate_hz = 200.0;
    let _daemon = Daemon::start(config.clone()).unwrap();
    let leavers = 20;
    for nth in 0..leavers {
        let mut subscriber = connect(&config);
        let wanted = Subscribe {
            profile: Some(slow_to_measure(nth)),
            ..Subscribe::default()
        };
        subscriber.subscribe(&wanted).unwrap();
    }
    let mut stays = connect(&config);
    state(&mut stays, Some(of(3, 5)), None).unwrap();
    let id = profiles(&config).last().unwrap()["id"].as_u64().unwrap();
    // Numbers are given in the order in which profiles are made: all who left would have been served before.
    assert!(id <= u64::from(leavers) / 2, "profile {id}");
}

#[test]
fn a_region_that_cannot_follow_the_daemons_own_profile_is_not_held_against_its_subscriber() {
    let (_folder, mut config) = config("sim:worst-case");
    config.profiles.max = 2;
    let _daemon = Daemon::start(config.clone()).unwrap();
    let mut thumbs = [connect(&config), connect(&config)];
    for thumb in &mut thumbs {
        state(thumb, None, Some(&["thumb"])).unwrap();
    }
    // Each holds the place that the other would need.
    for levels in 3..15 {
        let reply = control(
            &config,
            json!({ "cmd": "profile", "profile": { "levels": levels, "actuators": 5 } }),
        );
        assert_eq!(reply, json!({ "ok": true }));
        for thumb in &mut thumbs {
            loop {
                match next(thumb) {
                    Told::Refused(_) => break,
                    Told::Gone => panic!("let go at {levels} levels"),
                    Told::Hello(_) => panic!("there was room"),
                    Told::Image { .. } | Told::Other => {}
                }
            }
        }
    }
    for thumb in &mut thumbs {
        next_image(thumb);
    }
}
