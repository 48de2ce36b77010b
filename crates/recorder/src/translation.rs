//! From what a daemon sends to the messages of a recording, whoever takes them.

use crate::schema::Topic;
use crate::standard::{
    diagnostics_message, event_message, event_name, joints_message, picture_message, text_message,
};
use crate::tactile::{frame_message, image_message};
use taxel_wire::status::Status;
use taxel_wire::{Clock, EventKind, Hello, Received};

/// Who takes messages, and by which clock they are stamped.
pub trait Taker {
    /// Whether messages of this topic are wanted; those of others are not made.
    fn wants(&self, topic: Topic) -> bool;
    /// Now, on the wall clock, nanoseconds since 1970.
    fn now_ns(&self) -> u64;
    /// When that was on the wall clock, of a time of `CLOCK_MONOTONIC`.
    fn wall_ns(&self, t_ns: u64) -> u64;
    /// A time on the wall clock as it is to stand inside a message.
    fn stamp_ns(&self, wall_ns: u64) -> u64 {
        wall_ns
    }
    /// A message, and its time on the wall clock.
    fn take(&mut self, topic: Topic, wall_ns: u64, data: Vec<u8>);
}

/// Makes messages of what comes over one connection to a daemon. `docs/recordings.md` lists them.
#[derive(Debug, Default)]
pub struct Translation {
    /// The joints of the hand, by the newest HELLO.
    joints: Vec<String>,
    /// Whether its times are those of this machine.
    is_monotonic: bool,
}

impl Translation {
    /// Gives `taker` what becomes of a message of the daemon; of a report on its state, that report too.
    pub fn translate(&mut self, received: Received<'_>, taker: &mut impl Taker) -> Option<Status> {
        let now_ns = taker.now_ns();
        match received {
            Received::Hello(hello) => {
                self.take_hello(hello);
                let text = String::from_utf8_lossy(&hello.to_json()).into_owned();
                put(taker, Topic::Hello, now_ns, |_| text_message(&text));
            }
            Received::Raw(header, raw) => {
                let at_ns = self.wall_ns(taker, header.t_ns);
                put(taker, Topic::Frames, at_ns, |_| frame_message(&header, &raw));
                if raw.joints().len() == self.joints.len() && !self.joints.is_empty() {
                    put(taker, Topic::Joints, at_ns, |stamp_ns| {
                        joints_message(&self.joints, &raw, stamp_ns)
                    });
                }
            }
            Received::Image(header, image) => {
                let at_ns = self.wall_ns(taker, header.t_ns);
                put(taker, Topic::Images, at_ns, |_| image_message(&header, &image));
                put(taker, Topic::Picture, at_ns, |stamp_ns| {
                    picture_message(&image, stamp_ns)
                });
            }
            Received::Status(_, status) => {
                put(taker, Topic::Status, now_ns, |_| {
                    text_message(&status.to_string())
                });
                let status = Status::try_from(status).ok()?;
                put(taker, Topic::Diagnostics, now_ns, |stamp_ns| {
                    diagnostics_message(&status, stamp_ns)
                });
                return Some(status);
            }
            Received::Event(header, event) => {
                let at_ns = match event.event {
                    EventKind::Mark => self.wall_ns(taker, header.t_ns),
                    _ => now_ns,
                };
                put(taker, Topic::Events, at_ns, |stamp_ns| {
                    event_message(event_name(event.event), &event.message, stamp_ns)
                });
            }
            Received::Touch(..) | Received::Estimate(..) | Received::Other(_) => {}
        }
        None
    }

    /// When that was on the wall clock, of a time of the daemon; now, where its clock is that of a recording.
    pub fn wall_ns(&self, taker: &impl Taker, t_ns: u64) -> u64 {
        match self.is_monotonic {
            true => taker.wall_ns(t_ns),
            false => taker.now_ns(),
        }
    }

    fn take_hello(&mut self, hello: &Hello) {
        self.is_monotonic = hello.clock == Clock::Monotonic;
        self.joints.clone_from(&hello.joints);
    }
}

/// Makes a message and gives it, if it is wanted.
fn put(taker: &mut impl Taker, topic: Topic, wall_ns: u64, make: impl FnOnce(u64) -> Vec<u8>) {
    if taker.wants(topic) {
        let data = make(taker.stamp_ns(wall_ns));
        taker.take(topic, wall_ns, data);
    }
}
