//! What one tick felt.

use taxel_hand::{ForceFrame, TactileFrame};
use taxel_skin::{Conditioner, Movement};

/// What one tick felt. The buffers are used again at the next tick.
#[derive(Debug, Clone)]
pub struct Frames {
    /// The instant the tick was due: the timer tick, the frame that completed the sweep or began
    /// the one after it, or its deadline. Nanoseconds.
    pub due_ns: u64,
    /// Raw counts with their ages, and the joint angles of the same instant.
    pub tactile: TactileFrame,
    /// Force above baseline, contacts and faults. Without contacts while the engine is paused.
    pub force: ForceFrame,
    /// Baseline of each taxel, counts x, y, z; not a number where it has none. It means nothing while
    /// [`ForceFrame::calibrating`].
    pub baseline: Vec<[f32; 3]>,
    /// Calibrations that had ended before the frame; its threshold is that of the last of them.
    pub calibrations: u64,
    /// What moved in the last of them ([`CalibrationReport::moved`](taxel_skin::CalibrationReport)).
    pub moved: Movement,
}

impl Frames {
    /// Empty frames of `taxels` taxels, with all their memory.
    pub fn new(taxels: usize) -> Self {
        Self {
            due_ns: 0,
            tactile: TactileFrame::new(taxels),
            force: ForceFrame::new(taxels),
            baseline: vec![[0.0; 3]; taxels],
            calibrations: 0,
            moved: Movement::None,
        }
    }

    /// What the skin feels of the tactile frame at hand, and above which baseline; no contact while `paused`.
    pub(crate) fn feel(&mut self, conditioner: &mut Conditioner, paused: bool) {
        self.calibrations = conditioner.counters().calibrations;
        self.moved = conditioner.report().map_or(Movement::None, |report| report.moved);
        conditioner.process(&self.tactile, &mut self.force);
        if paused {
            self.force.contact.fill(false);
        }
        for (taxel, (baseline, known)) in self.baseline.iter_mut().zip(conditioner.baseline()).enumerate() {
            *baseline = match conditioner.has_baseline(taxel) {
                true => known.map(|counts| counts as f32),
                false => [f32::NAN; 3],
            };
        }
    }

    /// Number of the tick, from 1.
    pub fn tick(&self) -> u64 {
        self.tactile.seq + 1
    }
}
