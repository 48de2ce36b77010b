//! Tactile frames as `.npz`: arrays of counts, times and joint angles.

use crate::error::RecordError;
use crate::npz_writer::NpzWriter;
use std::path::Path;

/// Tactile frames of one hand, collected to be written together.
#[derive(Debug, Default, Clone)]
pub struct FrameArrays {
    counts: Vec<u16>,
    t_ns: Vec<u64>,
    joints: Vec<f32>,
}

impl FrameArrays {
    /// Adds a frame: counts x, y, z of each taxel, and the joint angles, radians.
    ///
    /// # Panics
    /// When it has another number of taxels or joints than the first.
    pub fn push(&mut self, t_ns: u64, counts: &[[u16; 3]], joints: &[f32]) {
        self.counts.extend_from_slice(counts.as_flattened());
        self.t_ns.push(t_ns);
        self.joints.extend_from_slice(joints);
        let frames = self.t_ns.len();
        assert!(
            self.counts.len().is_multiple_of(3 * frames) && self.joints.len().is_multiple_of(frames),
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

    /// Writes a `.npz`: `counts` `T x N x 3` u16, `t_ns` u64, and, where there are joints, `joints` `T x J` f32, radians, not
    /// a number where unknown. [`crate::Recording`] reads it.
    pub fn write_npz(&self, path: &Path) -> Result<(), RecordError> {
        let frames = self.len();
        let each = |len: usize| len / frames.max(1);
        let mut npz = NpzWriter::plain(path);
        let counts = self.counts.iter().copied();
        npz.add("counts", &[frames, each(self.counts.len()) / 3, 3], counts)?;
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

    #[test]
    fn frames_read_back_as_they_were_with_their_times_and_joints() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.npz");
        let mut frames = FrameArrays::default();
        frames.push(5, &[[1, 2, 3], [4, 5, 65_535]], &[0.5, f32::NAN]);
        frames.push(1_700_000_000_123_456_789, &[[7, 8, 9], [0, 0, 0]], &[-1.5, 2.0]);
        frames.write_npz(&path).unwrap();
        let read = Recording::open(&path, &ReadOptions::default()).unwrap();
        assert_eq!(
            (read.len(), read.taxels(), read.t_ns(1)),
            (2, 2, 1_700_000_000_123_456_789)
        );
        assert_eq!(read.counts(0).unwrap(), [[1, 2, 3], [4, 5, 65_535]]);
        assert!(read.joints(0)[0] == 0.5 && read.joints(0)[1].is_nan());
        assert_eq!(read.joints(1), [-1.5, 2.0]);
    }
}
