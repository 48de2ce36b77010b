//! A sequence of tactile frames, read from a file.

mod backwards;

use crate::error::RecordError;
use crate::idle;
use crate::meaning::Meaning;
use crate::table::{ColumnNames, Columns, DEFAULT_RATE_HZ, ReadOptions, Table, Void};
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
    /// Gives numbers their meaning by their shape and the options.
    pub(crate) fn from_table(table: Table, options: &ReadOptions) -> Result<Self, RecordError> {
        let Table {
            at,
            shape,
            mut values,
            times_ns,
            joints,
            columns,
            void,
            without_value,
            unitless_time,
            names,
            is_half,
        } = table;
        let Meaning {
            taxels,
            image,
            counts,
        } = Meaning::of(&at, &shape, columns, options)?;
        let without_value = without_value.unwrap_or_default();
        let is_without = |cell: usize| without_value.get(cell) == Some(&true);
        let (frames, cells) = match counts {
            Some(_) if options.idle_frames.is_some() => {
                let holds = "holds counts, whose baseline is measured; --idle is for magnitudes";
                return Err(RecordError::unfit(at, holds));
            }
            Some(columns) => {
                let mut counts = counts_of_columns(&at, taxels, columns, shape.len() == 2, &values)?;
                for cell in (0..counts.len()).filter(|cell| is_without(*cell)) {
                    counts[cell] = None;
                }
                (Frames::Counts(counts), None)
            }
            None => {
                for cell in (0..values.len()).filter(|cell| is_without(*cell)) {
                    values[cell] = f64::NAN;
                }
                let void = match options.void {
                    Some(Void::Nan) => Some(never_a_number(taxels, &values)),
                    _ => void,
                };
                let (frames, cells) = without_void(&at, taxels, values, void)?;
                let may_be_missing = |cell| options.void == Some(Void::Nan) || is_without(cell);
                let mut frames = magnitudes(
                    &at,
                    cells.as_deref(),
                    taxels,
                    frames,
                    may_be_missing,
                    names.empty_at_end,
                )?;
                if let Some(idle) = options.idle_frames {
                    idle::subtract(&at, frames.len() / shape[0], idle, &mut frames)?;
                }
                (Frames::Magnitudes(frames), cells)
            }
        };
        let taxels = cells
            .as_ref()
            .map_or(taxels, |cells| cells.iter().filter(|cell| **cell).count());
        let counts_step = match &frames {
            Frames::Counts(counts) if is_half => half_step(counts),
            _ => None,
        };
        let len = shape[0];
        let times_ns = if options.rate_hz.is_some() { None } else { times_ns };
        if let Some(times) = &times_ns {
            if times.len() != len {
                let reason = format!(
                    "{} times for {len} frames; give --rate HZ to ignore them",
                    times.len()
                );
                return Err(RecordError::unreadable(at, reason));
            }
            refuse_backwards(&at, times)?;
        }
        let rate_hz = options.rate_hz.unwrap_or(DEFAULT_RATE_HZ);
        Ok(Self {
            name: at,
            len,
            taxels,
            shape: image,
            cells,
            frames,
            times_ns,
            joints,
            rate_hz,
            unitless_time: unitless_time.filter(|_| options.rate_hz.is_none()),
            names: Box::new(names),
            counts_step,
            layout: None,
        })
    }

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

/// The cells of a frame that are not a number in any frame.
fn never_a_number(cells: usize, values: &[f64]) -> Vec<bool> {
    let mut void = vec![true; cells];
    for frame in values.chunks_exact(cells) {
        for (void, value) in void.iter_mut().zip(frame) {
            *void &= value.is_nan();
        }
    }
    void
}

/// The values of the cells that are taxels, and which those are; `None` where all of them are.
fn without_void(
    at: &str,
    cells: usize,
    mut values: Vec<f64>,
    void: Option<Vec<bool>>,
) -> Result<(Vec<f64>, Option<Vec<bool>>), RecordError> {
    let Some(void) = void.filter(|void| void.contains(&true)) else {
        return Ok((values, None));
    };
    if !void.contains(&false) {
        return Err(RecordError::unfit(at, "has no taxel: every cell is void"));
    }
    let mut index = 0;
    values.retain(|_| {
        let is_taxel = !void[index % cells];
        index += 1;
        is_taxel
    });
    Ok((values, Some(void.into_iter().map(|void| !void).collect())))
}

