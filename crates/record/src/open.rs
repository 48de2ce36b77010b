//! Which reader reads which file.

use crate::csv;
use crate::error::RecordError;
use crate::kind::{FileKind, ending_of};
use crate::numpy::{npy, npz};
use crate::packed::Packed;
use crate::recording::Recording;
use crate::table::{RATES_HZ, ReadOptions, Void};
use std::path::Path;
use taxel_hand::shell_word;

impl Recording {
    /// Reads the recording of a `.npy`, `.npz` or `.csv` file.
    ///
    /// # Errors
    /// Any [`RecordError`]; CAN traffic, such as a candump `.log`, is no sequence of frames and is refused.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, RecordError> {
        if let Some(rate_hz) = options.rate_hz
            && !RATES_HZ.contains(&rate_hz)
        {
            return Err(RecordError::Rate { rate_hz });
        }
        let refused = |reason: String| Err(RecordError::unreadable(path.display(), reason));
        let table = match FileKind::of(path) {
            Some(FileKind::Npy | FileKind::Csv) if options.array.is_some() => {
                return refused("--array picks one array of an .npz; this file has no named arrays".into());
            }
            Some(FileKind::Npy | FileKind::Csv) if matches!(options.void, Some(Void::Mask(_))) => {
                return refused("--void NAME is an array of an .npz; here it can be nan".into());
            }
            Some(FileKind::Npy) => npy::read(path, options)?,
            Some(FileKind::Npz) => npz::read(path, options)?,
            Some(FileKind::Csv) => csv::read(path, options)?,
            Some(FileKind::Log) => {
                return refused(
                    "a candump .log holds CAN traffic, not tactile frames; read it through a CAN source, log:FILE"
                        .into(),
                );
            }
            Some(FileKind::Mcap) => {
                return refused(format!(
                    "an .mcap holds more than tactile frames; `taxel convert {} {}` makes frames of it",
                    shell_word(path.display()),
                    shell_word(path.with_extension("npz").display())
                ));
            }
            None if path.is_dir() => {
                return refused("a folder; a recording is a file in it".into());
            }
            None => {
                let other = ending_of(path);
                let found = match other.as_str() {
                    "" => "nothing".into(),
                    other => format!(".{other}"),
                };
                let how = made_of(&other, path).map_or_else(
                    || "; for others see docs/recordings.md, \"Other formats\"".into(),
                    |how| format!("; {how}"),
                );
                return refused(format!(
                    "a recording ends in .npy, .npz or .csv (tactile frames), .log (candump) or .mcap (`taxel record`), \
                     not {found}{how}"
                ));
            }
        };
        Self::from_table(table, options)
    }
}

/// How a recording is made of a file of another kind that people have.
fn made_of(extension: &str, path: &Path) -> Option<String> {
    let file = shell_word(path.display());
    if let Some(packed) = Packed::of_ending(extension) {
        return Some(packed.is_read_by(&file));
    }
    match extension {
        "blf" | "asc" | "trc" | "db" | "mf4" => {
            let log = shell_word(path.with_extension("log").display());
            Some(format!(
                "`can_logconvert {file} {log}` of python-can makes a .log of it"
            ))
        }
        "mat" => Some(
            "save the array in Python, time first: numpy.save(\"frames.npy\", scipy.io.loadmat(..)[\"NAME\"]), with \
             numpy.moveaxis(.., -1, 0) where time is its last axis; of version 7.3, which is HDF5, h5py.File(..)[\"NAME\"][()], \
             whose axes are the other way round"
                .into(),
        ),
        "h5" | "hdf5" => Some(
            "save the array in Python, time first: numpy.save(\"frames.npy\", h5py.File(..)[\"NAME\"][()])".into(),
        ),
        "pkl" | "pickle" => Some(
            "save its array in Python: numpy.save(\"frames.npy\", numpy.asarray(pandas.read_pickle(..), float))".into(),
        ),
        "parquet" => {
            Some(
                "pandas.read_parquet(..).to_csv(\"grasp.csv\", index=False) makes a .csv of it, and of a column of lists \
                 numpy.savez(\"grasp.npz\", frames=numpy.stack(df.NAME), t_s=df.TIME) a recording"
                    .into(),
            )
        }
        // A log that was rotated among them.
        _ if matches!(extension, "txt" | "tsv") || extension.parse::<u32>().is_ok() => Some(format!(
            "`taxel COMMAND - < {file}` reads a log, a .csv or an array whatever its name"
        )),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_has_another_kind_of_file_is_told_what_makes_a_recording_of_it() {
        for (name, how) in [
            ("grasp.blf", "`can_logconvert grasp.blf grasp.log`"),
            ("grasp.ASC", "`can_logconvert grasp.ASC grasp.log`"),
            ("grasp.log.gz", "`zcat grasp.log.gz | taxel COMMAND -`"),
            ("grasp.csv.zst", "`zstdcat grasp.csv.zst"),
            ("grasp.mat", "numpy.save("),
            ("grasp.log.1", "`taxel COMMAND - < grasp.log.1`"),
            ("grasp.txt", "`taxel COMMAND - < grasp.txt`"),
            ("grasp.h5", "h5py.File("),
            ("grasp.pkl", "pandas.read_pickle("),
            ("grasp.parquet", "pandas.read_parquet("),
            ("grasp.parquet", "of a column of lists numpy.savez("),
        ] {
            let error = Recording::open(Path::new(name), &ReadOptions::default()).unwrap_err();
            assert!(error.to_string().contains(how), "{error}");
        }
        for (name, how) in [
            ("grasp.log", "read it through a CAN source"),
            (
                "GRASP.MCAP",
                "`taxel convert GRASP.MCAP GRASP.npz` makes frames of it",
            ),
        ] {
            let error = Recording::open(Path::new(name), &ReadOptions::default()).unwrap_err();
            assert!(error.to_string().contains(how), "{error}");
        }
        let error = Recording::open(Path::new("grasp.bag"), &ReadOptions::default()).unwrap_err();
        let told = "not .bag; for others see docs/recordings.md, \"Other formats\"";
        assert!(error.to_string().ends_with(told), "{error}");
    }
}
