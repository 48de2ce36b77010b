//! What comes, into files: one, several that are split, or only what is around a trigger.

use crate::gone::{Gone, is_at};
use crate::roomy_file::RoomyFile;
use crate::schema::Topic;
use crate::series::{Series, SharedSeries, folder_of};
use crate::store_error::StoreError;
use crate::writer::{Entry, Preamble, RecordingWriter};
use std::collections::VecDeque;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes that the messages before a trigger may take in memory.
const MOST_KEPT: usize = 512 << 20;
/// What is kept more at either end of what is around a trigger, nanoseconds: CAN frames come in messages that last a tenth of a
/// second, have the time of their first, and come when they are over.
const GATHERED_NS: u64 = 200_000_000;
/// How long what the recorder itself says waits for a file to stand in, nanoseconds.
const NOTES_NS: u64 = 10_000_000_000;

/// When a recording goes on in another file. Without either limit it is one file of the name given.
#[derive(Debug, Default, Clone)]
pub struct Split {
    /// After this many bytes.
    pub bytes: Option<u64>,
    /// After this time, nanoseconds.
    pub after_ns: Option<u64>,
    /// Older files beyond this many are removed, those of earlier runs too; and as many more as it takes where the disk is full.
    pub most_files: Option<usize>,
}

/// What is kept at least of a recording that is only made around triggers, nanoseconds.
#[derive(Debug, Clone, Copy)]
pub struct Around {
    /// Before a trigger.
    pub before_ns: u64,
    /// Behind it.
    pub after_ns: u64,
}

/// Puts messages into files. A file is begun with the first message of a hand, and older ones make room when it can be read
/// up to there: a recorder to which nothing comes neither makes nor removes a file, however often it is started.
#[derive(Debug)]
pub struct Store {
    series: SharedSeries,
    preamble: Preamble,
    split: Split,
    around: Option<Around>,
    current: Option<Current>,
    /// Files that are whole, and not handed out to be synced yet.
    whole: VecDeque<Written>,
    /// What waits for a file: what the recorder itself says, and, where a trigger is awaited, what came before it.
    kept: VecDeque<Kept>,
    kept_bytes: usize,
    /// Until when what a trigger began goes on; none where one is awaited.
    until_ns: Option<u64>,
    /// The newest of those messages that every file begins with.
    standing: Vec<Entry>,
    messages: u64,
    gone: Vec<Gone>,
    /// See [`Store::set_clock`].
    clock_moved_ns: i64,
}

/// A file with something in it that its disk may not have.
#[derive(Debug)]
pub struct Written {
    /// As it was made.
    pub path: PathBuf,
    /// The file.
    pub file: Arc<File>,
}

/// A message that waits for a file.
#[derive(Debug)]
struct Kept {
    entry: Entry,
    /// Whether it is the recorder's own, which makes no file.
    is_note: bool,
}

/// The file being written.
#[derive(Debug)]
struct Current {
    path: PathBuf,
    file: Arc<File>,
    writer: RecordingWriter<RoomyFile<File>>,
    began_ns: u64,
    /// What is added to the times of messages, nanoseconds.
    clock_moved_ns: i64,
    /// Bytes up to the last cut; 0 where nothing that came can be read yet.
    good: u64,
}

impl Current {
    /// What others did to it, at a cut.
    fn gone(&self) -> Option<Gone> {
        Gone::look(&self.path, &self.file, self.good)
    }
}

impl Store {
    /// A store of files named after `path`: that itself, or, where there may be several, with a number before its ending.
    pub fn new(path: &Path, preamble: Preamble, split: Split, around: Option<Around>) -> Self {
        let are_several = around.is_some() || split.bytes.is_some() || split.after_ns.is_some();
        Self {
            series: SharedSeries::new(Series::new(path, are_several, split.most_files)),
            preamble,
            split,
            around: around.map(|around| Around {
                before_ns: around.before_ns.saturating_add(GATHERED_NS),
                after_ns: around.after_ns.saturating_add(GATHERED_NS),
            }),
            current: None,
            whole: VecDeque::new(),
            kept: VecDeque::new(),
            kept_bytes: 0,
            until_ns: None,
            standing: Vec::new(),
            messages: 0,
            gone: Vec::new(),
            clock_moved_ns: 0,
        }
    }

    /// Files made so far, and neither removed since nor gone.
    pub fn files(&self) -> Vec<PathBuf> {
        self.series.lock().files().to_vec()
    }

    /// Files removed so far, to make room, those of earlier runs too.
    pub fn removed(&self) -> u32 {
        self.series.lock().removed()
    }

    /// How many of these were removed since the disk was full.
    pub fn given(&self) -> u32 {
        self.series.lock().given()
    }

    /// Files that others removed, renamed or changed while they were recorded into, the oldest first.
    pub fn gone(&self) -> &[Gone] {
        &self.gone
    }

