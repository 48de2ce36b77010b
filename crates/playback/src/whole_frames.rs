//! Recorded counts as tactile frames that are whole already.

use crate::fitted::recorded_taxels;
use taxel_hand::{Freshness, TactileFrame};
use taxel_record::Recording;
use taxel_skin::Layout;

/// The frames of a recording of a skin that has no buses, one after the other.
pub(crate) struct WholeFrames<'a> {
    recording: &'a Recording,
    /// For each taxel its number in the recording.
    recorded: Vec<usize>,
    next: usize,
}

impl<'a> WholeFrames<'a> {
    /// Refuses a recording that does not fit the skin; with `tile`, it is repeated on every module.
    pub(crate) fn new(recording: &'a Recording, layout: &Layout, tile: bool) -> anyhow::Result<Self> {
        Ok(Self {
            recording,
            recorded: recorded_taxels(recording, layout, tile)?,
            next: 0,
        })
    }

    /// Makes the next frame, at its recorded time; false at the end. A frame that has the time of the one before is passed
    /// over, as a board sends nothing twice at once.
    pub(crate) fn fill(&mut self, frame: &mut TactileFrame) -> bool {
        let recording = self.recording;
        while self.next > 0
            && self.next < recording.len()
            && recording.t_ns(self.next) == recording.t_ns(self.next - 1)
        {
            self.next += 1;
        }
        let Some(counts) = recording.counts(self.next) else {
            return false;
        };
        frame.t_ns = recording.t_ns(self.next);
        for (taxel, recorded) in self.recorded.iter().enumerate() {
            (frame.counts[taxel], frame.freshness[taxel], frame.age_ns[taxel]) = match counts[*recorded] {
                Some(counts) => (counts, Freshness::Fresh, 0),
                None => ([0; 3], Freshness::Missing, u64::MAX),
            };
        }
        let joints = recording.joints(self.next);
        frame.joints.clear();
        frame.joints.extend_from_slice(joints);
        frame.joint_age_ns.clear();
        frame.joint_age_ns.resize(joints.len(), 0);
        self.next += 1;
        true
    }
}
