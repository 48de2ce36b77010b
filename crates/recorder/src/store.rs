//! What comes, into files: one, several that are split, or only what is around a trigger.

use crate::schema::Topic;
use crate::writer::{Entry, Preamble, RecordingWriter};
use mcap::MAGIC;
use std::collections::VecDeque;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes that the messages before a trigger may take in memory.
const MOST_KEPT: usize = 512 << 20;
/// Numbers that files of one name are given at most.
const MOST_FILES: u32 = 1_000_000;

/// When a recording goes on in another file. Without either limit it is one file of the name given.
#[derive(Debug, Default, Clone)]
pub struct Split {
    /// After this many bytes.
    pub bytes: Option<u64>,
    /// After this time, nanoseconds.
    pub after_ns: Option<u64>,
    /// Older files beyond this many are removed, those of earlier runs too.
    pub most_files: Option<usize>,
}

/// What is kept of a recording that is only made around triggers, nanoseconds.
#[derive(Debug, Clone, Copy)]
pub struct Around {
    /// Before a trigger.
    pub before_ns: u64,
    /// Behind it.
    pub after_ns: u64,
}

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

/// Puts messages into files.
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    preamble: Preamble,
    split: Split,
    around: Option<Around>,
    current: Option<Current>,
    /// What came before a trigger, where one is awaited.
    kept: VecDeque<Entry>,
    kept_bytes: usize,
    /// Until when the file that a trigger began goes on.
    until_ns: u64,
    /// The newest of those messages that every file begins with.
    standing: Vec<Entry>,
    files: VecDeque<PathBuf>,
    /// Files of earlier runs, the oldest first.
    earlier: VecDeque<PathBuf>,
    removed: u32,
    /// That of the next file; none before it was looked for what is there.
    next_number: Option<u32>,
    messages: u64,
}

/// The file being written.
#[derive(Debug)]
struct Current {
    path: PathBuf,
    file: Arc<File>,
    writer: RecordingWriter<File>,
    began_ns: u64,
    /// Bytes up to the last cut.
    good: u64,
}

impl Store {
    /// A store of files named after `path`: that itself, or, where there may be several, with a number before its ending.
    pub fn new(path: &Path, preamble: Preamble, split: Split, around: Option<Around>) -> Self {
        Self {
            path: path.into(),
            preamble,
            split,
            around,
            current: None,
            kept: VecDeque::new(),
            kept_bytes: 0,
            until_ns: 0,
            standing: Vec::new(),
            files: VecDeque::new(),
            earlier: VecDeque::new(),
            removed: 0,
            next_number: None,
            messages: 0,
        }
    }

    /// Files made so far, and not removed since.
    pub fn files(&self) -> impl ExactSizeIterator<Item = &Path> {
        self.files.iter().map(PathBuf::as_path)
    }

    /// Files removed so far, to make room, those of earlier runs too.
    pub fn removed(&self) -> u32 {
        self.removed
    }

    /// Messages written so far.
    pub fn messages(&self) -> u64 {
        self.messages
            + self
                .current
                .as_ref()
                .map_or(0, |current| current.writer.messages())
    }

    /// Makes the first file at once, so that it is known whether that can be done; not where a trigger makes it.
    pub fn begin(&mut self, now_ns: u64) -> Result<(), StoreError> {
        match self.around {
            None => self.open(now_ns),
            Some(_) => Ok(()),
        }
    }

    /// Takes a message.
    pub fn take(&mut self, entry: Entry) -> Result<(), StoreError> {
        if matches!(entry.topic, Topic::Hello | Topic::Status) {
            self.standing.retain(|standing| standing.topic != entry.topic);
            self.standing.push(entry.clone());
        }
        let Some(around) = self.around else {
            if self.current.is_none() {
                self.open(entry.wall_ns)?;
            }
            return self.put(&entry);
        };
        if self.current.is_some() && entry.wall_ns <= self.until_ns {
            return self.put(&entry);
        }
        self.close()?;
        self.kept_bytes += entry.data.len();
        self.kept.push_back(entry);
        let newest_ns = self.kept.back().map_or(0, |entry| entry.wall_ns);
        while let Some(oldest) = self.kept.front()
            && (newest_ns.saturating_sub(oldest.wall_ns) > around.before_ns || self.kept_bytes > MOST_KEPT)
        {
            self.kept_bytes -= oldest.data.len();
            self.kept.pop_front();
        }
        Ok(())
    }

    /// Something happened at this time that is to be kept: begins a file with what was before it, or lets the one that another
    /// trigger began go on for longer. True where it began one.
    pub fn trigger(&mut self, at_ns: u64) -> Result<bool, StoreError> {
        let Some(around) = self.around else {
            return Ok(false);
        };
        self.until_ns = at_ns.saturating_add(around.after_ns);
        if self.current.is_some() {
            return Ok(false);
        }
        let from_ns = at_ns.saturating_sub(around.before_ns);
        self.open(
            self.kept
                .front()
                .map_or(at_ns, |oldest| oldest.wall_ns.max(from_ns)),
        )?;
        self.kept_bytes = 0;
        for entry in std::mem::take(&mut self.kept) {
            if entry.wall_ns >= from_ns {
                self.put(&entry)?;
            }
        }
        Ok(true)
    }

