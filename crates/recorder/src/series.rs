//! The files of one recording: how they are called, which are there, and which make room for new ones.

use crate::store_error::StoreError;
use mcap::MAGIC;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};

/// Numbers from here on are no files of a recording: people call files by a date, as 20261126, or by seconds. One a minute
/// comes so far in 19 years.
const MOST_NUMBERS: u64 = 10_000_000;

/// The files of one recording, of which whatever writes one may remove others.
#[derive(Debug, Clone)]
pub(crate) struct SharedSeries(Arc<Mutex<Series>>);

impl SharedSeries {
    pub(crate) fn new(series: Series) -> Self {
        Self(Arc::new(Mutex::new(series)))
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, Series> {
        self.0.lock().unwrap_or_else(|e| e.into_inner())
    }
}

/// The files of one recording.
#[derive(Debug)]
pub(crate) struct Series {
    path: PathBuf,
    /// Whether the next file has a number; the only file of a recording has none.
    is_numbered: bool,
    most_files: Option<usize>,
    /// The least number that the next file may have.
    next_number: u64,
    files: Vec<PathBuf>,
    removed: u32,
    given: u32,
}

impl Series {
    /// Of files named after `path`: that itself, or, where there may be several, with a number before its ending.
    pub(crate) fn new(path: &Path, is_numbered: bool, most_files: Option<usize>) -> Self {
        Self {
            path: path.into(),
            is_numbered,
            most_files: most_files.map(|most| most.max(1)),
            next_number: 1,
            files: Vec::new(),
            removed: 0,
            given: 0,
        }
    }

    /// Files made so far, without those that were removed to make room.
    pub(crate) fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Files removed so far to make room, those of earlier runs and of other recorders too.
    pub(crate) fn removed(&self) -> u32 {
        self.removed
    }

    /// How many of these were removed since the disk was full.
    pub(crate) fn given(&self) -> u32 {
        self.given
    }

    /// Whether a file can be made: makes one and removes it. Where the disk is full, older files have to be there that will
    /// make room.
    pub(crate) fn check(&self) -> Result<(), StoreError> {
        match self.create_new() {
            Ok((_, path, _)) => {
                std::fs::remove_file(&path).map_err(|source| StoreError::Create { path, source })
            }
            Err(StoreError::Create { source, .. })
                if is_of_full_disk(&source)
                    && self.most_files.is_some()
                    && self.removable().next().is_some() =>
            {
                Ok(())
            }
            Err(error) => Err(error),
        }
    }

    /// Makes the next file.
    pub(crate) fn create(&mut self) -> Result<(PathBuf, File), StoreError> {
        let (next_number, path, file) = loop {
            match self.create_new() {
                Err(StoreError::Create { source, .. }) if is_of_full_disk(&source) && self.give_way() => {}
                made => break made?,
            }
        };
        self.next_number = next_number;
        // A recording that was to be one file and needs another goes on with numbers.
        self.is_numbered = true;
        // So that no other recorder removes it; where the file system has no locks, it may.
        let _ = file.try_lock();
        self.files.push(path.clone());
        Ok((path, file))
    }

    /// Counts this file no longer, since it is not, or no longer, what was recorded.
    pub(crate) fn forget(&mut self, path: &Path) {
        self.files.retain(|file| file != path);
    }

    /// Removes the oldest files where there are too many. What is there is looked for anew, since other recorders may give
    /// their files the same name.
    pub(crate) fn make_room(&mut self) {
        let Some(most) = self.most_files else {
            return;
        };
        let too_many = recordings(&self.path).count().saturating_sub(most);
        let oldest: Vec<_> = self.removable().take(too_many).collect();
        for oldest in oldest {
            self.remove(&oldest);
        }
    }

    /// Removes the oldest file where the disk is full, and older ones are to make room for new ones; whether it did.
    pub(crate) fn give_way(&mut self) -> bool {
        let removable: Vec<_> = match self.most_files {
            Some(_) => self.removable().collect(),
            None => return false,
        };
        let has_given = removable.iter().any(|oldest| self.remove(oldest));
        self.given += u32::from(has_given);
        has_given
    }

    /// The files that may make room, the oldest first: none that is being written, by whomever.
    fn removable(&self) -> impl Iterator<Item = PathBuf> {
        let newest = self.files.last();
        recordings(&self.path).filter(move |path| newest != Some(path) && !is_being_written(path))
    }

