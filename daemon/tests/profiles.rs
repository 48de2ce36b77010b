//! What displays are promised that state their own profile: their own images, one making for all who ask for the same,
//! and a reason when they cannot have it.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};
use taxel_can::{LogWriter, Received};
use taxel_compress::{Compressor, Grey, Method, Profile, TactileImage};
use taxel_sim::{Scene, Simulator};
use taxel_skin::{Faults, ForceFrame, Layout};
use taxel_wire::{Event, EventKind, Header, Hello, ImageView, ReadError, Subscribe, Subscriber};
use taxeld::pipeline::{Frames, Pipeline};
use taxeld::{Config, Daemon};
use tempfile::TempDir;

const PATIENCE: Duration = Duration::from_secs(20);

fn hand() -> Layout {
    Layout::builtin("allegro-uskin-15").unwrap()
}

/// A daemon of its own for each test; debug builds are slow, so all of a tick may be spent.
fn config(source: &str) -> (TempDir, Config) {
    let folder = tempfile::tempdir().unwrap();
    let layout = hand();
    let sources = layout.buses.iter().map(|_| source.parse().unwrap()).collect();
    let mut config = Config::new(layout, sources);
    config.profiles.budget_percent = 100.0;
    config.socket.images = folder.path().join("images.sock");
    config.socket.control = folder.path().join("control.sock");
    (folder, config)
}

fn control(config: &Config, request: Value) -> Value {
    let mut socket = UnixStream::connect(&config.socket.control).unwrap();
    writeln!(socket, "{request}").unwrap();
    let mut line = String::new();
    BufReader::new(socket).read_line(&mut line).unwrap();
    serde_json::from_str(&line).unwrap()
}

fn status(config: &Config) -> Value {
    control(config, json!({ "cmd": "status" }))["status"].take()
}

fn profiles(config: &Config) -> Vec<Value> {
    status(config)["profiles"].as_array().unwrap().clone()
}

