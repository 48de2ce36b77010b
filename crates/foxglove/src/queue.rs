//! What a client is still to be sent: so much, and no more.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};
use taxel_recorder::Topic;

/// How old a frame or an image may get where more than [`FEW`] wait: a viewer that was held up goes on with what is now.
const LONGEST: Duration = Duration::from_secs(1);
/// Messages that are no backlog.
const FEW: usize = 64;
/// Bytes of frames and images, of which the newest is kept however large it is.
const MOST_BYTES: usize = 4 << 20;
/// Texts of the protocol, and events.
const MOST_TEXTS: usize = 256;

/// A message, made once for all clients.
#[derive(Debug)]
pub(crate) struct Message {
    pub(crate) topic: Topic,
    /// Its time on the wall clock, nanoseconds since 1970.
    pub(crate) wall_ns: u64,
    /// When it was made.
    pub(crate) made: Instant,
    pub(crate) data: Vec<u8>,
}

/// Whether a message of this topic says how things are now, so that whoever comes later is given the newest, and an older
/// one is worth nothing.
pub(crate) fn is_state(topic: Topic) -> bool {
    match topic {
        Topic::Hello | Topic::Status | Topic::Diagnostics | Topic::Clock => true,
        Topic::Can | Topic::Frames | Topic::Images | Topic::Picture | Topic::Joints | Topic::Events => false,
    }
}

/// What is sent next.
#[derive(Debug)]
pub(crate) enum Next {
    Text(String),
    Data(Arc<Message>),
}

/// What waits for a client.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    texts: VecDeque<String>,
    /// States, of each topic one, and events.
    told: VecDeque<Arc<Message>>,
    /// Frames, images and joints.
    stream: VecDeque<Arc<Message>>,
    stream_bytes: usize,
    lost: u64,
}

impl Queue {
    /// Puts a text of the protocol, which is not lost but where they pile up.
    pub(crate) fn push_text(&mut self, text: String) {
        self.texts.push_back(text);
        if self.texts.len() > MOST_TEXTS {
            self.texts.pop_front();
        }
    }

    /// Puts a message; those that it is too late for, or that have no room beside it, are lost.
    pub(crate) fn push(&mut self, message: Arc<Message>, now: Instant) {
        match message.topic {
            topic if is_state(topic) => {
                self.told.retain(|older| older.topic != topic);
                self.told.push_back(message);
            }
            Topic::Events => {
                self.told.push_back(message);
                if self.told.len() > MOST_TEXTS {
                    self.told.pop_front();
                    self.lost += 1;
                }
            }
            _ => {
                self.stream_bytes += message.data.len();
                self.stream.push_back(message);
                while let Some(oldest) = self.stream.front()
                    && self.is_too_much(now.saturating_duration_since(oldest.made))
                {
                    self.stream_bytes -= oldest.data.len();
                    self.stream.pop_front();
                    self.lost += 1;
                }
            }
        }
    }

    /// Whether the oldest frame or image, which is so old, is to make room.
    fn is_too_much(&self, oldest: Duration) -> bool {
        let waiting = self.stream.len();
        waiting > 1 && self.stream_bytes > MOST_BYTES || waiting > FEW && oldest > LONGEST
    }

    /// Takes what is to be sent next: first what tells something.
    pub(crate) fn pop(&mut self) -> Option<Next> {
        if let Some(text) = self.texts.pop_front() {
            return Some(Next::Text(text));
        }
        if let Some(message) = self.told.pop_front() {
            return Some(Next::Data(message));
        }
        let message = self.stream.pop_front()?;
        self.stream_bytes -= message.data.len();
        Some(Next::Data(message))
    }

    /// Messages lost so far.
    pub(crate) fn lost(&self) -> u64 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(topic: Topic, made: Instant, data: &[u8]) -> Arc<Message> {
        Arc::new(Message {
            topic,
            wall_ns: 0,
            made,
            data: data.to_vec(),
        })
    }

    fn taken(queue: &mut Queue) -> Vec<Vec<u8>> {
        std::iter::from_fn(|| queue.pop())
            .map(|next| match next {
                Next::Text(text) => text.into_bytes(),
                Next::Data(message) => message.data.clone(),
            })
            .collect()
    }

    #[test]
    fn of_a_backlog_what_got_old_is_lost_and_what_is_new_comes_in_order() {
        let (mut queue, began) = (Queue::default(), Instant::now());
        let at = |ms| began + Duration::from_millis(ms);
        for ms in 0..=1100 {
            queue.push(message(Topic::Images, at(ms), &ms.to_le_bytes()), at(ms));
        }
        let newest: Vec<_> = (100..=1100_u64).map(|ms| ms.to_le_bytes().to_vec()).collect();
        assert_eq!((taken(&mut queue), queue.lost()), (newest, 100));
        assert_eq!(queue.stream_bytes, 0);
    }

    #[test]
    fn a_few_messages_wait_for_a_viewer_that_is_held_up() {
        let (mut queue, began) = (Queue::default(), Instant::now());
        for minute in 0..FEW as u64 {
            let now = began + Duration::from_secs(60 * minute);
            queue.push(message(Topic::Images, now, b"image"), now);
        }
        assert_eq!((taken(&mut queue).len(), queue.lost()), (FEW, 0));
    }

    #[test]
    fn more_than_there_is_room_for_costs_the_oldest_and_never_the_newest() {
        let (mut queue, now) = (Queue::default(), Instant::now());
        let large = vec![0; MOST_BYTES];
        for topic in [Topic::Images, Topic::Frames] {
            queue.push(message(topic, now, &large), now);
        }
        queue.push(message(Topic::Frames, now, &vec![0; MOST_BYTES + 1]), now);
        assert_eq!((queue.stream.len(), queue.lost()), (1, 2));
        queue.push(message(Topic::Joints, now, b"small"), now);
        assert_eq!(taken(&mut queue), [b"small"]);
    }

    #[test]
    fn of_a_state_only_the_newest_waits_and_events_are_bounded() {
        let (mut queue, now) = (Queue::default(), Instant::now());
        queue.push(message(Topic::Status, now, b"old"), now);
        queue.push(message(Topic::Hello, now, b"hello"), now);
        queue.push(message(Topic::Status, now, b"new"), now);
        assert_eq!(taken(&mut queue), [&b"hello"[..], b"new"]);
        assert_eq!(queue.lost(), 0);
        for _ in 0..2 * MOST_TEXTS {
            queue.push(message(Topic::Events, now, b"mark"), now);
            queue.push_text("status".into());
        }
        assert_eq!(taken(&mut queue).len(), 2 * MOST_TEXTS);
    }

    #[test]
    fn what_tells_something_comes_before_frames_and_images() {
        let (mut queue, now) = (Queue::default(), Instant::now());
        queue.push(message(Topic::Frames, now, b"frame"), now);
        queue.push(message(Topic::Events, now, b"mark"), now);
        queue.push_text("text".into());
        assert_eq!(taken(&mut queue), [&b"text"[..], b"mark", b"frame"]);
    }
}