    fn remove(&mut self, path: &Path) -> bool {
        let is_removed = std::fs::remove_file(path).is_ok();
        if is_removed {
            self.forget(path);
            self.removed += 1;
        }
        is_removed
    }

    /// A new file, and the least number of the one behind it.
    fn create_new(&self) -> Result<(u64, PathBuf, File), StoreError> {
        let mut number = self.next_number;
        if self.is_numbered
            && let Some((greatest, _)) = numbered_files(&self.path).last()
        {
            number = number.max(greatest + 1);
        }
        loop {
            if number >= MOST_NUMBERS {
                let source =
                    io::Error::other("its numbers are used up; take another name, or move its files away");
                let path = numbered_file(&self.path, number);
                return Err(StoreError::Create { path, source });
            }
            let path = match self.is_numbered {
                true => numbered_file(&self.path, number),
                false => self.path.clone(),
            };
            match OpenOptions::new().append(true).create_new(true).open(&path) {
                Ok(file) => return Ok((number + u64::from(self.is_numbered), path, file)),
                // Somebody else's, made meanwhile, or of another kind.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists && self.is_numbered => {}
                Err(source) => return Err(StoreError::Create { path, source }),
            }
            number += 1;
        }
    }
}

/// The file of this number of a recording of this name.
fn numbered_file(path: &Path, number: u64) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().unwrap_or("mcap".as_ref()).to_string_lossy();
    path.with_file_name(format!("{stem}-{number:04}.{ending}"))
}

/// The files that are there and have a name of this recording's, by their numbers.
fn numbered_files(path: &Path) -> Vec<(u64, PathBuf)> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let number_of = |name: &str| {
        let number = name.strip_prefix(&*stem)?.strip_prefix('-')?;
        number
            .split('.')
            .next()?
            .parse()
            .ok()
            .filter(|number| *number < MOST_NUMBERS)
    };
    let entries = std::fs::read_dir(folder_of(path)).into_iter().flatten().flatten();
    let files = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()));
    let numbered = files.filter_map(|entry| {
        let number = number_of(&entry.file_name().to_string_lossy())?;
        let file = numbered_file(path, number);
        (file.file_name() == Some(&entry.file_name())).then_some((number, file))
    });
    let mut numbered: Vec<_> = numbered.collect();
    numbered.sort_unstable();
    numbered
}

/// Those of them that a recorder made: what somebody else has given such a name is not ours to remove.
fn recordings(path: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let there = numbered_files(path).into_iter().map(|(_, path)| path);
    there.filter(|path| is_recording(path))
}

/// The files of a recording: that of this name, or where there is none, those of its parts, `NAME-0001.mcap`,
/// `NAME-0002.mcap`, .., in the order of their numbers; where there are none either, that of this name.
pub fn parts(path: &Path) -> Vec<PathBuf> {
    let mut parts = Vec::new();
    if !path.exists() {
        parts.extend(numbered_files(path).into_iter().map(|(_, part)| part));
    }
    if parts.is_empty() {
        parts.push(path.into());
    }
    parts
}

/// The numbered files beside a file of this name, which are no [`parts`] of it: a recorder goes on in them where its next
/// daemon runs with another configuration, which is not that of the file.
pub fn numbered_beside(path: &Path) -> Vec<PathBuf> {
    let mut beside = Vec::new();
    if path.exists() {
        beside.extend(numbered_files(path).into_iter().map(|(_, file)| file));
    }
    beside
}

/// Whether the disk, or what its user may have of it, is used up.
pub(crate) fn is_of_full_disk(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
    )
}

fn is_recording(path: &Path) -> bool {
    let mut start = [0; MAGIC.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && start == *MAGIC
}

fn is_being_written(path: &Path) -> bool {
    let locked = File::open(path).map(|file| file.try_lock());
    matches!(locked, Ok(Err(TryLockError::WouldBlock)))
}

pub(crate) fn folder_of(path: &Path) -> &Path {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbered_files_are_parts_of_a_name_without_a_file_and_beside_one_that_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for name in ["day-0001.mcap", "day-0002.mcap", "day-x.mcap"] {
            std::fs::write(path(name), MAGIC).unwrap();
        }
        let (day, numbered) = (path("day.mcap"), ["day-0001.mcap", "day-0002.mcap"].map(path));
        let told = || (parts(&day), numbered_beside(&day));
        assert_eq!(told(), (numbered.to_vec(), Vec::new()));
        std::fs::write(&day, MAGIC).unwrap();
        assert_eq!(told(), (vec![day.clone()], numbered.to_vec()));
    }
}
