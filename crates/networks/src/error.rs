//! Why a network cannot be trained or used.

use std::io;
use std::path::PathBuf;

/// Why a network cannot be trained or used.
#[derive(Debug, thiserror::Error)]
pub enum NetworksError {
    /// Something went wrong in a tensor operation.
    #[error("computing a network: {0}; its memory may be exhausted")]
    Tensor(#[from] candle_core::Error),
    /// A checkpoint that cannot be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A checkpoint that is damaged, or of another run.
    #[error("{path}: {what}")]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        what: String,
    },
    /// A checkpoint of a network that was trained on other examples.
    #[error(
        "{path}: was trained on other examples; name another folder, or delete this checkpoint to begin anew"
    )]
    OtherExamples {
        /// The file.
        path: PathBuf,
    },
    /// Squeezes that a network cannot be fed.
    #[error("{session}: {what}")]
    Session {
        /// The session's file or folder.
        session: String,
        /// What is wrong, and what to do.
        what: String,
    },
}
