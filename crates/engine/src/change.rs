//! What happened to a daemon's conditioning while it was recorded.

use std::collections::VecDeque;
use taxel_can::Received;
use taxel_skin::{Calibrated, Conditioner};

/// What happened to a daemon's conditioning from one frame to the next.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// A calibration began.
    Calibrating,
    /// One had ended, with this.
    Calibrated(Calibrated),
    /// No contact was shown from here on (true), or contacts were shown again.
    Paused(bool),
}

/// What a recording holds for an engine, in the order of its times.
#[derive(Debug)]
pub enum Recorded {
    /// A frame, and the number of its bus.
    Frame(u8, Received),
    /// From the first tick on that feels what came at this time or later, nanoseconds, the hand is felt as it was after this
    /// change. It comes before the frames of that time.
    Change(u64, Box<Change>),
}

impl From<(u8, Received)> for Recorded {
    fn from((bus, received): (u8, Received)) -> Self {
        Self::Frame(bus, received)
    }
}

/// Changes that are still to come, in the order of their times.
#[derive(Debug, Default)]
pub(crate) struct Changes(VecDeque<(u64, Box<Change>)>);

impl Changes {
    pub(crate) fn push(&mut self, t_ns: u64, change: Box<Change>) {
        let place = self.0.partition_point(|(at_ns, _)| *at_ns <= t_ns);
        self.0.insert(place, (t_ns, change));
    }

    /// Makes those that have come before a frame of this time is felt.
    pub(crate) fn make(&mut self, t_ns: u64, conditioner: &mut Conditioner, paused: &mut bool) {
        while let Some((at_ns, change)) = self.0.front()
            && *at_ns <= t_ns
        {
            match &**change {
                Change::Calibrating => conditioner.rezero(),
                // Where the same was measured, it is known to more digits than were recorded.
                Change::Calibrated(known) if conditioner.has_measured(known) => {}
                Change::Calibrated(known) => conditioner.go_on_from(known),
                Change::Paused(is_paused) => *paused = *is_paused,
            }
            self.0.pop_front();
        }
    }
}
