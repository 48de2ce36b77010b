//! Motors that somebody wants off once more, though they were told so and to do nothing since.
//!
//! What has a motor switched off goes before all else. Asked for again and again, as by a program that has it in its loop, it
//! would be all that is on the bus: no angle would be read, and no other motor told anything. So that, and that alone, is told
//! in rounds: each motor once, however often it was asked for, all in one packet, and between two rounds is time for the rest.
//! Nobody who was told that a motor may not be off waits for such a round: what was in vain is told again by itself.

use super::Bus;
use crate::dynamixel::bus::writes::WriteError;

/// Between two rounds lies so many times as long as one took, and no longer than this.
const SHARE: u64 = 3;
const LONGEST_PAUSE_NS: u64 = 500_000_000;

/// When there is one.
#[derive(Debug, Default)]
pub(super) struct Repeats {
    /// Since when there is one; `None` where there is none.
    since_ns: Option<u64>,
    /// When there may be the next.
    due_ns: u64,
}

impl Bus {
    /// Whether a motor is to be told once more. One that is about to be started is told by that, which begins with it.
    fn is_to_repeat(&self, servo: usize) -> bool {
        self.servos[servo].is_asked_off_again && !self.is_being_started(servo)
    }

    /// Whether a round is to begin.
    pub(super) fn is_repeat_due(&self, now_ns: u64) -> bool {
        self.repeats.since_ns.is_none()
            && now_ns >= self.repeats.due_ns
            && (0..self.servos.len()).any(|servo| self.is_to_repeat(servo))
    }

    pub(super) fn has_urgent(&self) -> bool {
        self.writes.front().is_some_and(|write| write.urgent)
    }

    /// Begins a round, where it is due and nothing else is urgent.
    pub(super) fn repeat_offs(&mut self, now_ns: u64) {
        if self.has_urgent() || !self.is_repeat_due(now_ns) {
            return;
        }
        self.repeats.since_ns = Some(now_ns);
        for servo in 0..self.servos.len() {
            if self.is_to_repeat(servo) {
                self.insert_first_off(servo, 0);
            }
        }
    }

    /// Ends a round, once all of it was told and answered.
    pub(super) fn end_repeats(&mut self, now_ns: u64) {
        if !self.has_urgent()
            && let Some(since_ns) = self.repeats.since_ns.take()
        {
            let took_ns = now_ns.saturating_sub(since_ns);
            self.repeats.due_ns = now_ns + LONGEST_PAUSE_NS.min(SHARE * took_ns);
        }
    }

    /// The port is lost: who was to be told once more is told so when it is back.
    pub(super) fn forget_repeats(&mut self) {
        self.repeats = Repeats::default();
        for servo in 0..self.servos.len() {
            if std::mem::take(&mut self.servos[servo].is_asked_off_again) {
                let number = self.servos[servo].state.motor_off.newest;
                self.servos[servo].owe_off();
                self.note(servo, number, Err(WriteError::PortLost));
            }
        }
    }
}
