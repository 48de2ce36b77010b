//! The thread that reads the daemon.

use super::can::Buses;
use super::{Described, LOOK, Message, Plan, Shared};
use crate::schema::Topic;
use crate::standard::event_message;
use crate::translation::{Taker, Translation};
use crate::writer::Entry;
use std::path::Path;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::sync::mpsc::SyncSender;
use std::thread;
use std::time::{Duration, Instant};
use taxel_can::monotonic_ns;
use taxel_journal::Priority;
use taxel_wire::{EventKind, Hello, Received, Subscribe, Subscriber};

/// How long messages are left to gather in the socket.
const READ_PAUSE: Duration = Duration::from_millis(40);
/// Bytes that came since the last pause from which on there is none: a socket holds some 200 kB.
const MOST_GATHERED: usize = 64 << 10;
/// Between two attempts to reach the daemon.
const AGAIN: Duration = Duration::from_millis(500);

/// Reads the daemon, and the one that comes after it, until it is over.
pub(super) fn read_daemon(socket: &Path, plan: &Plan, queue: &SyncSender<Message>, shared: &Shared<'_>) {
    let mut recorded = Described {
        preamble: plan.preamble.clone(),
        can: plan.can.clone(),
        news: None,
    };
    let mut told = false;
    while !shared.is_over() {
        match Subscriber::connect(socket) {
            Ok(subscriber) => {
                told = false;
                let ended = read_subscription(subscriber, plan.mark_triggers, &mut recorded, queue, shared);
                if let Err(error) = ended {
                    tell(&error.to_string(), queue, shared);
                }
            }
            Err(error) if !told => {
                told = true;
                tell(&format!("{error}; waiting for it"), queue, shared);
            }
            Err(_) => {}
        }
        let again = Instant::now() + AGAIN;
        while !shared.is_over() && Instant::now() < again {
            thread::sleep(LOOK);
        }
    }
}

/// Records the hand that a daemon describes with what belongs to it, in another file where that is other than what is
/// recorded with.
fn follow(hello: &Hello, recorded: &mut Described, queue: &SyncSender<Message>, shared: &Shared<'_>) {
    let Some(mut described) = (shared.signals.described)(hello) else {
        return;
    };
    let mut news = described.news.clone().filter(|_| described.news != recorded.news);
    if described.can != recorded.can {
        match Buses::open(&described.can) {
            Ok(buses) => {
                *shared.other_buses.lock().unwrap_or_else(PoisonError::into_inner) = Some(buses);
            }
            Err(error) => {
                news = Some(format!("{error}; CAN is recorded of the buses of before"));
                described.can.clone_from(&recorded.can);
            }
        }
    }
    if described.preamble != recorded.preamble || described.can != recorded.can {
        // What is dropped where the disk is slow must not be that.
        let _ = queue.send(Message::Another(described.preamble.clone()));
    }
    if let Some(news) = news {
        tell(&news, queue, shared);
    }
    *recorded = described;
}

/// Says what is missing of the recording, there and to people.
fn tell(text: &str, queue: &SyncSender<Message>, shared: &Shared<'_>) {
    (shared.signals.say)(Priority::Warning, text);
    let wall_ns = shared.wall.at(monotonic_ns());
    let data = event_message("recorder", text, shared.stamp_ns(wall_ns));
    let topic = Topic::Events;
    shared.hand_over(queue, Message::Note(Entry { topic, wall_ns, data }));
}

fn read_subscription(
    mut subscriber: Subscriber,
    mark_triggers: bool,
    recorded: &mut Described,
    queue: &SyncSender<Message>,
    shared: &Shared<'_>,
) -> Result<(), taxel_wire::ReadError> {
    subscriber.subscribe(&Subscribe {
        raw: true,
        status: true,
        every: true,
        ..Subscribe::default()
    })?;
    let mut is_followed = false;
    let mut translation = Translation::default();
    let mut taken = Taken {
        gathered: 0,
        queue,
        shared,
    };
    let mut wait = Duration::ZERO;
    while !shared.is_over() {
        let Some(received) = subscriber.next_timeout(wait)? else {
            // A large hand fills a socket soon, and to wake up for each of its messages costs little beside them.
            wait = if taken.gathered > MOST_GATHERED {
                LOOK
            } else {
                thread::sleep(READ_PAUSE);
                Duration::ZERO
            };
            taken.gathered = 0;
            continue;
        };
        wait = Duration::ZERO;
        // What a daemon describes later is its profile at most: whatever else its configuration has in a file by then is
        // not in force before a restart.
        if let Received::Hello(hello) = &received {
            shared.is_described.store(true, Ordering::Relaxed);
            if !std::mem::replace(&mut is_followed, true) {
                follow(hello, recorded, queue, shared);
            }
        }
        count(&received, shared);
        let event = match &received {
            Received::Event(header, event) => Some((header.t_ns, event.clone())),
            _ => None,
        };
        let problems = translation.translate(received, &mut taken);
        if let Some(status) = problems {
            *shared.problems.lock().unwrap_or_else(PoisonError::into_inner) = status.problems;
        }
        match event {
            Some((_, event)) if event.event == EventKind::Disconnect => {
                let why = format!("taxeld closes the connection: {}", event.message);
                (shared.signals.say)(Priority::Warning, &why);
            }
            Some((t_ns, mark)) if mark_triggers && mark.event == EventKind::Mark => {
                let wall_ns = translation.wall_ns(&taken, t_ns);
                let why = format!("mark {:?}", mark.message);
                shared.hand_over(queue, Message::Trigger { wall_ns, why });
            }
            _ => {}
        }
    }
    Ok(())
}

/// Counts an image or a frame, and what was passed over before it.
fn count(received: &Received<'_>, shared: &Shared<'_>) {
    let skipped = match received {
        Received::Image(header, _) => {
            shared.images.fetch_add(1, Ordering::Relaxed);
            header.skipped
        }
        Received::Raw(header, _) => header.skipped,
        _ => return,
    };
    shared.skipped.fetch_add(skipped.into(), Ordering::Relaxed);
}

/// Takes every message, into the queue to the writer.
struct Taken<'a> {
    /// Bytes taken since it was last set to nothing.
    gathered: usize,
    queue: &'a SyncSender<Message>,
    shared: &'a Shared<'a>,
}

impl Taker for Taken<'_> {
    fn wants(&self, _topic: Topic) -> bool {
        true
    }

    fn now_ns(&self) -> u64 {
        self.shared.wall.at(monotonic_ns())
    }

    fn wall_ns(&self, t_ns: u64) -> u64 {
        self.shared.wall.at(t_ns)
    }

    fn stamp_ns(&self, wall_ns: u64) -> u64 {
        self.shared.stamp_ns(wall_ns)
    }

    fn take(&mut self, topic: Topic, wall_ns: u64, data: Vec<u8>) {
        self.gathered += data.len();
        self.shared.entry(self.queue, topic, wall_ns, data);
    }
}
