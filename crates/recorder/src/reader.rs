//! A recording out of a file.

use crate::left_out::LeftOut;
use crate::records::{Fields, Found, channel, look};
use crate::schema::Topic;
use crate::series::parts;
use crate::writer::Attached;
use crate::zstd::Zstd;
use mcap::records::op;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};
use std::collections::{BTreeSet, HashMap, VecDeque};
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Bytes of the longest record that is read.
const LONGEST: usize = 64 << 20;
/// Bytes asked from the file at once.
const BLOCK: usize = 256 << 10;
/// Bytes before a record: what it is, and how long.
const RECORD_HEAD: usize = 9;
/// Bytes of the record that ends a file, which says where the summary begins.
const FOOTER: usize = RECORD_HEAD + 20;
/// What is wrong with a record whose fields do not fit into it.
const CUT_OFF: &str = "a record is cut off";

/// Why a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// It is no MCAP file.
    #[error("{path}: no MCAP file: {problem}")]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}

/// What stands in a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Item<'a> {
    /// A message of a topic that is wanted.
    Message {
        /// What it is about.
        topic: Topic,
        /// When it was valid, nanoseconds of the wall clock since 1970.
        wall_ns: u64,
        /// The message, CDR.
        data: &'a [u8],
    },
    /// A file that the recording was made with.
    Attached(Attached),
    /// The same, where its bytes are damaged and therefore left out.
    Damaged,
}

/// Reads a recording from its beginning to its end, one file or [several](parts) after each other. Damaged chunks are passed
/// over, and a file that was torn off ends with its last whole chunk.
pub struct RecordingReader {
    path: PathBuf,
    /// Whether it is one of several.
    is_part: bool,
    /// The files behind the one that is read.
    next_parts: VecDeque<PathBuf>,
    /// What could not be read of those before it, a sentence each.
    left_out_before: Vec<String>,
    file: File,
    /// Gives the records of the file, chunks whole.
    records: LinearReader,
    /// The chunk that is being read.
    chunk: Option<Chunk>,
    wanted: Vec<Topic>,
    /// Topics by the number of their channel; none where it is not wanted.
    channels: HashMap<u16, Option<Topic>>,
    message: Vec<u8>,
    /// Bytes of the files before this one.
    bytes_before: u64,
    /// Bytes read of this one.
    bytes_read: u64,
    /// Where in it the next record begins.
    next_record: u64,
    left_out: LeftOut,
    ended: bool,
}

/// One chunk, and where in the file it stands.
struct Chunk {
    records: LinearReader,
    from: u64,
    to: u64,
    /// The times of its first message, of the one that was given last, and of its last one.
    begins_ns: u64,
    newest_ns: u64,
    ends_ns: u64,
}

impl Chunk {
    /// Of the content of its record.
    fn new(data: &[u8], from: u64, to: u64) -> Self {
        let options = options().with_skip_start_magic(true).with_skip_end_magic(true);
        let mut records = LinearReader::new_with_options(options.with_prevalidate_chunk_crcs(true));
        let added = records.add_decompressor(Zstd::with_window(LONGEST as u64));
        debug_assert!(added.is_ok(), "it has a name");
        let bytes = records.insert(RECORD_HEAD + data.len());
        bytes[0] = op::CHUNK;
        bytes[1..RECORD_HEAD].copy_from_slice(&(data.len() as u64).to_le_bytes());
        bytes[RECORD_HEAD..].copy_from_slice(data);
        records.notify_read(RECORD_HEAD + data.len());
        let mut head = Fields(data);
        let [begins_ns, ends_ns] = [(); 2].map(|()| head.u64().unwrap_or_default());
        Self {
            records,
            from,
            to,
            begins_ns,
            newest_ns: begins_ns,
            ends_ns,
        }
    }

    /// Where in the file the message stands that was given last, by its time.
    fn position(&self) -> u64 {
        let since_begin = |t_ns: u64| t_ns.saturating_sub(self.begins_ns) as f64;
        let share = since_begin(self.newest_ns) / since_begin(self.ends_ns).max(1.0);
        self.from + ((self.to - self.from) as f64 * share.min(1.0)) as u64
    }
}

fn open(path: &Path) -> Result<File, ReadError> {
    File::open(path).map_err(|source| ReadError::Io {
        path: path.into(),
        source,
    })
}

/// The records of a file, from its beginning.
fn records() -> LinearReader {
    let options = options()
        .with_emit_chunks(true)
        .with_validate_data_section_crc(true);
    LinearReader::new_with_options(options)
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default().with_record_length_limit(LONGEST)
}

