//! A recording on its way into a file.

use crate::schema::Topic;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Uncompressed bytes after which a chunk is written even before it is asked for.
const CHUNK: u64 = 256 << 10;

/// One message of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// What it is about.
    pub topic: Topic,
    /// When it was valid, nanoseconds of the wall clock since 1970.
    pub wall_ns: u64,
    /// The message, CDR.
    pub data: Vec<u8>,
}

impl Entry {
    /// The same message by a wall clock that was set so far.
    pub(crate) fn moved(self, moved_ns: i64) -> Self {
        let wall_ns = self.wall_ns.saturating_add_signed(moved_ns);
        Self { wall_ns, ..self }
    }
}

/// A file that a recording is made with: its name there, its kind (a MIME type), its content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attached {
    /// Such as `taxeld.toml`.
    pub name: String,
    /// Such as `application/toml`.
    pub media_type: String,
    /// The bytes.
    pub data: Vec<u8>,
}

/// What stands at the beginning of every file of a recording.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct Preamble {
    /// What made it, and when: names and values.
    pub facts: BTreeMap<String, String>,
    /// Configuration and layout.
    pub attached: Vec<Attached>,
}

/// A recording on its way into `W`. What was cut is there; what came after that is not yet.
pub struct RecordingWriter<W: Write + Seek> {
    writer: Option<Writer<Counting<W>>>,
    channels: [Option<u16>; Topic::ALL.len()],
    sequence: u32,
    messages: u64,
    bytes: Arc<AtomicU64>,
}

impl<W: Write + Seek> RecordingWriter<W> {
    /// Begins a recording at the start of `output`.
    pub fn begin(output: W, preamble: &Preamble, wall_ns: u64) -> io::Result<Self> {
        let bytes = Arc::new(AtomicU64::new(0));
        let options = WriteOptions::new()
            .compression(Some(Compression::Lz4))
            .profile("ros2")
            .library(concat!("taxel ", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(CHUNK))
            // Chunks come into the file whole.
            .disable_seeking(true);
        let mut writer = options
            .create(Counting {
                inner: output,
                at: Arc::clone(&bytes),
            })
            .map_err(io_error)?;
        let metadata = Metadata {
            name: "taxel".into(),
            metadata: preamble.facts.clone(),
        };
        writer.write_metadata(&metadata).map_err(io_error)?;
        for attached in &preamble.attached {
            let attachment = Attachment {
                log_time: wall_ns,
                create_time: wall_ns,
                name: attached.name.clone(),
                media_type: attached.media_type.clone(),
                data: attached.data.as_slice().into(),
            };
            writer.attach(&attachment).map_err(io_error)?;
        }
        Ok(Self {
            writer: Some(writer),
            channels: [None; Topic::ALL.len()],
            sequence: 0,
            messages: 0,
            bytes,
        })
    }

    /// Adds a message.
    pub fn put(&mut self, entry: &Entry) -> io::Result<()> {
        let place = Topic::ALL
            .iter()
            .position(|topic| *topic == entry.topic)
            .unwrap_or(0);
        let writer = self.writer.as_mut().ok_or_else(ended)?;
        let channel_id = match self.channels[place] {
            Some(channel) => channel,
            None => *self.channels[place].insert(add_channel(writer, entry.topic).map_err(io_error)?),
        };
        let header = MessageHeader {
            channel_id,
            sequence: self.sequence,
            log_time: entry.wall_ns,
            publish_time: entry.wall_ns,
        };
        self.sequence = self.sequence.wrapping_add(1);
        self.messages += 1;
        writer
            .write_to_known_channel(&header, &entry.data)
            .map_err(io_error)
    }

    /// Writes everything that came so far: after a crash it can be read.
    pub fn cut(&mut self) -> io::Result<()> {
        self.writer.as_mut().ok_or_else(ended)?.flush().map_err(io_error)
    }

    /// Number of messages.
    pub fn messages(&self) -> u64 {
        self.messages
    }

    /// Bytes that the output has taken.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Writes what is left and the index, and gives the output back.
    pub fn finish(mut self) -> io::Result<W> {
        let mut writer = self.writer.take().ok_or_else(ended)?;
        writer.finish().map_err(io_error)?;
        Ok(writer.into_inner().inner)
    }

    /// Gives the output back as it is, after a failure.
    pub fn give_up(mut self) -> Option<W> {
        self.writer.take().map(|writer| writer.into_inner().inner)
    }
}

impl<W: Write + Seek> std::fmt::Debug for RecordingWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RecordingWriter")
            .field("messages", &self.messages)
            .finish_non_exhaustive()
    }
}

fn ended() -> io::Error {
    io::Error::other("the recording has ended")
}

fn add_channel<W: Write + Seek>(writer: &mut Writer<W>, topic: Topic) -> Result<u16, McapError> {
    let schema = topic.schema();
    let schema_id = writer.add_schema(schema.type_name, "ros2msg", schema.text.as_bytes())?;
    writer.add_channel(schema_id, schema.topic, "cdr", &BTreeMap::new())
}

/// The system's own words where it failed.
fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// Knows its place without asking the system, so that anything that bytes can be written to will do.
struct Counting<W> {
    inner: W,
    at: Arc<AtomicU64>,
}

impl<W: Write> Write for Counting<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.at.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<W: Seek> Seek for Counting<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        if to == SeekFrom::Current(0) {
            return Ok(self.at.load(Ordering::Relaxed));
        }
        let at = self.inner.seek(to)?;
        self.at.store(at, Ordering::Relaxed);
        Ok(at)
    }
}
