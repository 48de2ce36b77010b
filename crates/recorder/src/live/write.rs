//! The thread that writes what the readers hand over, and what the recorder itself has to say of the recording.

use super::{LOOK, LiveError, Message, Plan, QUEUE, Shared};
use crate::schema::Topic;
use crate::standard::{clock_message, event_message};
use crate::store::{Store, Written};
use crate::store_error::StoreError;
use crate::writer::Entry;
use std::ops::ControlFlow;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError};
use std::thread;
use std::time::{Duration, Instant};
use taxel_can::{both_clocks_ns, monotonic_ns};
use taxel_journal::Priority;

/// Between two cuts. With the time that a disk takes, a crash costs less than a second.
const CUT: Duration = Duration::from_millis(500);
/// Between two notes of both clocks.
const CLOCK: Duration = Duration::from_secs(1);
/// How long messages are left to gather before they are written. To wake up for each of a few hundred a second costs more
/// than what is done with them.
const WRITE_PAUSE: Duration = Duration::from_millis(50);

/// Writes a recording.
pub(super) struct Writer<'a> {
    plan: &'a Plan,
    store: &'a mut Store,
    shared: &'a Shared<'a>,
    began: Instant,
    /// Messages that were dropped, and files that are gone, of which was told.
    told_dropped: u64,
    told_gone: usize,
    told_given: u32,
    /// How far the wall clock had been set when that was last told, nanoseconds.
    clock_moved_ns: i64,
}

impl<'a> Writer<'a> {
    pub(super) fn new(plan: &'a Plan, store: &'a mut Store, shared: &'a Shared<'a>) -> Self {
        Self {
            plan,
            store,
            shared,
            began: Instant::now(),
            told_dropped: 0,
            told_gone: 0,
            told_given: 0,
            clock_moved_ns: 0,
        }
    }

    /// Writes until it is to stop.
    pub(super) fn write(
        &mut self,
        messages: &Receiver<Message>,
        to_sync: &SyncSender<Written>,
        sync_failure: &Receiver<LiveError>,
    ) -> Result<(), LiveError> {
        let (mut cut, mut noted, mut looked) = (self.began, None::<Instant>, self.began);
        loop {
            thread::sleep(WRITE_PAUSE);
            self.take_messages(messages)?;
            let now = Instant::now();
            let wall_ns = self.shared.wall.at(monotonic_ns());
            if now - looked >= LOOK {
                looked = now;
                if self.look(now, wall_ns)?.is_break() {
                    return Ok(());
                }
                if let Ok(error) = sync_failure.try_recv() {
                    return Err(error);
                }
            }
            self.follow_clock(wall_ns)?;
            if noted.is_none_or(|noted| now - noted >= CLOCK) {
                noted = Some(now);
                self.note_clocks(wall_ns)?;
                self.tell_dropped(wall_ns)?;
            }
            if now - cut >= CUT {
                cut = now;
                self.cut(to_sync, wall_ns)?;
            }
            let clock_of_file = &self.shared.clock_of_file_ns;
            clock_of_file.store(self.store.clock_of_file(), Ordering::Relaxed);
        }
    }

