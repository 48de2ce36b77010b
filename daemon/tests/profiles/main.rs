//! What displays are promised that state their own profile: their own images, one making for all
//! who ask for the same, and a reason when they cannot have it.

mod shared;
mod ten_displays;
mod waiting;

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};
use taxel_hand::{Method, Profile};
use taxel_skin::Layout;
use taxel_wire::{Event, EventKind, Hello, ReadError, Subscribe, Subscriber};
use taxeld::Config;
use tempfile::TempDir;

pub(crate) const PATIENCE: Duration = Duration::from_secs(200);

pub(crate) fn hand() -> Layout {
    Layout::builtin("allegro-uskin-15").unwrap()
}

/// A daemon of its own for each test; debug builds are slow, so all of a tick may be spent.
pub(crate) fn config(source: &str) -> (TempDir, Config) {
    let folder = tempfile::tempdir().unwrap();
    let layout = hand();
    let sources = layout.buses.iter().map(|_| source.parse().unwrap()).collect();
    let mut config = Config::new(layout, sources);
    config.profiles.budget_percent = 100.0;
    config.socket.images = folder.path().join("images.sock");
    config.socket.control = folder.path().join("control.sock");
    (folder, config)
}

pub(crate) fn control(config: &Config, request: Value) -> Value {
    let mut socket = UnixStream::connect(&config.socket.control).unwrap();
    writeln!(socket, "{request}").unwrap();
    let mut line = String::new();
    BufReader::new(socket).read_line(&mut line).unwrap();
    serde_json::from_str(&line).unwrap()
}

pub(crate) fn status(config: &Config) -> Value {
    control(config, json!({ "cmd": "status" }))["status"].take()
}

pub(crate) fn profiles(config: &Config) -> Vec<Value> {
    status(config)["profiles"].as_array().unwrap().clone()
}

/// Asks until the answer is as expected.
pub(crate) fn eventually(what: &str, mut holds: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !holds() {
        assert!(Instant::now() < deadline, "still not so: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// What a subscriber was told.
pub(crate) enum Told {
    Hello(Box<Hello>),
    Refused(String),
    Image { seq: u64, levels: usize, contacts: u32 },
    Other,
    Gone,
}

pub(crate) fn next(subscriber: &mut Subscriber) -> Told {
    match subscriber.next_timeout(PATIENCE) {
        Ok(Some(taxel_wire::Received::Hello(hello))) => Told::Hello(Box::new(hello.clone())),
        Ok(Some(taxel_wire::Received::Event(
            _,
            Event {
                event: EventKind::Refused,
                message,
            },
        ))) => Told::Refused(message),
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
pub(crate) fn connect(config: &Config) -> Subscriber {
    let mut subscriber = Subscriber::connect(&config.socket.images).unwrap();
    while !matches!(next(&mut subscriber), Told::Hello(_)) {}
    subscriber
}

/// States a profile and waits for the answer.
pub(crate) fn state(
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

pub(crate) fn next_image(subscriber: &mut Subscriber) -> (u64, usize, u32) {
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

pub(crate) fn of(levels: u16, actuators: u16) -> Profile {
    Profile {
        method: Method::Paper,
        levels,
        actuators,
        ..Profile::default()
    }
}