impl RecordingReader {
    /// Opens a recording, of which messages of these topics are given; its other messages are passed over. Where there is
    /// no file of this name, its [`parts`] are read.
    ///
    /// # Errors
    /// Where the file cannot be read. That it is no MCAP file shows with the first item.
    pub fn open(path: &Path, wanted: &[Topic]) -> Result<Self, ReadError> {
        let mut next_parts = VecDeque::from(parts(path));
        let path = next_parts.pop_front().unwrap_or_default();
        Ok(Self {
            file: open(&path)?,
            path,
            is_part: !next_parts.is_empty(),
            next_parts,
            left_out_before: Vec::new(),
            records: records(),
            chunk: None,
            wanted: wanted.into(),
            channels: HashMap::new(),
            message: Vec::new(),
            bytes_before: 0,
            bytes_read: 0,
            next_record: MAGIC.len() as u64,
            left_out: LeftOut::default(),
            ended: false,
        })
    }

    /// The next item; none at the end, which for a torn recording is behind its last whole chunk.
    pub fn next_item(&mut self) -> Result<Option<Item<'_>>, ReadError> {
        while !self.ended {
            let found = match self.chunk.is_some() {
                true => self.look_into_chunk(),
                false => self.look_into_file()?,
            };
            match found {
                Found::Other => {}
                Found::End => match self.next_parts.pop_front() {
                    Some(part) => self.go_on_with(part)?,
                    None => self.ended = true,
                },
                Found::Channel(id, topic) => self.take_channel(id, topic),
                Found::NoTopic => self.left_out.of_no_topic += 1,
                Found::Attached(attached) => return Ok(Some(Item::Attached(attached))),
                Found::Damaged(_) => return Ok(Some(Item::Damaged)),
                Found::Message(topic, wall_ns) => {
                    let data = &self.message;
                    return Ok(Some(Item::Message { topic, wall_ns, data }));
                }
            }
        }
        Ok(None)
    }

    fn go_on_with(&mut self, part: PathBuf) -> Result<(), ReadError> {
        self.left_out_before = self.left_out();
        self.left_out = LeftOut::default();
        self.bytes_before += self.file.metadata().map_or(self.next_record, |file| file.len());
        self.file = open(&part)?;
        self.bytes_read = 0;
        self.path = part;
        (self.records, self.chunk) = (records(), None);
        self.channels.clear();
        self.next_record = MAGIC.len() as u64;
        Ok(())
    }

    fn take_channel(&mut self, id: u16, topic: Option<Topic>) {
        let wanted = topic.filter(|topic| self.wanted.contains(topic));
        self.channels.insert(id, wanted);
    }

    fn look_into_file(&mut self) -> Result<Found, ReadError> {
        let at = self.next_record;
        let (is_cut_off, problem) = match self.records.next_event() {
            None => return Ok(Found::End),
            Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                self.fill(wanted.max(BLOCK))?;
                return Ok(Found::Other);
            }
            Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                let end = at + (RECORD_HEAD + data.len()) as u64;
                self.next_record = end;
                if opcode == op::CHUNK {
                    self.chunk = Some(Chunk::new(data, at, end));
                    return Ok(Found::Other);
                }
                let found = look(opcode, data, &self.channels, &mut self.message);
                if let Some(Found::Damaged(name)) = &found {
                    self.left_out.record(at, end, format!("the attached {name:?}"));
                }
                if matches!(found, Some(Found::End)) {
                    let len = self.file.metadata().map_or(end, |file| file.len());
                    if !ends_whole(&self.file, len) {
                        self.left_out.torn_behind_all();
                    }
                }
                return Ok(found.unwrap_or_else(|| {
                    self.left_out.record(at, end, CUT_OFF.into());
                    Found::Other
                }));
            }
            Some(Err(McapError::BadDataCrc { .. })) => {
                self.left_out.unsound();
                return Ok(Found::End);
            }
            Some(Err(McapError::UnexpectedEof)) => (true, "it ends in the middle".to_owned()),
            Some(Err(error)) => (false, error.to_string()),
        };
        if at == MAGIC.len() as u64 {
            let path = self.path.clone();
            return Err(ReadError::NotMcap { path, problem });
        }
        let len = self.file.metadata().map_or(at, |file| file.len());
        match is_cut_off && !ends_whole(&self.file, len) {
            true => self.left_out.torn(),
            false => self.left_out.lost(at, len, problem),
        }
        Ok(Found::End)
    }

    fn look_into_chunk(&mut self) -> Found {
        let Some(chunk) = &mut self.chunk else {
            return Found::Other;
        };
        let problem = match chunk.records.next_event() {
            Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                match look(opcode, data, &self.channels, &mut self.message) {
                    Some(found) => {
                        if let Found::Message(_, wall_ns) = found {
                            chunk.newest_ns = wall_ns;
                        }
                        return found;
                    }
                    None => Ok(()),
                }
            }
            // It has all of its bytes: where more are asked for it has ended, or says that it is longer than it is.
            Some(Ok(LinearReadEvent::ReadRequest(_))) => {
                chunk.records.notify_read(0);
                return Found::Other;
            }
            None => {
                self.chunk = None;
                return Found::Other;
            }
            Some(Err(error)) => Err(error),
        };
        match problem {
            Err(McapError::UnsupportedCompression(name)) => self.left_out.compressed(name),
            Ok(()) | Err(McapError::UnexpectedEof) => {
                self.left_out.record(chunk.from, chunk.to, CUT_OFF.into())
            }
            Err(error) => self.left_out.record(chunk.from, chunk.to, error.to_string()),
        }
        self.chunk = None;
        // The chunk may have said which topics later messages are of; the summary says it again.
        for (id, topic, _) in channels_of_summary(&self.file).unwrap_or_default() {
            self.take_channel(id, topic);
        }
        Found::Other
    }

    fn fill(&mut self, wanted: usize) -> Result<(), ReadError> {
        let read = loop {
            match self.file.read(self.records.insert(wanted)) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                read => break read,
            }
        };
        let read = read.map_err(|source| ReadError::Io {
            path: self.path.clone(),
            source,
        })?;
        self.records.notify_read(read);
        self.bytes_read += read as u64;
        Ok(())
    }

    /// Whether there may be messages of a topic in what is read yet: not where the summary at the end of each file lists
    /// others alone.
    pub fn may_hold(&self, topic: Topic) -> bool {
        let may_hold = |file: &File| {
            let listed = channels_of_summary(file).unwrap_or_default();
            listed.is_empty() || listed.iter().any(|(_, listed, _)| *listed == Some(topic))
        };
        let next = |part: &PathBuf| File::open(part).is_ok_and(|file| may_hold(&file));
        may_hold(&self.file) || self.next_parts.iter().any(next)
    }

    /// Topics that its index lists, those of other programs too, each once, by the alphabet; none where it has no index.
    pub fn topics(&self) -> Vec<String> {
        let listed = channels_of_summary(&self.file).unwrap_or_default().into_iter();
        let names: BTreeSet<String> = listed.map(|(.., name)| name).collect();
        names.into_iter().collect()
    }

    /// What of the file could not be read so far, a sentence each: damaged bytes, and where it was torn off.
    pub fn left_out(&self) -> Vec<String> {
        let name = self.path.file_name().unwrap_or_default().display();
        let of_this = self.left_out.sentences().into_iter();
        let of_this = of_this.map(|sentence| match self.is_part {
            true => format!("{name}: {sentence}"),
            false => sentence,
        });
        self.left_out_before.iter().cloned().chain(of_this).collect()
    }

    /// Bytes of its files in front of the item that was given last; what was read ahead is not among them.
    pub fn position(&self) -> u64 {
        let in_this = self.chunk.as_ref().map_or(self.next_record, Chunk::position);
        // A file may be shorter than what the first record is behind.
        self.bytes_before + in_this.min(self.bytes_read)
    }
}

