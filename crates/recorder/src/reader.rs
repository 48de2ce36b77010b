//! A recording out of a file.

use crate::schema::Topic;
use crate::writer::Attached;
use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Bytes of the longest record that is read.
const LONGEST: usize = 256 << 20;
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
                    look(opcode, data, &self.channels, &mut self.message)
                }
                Some(Err(error)) => Err(error),
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
                Err(error) if !self.begun => {
                    return Err(ReadError::NotMcap {
                        path: self.path.clone(),
                        problem: error.to_string(),
                    });
                }
                Err(error) => {
                    self.ended = true;
                    self.torn = Some(match error {
                        McapError::UnexpectedEof => "it ends in the middle".into(),
                        error => error.to_string(),
                    });
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

/// Takes a record; a message's bytes are put into `message`.
fn look(
    opcode: u8,
    data: &[u8],
    channels: &HashMap<u16, Topic>,
    message: &mut Vec<u8>,
) -> Result<Found, McapError> {
    if ![op::MESSAGE, op::CHANNEL, op::ATTACHMENT, op::DATA_END].contains(&opcode) {
        return Ok(Found::Other);
    }
    Ok(match mcap::parse_record(opcode, data)? {
        Record::Message { header, data } => match channels.get(&header.channel_id) {
            Some(topic) => {
                message.clear();
                message.extend_from_slice(&data);
                Found::Message(*topic, header.log_time)
            }
            None => Found::Other,
        },
        Record::Channel(channel) => {
            let topic = Topic::ALL.into_iter().find(|topic| topic.name() == channel.topic);
            Found::Channel(channel.id, topic.filter(|_| channel.message_encoding == "cdr"))
        }
        Record::Attachment { header, data, .. } => Found::Attached(Attached {
            name: header.name,
            media_type: header.media_type,
            data: data.into_owned(),
        }),
        Record::DataEnd(_) => Found::End,
        _ => Found::Other,
    })
}
