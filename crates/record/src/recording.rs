//! A sequence of tactile frames, read from a file.

mod backwards;
mod from_table;

use crate::error::RecordError;
use crate::table::{ColumnNames, DEFAULT_RATE_HZ};
use backwards::refuse_backwards;

/// Raw counts x, y, z of a taxel; none where it had no value of that time.
pub type TaxelCounts = Option<[u16; 3]>;

/// The values of a recording, frame after frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Frames {
    /// One number per taxel, in the recording's own unit; finite, or not a number where the taxel is missing.
    Magnitudes(Vec<f64>),
    /// Raw counts per taxel.
    Counts(Vec<TaxelCounts>),
}

/// A sequence of tactile frames of equal size. Frames are numbered from 0, taxels `0..N` in the file's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    name: String,
    len: usize,
    taxels: usize,
    shape: Option<(usize, usize)>,
    /// Which cells of a frame are taxels, where not all of them are.
    cells: Option<Vec<bool>>,
    pub(crate) frames: Frames,
    times_ns: Option<Vec<u64>>,
    joints: Option<Vec<f32>>,
    rate_hz: f64,
    unitless_time: Option<String>,
    pub(crate) names: Box<ColumnNames>,
    counts_step: Option<u32>,
    layout: Option<Box<str>>,
}

impl Recording {
    /// A recording of raw counts x, y, z of `taxels` taxels per frame, with a time in nanoseconds and the joint angles of each,
    /// radians; `joints` is empty where there are none.
    ///
    /// # Errors
    /// Where there is no frame, where lengths do not fit together, or times run backwards.
    pub fn of_counts(
        name: String,
        taxels: usize,
        counts: Vec<TaxelCounts>,
        times_ns: Vec<u64>,
        joints: Vec<f32>,
    ) -> Result<Self, RecordError> {
        let len = times_ns.len();
        if len == 0 || taxels == 0 || counts.len() != len * taxels || !joints.len().is_multiple_of(len) {
            let reason = format!(
                "{} counts and {} angles for {len} frames of {taxels} taxels",
                counts.len(),
                joints.len()
            );
            return Err(RecordError::unreadable(name, reason));
        }
        refuse_backwards(&name, &times_ns)?;
        Ok(Self {
            name,
            len,
            taxels,
            shape: None,
            cells: None,
            frames: Frames::Counts(counts),
            times_ns: Some(times_ns),
            joints: Some(joints).filter(|joints| !joints.is_empty()),
            rate_hz: DEFAULT_RATE_HZ,
            unitless_time: None,
            names: Box::default(),
            counts_step: None,
            layout: None,
        })
    }

    /// Says which layout its hand has.
    pub fn with_layout(mut self, layout: &str) -> Self {
        self.layout = Some(layout.into());
        self
    }

    /// The layout of its hand, where it says which.
    pub fn layout(&self) -> Option<&str> {
        self.layout.as_deref()
    }

    /// The file, and the array where there is one, for messages: `FILE [ARRAY]`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of frames, `T`; at least one.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Always false: a recording has at least one frame.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Number of taxels, `N`; at least one.
    pub fn taxels(&self) -> usize {
        self.taxels
    }

    /// Height and width of the image, where the array was `T x H x W` or `T x H x W x 3`.
    pub fn image_shape(&self) -> Option<(usize, usize)> {
        self.shape
    }

    /// Which cells of a frame are taxels, in the file's order; `None` where all of them are.
    pub fn cells(&self) -> Option<&[bool]> {
        self.cells.as_deref()
    }

    /// All frames at once.
    pub fn frames(&self) -> &Frames {
        &self.frames
    }

    /// Whether the frames are raw counts.
    pub fn has_counts(&self) -> bool {
        matches!(self.frames, Frames::Counts(_))
    }

    /// Whether the file recorded the time of each frame; otherwise the rate makes it.
    pub fn has_times(&self) -> bool {
        self.times_ns.is_some()
    }

