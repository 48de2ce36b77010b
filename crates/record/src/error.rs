//! Why a recording cannot be read or written.

use std::fmt;
use std::path::PathBuf;

/// Why a recording cannot be read or written. Each variant names the file, and the array where there is one.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be opened, read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The name does not end in anything known.
    #[error("{path}: a recording ends in .npy, .npz or .csv (tactile frames) or .log (candump), not {found}")]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// Its extension, as the message prints it.
        found: String,
    },
    /// MCAP is not read yet.
    #[error(
        "{path}: MCAP recordings cannot be read by this version; export the CAN traffic as a candump .log, \
         or the frames as .npz"
    )]
    Mcap {
        /// The file.
        path: PathBuf,
    },
    /// A candump log where tactile frames were expected.
    #[error(
        "{path}: a candump .log holds CAN traffic, not tactile frames; read it through a CAN source, log:FILE"
    )]
    BusTraffic {
        /// The file.
        path: PathBuf,
    },
    /// The npz has several arrays and none was named.
    #[error("{path} holds several arrays; name one with --array NAME:\n{arrays}")]
    WhichArray {
        /// The file.
        path: PathBuf,
        /// What it holds.
        arrays: ArrayList,
    },
    /// The npz has no array of that name.
    #[error("{path} has no array {name:?}; it holds:\n{arrays}")]
    NoSuchArray {
        /// The file.
        path: PathBuf,
        /// The name asked for.
        name: String,
        /// What it holds.
        arrays: ArrayList,
    },
    /// An array was named and the file holds no named arrays.
    #[error("{path}: --array picks one array of an .npz; this file has no named arrays")]
    NoNamedArrays {
        /// The file.
        path: PathBuf,
    },
    /// Not an npy array, or a damaged one.
    #[error("{at}: not a readable npy array: {reason}")]
    BadNpy {
        /// File and array.
        at: String,
        /// What is wrong.
        reason: String,
    },
    /// Not a readable zip archive.
    #[error("{path}: not a readable npz (zip) file: {reason}")]
    BadNpz {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// An element type that holds no magnitudes or counts.
    #[error("{at}: elements are {dtype}; a recording has u8, u16, i16, i32, u32, f32 or f64")]
    Dtype {
        /// File and array.
        at: String,
        /// The element type in numpy's notation.
        dtype: String,
    },
    /// A shape that is no recording.
    #[error("{at} has shape {}; expected {expected}", show_shape(shape))]
    Shape {
        /// File and array.
        at: String,
        /// The shape found.
        shape: Vec<usize>,
        /// The shapes that would do.
        expected: &'static str,
    },
    /// A value that is no raw count.
    #[error("{at}: frame {frame}, value {column} is {value}; a raw count is a whole number from 0 to 65535")]
    NotACount {
        /// File and array.
        at: String,
        /// Frame, from 0.
        frame: usize,
        /// Place in the frame, from 0.
        column: usize,
        /// The value.
        value: f64,
    },
    /// A magnitude that is not finite.
    #[error("{at}: frame {frame}, taxel {column} is {value}; a magnitude is a finite number")]
    NotFinite {
        /// File and array.
        at: String,
        /// Frame, from 0.
        frame: usize,
        /// Taxel, from 0.
        column: usize,
        /// The value.
        value: f64,
    },
    /// Times that run backwards.
    #[error("{at}: the time of frame {frame} is before that of the frame before it")]
    TimeBackwards {
        /// File and array.
        at: String,
        /// Frame, from 0.
        frame: usize,
    },
    /// A time that is negative or not finite, or a list of times of another length.
    #[error("{at}: {reason}")]
    BadTimes {
        /// File and array.
        at: String,
        /// What is wrong.
        reason: String,
    },
    /// A rate that is not one.
    #[error("a rate of {rate_hz} Hz is outside 0.001..=100000 Hz")]
    Rate {
        /// The rate given.
        rate_hz: f64,
    },
    /// A line of a csv file that cannot be read.
    #[error("{path}:{line}: {reason}")]
    CsvLine {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong and what to do.
        reason: String,
    },
}

/// The arrays of an npz file, one a line, as error messages list them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArrayList(pub Vec<(String, String)>);

impl fmt::Display for ArrayList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.0.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        for (i, (name, what)) in self.0.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "  {name:width$}  {what}")?;
        }
        Ok(())
    }
}

/// A shape as people write it: `860 x 48`.
pub(crate) fn show_shape(shape: &[usize]) -> String {
    if shape.is_empty() {
        return "() (a single number)".into();
    }
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    sizes.join(" x ")
}
