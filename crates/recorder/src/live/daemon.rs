//! The thread that reads the daemon.

use super::can::Buses;
use super::{Described, LOOK, Message, Plan, Shared};
use crate::schema::Topic;
use crate::standard::{
    diagnostics_message, event_message, event_name, joints_message, picture_message, text_message,
};
use crate::tactile::{frame_message, image_message};
use crate::writer::Entry;
use std::path::Path;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::sync::mpsc::SyncSender;
use std::thread;
use std::time::{Duration, Instant};
use taxel_can::monotonic_ns;
use taxel_wire::status::Status;
use taxel_wire::{Clock, EventKind, Hello, Received, Subscribe, Subscriber};

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

/// Says something about the recording, there and to people.
fn tell(text: &str, queue: &SyncSender<Message>, shared: &Shared<'_>) {
    (shared.signals.say)(text);
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
    let mut kept = Kept {
        is_followed: false,
        joints: Vec::new(),
        is_monotonic: false,
        mark_triggers,
        recorded,
        queue,
        shared,
    };
    let (mut wait, mut gathered) = (Duration::ZERO, 0);
    while !shared.is_over() {
        let Some(received) = subscriber.next_timeout(wait)? else {
            // A large hand fills a socket soon, and to wake up for each of its messages costs little beside them.
            wait = if gathered > MOST_GATHERED {
                LOOK
            } else {
                thread::sleep(READ_PAUSE);
                Duration::ZERO
            };
            gathered = 0;
            continue;
        };
        wait = Duration::ZERO;
        kept.keep(received, &mut |topic, wall_ns, data: Vec<u8>| {
            gathered += data.len();
            shared.entry(queue, topic, wall_ns, data);
        });
    }
    Ok(())
}

/// What a subscription is written with.
struct Kept<'a> {
    /// Whether its daemon has described itself. What it describes later is its profile at most: whatever else its
    /// configuration has in a file by then is not in force before a restart.
    is_followed: bool,
    /// The joints of the hand, by the newest HELLO.
    joints: Vec<String>,
    /// Whether its times are those of this machine.
    is_monotonic: bool,
    mark_triggers: bool,
    recorded: &'a mut Described,
    queue: &'a SyncSender<Message>,
    shared: &'a Shared<'a>,
}

impl Kept<'_> {
    /// Puts what is kept of a message: topic, time on the wall clock, bytes.
    fn keep(&mut self, received: Received<'_>, put: &mut dyn FnMut(Topic, u64, Vec<u8>)) {
        let shared = self.shared;
        let now_ns = shared.wall.at(monotonic_ns());
        let is_monotonic = self.is_monotonic;
        let wall = |t_ns| match is_monotonic {
            true => shared.wall.at(t_ns),
            false => now_ns,
        };
        match received {
            Received::Hello(hello) => {
                shared.is_described.store(true, Ordering::Relaxed);
                if !std::mem::replace(&mut self.is_followed, true) {
                    follow(hello, self.recorded, self.queue, shared);
                }
                self.is_monotonic = hello.clock == Clock::Monotonic;
                self.joints.clone_from(&hello.joints);
                let text = String::from_utf8_lossy(&hello.to_json()).into_owned();
                put(Topic::Hello, now_ns, text_message(&text));
            }
            Received::Raw(header, raw) => {
                let wall_ns = wall(header.t_ns);
                shared.skipped.fetch_add(header.skipped.into(), Ordering::Relaxed);
                put(Topic::Frames, wall_ns, frame_message(&header, &raw));
                if raw.joints().len() == self.joints.len() && !self.joints.is_empty() {
                    put(
                        Topic::Joints,
                        wall_ns,
                        joints_message(&self.joints, &raw, shared.stamp_ns(wall_ns)),
                    );
                }
            }
            Received::Image(header, image) => {
                let wall_ns = wall(header.t_ns);
                shared.images.fetch_add(1, Ordering::Relaxed);
                shared.skipped.fetch_add(header.skipped.into(), Ordering::Relaxed);
                put(Topic::Images, wall_ns, image_message(&header, &image));
                put(
                    Topic::Picture,
                    wall_ns,
                    picture_message(&image, shared.stamp_ns(wall_ns)),
                );
            }
            Received::Status(_, status) => {
                put(Topic::Status, now_ns, text_message(&status.to_string()));
                if let Ok(status) = Status::try_from(status) {
                    put(
                        Topic::Diagnostics,
                        now_ns,
                        diagnostics_message(&status, shared.stamp_ns(now_ns)),
                    );
                    *shared.problems.lock().unwrap_or_else(PoisonError::into_inner) = status.problems;
                }
            }
            Received::Event(header, event) => {
                let wall_ns = if event.event == EventKind::Mark {
                    wall(header.t_ns)
                } else {
                    now_ns
                };
                let text = event_message(event_name(event.event), &event.message, shared.stamp_ns(wall_ns));
                put(Topic::Events, wall_ns, text);
                if event.event == EventKind::Disconnect {
                    (shared.signals.say)(&format!("taxeld closes the connection: {}", event.message));
                }
                if self.mark_triggers && event.event == EventKind::Mark {
                    let why = format!("mark {:?}", event.message);
                    shared.hand_over(self.queue, Message::Trigger { wall_ns, why });
                }
            }
            Received::Touch(..) | Received::Estimate(..) | Received::Other(_) => {}
        }
    }
}
