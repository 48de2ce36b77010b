//! Why files of a recording cannot be made or written.

use std::io;
use std::path::PathBuf;

/// Why a recording stopped.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The file cannot be made.
    #[error("cannot create {path}: {source}{}", advice(.source))]
    Create {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file cannot be written; what it holds of the recording can be read.
    #[error(
        "{path}: {source}: the recording stopped there; its first {good} bytes are whole and can be read"
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said, such as that the disk is full.
        source: io::Error,
        /// Bytes of the file that can be read.
        good: u64,
    },
}

fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::AlreadyExists => "; a recording is not overwritten: remove it or give another name",
        _ => "",
    }
}