    /// Writes what came so far, so that it can be read after a crash, and goes on in another file where it is time. Returns the
    /// file that is to be synced to its disk.
    pub fn cut(&mut self, now_ns: u64) -> Result<Option<Arc<File>>, StoreError> {
        if self.around.is_some() && now_ns > self.until_ns {
            return self.close();
        }
        let Some(current) = &mut self.current else {
            return Ok(None);
        };
        if let Err(error) = current.writer.cut() {
            return Err(self.failed(error));
        }
        let at = (&*current.file).stream_position();
        current.good = at.unwrap_or(current.good);
        let is_full = self.split.bytes.is_some_and(|most| current.good >= most);
        let is_old =
            (self.split.after_ns).is_some_and(|most| now_ns.saturating_sub(current.began_ns) >= most);
        match is_full || is_old {
            true => self.close(),
            false => Ok(Some(Arc::clone(&current.file))),
        }
    }

    /// Ends the file being written, with its index; returns it to be synced.
    pub fn close(&mut self) -> Result<Option<Arc<File>>, StoreError> {
        let Some(current) = self.current.take() else {
            return Ok(None);
        };
        let Current {
            path,
            file,
            writer,
            good,
            ..
        } = current;
        self.messages += writer.messages();
        match writer.finish() {
            Ok(_) => Ok(Some(file)),
            Err(source) => Err(Self::torn(path, &file, good, source)),
        }
    }

    fn put(&mut self, entry: &Entry) -> Result<(), StoreError> {
        let Some(current) = &mut self.current else {
            return Ok(());
        };
        match current.writer.put(entry) {
            Ok(()) => Ok(()),
            Err(error) => Err(self.failed(error)),
        }
    }

    fn failed(&mut self, source: io::Error) -> StoreError {
        match self.current.take() {
            Some(current) => {
                self.messages += current.writer.messages();
                drop(current.writer.give_up());
                Self::torn(current.path, &current.file, current.good, source)
            }
            None => StoreError::Create {
                path: self.path.clone(),
                source,
            },
        }
    }

    /// Takes half a chunk off the end of a file.
    fn torn(path: PathBuf, file: &File, good: u64, source: io::Error) -> StoreError {
        // Where that fails, too, readers pass over it.
        let _ = file.set_len(good);
        StoreError::Write { path, source, good }
    }

    fn open(&mut self, now_ns: u64) -> Result<(), StoreError> {
        let (path, file) = self.create()?;
        let clone = file.try_clone();
        let begun = clone.and_then(|clone| {
            let mut writer = RecordingWriter::begin(clone, &self.preamble, now_ns)?;
            for standing in &self.standing {
                writer.put(&Entry {
                    wall_ns: now_ns,
                    ..standing.clone()
                })?;
            }
            writer.cut()?;
            Ok((writer, (&file).stream_position()?))
        });
        match begun {
            Ok((writer, good)) => {
                sync_folder(&path);
                self.files.push_back(path.clone());
                self.current = Some(Current {
                    path,
                    file: Arc::new(file),
                    writer,
                    began_ns: now_ns,
                    good,
                });
            }
            Err(source) => return Err(Self::torn(path, &file, 0, source)),
        }
        let is_too_many = |store: &Self| {
            let most = store.split.most_files.map(|most| most.max(1));
            most.is_some_and(|most| store.earlier.len() + store.files.len() > most)
        };
        while is_too_many(self)
            && let Some(oldest) = self.earlier.pop_front().or_else(|| self.files.pop_front())
        {
            // One that somebody else removed is gone as it should be.
            let _ = std::fs::remove_file(oldest);
            self.removed += 1;
        }
        Ok(())
    }

    fn create(&mut self) -> Result<(PathBuf, File), StoreError> {
        let create = |path: PathBuf| match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(file) => Ok((path, file)),
            Err(source) => Err(StoreError::Create { path, source }),
        };
        let is_one = self.around.is_none() && self.split.bytes.is_none() && self.split.after_ns.is_none();
        if is_one {
            return create(self.path.clone());
        }
        let mut number = self.next_number.unwrap_or_else(|| {
            let numbered = numbered_files(&self.path);
            let next = numbered.last().map_or(1, |(number, _)| number + 1);
            let files = numbered.into_iter().map(|(_, path)| path);
            // What somebody else has given such a name is not ours to remove.
            self.earlier = files.filter(|path| is_recording(path)).collect();
            next
        });
        loop {
            let created = create(numbered_file(&self.path, number));
            number += 1;
            self.next_number = Some(number);
            match created {
                // Somebody else's, made meanwhile.
                Err(StoreError::Create { source, .. })
                    if source.kind() == io::ErrorKind::AlreadyExists && number <= MOST_FILES => {}
                created => return created,
            }
        }
    }
}

/// The file of this number of a recording of this name.
fn numbered_file(path: &Path, number: u32) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().unwrap_or("mcap".as_ref()).to_string_lossy();
    path.with_file_name(format!("{stem}-{number:04}.{ending}"))
}

/// The files that are there and have a name of this recording's, by their numbers.
fn numbered_files(path: &Path) -> Vec<(u32, PathBuf)> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let number_of = |name: &str| {
        let number = name.strip_prefix(&*stem)?.strip_prefix('-')?;
        number
            .split('.')
            .next()?
            .parse()
            .ok()
            .filter(|number| *number < MOST_FILES)
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

fn is_recording(path: &Path) -> bool {
    let mut start = [0; MAGIC.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && start == *MAGIC
}

fn folder_of(path: &Path) -> &Path {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

/// After a power loss a new file has its name only if its folder was synced.
fn sync_folder(path: &Path) {
    if let Ok(folder) = File::open(folder_of(path)) {
        let _ = folder.sync_all();
    }
}
