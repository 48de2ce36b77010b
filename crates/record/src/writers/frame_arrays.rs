//! Tactile frames as `.npz`: arrays of counts, times and joint angles.

use super::frames::counts_of;
use crate::error::RecordError;
use crate::numpy::npy::MAX_NUMBERS;
use crate::numpy::npz::WITHOUT_VALUE;
use crate::numpy::npz_writer::NpzWriter;
use crate::numpy::spool::Column;
use std::io;
use std::path::{Path, PathBuf};
use taxel_hand::TactileFrame;

/// Tactile frames of one hand, collected to be written together. They are put aside on the disk, beside the file.
#[derive(Debug)]
pub struct FrameArrays {
    path: PathBuf,
    /// Height and width, where frames are images.
    image: Option<[usize; 2]>,
    /// x, y and z of each taxel, 0 where there is no value.
    counts: Column<u16>,
    without_value: Column<bool>,
    any_without_value: bool,
    t_ns: Column<u64>,
    joints: Column<f32>,
}

impl FrameArrays {
    /// None yet, for this file, of frames that are lists, or images of this height and width, their taxels row by row.
    pub fn new(path: &Path, image: Option<[usize; 2]>) -> Self {
        Self {
            path: path.into(),
            image,
            counts: Column::beside(path),
            without_value: Column::beside(path),
            any_without_value: false,
            t_ns: Column::beside(path),
            joints: Column::beside(path),
        }
    }

    /// Adds a frame: its time, counts and joint angles.
    ///
    /// # Errors
    /// Where the disk does not take it.
    ///
    /// # Panics
    /// When it has another number of taxels or joints than the first.
    pub fn push(&mut self, frame: &TactileFrame) -> Result<(), RecordError> {
        self.put(frame).map_err(RecordError::io(&self.path))?;
        let frames = self.len();
        assert!(
            self.counts.len().is_multiple_of(frames) && self.joints.len().is_multiple_of(frames),
            "a frame of another size"
        );
        Ok(())
    }

    fn put(&mut self, frame: &TactileFrame) -> io::Result<()> {
        for counts in counts_of(frame) {
            self.any_without_value |= counts.is_none();
            self.without_value.extend([counts.is_none()])?;
            self.counts.extend(counts.unwrap_or_default())?;
        }
        self.t_ns.extend([frame.t_ns])?;
        self.joints.extend(frame.joints.iter().copied())
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.t_ns.len()
    }

    /// Whether [`crate::Recording`] reads as many.
    pub fn are_read(&self) -> bool {
        self.counts.len() <= MAX_NUMBERS
    }

    /// Whether there is none yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Writes a `.npz`: `counts` `T x N x 3` u16, of images `T x H x W x 3`, `t_ns` u64; where any taxel has no value of the
    /// time of a frame, `without_value` `T x N` bool, true there; and, where there are joints, `joints` `T x J` f32, radians, not a number where unknown.
    /// [`crate::Recording`] reads it. There is none left then.
    pub fn write_npz(&mut self) -> Result<(), RecordError> {
        let frames = self.len();
        let each = |len: usize| len / frames.max(1);
        let mut npz = NpzWriter::plain(&self.path);
        let taxels = each(self.without_value.len());
        let of_images = self.image.map(|[height, width]| [frames, height, width, 3]);
        let of_lists = [frames, taxels, 3];
        let shape = of_images.as_ref().map_or(&of_lists[..], |shape| &shape[..]);
        npz.add_column("counts", shape, &mut self.counts)?;
        if self.any_without_value {
            npz.add_column(WITHOUT_VALUE, &[frames, taxels], &mut self.without_value)?;
        }
        npz.add_column("t_ns", &[frames], &mut self.t_ns)?;
        if self.joints.len() > 0 {
            let shape = [frames, each(self.joints.len())];
            npz.add_column("joints", &shape, &mut self.joints)?;
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
        let first = frame(5, [[1, 2, 3], [4, 5, 65_535]], [0.5, f32::NAN]);
        let mut second = frame(1_700_000_000_123_456_789, [[7, 8, 9], [0, 0, 0]], [-1.5, 2.0]);
        for (freshness, counts) in [(Freshness::Fresh, Some([0; 3])), (Freshness::Missing, None)] {
            second.freshness[1] = freshness;
            let mut frames = FrameArrays::new(&path, None);
            frames.push(&first).unwrap();
            frames.push(&second).unwrap();
            frames.write_npz().unwrap();
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
