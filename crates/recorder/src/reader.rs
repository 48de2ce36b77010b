//! A recording out of a file.

use crate::schema::Topic;
use crate::writer::Attached;
use mcap::McapError;
use mcap::records::op;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Bytes of the longest record that is read.
const LONGEST: usize = 64 << 20;
/// Bytes asked from the file at once.
const BLOCK: usize = 256 << 10;

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
}

/// Reads a recording from its beginning to its end, or to the last whole chunk of one that was torn off.
pub struct RecordingReader {
    path: PathBuf,
    file: File,
    reader: LinearReader,
    wanted: Vec<Topic>,
    /// Topics by the number of their channel.
    channels: HashMap<u16, Topic>,
    message: Vec<u8>,
    position: u64,
    /// Whether the file was found to be of this kind.
    begun: bool,
    torn: Option<String>,
    ended: bool,
}

/// What a record is to the reader.
enum Found {
    Message(Topic, u64),
    Attached(Attached),
    Channel(u16, Option<Topic>),
    End,
    Other,
}

impl RecordingReader {
    /// Opens a recording, of which messages of these topics are given; its other messages are passed over.
    ///
    /// # Errors
    /// Where the file cannot be read. That it is no MCAP file shows with the first item.
    pub fn open(path: &Path, wanted: &[Topic]) -> Result<Self, ReadError> {
        let file = File::open(path).map_err(|source| ReadError::Io {
            path: path.into(),
            source,
        })?;
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST);
        Ok(Self {
            path: path.into(),
            file,
            reader: LinearReader::new_with_options(options),
            wanted: wanted.into(),
            channels: HashMap::new(),
            message: Vec::new(),
            position: 0,
            begun: false,
            torn: None,
            ended: false,
        })
    }

    /// The next item; none at the end, which for a torn recording is behind its last whole chunk.
    pub fn next_item(&mut self) -> Result<Option<Item<'_>>, ReadError> {
        while !self.ended {
            let found = match self.reader.next_event() {
                None => Ok(Found::End),
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    self.fill(wanted.max(BLOCK))?;
                    continue;
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    self.begun = true;
                    let found = look(opcode, data, &self.channels, &mut self.message);
                    found.ok_or_else(|| "a record is cut off".to_owned())
                }
                Some(Err(McapError::UnexpectedEof)) => Err("it ends in the middle".into()),
                Some(Err(error)) => Err(error.to_string()),
            };
            match found {
                Ok(Found::Other) => {}
                Ok(Found::End) => self.ended = true,
                Ok(Found::Channel(id, topic)) => match topic.filter(|topic| self.wanted.contains(topic)) {
                    Some(topic) => drop(self.channels.insert(id, topic)),
                    None => drop(self.channels.remove(&id)),
                },
                Ok(Found::Attached(attached)) => return Ok(Some(Item::Attached(attached))),
                Ok(Found::Message(topic, wall_ns)) => {
                    let data = &self.message;
                    return Ok(Some(Item::Message { topic, wall_ns, data }));
                }
                Err(problem) if !self.begun => {
                    let path = self.path.clone();
                    return Err(ReadError::NotMcap { path, problem });
                }
                Err(problem) => {
                    self.ended = true;
                    self.torn = Some(problem);
                }
            }
        }
        Ok(None)
    }

    fn fill(&mut self, wanted: usize) -> Result<(), ReadError> {
        let read = loop {
            match self.file.read(self.reader.insert(wanted)) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                read => break read,
            }
        };
        let read = read.map_err(|source| ReadError::Io {
            path: self.path.clone(),
            source,
        })?;
        self.reader.notify_read(read);
        self.position += read as u64;
        Ok(())
    }

    /// Why a recording that was torn off has no more items; none where it is whole, or not yet read so far.
    pub fn torn(&self) -> Option<&str> {
        self.torn.as_deref()
    }

    /// Bytes of the file read so far.
    pub fn position(&self) -> u64 {
        self.position
    }
}

impl std::fmt::Debug for RecordingReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RecordingReader")
            .field("path", &self.path)
            .field("position", &self.position)
            .finish_non_exhaustive()
    }
}

/// Takes a record; a message's bytes are put into `message`. None where the record is cut off.
fn look(opcode: u8, data: &[u8], channels: &HashMap<u16, Topic>, message: &mut Vec<u8>) -> Option<Found> {
    let mut fields = Fields(data);
    Some(match opcode {
        op::MESSAGE => {
            let (channel, _sequence, wall_ns, _published_ns) =
                (fields.u16()?, fields.u32()?, fields.u64()?, fields.u64()?);
            match channels.get(&channel) {
                Some(topic) => {
                    message.clear();
                    message.extend_from_slice(fields.0);
                    Found::Message(*topic, wall_ns)
                }
                None => Found::Other,
            }
        }
        op::CHANNEL => {
            let (id, _schema) = (fields.u16()?, fields.u16()?);
            let (name, encoding) = (fields.text()?, fields.text()?);
            let topic = Topic::ALL
                .into_iter()
                .find(|topic| topic.name().as_bytes() == name);
            Found::Channel(id, topic.filter(|_| encoding == b"cdr"))
        }
        op::ATTACHMENT => {
            let (_logged_ns, _created_ns) = (fields.u64()?, fields.u64()?);
            let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
            let (name, media_type) = (text(fields.text()?), text(fields.text()?));
            let len = usize::try_from(fields.u64()?).ok()?;
            let data = fields.take(len)?.into();
            Found::Attached(Attached {
                name,
                media_type,
                data,
            })
        }
        op::DATA_END => Found::End,
        _ => Found::Other,
    })
}

/// The fields of a record, one after the other.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, len: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(len)?;
        self.0 = rest;
        Some(taken)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    fn u16(&mut self) -> Option<u16> {
        self.number().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.number().map(u64::from_le_bytes)
    }

    fn text(&mut self) -> Option<&'a [u8]> {
        let len = self.u32()? as usize;
        self.take(len)
    }
}