/// Whether a file has the end that a recording has, so that nothing is missing behind it.
fn ends_whole(file: &File, len: u64) -> bool {
    let mut end = [0; MAGIC.len()];
    let at = len.saturating_sub(MAGIC.len() as u64);
    file.read_exact_at(&mut end, at).is_ok() && end == *MAGIC
}

/// The channels that the summary at the end of a file lists, and what they are called; none where there is no summary.
fn channels_of_summary(file: &File) -> Option<Vec<(u16, Option<Topic>, String)>> {
    let end = (file.metadata().ok()?.len()).checked_sub((FOOTER + MAGIC.len()) as u64)?;
    let mut footer = [0; FOOTER];
    file.read_exact_at(&mut footer, end).ok()?;
    let begin = Fields(&footer[RECORD_HEAD..]).u64()?;
    let size = end.checked_sub(begin)?;
    if footer[0] != op::FOOTER || begin == 0 || size > LONGEST as u64 {
        return None;
    }
    let mut summary = vec![0; size as usize];
    file.read_exact_at(&mut summary, begin).ok()?;
    let (mut records, mut channels) = (Fields(&summary), Vec::new());
    while let Some([opcode]) = records.number() {
        let len = usize::try_from(records.u64()?).ok()?;
        let record = records.take(len)?;
        if opcode == op::CHANNEL {
            channels.push(channel(Fields(record))?);
        }
    }
    Some(channels)
}

impl std::fmt::Debug for RecordingReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RecordingReader")
            .field("path", &self.path)
            .field("position", &self.position())
            .finish_non_exhaustive()
    }
}
