//! Which reader reads which file.

use crate::error::RecordError;
use crate::recording::Recording;
use crate::table::{ReadOptions, Void};
use crate::{csv, npy, npz};
use std::path::Path;

impl Recording {
    /// Reads the recording of a `.npy`, `.npz` or `.csv` file.
    ///
    /// # Errors
    /// Any [`RecordError`]; CAN traffic, such as a candump `.log`, is no sequence of frames and is refused.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, RecordError> {
        if let Some(rate_hz) = options.rate_hz
            && !(0.001..=100_000.0).contains(&rate_hz)
        {
            return Err(RecordError::Rate { rate_hz });
        }
        let refused = |reason: String| Err(RecordError::unreadable(path.display(), reason));
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        let table = match extension.to_ascii_lowercase().as_str() {
            "npy" | "csv" if options.array.is_some() => {
                return refused("--array picks one array of an .npz; this file has no named arrays".into());
            }
            "npy" | "csv" if matches!(options.void, Some(Void::Mask(_))) => {
                return refused("--void NAME is an array of an .npz; here it can be nan".into());
            }
            "npy" => npy::read(path, options)?,
            "npz" => npz::read(path, options)?,
            "csv" => csv::read(path, options)?,
            "log" => {
                return refused(
                    "a candump .log holds CAN traffic, not tactile frames; read it through a CAN source, log:FILE"
                        .into(),
                );
            }
            "mcap" => {
                return refused(
                    "MCAP recordings cannot be read by this version; export the CAN traffic as a candump .log, or \
                     the frames as .npz"
                        .into(),
                );
            }
            other => {
                let found = match other {
                    "" => "nothing".into(),
                    other => format!(".{other}"),
                };
                return refused(format!(
                    "a recording ends in .npy, .npz or .csv (tactile frames), .log (candump) or .mcap (`taxel record`), not {found}"
                ));
            }
        };
        Self::from_table(table, options)
    }
}
