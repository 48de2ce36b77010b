//! Arrays in numpy's files, `.npy` and `.npz`: read and written.

pub(crate) mod npy;
pub(crate) mod npy_header;
pub(crate) mod npz;
pub(crate) mod npz_writer;
pub(crate) mod number;
pub(crate) mod number_array;
pub(crate) mod spool;
