//! Tactile frames as `.npz`: arrays of counts, times and joint angles.

use crate::error::RecordError;
use crate::frames::counts_of;
use crate::npz::WITHOUT_VALUE;
use crate::npz_writer::NpzWriter;
use crate::recording::TaxelCounts;
use std::path::Path;
use taxel_hand::TactileFrame;

/// Tactile frames of one hand, collected to be written together.
#[derive(Debug, Default, Clone)]
pub struct FrameArrays {
    /// Height and width, where frames are images.
    image: Option<[usize; 2]>,
    counts: Vec<TaxelCounts>,
    t_ns: Vec<u64>,
    joints: Vec<f32>,
}

impl FrameArrays {
    /// None yet, of frames that are images of this height and width, their taxels row by row. By default they are lists.
    pub fn of_images(height: usize, width: usize) -> Self {
        Self {
            image: Some([height, width]),
            ..Self::default()
        }
    }

    /// Adds a frame: its time, counts and joint angles.
    ///
    /// # Panics
    /// When it has another number of taxels or joints than the first.
    pub fn push(&mut self, frame: &TactileFrame) {
        self.counts.extend(counts_of(frame));
        self.t_ns.push(frame.t_ns);
        self.joints.extend_from_slice(&frame.joints);
        let frames = self.t_ns.len();
        assert!(
            self.counts.len().is_multiple_of(frames) && self.joints.len().is_multiple_of(frames),
            "a frame of another size"
        );
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.t_ns.len()
    }

    /// Whether there is none yet.
    pub fn is_empty(&self) -> bool {
        self.t_ns.is_empty()
    }

    /// Writes a `.npz`: `counts` `T x N x 3` u16, of images `T x H x W x 3`, `t_ns` u64; where any taxel has no value of the
    /// time of a frame, `without_value` `T x N` bool, true there; and, where there are joints, `joints` `T x J` f32, radians, not a number where unknown.
    /// [`crate::Recording`] reads it.
    pub fn write_npz(&self, path: &Path) -> Result<(), RecordError> {
        let frames = self.len();
        let each = |len: usize| len / frames.max(1);
        let mut npz = NpzWriter::plain(path);
        let taxels = each(self.counts.len());
        let of_images = self.image.map(|[height, width]| [frames, height, width, 3]);
        let of_lists = [frames, taxels, 3];
        let shape = of_images.as_ref().map_or(&of_lists[..], |shape| &shape[..]);
        let counts = self.counts.iter().flat_map(|counts| counts.unwrap_or_default());
        npz.add("counts", shape, counts)?;
        if self.counts.contains(&None) {
            let without = self.counts.iter().map(Option::is_none);
            npz.add(WITHOUT_VALUE, &[frames, taxels], without)?;
        }
        npz.add("t_ns", &[frames], self.t_ns.iter().copied())?;
        if !self.joints.is_empty() {
            let joints = self.joints.iter().copied();
            npz.add("joints", &[frames, each(self.joints.len())], joints)?;
        }
        npz.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadOptions, Recording};
    use taxel_hand::Freshness;

    #[test]
    fn frames_read_back_as_they_were_with_their_times_and_joints() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.npz");
        let frame = |t_ns, counts: [[u16; 3]; 2], joints: [f32; 2]| TactileFrame {
            t_ns,
            counts: counts.to_vec(),
            freshness: vec![Freshness::Fresh; 2],
            joints: joints.to_vec(),
            ..TactileFrame::default()
        };
        let mut frames = FrameArrays::default();
        frames.push(&frame(5, [[1, 2, 3], [4, 5, 65_535]], [0.5, f32::NAN]));
        let mut second = frame(1_700_000_000_123_456_789, [[7, 8, 9], [0, 0, 0]], [-1.5, 2.0]);
        for (freshness, counts) in [(Freshness::Fresh, Some([0; 3])), (Freshness::Missing, None)] {
            let mut frames = frames.clone();
            second.freshness[1] = freshness;
            frames.push(&second);
            frames.write_npz(&path).unwrap();
            let read = Recording::open(&path, &ReadOptions::default()).unwrap();
            assert_eq!(
                (read.len(), read.taxels(), read.t_ns(1)),
                (2, 2, 1_700_000_000_123_456_789)
            );
            assert_eq!(read.counts(0).unwrap(), [[1, 2, 3], [4, 5, 65_535]].map(Some));
            assert_eq!(read.counts(1).unwrap(), [Some([7, 8, 9]), counts]);
            assert!(read.joints(0)[0] == 0.5 && read.joints(0)[1].is_nan());
            assert_eq!(read.joints(1), [-1.5, 2.0]);
        }
    }
}
