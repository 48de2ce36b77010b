//! Tactile frames as `.csv`: one reading of the whole hand a line, and the joint angles of the same instant.

use crate::error::RecordError;
use crate::recording::TaxelCounts;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use taxel_hand::{Freshness, TactileFrame};

/// A csv file of tactile frames, written frame by frame: `t_ns`, then x, y and z of each taxel as
/// `{module}B{taxel}X`, `..Y`, `..Z`, then the joint angles as `J0`, `J1`, .., radians. [`crate::Recording`] reads it.
#[derive(Debug)]
pub struct FrameTable {
    path: PathBuf,
    file: BufWriter<File>,
    taxels: Vec<(u16, u16)>,
    /// Of every frame as many as of the first.
    joints: Option<usize>,
}

impl FrameTable {
    /// Creates the file for frames of these taxels: module, and the taxel's own number there, ascending.
    pub fn create(path: &Path, taxels: impl IntoIterator<Item = (u16, u16)>) -> Result<Self, RecordError> {
        let file = File::create(path).map_err(RecordError::io(path))?;
        Ok(Self {
            path: path.into(),
            file: BufWriter::new(file),
            taxels: taxels.into_iter().collect(),
            joints: None,
        })
    }

    /// Writes a frame. Of a taxel without a value of its time, which is one that is not [`Freshness::Fresh`], the three cells
    /// are empty: a chip that does not answer reads 0, 0, 0. A joint angle that is not known is `NaN`.
    pub fn push(&mut self, frame: &TactileFrame) -> Result<(), RecordError> {
        self.write(frame).map_err(RecordError::io(&self.path))
    }

    fn write(&mut self, frame: &TactileFrame) -> io::Result<()> {
        let Self {
            file, taxels, joints, ..
        } = self;
        let count = match *joints {
            Some(count) => count,
            None => {
                write!(file, "t_ns")?;
                for (module, taxel) in taxels.iter() {
                    write!(file, ",{module}B{taxel}X,{module}B{taxel}Y,{module}B{taxel}Z")?;
                }
                for joint in 0..frame.joints.len() {
                    write!(file, ",J{joint}")?;
                }
                writeln!(file)?;
                *joints.insert(frame.joints.len())
            }
        };
        let mut digits = itoa::Buffer::new();
        file.write_all(digits.format(frame.t_ns).as_bytes())?;
        for counts in counts_of(frame).take(taxels.len()) {
            let Some(counts) = counts else {
                file.write_all(b",,,")?;
                continue;
            };
            for count in counts {
                file.write_all(b",")?;
                file.write_all(digits.format(count).as_bytes())?;
            }
        }
        for joint in 0..count {
            write!(file, ",{}", frame.joints.get(joint).copied().unwrap_or(f32::NAN))?;
        }
        writeln!(file)
    }

    /// Writes what is left.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.file.flush().map_err(RecordError::io(&self.path))
    }
}

/// What each taxel of a frame measured at its time.
pub(crate) fn counts_of(frame: &TactileFrame) -> impl Iterator<Item = TaxelCounts> {
    let taxels = frame.counts.iter().zip(&frame.freshness);
    taxels.map(|(counts, freshness)| Some(*counts).filter(|_| *freshness == Freshness::Fresh))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadOptions, Recording};
    use tempfile::TempDir;

    #[test]
    fn frames_read_back_as_they_were_with_their_times_and_joints() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("frames.csv");
        let mut table = FrameTable::create(&path, [(0, 3), (12, 0)]).unwrap();
        let frame = |t_ns: u64, first: u16| TactileFrame {
            t_ns,
            counts: vec![[first, 2, 65_535], [4, 5, 6]],
            freshness: vec![Freshness::Fresh; 2],
            joints: vec![0.1, f32::NAN, -1.5],
            ..TactileFrame::default()
        };
        table.push(&frame(5, 1)).unwrap();
        table.push(&frame(1_700_000_000_123_456_789, 7)).unwrap();
        for without_value in [Freshness::Missing, Freshness::Stale] {
            let mut frame = frame(1_700_000_000_123_456_790, 0);
            frame.freshness[1] = without_value;
            table.push(&frame).unwrap();
        }
        let mut silent = frame(1_700_000_000_123_456_791, 0);
        silent.freshness.fill(Freshness::Stale);
        table.push(&silent).unwrap();
        table.finish().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().nth(1), Some("5,1,2,65535,4,5,6,0.1,NaN,-1.5"));
        let read = Recording::open(&path, &ReadOptions::default()).unwrap();
        assert_eq!(read.counts(1).unwrap(), [[7, 2, 65_535], [4, 5, 6]].map(Some));
        for index in [2, 3] {
            let cells = text.lines().nth(1 + index).unwrap();
            assert_eq!(cells, "1700000000123456790,0,2,65535,,,,0.1,NaN,-1.5");
            assert_eq!(read.counts(index).unwrap(), [Some([0, 2, 65_535]), None]);
        }
        assert_eq!(
            text.lines().last(),
            Some("1700000000123456791,,,,,,,0.1,NaN,-1.5")
        );
        assert_eq!(read.counts(4).unwrap(), [None, None]);
        assert_eq!((read.len(), read.missing()), (5, 4));
        assert_eq!((read.t_ns(0), read.t_ns(1)), (5, 1_700_000_000_123_456_789));
        let joints = read.joints(1);
        assert!(joints.len() == 3 && joints[0] == 0.1 && joints[1].is_nan() && joints[2] == -1.5);
    }
}
