//! A file's numbers before it is decided what they mean, and what a caller says of them.

use std::ops::RangeInclusive;
use std::str::FromStr;

/// The rate assumed where a file records no times and none is given, hertz: the uSkin recordings' own.
pub const DEFAULT_RATE_HZ: f64 = 30.0;
/// Rates that frames may have, hertz.
pub const RATES_HZ: RangeInclusive<f64> = 0.001..=100_000.0;

/// What a file's columns mean, and when its frames were taken, where the file does not say.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReadOptions {
    /// The array of an npz to read; needed when it holds several.
    pub array: Option<String>,
    /// Says that the columns of a two-dimensional array are raw counts, and in which order.
    pub columns: Option<Columns>,
    /// Frames per second, one of [`RATES_HZ`], overriding recorded times; [`DEFAULT_RATE_HZ`] where
    /// neither exists.
    pub rate_hz: Option<f64>,
    /// Says that frames are images of this height and width, so that `T x H x 3` is magnitudes too.
    pub image: Option<(usize, usize)>,
    /// Which cells of the frames are no taxels.
    pub void: Option<Void>,
    /// Says that a csv file's column of that name, or else its first, is time, in this unit.
    pub time_column: Option<TimeUnit>,
    /// How many of the last columns of a csv file whose header does not name them are joint angles, radians.
    pub joint_columns: usize,
    /// Says that no taxel is touched in so many of the first frames: its magnitudes are above their median.
    pub idle_frames: Option<usize>,
}

/// The order of x, y and z counts in the columns of a two-dimensional array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Columns {
    /// `x1, y1, z1, x2, y2, z2, ...`
    XyzInterleaved,
    /// `x1, x2, ..., y1, y2, ..., z1, z2, ...`
    XyzBlocks,
}

/// Which cells of the frames are no taxels, as where a skin has holes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Void {
    /// Those that are not a number in any frame. One that is not a number in some frames is missing there.
    Nan,
    /// Those that are not zero in this array of the npz, which has a frame's shape.
    Mask(String),
}

/// The unit of a time column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeUnit {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

/// What the columns of a file are called; none where it has no names.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct ColumnNames {
    /// Those that are values, in the order of a frame's.
    pub(crate) values: Vec<String>,
    /// How they stood, in words, where they were put in the order of their numbers.
    pub(crate) order_before: Option<&'static str>,
    /// What is to be said of numbers in them that are rows and columns of a grid.
    pub(crate) of_grid: Option<String>,
    /// Those that are neither values, joint angles nor the time of a frame.
    pub(crate) left_out: Vec<String>,
    /// The comment that they stand in, where no line of their own has them.
    pub(crate) comment: Option<String>,
    /// The line of the first frame, where that is 0, 1, 2, ..., as pandas names columns.
    pub(crate) may_be_line: Option<u64>,
    /// Empty cells at the end of the first line, where there may be one more of them, and one more column; else 0.
    pub(crate) empty_at_end: usize,
}

/// A file's numbers before it is decided what they mean: row-major, with the file's own shape.
pub(crate) struct Table {
    pub(crate) at: String,
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f64>,
    pub(crate) times_ns: Option<Vec<u64>>,
    /// Joint angles, as many of each frame, radians.
    pub(crate) joints: Option<Vec<f32>>,
    /// What the file itself says of its columns.
    pub(crate) columns: Option<Columns>,
    /// The name of the time column, where it says no unit.
    pub(crate) unitless_time: Option<String>,
    /// What its columns are called.
    pub(crate) names: ColumnNames,
    /// Which cells of a frame are no taxels, where the file says so.
    pub(crate) void: Option<Vec<bool>>,
    /// Which cells of every frame have no value, where the file says so besides.
    pub(crate) without_value: Option<Vec<bool>>,
    /// Whether its numbers stood in floats of 16 bits.
    pub(crate) is_half: bool,
}

impl FromStr for Columns {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "xyz-interleaved" => Ok(Columns::XyzInterleaved),
            "xyz-blocks" => Ok(Columns::XyzBlocks),
            _ => Err(format!(
                "{text:?} is no column order; use xyz-interleaved or xyz-blocks"
            )),
        }
    }
}

impl FromStr for Void {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "" => Err("name an array, or say nan".into()),
            "nan" => Ok(Void::Nan),
            name => Ok(Void::Mask(name.into())),
        }
    }
}

impl FromStr for TimeUnit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "s" => Ok(TimeUnit::S),
            "ms" => Ok(TimeUnit::Ms),
            "us" => Ok(TimeUnit::Us),
            "ns" => Ok(TimeUnit::Ns),
            _ => Err(format!("{text:?} is no unit of time; use s, ms, us or ns")),
        }
    }
}

impl TimeUnit {
    /// As an option names it.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            TimeUnit::S => "s",
            TimeUnit::Ms => "ms",
            TimeUnit::Us => "us",
            TimeUnit::Ns => "ns",
        }
    }

    /// Decimals of one unit down to a nanosecond.
    pub(crate) fn decimals(self) -> i32 {
        match self {
            TimeUnit::S => 9,
            TimeUnit::Ms => 6,
            TimeUnit::Us => 3,
            TimeUnit::Ns => 0,
        }
    }
}
