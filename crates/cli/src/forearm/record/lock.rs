//! One program at a time in the folder of a session.

use crate::notices;
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
    /// Takes the folder, and makes it where it is missing. On a filesystem without locks it goes on, and says so.
    ///
    /// # Errors
    /// Another program has it.
    pub(super) fn take(folder: &Path) -> anyhow::Result<Self> {
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        let path = folder.join(NAME);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        // One that another user has made is locked without being written.
        let file = (options.open(&path))
            .or_else(|error| File::open(&path).map_err(|_| error))
            .with_context(|| path.display().to_string())?;
        Self::of(file, folder)
    }

    fn of(mut file: File, folder: &Path) -> anyhow::Result<Self> {
        match file.try_lock() {
            Ok(()) => {
                // For others to be told, where it can be.
                let _ = (file.set_len(0)).and_then(|()| writeln!(file, "{}", std::process::id()));
            }
            Err(TryLockError::WouldBlock) => {
                let mut pid = String::new();
                let _ = (&file).take(20).read_to_string(&mut pid);
                let pid = pid.trim();
                // Another user's may have been there before.
                let process = match !pid.is_empty() && Path::new("/proc").join(pid).exists() {
                    true => format!(" (process {pid})"),
                    false => String::new(),
                };
                bail!(
                    "{}: another `taxel forearm record`{process} is at work in this folder; wait until it ends, or end it, \
                     or record into another folder",
                    folder.display(),
                );
            }
            Err(TryLockError::Error(error)) => notices::warn(&format!(
                "taxel: {}: nothing keeps another `taxel forearm record` out of this folder: {error}",
                folder.display()
            )),
        }
        Ok(Self { _file: file })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::libc::O_PATH;
    use nix::unistd::{Uid, setfsuid};
    use std::fs::Permissions;
    use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
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

    #[test]
    fn a_folder_in_which_another_user_was_at_work_is_one_program_s_too() {
        let dir = TempDir::new().unwrap();
        fs::set_permissions(dir.path(), Permissions::from_mode(0o755)).unwrap();
        let path = dir.path().join(NAME);
        fs::write(&path, "99999999").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o444)).unwrap();
        // This thread's alone: root may write whatever it likes.
        let own = setfsuid(Uid::from_raw(65534));
        assert!(OpenOptions::new().write(true).open(&path).is_err());
        let (lock, second) = (Lock::take(dir.path()), Lock::take(dir.path()));
        setfsuid(own);
        lock.unwrap();
        let error = second.unwrap_err().to_string();
        assert!(error.contains("record` is at work in this folder"), "{error}");
    }

    #[test]
    fn where_the_filesystem_has_no_locks_it_is_gone_on_without() {
        let dir = TempDir::new().unwrap();
        // It can be locked as little as a file there.
        let file = OpenOptions::new()
            .read(true)
            .custom_flags(O_PATH)
            .open(dir.path())
            .unwrap();
        Lock::of(file, dir.path()).unwrap();
    }
}