/// Magnitudes of taxels: finite, or not a number where `may_be_missing` says so of a cell of the table. `cells` says which
/// cells of a frame they are.
fn magnitudes(
    at: &str,
    cells: Option<&[bool]>,
    all: usize,
    values: Vec<f64>,
    may_be_missing: impl Fn(usize) -> bool,
    empty_at_end: usize,
) -> Result<Vec<f64>, RecordError> {
    let taxels: Vec<usize> = match cells {
        Some(cells) => (0..all).filter(|cell| cells[*cell]).collect(),
        None => (0..all).collect(),
    };
    let place = |i: usize| (i / taxels.len(), taxels[i % taxels.len()]);
    let is_bad = |i: &usize| {
        let (frame, taxel) = place(*i);
        !(values[*i].is_finite() || values[*i].is_nan() && may_be_missing(frame * all + taxel))
    };
    let Some(i) = (0..values.len()).find(is_bad) else {
        return Ok(values);
    };
    let ((frame, taxel), value) = (place(i), values[i]);
    if value.is_nan() {
        return Err(RecordError::NotANumber {
            at: at.to_owned(),
            frame,
            taxel,
            cells: all,
            empty_at_end,
        });
    }
    let reason = format!(
        "frame {frame}, taxel {taxel} is {value}; a magnitude is a finite number. Where it stands for none, write NaN instead \
         (in a .csv an empty cell): with --void nan the taxel is then missing"
    );
    Err(RecordError::unreadable(at, reason))
}

/// The counts of frames that have three columns for each taxel, or with `is_flat` false are of that shape.
fn counts_of_columns(
    at: &str,
    taxels: usize,
    columns: Columns,
    is_flat: bool,
    values: &[f64],
) -> Result<Vec<TaxelCounts>, RecordError> {
    let mut counts = Vec::with_capacity(values.len() / 3);
    for (frame, row) in values.chunks_exact(taxels * 3).enumerate() {
        for taxel in 0..taxels {
            let places = [0, 1, 2].map(|axis| match columns {
                Columns::XyzInterleaved => taxel * 3 + axis,
                Columns::XyzBlocks => axis * taxels + taxel,
            });
            if places.iter().all(|column| row[*column].is_nan()) {
                counts.push(None);
                continue;
            }
            let mut xyz = [0; 3];
            for (count, column) in xyz.iter_mut().zip(places) {
                *count = count_of(row[column]).ok_or_else(|| {
                    let what = format!("frame {frame}, value {column} is {}", row[column]);
                    RecordError::unreadable(at, no_count(&what, taxels, is_flat, row[column], values))
                })?;
            }
            counts.push(Some(xyz));
        }
    }
    Ok(counts)
}

/// Why a value, which is `what`, cannot be a count: one of all these.
fn no_count(what: &str, taxels: usize, is_flat: bool, value: f64, values: &[f64]) -> String {
    let because = match value.is_nan() {
        true => "; a taxel without a value has none on all three axes",
        false => "",
    };
    let or_else = match is_flat {
        true => String::new(),
        false => format!("; magnitudes of {taxels} x 3 cells are told by --layout grid:{taxels}x3"),
    };
    let made = made_counts(values).map_or_else(String::new, |made| {
        format!(
            ". Of forces on three axes give the norms, numpy.linalg.norm(a, axis=-1); what is not 0 at rest, as magnetic \
             fields, as whole numbers, {made}"
        )
    });
    format!("{what}; a raw count is a whole number from 0 to 65535{because}{made}{or_else}")
}

/// What makes counts of these values, in Python; none where all are counts that are numbers at all.
fn made_counts(values: &[f64]) -> Option<String> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    if finite().all(|value| count_of(value).is_some()) {
        return None;
    }
    let least = finite().fold(0.0, f64::min);
    let greatest = finite().fold(0.0, f64::max);
    let are_signed = f64::from(i16::MIN) <= least && greatest <= f64::from(i16::MAX);
    if are_signed && finite().all(|value| value.fract() == 0.0) {
        // In doubles: it does not fit into the 16 bits that they may stand in.
        return Some("a.astype(float) + 32768".into());
    }
    let fits = |scale: f64| {
        count_of((30_000.0 + scale * least).floor()).is_some() && 30_000.0 + scale * greatest < 65_535.0
    };
    let decimals = (-1..=308).find(|decimals| fits(10f64.powi(-decimals)))?;
    let scaled = match decimals {
        -1 => "10 * a".into(),
        0 => "a".into(),
        _ => format!("1e-{decimals} * a"),
    };
    Some(format!("numpy.round({scaled}) + 30000"))
}

/// The step from the greatest of these counts to the one before in floats of 16 bits, whose fraction has 10 of them; none where
/// that is 1.
fn half_step(counts: &[TaxelCounts]) -> Option<u32> {
    let greatest = counts.iter().flatten().flatten().max()?;
    let beyond = greatest.checked_ilog2()?.checked_sub(10)?;
    (beyond > 0).then(|| 1 << beyond)
}

fn count_of(value: f64) -> Option<u16> {
    ((0.0..=65535.0).contains(&value) && value.fract() == 0.0).then_some(value as u16)
}

#[cfg(test)]
mod tests;
