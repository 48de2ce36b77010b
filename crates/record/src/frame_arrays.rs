//! Tactile frames as `.npz`: arrays of counts, times and joint angles.

use crate::error::RecordError;
use ndarray::{ArrayView1, ArrayView2, ArrayView3};
use ndarray_npy::{NpzWriter, WriteNpzError};
use std::io::{self, Cursor};
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
    pub fn push(
        &mut self,
        t_ns: u64,
        counts: impl IntoIterator<Item = [u16; 3]>,
        joints: impl IntoIterator<Item = f32>,
    ) {
        self.counts.extend(counts.into_iter().flatten());
        self.t_ns.push(t_ns);
        self.joints.extend(joints);
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
        // In memory first: a writer of zip files that meets a full disk says so on stderr by itself, unasked.
        let archive = || -> Result<Vec<u8>, WriteNpzError> {
            let mut npz = NpzWriter::new(Cursor::new(Vec::new()));
            let counts = ArrayView3::from_shape((frames, each(self.counts.len()) / 3, 3), &self.counts);
            npz.add_array("counts", &counts.expect("push keeps the shape"))?;
            npz.add_array("t_ns", &ArrayView1::from(&self.t_ns))?;
            if !self.joints.is_empty() {
                let joints = ArrayView2::from_shape((frames, each(self.joints.len())), &self.joints);
                npz.add_array("joints", &joints.expect("push keeps the shape"))?;
            }
            Ok(npz.finish()?.into_inner())
        };
        let bytes = archive().map_err(io::Error::other);
        let written = bytes.and_then(|bytes| std::fs::write(path, bytes));
        written.map_err(RecordError::io(path))
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
        frames.push(5, [[1, 2, 3], [4, 5, 65_535]], [0.5, f32::NAN]);
        frames.push(1_700_000_000_123_456_789, [[7, 8, 9], [0, 0, 0]], [-1.5, 2.0]);
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
