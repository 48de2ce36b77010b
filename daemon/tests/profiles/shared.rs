//! Displays that share a daemon: what is refused, what each keeps when others come, go or stall.

use crate::*;
use taxeld::Daemon;

#[test]
fn an_impossible_profile_is_refused_with_the_reason_and_the_one_before_stays() {
    let (_folder, config) = config("sim:worst-case");
    let _daemon = Daemon::start(config.clone()).unwrap();
    let mut subscriber = connect(&config);
    state(&mut subscriber, Some(of(3, 5)), None).unwrap();
    type Case = (Profile, Option<&'static [&'static str]>, &'static str);
    let cases: [Case; 4] = [
        (of(0, 5), None, "levels = 0"),
        (
            Profile {
                codebook: vec![2.0, 1.0],
                ..of(3, 5)
            },
            None,
            "codebook entry 1",
        ),
        (
            of(3, 5),
            Some(&["index", "palm"]),
            "`palm`; it has index, middle, ring, thumb",
        ),
        (of(3, 5), Some(&[]), "no part is named"),
    ];
    for (profile, region, complaint) in cases {
        let reason = state(&mut subscriber, Some(profile), region).unwrap_err();
        assert!(reason.contains(complaint), "{reason}");
    }
    eventually("images of three levels", || next_image(&mut subscriber).1 == 3);
    assert_eq!(profiles(&config).len(), 2);

    // The same display asks again and again for what it cannot have.
    for _ in 4..8 {
        state(&mut subscriber, Some(of(0, 5)), None).unwrap_err();
    }
    let wanted = Subscribe {
        region: Some(vec!["palm".into()]),
        ..Subscribe::default()
    };
    subscriber.subscribe(&wanted).unwrap();
    while !matches!(next(&mut subscriber), Told::Gone) {}
}

#[test]
fn a_profile_that_costs_too_much_is_refused_with_the_numbers() {
    let (_folder, mut config) = config("sim:idle");
    config.tick.rate_hz = 1000.0;
    // 100 ns of each tick: less than any display takes.
    config.profiles.budget_percent = 0.01;
    let _daemon = Daemon::start(config.clone()).unwrap();
    let mut subscriber = connect(&config);
    let reason = state(&mut subscriber, Some(of(4, 5)), None).unwrap_err();
    for part in [
        "costs too much",
        "us per tick with every taxel in contact",
        "for the 1 in use",
        "may be 0.1 us, 0.01 % of a tick of 1000.0 us",
        "[profiles] budget_percent",
    ] {
        assert!(reason.contains(part), "{part}: {reason}");
    }
    assert_eq!(profiles(&config).len(), 1);
    // The daemon's own profile is not looked at twice, whoever states it.
    let own = state(&mut subscriber, Some(config.profile.clone()), None).unwrap();
    assert_eq!(own.profile, (&config.profile).into());
    assert_eq!(profiles(&config)[0]["subscribers"], 1);

    let reply = control(&config, json!({ "cmd": "profile", "profile": { "levels": 4 } }));
    assert!(
        reply["error"].as_str().unwrap().contains("costs too much"),
        "{reply}"
    );
    assert_eq!(
        control(&config, json!({ "cmd": "profile" }))["profile"]["levels"],
        8
    );
}

#[test]
fn one_profile_more_than_configured_is_refused_until_another_is_given_up() {
    let (_folder, mut config) = config("sim:idle");
    config.profiles.max = 2;
    let _daemon = Daemon::start(config.clone()).unwrap();
    let (mut first, mut second) = (connect(&config), connect(&config));
    state(&mut first, Some(of(4, 5)), None).unwrap();
    let reason = state(&mut second, Some(of(5, 5)), None).unwrap_err();
    assert!(
        reason.contains("2 different profiles are in use, and [profiles] max = 2"),
        "{reason}"
    );
    // Its own place is free for what it wants instead.
    state(&mut first, Some(of(6, 5)), None).unwrap();
    // A place that is only kept in case somebody comes back is free for others.
    drop(first);
    eventually("the place is free", || {
        state(&mut second, Some(of(5, 5)), None).is_ok()
    });
    eventually("two profiles are made", || profiles(&config).len() == 2);
}

#[test]
fn a_profile_stays_for_a_reader_that_reconnects_and_goes_when_nobody_does() {
    let (_folder, config) = config("sim:idle");
    let _daemon = Daemon::start(config.clone()).unwrap();
    let id = || profiles(&config).last().unwrap()["id"].clone();
    let own = id();
    let mut subscriber = connect(&config);
    state(&mut subscriber, Some(of(4, 5)), None).unwrap();
    let stated = id();
    assert_ne!(stated, own);
    drop(subscriber);
    let mut subscriber = connect(&config);
    state(&mut subscriber, Some(of(4, 5)), None).unwrap();
    assert_eq!(id(), stated, "the same profile, not made anew");
    drop(subscriber);
    eventually("the daemon's own profile is left", || {
        profiles(&config).len() == 1 && id() == own
    });
    // And it can be had again.
    let mut subscriber = connect(&config);
    state(&mut subscriber, Some(of(4, 5)), None).unwrap();
    assert!(![own, stated].contains(&id()));
    next_image(&mut subscriber);
}