    /// Tells how far the wall clock was set since the recording began, nanoseconds. Messages and cuts have times that do not
    /// know of that; a file has them by the clock as it stood when the file was begun, so that time in it never jumps.
    pub fn set_clock(&mut self, moved_ns: i64) {
        self.clock_moved_ns = moved_ns;
    }

    /// How far the clock had been set when the file was begun that messages go into, nanoseconds; that of the next one where
    /// there is none.
    pub fn clock_of_file(&self) -> i64 {
        (self.current.as_ref()).map_or(self.clock_moved_ns, |current| current.clock_moved_ns)
    }

    /// Whether there is a file that messages go into now.
    pub fn is_writing(&self) -> bool {
        self.current.is_some()
    }

    /// Messages written so far.
    pub fn messages(&self) -> u64 {
        self.messages
            + self
                .current
                .as_ref()
                .map_or(0, |current| current.writer.messages())
    }

    /// Whether the first file can be made, before anything has come that is to be in it.
    pub fn check(&self) -> Result<(), StoreError> {
        self.series.lock().check()
    }

    /// Takes a message of a hand.
    pub fn take(&mut self, entry: Entry) -> Result<(), StoreError> {
        if matches!(entry.topic, Topic::Hello | Topic::Status) {
            self.standing.retain(|standing| standing.topic != entry.topic);
            self.standing.push(entry.clone());
        }
        self.add(entry, false)
    }

    /// Takes a message of the recorder's own. Alone it makes no file: it waits ten seconds for one, where there is none.
    pub fn note(&mut self, entry: Entry) -> Result<(), StoreError> {
        self.add(entry, true)
    }

    /// Goes on in another file, at the beginning of which this stands, since what comes is of another configuration. What was
    /// kept for a trigger is of the one before, and left out. True where anything of a hand is in a file, or was kept.
    pub fn begin_another(&mut self, preamble: Preamble) -> Result<bool, StoreError> {
        let has_begun = self.current.is_some() || self.kept.iter().any(|kept| !kept.is_note);
        self.close()?;
        self.preamble = preamble;
        self.standing.clear();
        self.kept.retain(|kept| kept.is_note);
        self.kept_bytes = self.kept.iter().map(|kept| kept.entry.data.len()).sum();
        Ok(has_begun)
    }

    fn add(&mut self, entry: Entry, is_note: bool) -> Result<(), StoreError> {
        if self.around.is_some() && self.until_ns.is_none_or(|until_ns| entry.wall_ns > until_ns) {
            self.until_ns = None;
            self.close()?;
            self.keep(entry, is_note);
            return Ok(());
        }
        if self.current.is_none() {
            if is_note {
                self.keep(entry, is_note);
                return Ok(());
            }
            self.open(entry.wall_ns)?;
        }
        self.put(entry)
    }

    fn keep(&mut self, entry: Entry, is_note: bool) {
        let before_ns = self.around.map_or(NOTES_NS, |around| around.before_ns);
        let from_ns = entry.wall_ns.saturating_sub(before_ns);
        self.kept_bytes += entry.data.len();
        self.kept.push_back(Kept { entry, is_note });
        while let Some(oldest) = self.kept.front()
            && (oldest.entry.wall_ns < from_ns || self.kept_bytes > MOST_KEPT)
        {
            self.kept_bytes -= oldest.entry.data.len();
            self.kept.pop_front();
        }
    }

    /// Something happened at this time that is to be kept: begins a file with what was before it, or lets the one that another
    /// trigger began go on for longer. True where it began one; where nothing of a hand was before it, what comes behind it
    /// does.
    pub fn trigger(&mut self, at_ns: u64) -> Result<bool, StoreError> {
        let Some(around) = self.around else {
            return Ok(false);
        };
        self.until_ns = Some(at_ns.saturating_add(around.after_ns));
        let from_ns = at_ns.saturating_sub(around.before_ns);
        self.kept.retain(|kept| kept.entry.wall_ns >= from_ns);
        self.kept_bytes = self.kept.iter().map(|kept| kept.entry.data.len()).sum();
        let is_of_hand = self.kept.iter().any(|kept| !kept.is_note);
        if self.current.is_some() || !is_of_hand {
            return Ok(false);
        }
        self.open(at_ns)?;
        Ok(true)
    }

    /// Writes what came so far, so that it can be read after a crash, and goes on in another file where it is time, or where
    /// others did something to this one.
    pub fn cut(&mut self, now_ns: u64) -> Result<(), StoreError> {
        if self.until_ns.is_some_and(|until_ns| now_ns > until_ns) {
            self.until_ns = None;
            return self.close();
        }
        self.cut_current()?;
        let Some(current) = &self.current else {
            return Ok(());
        };
        let is_full = self.split.bytes.is_some_and(|most| current.good >= most);
        let is_old =
            (self.split.after_ns).is_some_and(|most| now_ns.saturating_sub(current.began_ns) >= most);
        match is_full || is_old || current.gone().is_some() {
            true => self.close(),
            false => Ok(()),
        }
    }

