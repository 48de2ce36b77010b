//! One program at a time in the folder of a session.

use anyhow::{Context, bail};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read, Write};
use std::path::Path;

/// Its file in the folder.
const NAME: &str = ".lock";

/// The folder is this program's until it is dropped, or the program dies, however that is.
#[derive(Debug)]
pub(super) struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the folder, and makes it where it is missing.
    ///
    /// # Errors
    /// Another program has it.
    pub(super) fn take(folder: &Path) -> anyhow::Result<Self> {
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        let path = folder.join(NAME);
        let named = || path.display().to_string();
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(&path).with_context(named)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut pid = String::new();
                let _ = (&file).take(20).read_to_string(&mut pid);
                bail!(
                    "{}: another `taxel forearm record` (process {}) is at work in this folder; wait until it ends, or end \
                     it, or record into another folder",
                    folder.display(),
                    pid.trim()
                );
            }
            Err(TryLockError::Error(error)) => return Err(error).with_context(named),
        }
        file.set_len(0)
            .and_then(|()| writeln!(file, "{}", std::process::id()))
            .with_context(named)?;
        Ok(Self { _file: file })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    #[test]
    fn a_folder_is_one_program_s_until_that_has_ended_and_it_is_said_whose() {
        let dir = TempDir::new().unwrap();
        let folder = dir.path().join("session");
        fs::create_dir(&folder).unwrap();
        // As one that was killed leaves it.
        fs::write(folder.join(NAME), "99999999").unwrap();
        for _ in 0..2 {
            let lock = Lock::take(&folder).unwrap();
            let error = Lock::take(&folder).unwrap_err().to_string();
            let own = format!("(process {}) is at work", std::process::id());
            assert!(error.contains(&own), "{error}");
            drop(lock);
        }
    }
}