    /// Takes messages, no more than there is room for: who reads more than can be written must not keep it from being cut.
    fn take_messages(&mut self, messages: &Receiver<Message>) -> Result<(), LiveError> {
        for message in messages.try_iter().take(QUEUE) {
            match message {
                Message::Entry(entry) => self.store.take(entry)?,
                Message::Note(entry) => self.store.note(entry)?,
                Message::Trigger { wall_ns, why } => self.trigger(wall_ns, &why)?,
                Message::Another(preamble) => {
                    if self.store.begin_another(preamble)? {
                        let text = "the daemon runs with another configuration, or reads other buses, than before; the \
                                    recording goes on in another file";
                        self.say(Priority::Info, text, self.shared.wall.at(monotonic_ns()))?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Looks whether something is to be kept, and whether it is over.
    fn look(&mut self, now: Instant, wall_ns: u64) -> Result<ControlFlow<()>, LiveError> {
        let signals = self.shared.signals;
        if (signals.trigger)() {
            self.trigger(wall_ns, "asked by signal")?;
        }
        let is_time_over = |duration| now - self.began >= duration;
        Ok(
            match (signals.stop)() || self.plan.duration.is_some_and(is_time_over) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            },
        )
    }

    /// Has the next file go by the wall clock as it is set, and says where that was set in the middle of one.
    fn follow_clock(&mut self, wall_ns: u64) -> Result<(), StoreError> {
        let Some(moved_ns) = self.shared.wall.moved_ns(self.clock_moved_ns) else {
            return Ok(());
        };
        let by_s = (moved_ns - self.clock_moved_ns) as f64 / 1e9;
        self.clock_moved_ns = moved_ns;
        self.store.set_clock(moved_ns);
        if !self.store.is_writing() {
            return Ok(());
        }
        let text = format!(
            "the wall clock was set by {by_s:+.1} s: times in this file go on as before, as /taxel/clock shows, and \
             the next file is by the new one"
        );
        self.say(Priority::Warning, &text, wall_ns)
    }

    fn note_clocks(&mut self, wall_ns: u64) -> Result<(), StoreError> {
        let (realtime_ns, monotonic_ns) = both_clocks_ns();
        self.store.note(Entry {
            topic: Topic::Clock,
            wall_ns,
            data: clock_message(monotonic_ns, realtime_ns),
        })
    }

    /// Says how many messages were dropped since it last did, if any.
    fn tell_dropped(&mut self, wall_ns: u64) -> Result<(), StoreError> {
        let dropped = self.shared.dropped.load(Ordering::Relaxed);
        let new = dropped - std::mem::replace(&mut self.told_dropped, dropped);
        match new {
            0 => Ok(()),
            _ => self.say(
                Priority::Warning,
                &format!("{new} messages were dropped: the disk is too slow"),
                wall_ns,
            ),
        }
    }

    /// Cuts what was written, hands it to the disk, and says which file is gone.
    fn cut(&mut self, to_sync: &SyncSender<Written>, wall_ns: u64) -> Result<(), StoreError> {
        self.store.cut(wall_ns)?;
        self.store.hand_out(|written| match to_sync.try_send(written) {
            // The disk is busy with those before.
            Err(TrySendError::Full(written)) => Err(written),
            Ok(()) | Err(TrySendError::Disconnected(_)) => Ok(()),
        });
        let given = self.store.given();
        let new = given - std::mem::replace(&mut self.told_given, given);
        if new > 0 {
            let files = match new {
                1 => "the oldest file of the recording was".to_string(),
                _ => format!("the {new} oldest files of the recording were"),
            };
            self.say(
                Priority::Warning,
                &format!("the disk is full: {files} removed to make room"),
                wall_ns,
            )?;
        }
        let Some(gone) = self.store.gone().get(self.told_gone) else {
            return Ok(());
        };
        self.told_gone += 1;
        let text = format!("{gone}; the recording goes on in another file");
        self.say(Priority::Warning, &text, wall_ns)
    }

    /// Says something about the recording, there and to people.
    fn say(&mut self, priority: Priority, text: &str, wall_ns: u64) -> Result<(), StoreError> {
        (self.shared.signals.say)(priority, text);
        self.store.note(Entry {
            topic: Topic::Events,
            wall_ns,
            data: event_message("recorder", text, self.shared.stamp_ns(wall_ns)),
        })
    }

    fn trigger(&mut self, wall_ns: u64, why: &str) -> Result<(), LiveError> {
        let say = self.shared.signals.say;
        let has_begun = self.store.trigger(wall_ns)?;
        if let Some(file) = self.store.files().last().filter(|_| has_begun) {
            say(Priority::Info, &format!("{}: {why}", file.display()));
        } else if !self.store.is_writing() {
            let nothing = format!("{why}: nothing came before it that could be kept");
            say(Priority::Warning, &nothing);
        }
        Ok(())
    }
}
