//! Tactile recordings in and out.
//!
//! A [`Recording`] is a sequence of tactile frames read from `.npy`, `.npz` or `.csv`: either
//! magnitudes, one number per taxel, or raw counts, three per taxel; a taxel without a value at a time is not a number there,
//! and an empty cell of a `.csv`. What a file means is decided by its shape and by options, never guessed. A candump `.log` is not a sequence of frames but of
//! bus traffic: `taxel_can` reads it.
//!
//! [`Labelled`] is frames with the classes they are of; [`NumberArray`] any array, for files that are no recordings, and
//! [`NpzWriter`] writes such files.
//!
//! [`ImageStack`] collects tactile images and writes them as `.npy` or `.npz`, [`ImageTable`] as `.csv`; [`FrameTable`] writes tactile
//! frames, counts and joint angles, as `.csv`, [`FrameArrays`] as `.npz`, and `FrameColumns`, with the feature `parquet`, as
//! `.parquet`.

mod boards;
mod clock_name;
mod csv;
mod error;
mod idle;
mod kind;
mod labelled;
mod meaning;
mod numpy;
mod open;
mod packed;
mod recording;
mod table;
mod writers;

pub use error::RecordError;
pub use kind::{FileKind, ending_of};
pub use labelled::Labelled;
pub use numpy::npz_writer::{NpzWriter, write_npy};
pub use numpy::number::Number;
pub use numpy::number_array::NumberArray;
pub use packed::Packed;
pub use recording::{Frames, Recording, TaxelCounts};
pub use table::{Columns, DEFAULT_RATE_HZ, RATES_HZ, ReadOptions, TimeUnit, Void};
pub use writers::frame_arrays::FrameArrays;
#[cfg(feature = "parquet")]
pub use writers::frame_columns::FrameColumns;
pub use writers::frames::FrameTable;
pub use writers::images::{ImageStack, ImageTable};