    /// The name of the column of times, where it says no unit and seconds were taken.
    pub fn unitless_time(&self) -> Option<&str> {
        self.unitless_time.as_deref()
    }

    /// The names of the columns that are values, in the order of a frame's; empty where the file names none.
    pub fn column_names(&self) -> &[String] {
        &self.names.values
    }

    /// How columns of magnitudes stood that were put in the order of the numbers in their names, `s1`, `s2`, `s10`: "in the
    /// order of their names as texts".
    pub fn column_order_before(&self) -> Option<&'static str> {
        self.names.order_before
    }

    /// The comment before the first frame that the names of the columns were taken from, without its `#`.
    pub fn names_comment(&self) -> Option<&str> {
        self.names.comment.as_deref()
    }

    /// Whether columns are named as XELA's server names them, which numbers the taxels of a module row by row.
    pub fn is_of_xela(&self) -> bool {
        self.column_names()
            .first()
            .is_some_and(|first| first.starts_with("txl"))
    }

    /// The names of the columns that are neither values, joint angles nor the time of a frame, and so left out.
    pub fn left_out_columns(&self) -> &[String] {
        &self.names.left_out
    }

    /// What is to be said of the names of its columns, whose numbers are rows and columns of the image.
    pub fn columns_of_grid(&self) -> Option<&str> {
        self.names.of_grid.as_deref()
    }

    /// The line of the first frame of a file without names, from 1, where that is 0, 1, 2, 3, ...: the names that pandas gives
    /// columns without one.
    pub fn names_line(&self) -> Option<u64> {
        self.names.may_be_line
    }

    /// What the greatest of its counts go in steps of, where they stood in numbers that cannot tell each from the next: floats
    /// of 16 bits, from 2048 on.
    pub fn counts_step(&self) -> Option<u32> {
        self.counts_step
    }

    /// Time of frame `index`, nanoseconds: as recorded, or `index` divided by the rate.
    ///
    /// # Panics
    /// When the recorded times have no such frame.
    pub fn t_ns(&self, index: usize) -> u64 {
        match &self.times_ns {
            Some(times) => times[index],
            None => (index as f64 * 1e9 / self.rate_hz).round() as u64,
        }
    }

    /// The joint angles of frame `index`, radians, not a number where unknown; empty where the file has none, and past the
    /// end.
    pub fn joints(&self, index: usize) -> &[f32] {
        let joints = self.joints.as_deref().unwrap_or_default();
        let each = joints.len() / self.len.max(1);
        joints.get(index * each..(index + 1) * each).unwrap_or_default()
    }

    /// How many values of a taxel at a time are not there.
    pub fn missing(&self) -> usize {
        match &self.frames {
            Frames::Magnitudes(values) => values.iter().filter(|value| value.is_nan()).count(),
            Frames::Counts(values) => values.iter().filter(|counts| counts.is_none()).count(),
        }
    }

    /// The usual time from one frame to the next, nanoseconds: the median of the recorded ones, or
    /// of the rate.
    pub fn period_ns(&self) -> u64 {
        let Some(times) = self.times_ns.as_ref().filter(|times| times.len() > 1) else {
            return (1e9 / self.rate_hz).round() as u64;
        };
        let mut periods: Vec<u64> = times.windows(2).map(|w| w[1] - w[0]).collect();
        periods.sort_unstable();
        periods[periods.len() / 2]
    }

    /// The magnitudes of frame `index`, one per taxel; `None` for a recording of counts or past the end.
    pub fn magnitudes(&self, index: usize) -> Option<&[f64]> {
        match &self.frames {
            Frames::Magnitudes(values) => values.chunks_exact(self.taxels).nth(index),
            Frames::Counts(_) => None,
        }
    }

    /// The counts of frame `index`, per taxel; `None` for a recording of magnitudes or past the end.
    pub fn counts(&self, index: usize) -> Option<&[TaxelCounts]> {
        match &self.frames {
            Frames::Counts(values) => values.chunks_exact(self.taxels).nth(index),
            Frames::Magnitudes(_) => None,
        }
    }
}

#[cfg(test)]
mod tests;
