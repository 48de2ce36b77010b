//! Where a board's frames wait for the bus.

use std::collections::VecDeque;
use taxel_can::CanFrame;

/// Entries of an MTB3's transmit stack (`can_interface.h`, docs/protocols.md, "MTB3 firmware").
const STACK: usize = 20;

/// The frame in the controller, and those behind it.
#[derive(Debug)]
pub(super) struct Queue {
    /// What the CAN controller is sending or trying to send.
    register: Option<CanFrame>,
    waiting: VecDeque<CanFrame>,
    room: usize,
    /// Last in, first out, and emptied when it is full.
    stack: bool,
    overflows: u64,
}

impl Queue {
    /// The transmit stack of IIT's MTB3 firmware.
    pub(super) fn stack() -> Self {
        Self::new(STACK, true)
    }

    /// A queue that is sent in order; what finds it full is lost. How many frames boards other than
    /// the MTB3 keep, no source says.
    pub(super) fn ring(room: usize) -> Self {
        Self::new(room, false)
    }

    fn new(room: usize, stack: bool) -> Self {
        Self {
            register: None,
            waiting: VecDeque::with_capacity(room),
            room,
            stack,
            overflows: 0,
        }
    }

    /// Adds a frame. A full stack is emptied, the frame with it, and `notice` says so (docs/protocols.md,
    /// "MTB3 firmware").
    pub(super) fn push(&mut self, frame: CanFrame, notice: impl FnOnce() -> Option<CanFrame>) {
        if self.register.is_none() {
            self.register = Some(frame);
        } else if self.waiting.len() < self.room {
            self.waiting.push_back(frame);
        } else {
            self.overflows += 1;
            if self.stack {
                self.waiting.clear();
                self.waiting.extend(notice());
            }
        }
    }

    /// The frame in the controller.
    pub(super) fn front(&self) -> Option<CanFrame> {
        self.register
    }

    /// The frame in the controller is through.
    pub(super) fn sent(&mut self) {
        self.register = if self.stack {
            self.waiting.pop_back()
        } else {
            self.waiting.pop_front()
        };
    }

    /// Whether so many frames fit.
    pub(super) fn has_room(&self, frames: usize) -> bool {
        self.waiting.len() + frames <= self.room + usize::from(self.register.is_none())
    }

    pub(super) fn clear(&mut self) {
        self.register = None;
        self.waiting.clear();
    }

    /// How often it overflowed since the beginning.
    pub(super) fn overflows(&self) -> u64 {
        self.overflows
    }
}
