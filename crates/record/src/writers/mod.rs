//! Tactile frames and images, written to files.

pub(crate) mod frame_arrays;
#[cfg(feature = "parquet")]
pub(crate) mod frame_columns;
pub(crate) mod frames;
pub(crate) mod images;
