//! An Allegro hand that no other program controls, and that therefore has to be started.

use taxel_can::{CanFrame, CanSource, LinkState};
use taxel_joints::{AllegroConfig, start_commands, stop_commands};

/// A hand that says nothing for so long is started again, nanoseconds.
const SILENCE_NS: u64 = 1_000_000_000;

/// Starts and stops a hand; does nothing, ever, unless the configuration says `own_bus = true`.
pub(crate) struct OwnHand {
    /// Number of its bus.
    bus: usize,
    start: Vec<CanFrame>,
    stop: Vec<CanFrame>,
    /// Commands of `start` that were handed to the bus.
    sent: usize,
    again_ns: u64,
}

impl OwnHand {
    pub(crate) fn new(bus: u8, config: &AllegroConfig) -> Self {
        Self {
            bus: bus.into(),
            start: start_commands(config),
            stop: stop_commands(config),
            sent: 0,
            again_ns: 0,
        }
    }

    /// Sends what is due. A full queue is tried again at the next round.
    pub(crate) fn poll(&mut self, now_ns: u64, heard_ns: Option<u64>, sources: &mut [Box<dyn CanSource>]) {
        if self.start.is_empty() {
            return;
        }
        let Some(source) = sources.get_mut(self.bus) else {
            return;
        };
        if source.link() != LinkState::Up {
            self.sent = 0;
            self.again_ns = 0;
            return;
        }
        let speaks = heard_ns.is_some_and(|heard| now_ns.saturating_sub(heard) < SILENCE_NS);
        if self.sent == self.start.len() && !speaks && now_ns >= self.again_ns {
            self.sent = 0;
        }
        while let Some(frame) = self.start.get(self.sent) {
            if source.send(frame).is_err() {
                return;
            }
            self.sent += 1;
            self.again_ns = now_ns + SILENCE_NS;
        }
    }

    /// Switches the hand off.
    pub(crate) fn stop(&mut self, sources: &mut [Box<dyn CanSource>]) {
        if let Some(source) = sources.get_mut(self.bus) {
            for frame in &self.stop {
                let _ = source.send(frame);
            }
        }
    }
}