    /// Hands out the files that are to be synced to their disk, those that are whole first, until `sync` gives one back: a
    /// whole one is handed out the next time, and the one being written with what is written until then.
    pub fn hand_out(&mut self, mut sync: impl FnMut(Written) -> Result<(), Written>) {
        while let Some(whole) = self.whole.pop_front() {
            if let Err(whole) = sync(whole) {
                self.whole.push_front(whole);
                return;
            }
        }
        if let Some(Current { path, file, .. }) = &self.current {
            let _ = sync(Written {
                path: path.clone(),
                file: Arc::clone(file),
            });
        }
    }

    /// Ends the file being written, with its index.
    pub fn close(&mut self) -> Result<(), StoreError> {
        self.cut_current()?;
        let Some(current) = self.current.take() else {
            return Ok(());
        };
        if let Some(gone) = current.gone() {
            self.series.lock().forget(&gone.path);
            self.gone.push(gone);
        }
        // One that was renamed becomes whole, too.
        let Current {
            path,
            file,
            writer,
            good,
            ..
        } = current;
        self.messages += writer.messages();
        match writer.finish() {
            Ok(_) => {
                // It may be held for long until its disk has it, and may make room meanwhile.
                let _ = file.unlock();
                self.whole.push_back(Written { path, file });
                Ok(())
            }
            Err(source) => Err(self.torn(path, &file, good, source)),
        }
    }

    fn cut_current(&mut self) -> Result<(), StoreError> {
        let Some(current) = &mut self.current else {
            return Ok(());
        };
        if let Err(error) = current.writer.cut() {
            return self.failed(error);
        }
        let is_first = current.good == 0;
        current.good = current.writer.bytes();
        if is_first {
            self.series.lock().make_room();
        }
        Ok(())
    }

    fn put(&mut self, entry: Entry) -> Result<(), StoreError> {
        let Some(current) = &mut self.current else {
            return Ok(());
        };
        match current.writer.put(&entry.moved(current.clock_moved_ns)) {
            Ok(()) => Ok(()),
            Err(error) => self.failed(error),
        }
    }

    fn failed(&mut self, source: io::Error) -> Result<(), StoreError> {
        let Some(current) = self.current.take() else {
            return Ok(());
        };
        self.messages += current.writer.messages();
        drop(current.writer.give_up());
        Err(self.torn(current.path, &current.file, current.good, source))
    }

    /// Takes half a chunk off the end of a file; one that holds no whole one is removed.
    fn torn(&mut self, path: PathBuf, file: &File, good: u64, source: io::Error) -> StoreError {
        if good == 0 {
            self.series.lock().forget(&path);
            if is_at(&path, file).is_ok_and(|is_it| is_it) {
                let _ = std::fs::remove_file(&path);
            }
            return StoreError::Create { path, source };
        }
        if file.metadata().is_ok_and(|file| file.len() > good) {
            // Where that fails, too, readers pass over it.
            let _ = file.set_len(good);
        }
        StoreError::Write { path, source, good }
    }

    fn open(&mut self, now_ns: u64) -> Result<(), StoreError> {
        let (path, file) = self.series.lock().create()?;
        let oldest_ns = self.kept.front().map(|kept| kept.entry.wall_ns);
        let began_ns = oldest_ns.map_or(now_ns, |oldest_ns| oldest_ns.min(now_ns));
        let clock_moved_ns = self.clock_moved_ns;
        let clone = file.try_clone();
        let begun = clone.and_then(|clone| {
            let mut writer = RecordingWriter::begin(
                RoomyFile::new(clone, self.series.clone()),
                &self.preamble,
                began_ns.saturating_add_signed(clock_moved_ns),
            )?;
            let standing = self.standing.iter().cloned().map(|standing| Entry {
                wall_ns: began_ns,
                ..standing
            });
            for entry in standing.chain(self.kept.drain(..).map(|kept| kept.entry)) {
                writer.put(&entry.moved(clock_moved_ns))?;
            }
            Ok(writer)
        });
        self.kept_bytes = 0;
        match begun {
            Ok(writer) => {
                sync_folder(&path);
                self.current = Some(Current {
                    path,
                    file: Arc::new(file),
                    writer,
                    began_ns: now_ns,
                    clock_moved_ns,
                    good: 0,
                });
                Ok(())
            }
            Err(source) => Err(self.torn(path, &file, 0, source)),
        }
    }
}

/// After a power loss a new file has its name only if its folder was synced.
fn sync_folder(path: &Path) {
    if let Ok(folder) = File::open(folder_of(path)) {
        let _ = folder.sync_all();
    }
}
