//! The thread that reads the daemon.

use crate::counts::add;
use crate::hub::Hub;
use crate::queue::Message;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};
use taxel_can::both_clocks_ns;
use taxel_journal::Priority;
use taxel_recorder::{Taker, Topic, Translation, clock_message, event_message};
use taxel_wire::{ReadError, Received, Subscribe, Subscriber};

/// Between two attempts to reach the daemon.
const AGAIN: Duration = Duration::from_millis(500);
/// How often to look what is wanted, and whether it is over.
const LOOK: Duration = Duration::from_millis(100);
/// How long messages are left to gather: a picture on a screen is as old.
const GATHER: Duration = Duration::from_millis(10);
/// Messages that are handed over at once.
const AT_ONCE: usize = 64;
/// Between two notes of both clocks.
const CLOCK: Duration = Duration::from_secs(1);
/// How long a daemon may say nothing that reports once a second.
const SILENCE: Duration = Duration::from_secs(5);

/// The daemon's image socket, asked before each attempt to reach it.
pub(crate) type Socket = Box<dyn Fn() -> PathBuf + Send + Sync>;

/// Reads the daemon, and the one that comes after it, until it is over. `socket` is asked at each attempt: a daemon may
/// start somewhere else.
pub(crate) fn read_daemon(socket: &Socket, hub: &Hub) {
    let mut is_told = false;
    while !hub.has_ended() {
        if let Err(error) = read_one(&socket(), hub, &mut is_told)
            && !std::mem::replace(&mut is_told, true)
        {
            gone(hub, &format!("{error}; waiting for it"));
        }
        let again = Instant::now() + AGAIN;
        while !hub.has_ended() && Instant::now() < again {
            thread::sleep(LOOK);
        }
    }
}

/// Says that the daemon is gone, or back, to people, to clients, and among the events.
fn gone(hub: &Hub, why: &str) {
    hub.say(Priority::Warning, why);
    hub.gone(why);
    tell(hub, why);
}

fn tell(hub: &Hub, text: &str) {
    let (realtime_ns, _) = both_clocks_ns();
    let data = event_message("bridge", text, realtime_ns);
    hub.publish(vec![message(Topic::Events, realtime_ns, data)]);
}

fn message(topic: Topic, wall_ns: u64, data: Vec<u8>) -> Message {
    let made = Instant::now();
    Message {
        topic,
        wall_ns,
        made,
        data,
    }
}

/// What the clients want of the daemon. Its reports come in any case: they also tell that it is alive.
fn wish(hub: &Hub) -> Subscribe {
    Subscribe {
        image: hub.wants(Topic::Images) || hub.wants(Topic::Picture),
        raw: hub.wants(Topic::Frames) || hub.wants(Topic::Joints),
        status: true,
        every: true,
        ..Subscribe::default()
    }
}

/// Reads a connection until it or the bridge ends.
fn read_one(socket: &Path, hub: &Hub, is_gone: &mut bool) -> Result<(), ReadError> {
    let mut subscriber = Subscriber::connect(socket)?;
    add(&hub.counters.daemons, 1);
    let mut translation = Translation::default();
    let mut taken = Taken::new(hub);
    let mut wished = wish(hub);
    subscriber.subscribe(&wished)?;
    // What was made while nobody wanted it was not passed over.
    let (mut is_new_image, mut is_new_raw) = (true, true);
    let (mut heard, mut noted) = (Instant::now(), None::<Instant>);
    while !hub.has_ended() {
        let wanted = wish(hub);
        if wanted != wished {
            subscriber.subscribe(&wanted)?;
            is_new_image |= !wished.image;
            is_new_raw |= !wished.raw;
            wished = wanted;
        }
        let mut wait = LOOK;
        while let Some(received) = next(&mut subscriber, wait, hub)? {
            wait = Duration::ZERO;
            heard = Instant::now();
            if std::mem::take(is_gone) {
                let text = "taxeld is there again";
                hub.say(Priority::Info, text);
                hub.back(text);
                tell(hub, text);
            }
            let skipped = match &received {
                Received::Image(header, _) if !std::mem::take(&mut is_new_image) => header.skipped,
                Received::Raw(header, _) if !std::mem::take(&mut is_new_raw) => header.skipped,
                _ => 0,
            };
            add(&hub.counters.skipped, skipped.into());
            translation.translate(received, &mut taken);
            if taken.messages.len() >= AT_ONCE {
                break;
            }
        }
        if noted.is_none_or(|noted| noted.elapsed() >= CLOCK) {
            noted = Some(Instant::now());
            let (realtime_ns, monotonic_ns) = both_clocks_ns();
            let clocks = clock_message(monotonic_ns, realtime_ns);
            taken.take(Topic::Clock, realtime_ns, clocks);
        }
        if heard.elapsed() > SILENCE && !std::mem::replace(is_gone, true) {
            gone(
                hub,
                "taxeld says nothing; its log says what it does, and where it hangs, restart it",
            );
        }
        if !taken.messages.is_empty() {
            let is_all = taken.messages.len() < AT_ONCE;
            hub.publish(std::mem::take(&mut taken.messages));
            if is_all {
                thread::sleep(GATHER);
            }
        }
    }
    Ok(())
}

/// The next message that can be read; one that cannot is said, and passed over.
fn next<'s>(
    subscriber: &'s mut Subscriber,
    wait: Duration,
    hub: &Hub,
) -> Result<Option<Received<'s>>, ReadError> {
    match subscriber.next_timeout(wait) {
        Err(error) if !error.is_end() => {
            hub.remark(error.to_string());
            Ok(None)
        }
        received => received,
    }
}

/// What is taken of the daemon's messages, until it is handed over. Times are those of the wall clock as it stands.
struct Taken<'a> {
    hub: &'a Hub,
    messages: Vec<Message>,
}

impl<'a> Taken<'a> {
    fn new(hub: &'a Hub) -> Self {
        let messages = Vec::new();
        Self { hub, messages }
    }
}

impl Taker for Taken<'_> {
    fn wants(&self, topic: Topic) -> bool {
        self.hub.wants(topic)
    }

    fn now_ns(&self) -> u64 {
        both_clocks_ns().0
    }

    fn wall_ns(&self, t_ns: u64) -> u64 {
        let (realtime_ns, monotonic_ns) = both_clocks_ns();
        let ago_ns = monotonic_ns.wrapping_sub(t_ns) as i64;
        realtime_ns.saturating_add_signed(-ago_ns)
    }

    fn take(&mut self, topic: Topic, wall_ns: u64, data: Vec<u8>) {
        // A daemon describes its hand again with every subscription.
        if topic == Topic::Hello && self.hub.is_known(topic, &data) {
            return;
        }
        self.messages.push(message(topic, wall_ns, data));
    }
}