#[test]
fn a_region_is_all_that_a_display_is_shown() {
    let (_folder, config) = config("sim:worst-case");
    let _daemon = Daemon::start(config.clone()).unwrap();
    let layout = &config.layout;
    let on = |parts: &[&str]| {
        let modules = layout.modules.iter().filter(|m| parts.contains(&m.part.as_str()));
        modules.map(|m| u32::from(m.taxels)).sum::<u32>()
    };
    let mut subscriber = connect(&config);
    let hello = state(&mut subscriber, None, Some(&["thumb", "index", "thumb"])).unwrap();
    assert_eq!(hello.region.unwrap(), ["index", "thumb"]);
    assert_eq!(hello.profile, (&config.profile).into());
    let all = on(&["index", "thumb"]);
    eventually("every taxel of the region in contact", || {
        next_image(&mut subscriber).2 == all
    });
    let hello = state(&mut subscriber, None, Some(&["index", "middle", "ring", "thumb"])).unwrap();
    assert_eq!(hello.region, None, "that is the whole hand");
    assert_eq!(profiles(&config).len(), 1, "and the daemon's own profile");
}

#[test]
fn who_stated_a_profile_keeps_it_when_the_daemons_own_changes_and_others_follow() {
    let (_folder, config) = config("sim:worst-case");
    let _daemon = Daemon::start(config.clone()).unwrap();
    let (mut stated, mut follower, mut thumb) = (connect(&config), connect(&config), connect(&config));
    state(&mut stated, Some(of(3, 5)), None).unwrap();
    state(&mut thumb, None, Some(&["thumb"])).unwrap();
    let reply = control(
        &config,
        json!({ "cmd": "profile", "profile": { "levels": 6, "actuators": 9 } }),
    );
    assert_eq!(reply, json!({ "ok": true }));
    for (subscriber, region) in [
        (&mut follower, None),
        (&mut thumb, Some(vec!["thumb".to_string()])),
    ] {
        let hello = loop {
            match next(subscriber) {
                Told::Hello(hello) => break hello,
                Told::Gone | Told::Refused(_) => panic!("no new HELLO"),
                _ => {}
            }
        };
        assert_eq!((hello.profile.levels, hello.profile.actuators), (6, 9));
        assert_eq!(hello.region, region);
        eventually("images of six levels", || next_image(subscriber).1 == 6);
    }
    eventually("images of three levels", || next_image(&mut stated).1 == 3);
    eventually("three profiles are left", || profiles(&config).len() == 3);
    assert_eq!(stated.hello().unwrap().profile.levels, 3);
    // Back to the daemon's own.
    stated.subscribe(&Subscribe::default()).unwrap();
    eventually("images of six levels", || next_image(&mut stated).1 == 6);
    assert_eq!(stated.hello().unwrap().profile.levels, 6);
}

#[test]
fn a_reader_that_takes_nothing_disturbs_no_other_of_its_profile_or_another() {
    let (_folder, config) = config("sim:worst-case");
    let _daemon = Daemon::start(config.clone()).unwrap();
    let (mut stalled, mut same, mut other) = (connect(&config), connect(&config), connect(&config));
    state(&mut stalled, Some(of(4, 5)), None).unwrap();
    state(&mut same, Some(of(4, 5)), None).unwrap();
    state(&mut other, Some(of(7, 9)), None).unwrap();
    let images = || -> Vec<u64> {
        let status = status(&config);
        let subscribers = status["subscribers"].as_array().unwrap();
        subscribers
            .iter()
            .map(|s| s["images"].as_u64().unwrap())
            .collect()
    };
    let mut last = (0, 0);
    for _ in 0..90 {
        last = (next_image(&mut same).0, next_image(&mut other).0);
    }
    let before = images();
    for _ in 0..30 {
        let now = (next_image(&mut same).0, next_image(&mut other).0);
        assert!(now.0 > last.0 && now.1 > last.1);
        last = now;
    }
    let after = images();
    assert_eq!(before.len(), 3);
    assert_eq!(after[0], before[0], "its socket is full: {before:?} {after:?}");
    assert!(
        after[1] >= before[1] + 29 && after[2] >= before[2] + 29,
        "{before:?} {after:?}"
    );
}
