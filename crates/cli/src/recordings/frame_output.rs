//! Where tactile frames go: a file, in the format its name tells.

use anyhow::bail;
use std::path::{Path, PathBuf};
use taxel_hand::{Freshness, TactileFrame};
use taxel_playback::recorded::tell_frames_before;
#[cfg(feature = "parquet")]
use taxel_record::FrameColumns;
use taxel_record::{FrameArrays, FrameTable, RecordError};
use taxel_skin::Layout;

/// What a file of frames looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FrameFormat {
    /// Arrays of counts, times and joint angles.
    Npz,
    /// A frame a line.
    Csv,
    /// A frame a row, by columns.
    Parquet,
}

impl FrameFormat {
    /// By what a name ends with, in small letters.
    pub(crate) fn of_ending(ending: &str) -> Option<Self> {
        match ending {
            "npz" => Some(Self::Npz),
            "csv" => Some(Self::Csv),
            "parquet" => Some(Self::Parquet),
            _ => None,
        }
    }

    /// Refuses what this build cannot write.
    pub(crate) fn check(self, out: &Path) -> anyhow::Result<()> {
        if self == Self::Parquet && !cfg!(feature = "parquet") {
            bail!(
                "{}: this taxel was built without Parquet, which its packages have; build it with \
                 `cargo build --release -p taxel-cli --features parquet`, or write a .csv, which \
                 `pandas.read_csv(..).to_parquet(..)` makes Parquet of",
                out.display()
            );
        }
        Ok(())
    }
}

/// A file of tactile frames, written frame by frame.
pub(crate) struct FrameOutput {
    path: PathBuf,
    format: FrameFormat,
    image: Option<(usize, usize)>,
    /// None before the first frame, which says how many joints there are.
    file: Option<FrameFile>,
    count: u64,
    /// Frames before the first in which a taxel has a value.
    before: u64,
}

enum FrameFile {
    Csv(FrameTable),
    Arrays(Box<FrameArrays>),
    #[cfg(feature = "parquet")]
    Parquet(Box<FrameColumns>),
}

impl FrameOutput {
    /// Nothing is written before the first frame. `image` is height and width of the frames, where they come from a file of
    /// images.
    pub(crate) fn create(path: &Path, format: FrameFormat, image: Option<(usize, usize)>) -> Self {
        Self {
            path: path.into(),
            format,
            image,
            file: None,
            count: 0,
            before: 0,
        }
    }

    /// Writes a frame of a hand. Frames before the first in which a taxel has a value are left out: nothing has begun.
    /// Those behind it are written all the same, so that times and joint angles have no hole.
    pub(crate) fn put(&mut self, layout: &Layout, frame: &TactileFrame) -> anyhow::Result<()> {
        if self.file.is_none() && !frame.freshness.contains(&Freshness::Fresh) {
            self.before += 1;
            return Ok(());
        }
        let file = match &mut self.file {
            Some(file) => file,
            None => {
                let image = self
                    .image
                    .filter(|(height, width)| height * width == layout.len());
                self.file
                    .insert(FrameFile::create(&self.path, self.format, layout, image)?)
            }
        };
        file.push(frame)?;
        self.count += 1;
        Ok(())
    }

    /// Writes what is left, and says how many frames were left out; returns how many frames there are, and how many of no
    /// value were before them.
    pub(crate) fn finish(self) -> anyhow::Result<[u64; 2]> {
        if let Some(file) = self.file {
            file.finish()?;
            tell_frames_before(&self.path.display().to_string(), self.before);
        }
        Ok([self.count, self.before])
    }
}

impl FrameFile {
    fn create(
        path: &Path,
        format: FrameFormat,
        layout: &Layout,
        image: Option<(usize, usize)>,
    ) -> Result<Self, RecordError> {
        let taxels = layout.taxels.iter().zip(&layout.k);
        let taxels = taxels.map(|(taxel, k)| (taxel.module, *k));
        match format {
            FrameFormat::Npz => {
                let image = image.map(|(height, width)| [height, width]);
                Ok(Self::Arrays(Box::new(FrameArrays::new(path, image))))
            }
            #[cfg(feature = "parquet")]
            FrameFormat::Parquet => Ok(Self::Parquet(Box::new(FrameColumns::create(path, taxels)))),
            _ => {
                if let Some((height, width)) = image {
                    remark!(
                        "taxel: {}: a .csv does not say that its frames are images; it is read with --layout \
                         grid:{height}x{width}",
                        path.display()
                    );
                }
                FrameTable::create(path, taxels).map(Self::Csv)
            }
        }
    }

    fn push(&mut self, frame: &TactileFrame) -> Result<(), RecordError> {
        match self {
            Self::Csv(table) => table.push(frame),
            Self::Arrays(arrays) => arrays.push(frame),
            #[cfg(feature = "parquet")]
            Self::Parquet(columns) => columns.push(frame),
        }
    }

    fn finish(self) -> Result<(), RecordError> {
        match self {
            Self::Csv(table) => table.finish(),
            Self::Arrays(mut arrays) => {
                if !arrays.are_read() {
                    remark!(
                        "taxel: the .npz has more numbers than taxel reads of one; numpy reads it, and taxel what it was \
                         made of, or a .log or .mcap"
                    );
                }
                arrays.write_npz()
            }
            #[cfg(feature = "parquet")]
            Self::Parquet(columns) => columns.finish(),
        }
    }
}
