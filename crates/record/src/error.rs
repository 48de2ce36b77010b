//! Why a recording cannot be read or written.

use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

/// Why a recording cannot be read or written. The message names the file, the array or line where
/// there is one, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be opened, read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Another format, a damaged file, an element type, value or time that a recording cannot have.
    #[error("{at}: {reason}")]
    Unreadable {
        /// File, and its line or array where there is one: `FILE`, `FILE:LINE` or `FILE [ARRAY]`.
        at: String,
        /// What is wrong and what to do.
        reason: String,
    },
    /// A magnitude that is infinite, or not a number where every cell of a frame is a taxel.
    #[error("{at}: frame {frame}, taxel {taxel} is {value}; a magnitude is a finite number")]
    NotFinite {
        /// File, and the array where there is one.
        at: String,
        /// The frame, from 0.
        frame: usize,
        /// The taxel, from 0.
        taxel: usize,
        /// What it is: infinite, or NaN.
        value: f64,
        /// Cells of a frame.
        cells: usize,
        /// How many of them are empty at the end of the first line of a .csv where there may be one more, since that ends
        /// with a separator; else 0.
        empty_at_end: usize,
    },
    /// A readable file that does not hold what was asked for: its arrays or their shape.
    #[error("{at} {holds}")]
    Unfit {
        /// File, and the array where there is one.
        at: String,
        /// What it holds, and what was expected.
        holds: String,
    },
    /// A rate that is not one.
    #[error("a rate of {rate_hz} Hz is outside 0.001..=100000 Hz")]
    Rate {
        /// The rate given.
        rate_hz: f64,
    },
}

impl RecordError {
    pub(crate) fn io(path: &Path) -> impl Fn(io::Error) -> Self + use<'_> {
        move |source| Self::Io {
            path: path.into(),
            source,
        }
    }

    pub(crate) fn unreadable(at: impl Display, reason: impl Into<String>) -> Self {
        let (at, reason) = (at.to_string(), reason.into());
        Self::Unreadable { at, reason }
    }

    pub(crate) fn unfit(at: impl Display, holds: impl Into<String>) -> Self {
        let (at, holds) = (at.to_string(), holds.into());
        Self::Unfit { at, holds }
    }

    pub(crate) fn shape(at: impl Display, shape: &[usize], expected: &str) -> Self {
        Self::unfit(
            at,
            format!("has shape {}; expected {expected}", show_shape(shape)),
        )
    }
}

/// The least that a recording holds.
pub(crate) const SOMETHING: &str = "at least one frame of at least one taxel";

/// A shape as people write it: `860 x 48`.
pub(crate) fn show_shape(shape: &[usize]) -> String {
    if shape.is_empty() {
        return "() (a single number)".into();
    }
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    sizes.join(" x ")
}