/// Asks until the answer is as expected.
fn eventually(what: &str, mut holds: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !holds() {
        assert!(Instant::now() < deadline, "still not so: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// What a subscriber was told.
enum Told {
    Hello(Box<Hello>),
    Refused(String),
    Image { seq: u64, levels: usize, contacts: u32 },
    Other,
    Gone,
}

fn next(subscriber: &mut Subscriber) -> Told {
    match subscriber.next_timeout(PATIENCE) {
        Ok(Some(taxel_wire::Received::Hello(hello))) => Told::Hello(Box::new(hello.clone())),
        Ok(Some(taxel_wire::Received::Event(Event {
            event: EventKind::Refused,
            message,
        }))) => Told::Refused(message),
        Ok(Some(taxel_wire::Received::Image(header, image))) => Told::Image {
            seq: header.seq,
            levels: image.levels().count(),
            contacts: image.contacts,
        },
        Ok(Some(_)) => Told::Other,
        Ok(None) => panic!("nothing came in {PATIENCE:?}"),
        Err(ReadError::Closed) => Told::Gone,
        Err(error) => panic!("{error}"),
    }
}

/// Connects and passes over the first HELLO, which is of the daemon's own profile.
fn connect(config: &Config) -> Subscriber {
    let mut subscriber = Subscriber::connect(&config.socket.images).unwrap();
    while !matches!(next(&mut subscriber), Told::Hello(_)) {}
    subscriber
}

/// States a profile and waits for the answer.
fn state(
    subscriber: &mut Subscriber,
    profile: Option<Profile>,
    region: Option<&[&str]>,
) -> Result<Hello, String> {
    let region = region.map(|parts| parts.iter().map(|part| part.to_string()).collect());
    let wanted = Subscribe {
        profile,
        region,
        ..Subscribe::default()
    };
    subscriber.subscribe(&wanted).unwrap();
    loop {
        match next(subscriber) {
            Told::Hello(hello) => return Ok(*hello),
            Told::Refused(reason) => return Err(reason),
            Told::Gone => panic!("disconnected"),
            Told::Image { .. } | Told::Other => {}
        }
    }
}

fn next_image(subscriber: &mut Subscriber) -> (u64, usize, u32) {
    loop {
        match next(subscriber) {
            Told::Image {
                seq,
                levels,
                contacts,
            } => return (seq, levels, contacts),
            Told::Gone => panic!("disconnected"),
            _ => {}
        }
    }
}

fn of(levels: u16, actuators: u16) -> Profile {
    Profile {
        method: Method::Paper,
        levels,
        actuators,
        ..Profile::default()
    }
}

/// Ten displays as different as displays are: the daemon's own, and nine others.
fn ten_displays() -> Vec<(Option<Profile>, Option<&'static [&'static str]>)> {
    let optimal = |levels, actuators| Profile {
        method: Method::Optimal,
        ..of(levels, actuators)
    };
    vec![
        (None, None),
        (Some(of(4, 5)), None),
        (Some(of(8, 16)), None),
        (
            Some(Profile {
                parts_apart: true,
                ..optimal(4, 5)
            }),
            None,
        ),
        (
            Some(Profile {
                grey: Grey::Centroid,
                ..of(8, 16)
            }),
            None,
        ),
        (
            Some(Profile {
                codebook: vec![300.0, 900.0, 2700.0],
                ..of(3, 8)
            }),
            None,
        ),
        (
            Some(Profile {
                level_hysteresis: 0.2,
                ..optimal(8, 16)
            }),
            None,
        ),
        (Some(optimal(8, 16)), Some(&["thumb"])),
        (Some(of(16, 32)), Some(&["thumb", "index"])),
        (
            Some(Profile {
                history: 1.0,
                force_weighted: true,
                ..optimal(32, 4)
            }),
            None,
        ),
    ]
}

/// A scene in which nothing is touched until ten displays have connected, however busy the machine is.
const SCENE: &str = r#"
name = "late touch"
about = "Pressure travels over the whole hand after a long rest."
seconds = 11.0
[[contact]]
shape = "flat"
on = ["all"]
radius = 30.0
force_n = [[7.0, 0.0], [7.5, 0.8], [8.5, 1.2], [9.5, 0.4], [10.0, 0.0]]
[[contact]]
shape = "bump"
on = ["all"]
radius = 7.0
path = [[0.0, 2.0, 2.0], [7.0, 2.0, 2.0], [9.0, 13.0, 5.0], [10.0, 5.0, 13.0], [11.0, 7.5, 7.5]]
force_n = [[7.0, 0.0], [7.5, 4.0], [9.5, 4.0], [10.5, 0.0]]
"#;

/// A recording of the scene, and its frames as the recording has them: in whole microseconds from the first.
fn record(folder: &TempDir) -> (String, Vec<(u8, Received)>) {
    let layout = hand();
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, SCENE).unwrap();
    let scene = Scene::load(&scene).unwrap();
    let mut simulator = Simulator::new(&scene, &layout, 1).unwrap();
    simulator.start_all();
    let mut frames = Vec::new();
    simulator.advance(scene.length_ns(), &mut frames);
    let first_us = frames.iter().map(|(_, r)| r.t_ns).min().unwrap() / 1000;
    let path = folder.path().join("recording.log");
    let mut log = LogWriter::new(BufWriter::new(std::fs::File::create(&path).unwrap()));
    for (bus, received) in &mut frames {
        let interface = &layout.buses[usize::from(*bus)];
        log.write(received.t_ns, interface, &received.frame).unwrap();
        received.t_ns = (received.t_ns / 1000 - first_us) * 1000;
    }
    log.flush().unwrap();
    (path.display().to_string(), frames)
}

/// The force frame as a region of the hand feels it, written without looking at how the daemon does it.
fn restrict(force: &ForceFrame, layout: &Layout, parts: &[&str]) -> ForceFrame {
    let mut inside = force.clone();
    for taxel in 0..layout.len() {
        if !parts.contains(&layout.module_of(taxel).part.as_str()) {
            inside.contact[taxel] = false;
            inside.faults[taxel] = Faults::NONE;
            inside.repaired[taxel] = false;
        }
    }
    inside
}

/// Images as they come over the wire, by sequence number.
type Images = BTreeMap<u64, TactileImage>;

/// What compressors of their own make of the same force frames, for each display.
fn offline(config: &Config, frames: &[(u8, Received)]) -> Vec<Images> {
    let layout = &config.layout;
    let displays = ten_displays();
    let mut compressors: Vec<Compressor> = (displays.iter())
        .map(|(profile, _)| profile.as_ref().unwrap_or(&config.profile))
        .map(|profile| Compressor::new(profile.clone(), layout).unwrap())
        .collect();
    let mut images = vec![Images::new(); displays.len()];
    let mut pipeline = Pipeline::new(config, 0).unwrap();
    let mut emit = |frames: &Frames| {
        for (((_, region), compressor), images) in displays.iter().zip(&mut compressors).zip(&mut images) {
            let force = match region {
                Some(parts) => restrict(&frames.force, layout, parts),
                None => frames.force.clone(),
            };
            let mut image = compressor.new_image();
            compressor.compress(&force, &mut image);
            let mut payload = Vec::new();
            taxel_wire::encode_image_payload(&image, &mut payload).unwrap();
            let header = Header::of_image(&image, payload.len());
            images.insert(image.seq, ImageView::decode(&payload).unwrap().to_image(&header));
        }
    };
    for (bus, received) in frames {
        pipeline.push(*bus, received, &mut emit);
    }
    images
}

#[test]
fn ten_different_displays_on_one_hand_each_get_what_a_compressor_of_their_own_makes() {
    let (folder, mut config) = config("sim:idle");
    let (path, frames) = record(&folder);
    for (source, bus) in config.sources.iter_mut().zip(&config.layout.buses) {
        *source = format!("log:{path}?interface={bus}").parse().unwrap();
    }
    let expected = offline(&config, &frames);
    let touched = expected[0].values().find(|image| image.contacts > 0).unwrap().seq;

    let daemon = Daemon::start(config.clone()).unwrap();
    let readers: Vec<_> = (ten_displays().into_iter())
        .map(|(profile, region)| {
            let config = config.clone();
            std::thread::spawn(move || {
                let mut subscriber = connect(&config);
                let hello = match (&profile, region) {
                    (None, None) => subscriber.hello().unwrap().clone(),
                    _ => state(&mut subscriber, profile, region).unwrap(),
                };
                let mut images = Images::new();
                loop {
                    match subscriber.next() {
                        Ok(taxel_wire::Received::Image(header, image)) => {
                            images.insert(header.seq, image.to_image(&header));
                        }
                        Ok(_) => {}
                        Err(ReadError::Closed) => return (hello, images),
                        Err(error) => panic!("{error}"),
                    }
                }
            })
        })
        .collect();
    eventually("ten profiles are made", || profiles(&config).len() == 10);
    // The same display twice: both are shown one profile.
    let mut twin = connect(&config);
    let (profile, region) = ten_displays().swap_remove(7);
    state(&mut twin, profile, region).unwrap();
    let shared = profiles(&config);
    assert_eq!(shared.len(), 10, "{shared:?}");
    let of_two: Vec<_> = shared.iter().filter(|p| p["subscribers"] == 2).collect();
    assert_eq!(of_two.len(), 1, "{shared:?}");
    assert_eq!(of_two[0]["region"], json!(["thumb"]));
    assert_eq!(
        shared.iter().filter(|p| p["subscribers"] == 1).count(),
        9,
        "{shared:?}"
    );

    eventually("the recording has ended", || !daemon.is_running());
    println!(
        "{}",
        json!(shared.iter().map(|p| &p["cost_us"]).collect::<Vec<_>>())
    );
    for (display, (reader, expected)) in readers.into_iter().zip(&expected).enumerate() {
        let (hello, images) = reader.join().unwrap();
        let (profile, region) = &ten_displays()[display];
        let stated = profile.as_ref().unwrap_or(&config.profile);
        assert_eq!(hello.profile, stated.into(), "display {display}");
        assert_eq!(hello.region.is_some(), region.is_some(), "display {display}");
        // Compressors remember; the daemon's began where nothing had been touched yet.
        let first = *images.keys().next().unwrap();
        assert!(
            first < touched,
            "display {display} came too late: {first} of {touched}"
        );
        let shown = images.values().filter(|image| image.contacts > 0).count();
        assert!(shown > 40, "display {display}: {shown} images with contacts");
        for (seq, image) in &images {
            assert_eq!(*image, expected[seq], "display {display}, image {seq}");
        }
    }
}

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

/// Displays that take long to measure and are unlike each other.
fn slow_to_measure(nth: u16) -> Profile {
    Profile {
        method: Method::Optimal,
        ..of(8, 20 + nth)
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
    config.tick.rate_hz = 10.0;
    let _daemon = Daemon::start(config.clone()).unwrap();
    let leavers = 20;
    for nth in 0..leavers {
        let mut subscriber = connect(&config);
        let wanted = Subscribe {
            profile: Some(of(8, 20 + nth)),
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
