//! CAN traffic into a file.

use super::frame_file::FrameFile;
use super::traffic::Traffic;
use crate::counts::array_frames::ArrayFrames;
use crate::counts::sweep::Sweeps;
use crate::output::output_file::create_stream;
use anyhow::Context;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use taxel_can::{LogWriter, Received};
use taxel_recorder::{CanBlock, Entry, Preamble, RecordingWriter, Topic};

/// Stops a copy by an error, asked from time to time.
pub type Check<'a> = dyn Fn() -> anyhow::Result<()> + 'a;

/// CAN frames between two such questions.
const CHECKED: u64 = 4096;

/// What a file of CAN traffic looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrafficFormat {
    /// Lines as candump writes them.
    Candump,
    /// A recording.
    Mcap,
}

impl TrafficFormat {
    /// By what a name ends with, in small letters.
    pub fn of_ending(ending: &str) -> Option<Self> {
        match ending {
            "log" => Some(Self::Candump),
            "mcap" => Some(Self::Mcap),
            _ => None,
        }
    }
}

/// A file of CAN traffic.
pub struct TrafficOutput {
    path: PathBuf,
    file: TrafficFile,
    frames: u64,
}

enum TrafficFile {
    Candump(LogWriter<BufWriter<File>>),
    Mcap {
        writer: Box<RecordingWriter<BufWriter<File>>>,
        block: CanBlock,
        names: Vec<String>,
        wall_ns: u64,
    },
}

impl TrafficOutput {
    /// A new file that `command` makes.
    pub fn create(path: &Path, format: TrafficFormat, command: &str) -> anyhow::Result<Self> {
        let file = TrafficFile::create(path, format, command);
        Ok(Self {
            path: path.into(),
            file: file.with_context(|| path.display().to_string())?,
            frames: 0,
        })
    }

    /// Writes all frames of a recording.
    pub fn take_traffic(&mut self, traffic: &Traffic, check: &Check<'_>) -> anyhow::Result<()> {
        let file = FrameFile::open(traffic, None)?;
        file.copy(&mut |name, wall_ns, received| self.put(name, wall_ns, received, check))
    }

    /// Writes what boards would have sent.
    pub fn take_sweeps(&mut self, sweeps: &Sweeps<'_>, check: &Check<'_>) -> anyhow::Result<()> {
        let buses = &sweeps.layout().buses;
        for (bus, received) in sweeps.frames() {
            self.put(&buses[usize::from(bus)], received.t_ns, &received, check)?;
        }
        Ok(())
    }

    /// Writes what pressure arrays would have sent.
    pub fn take_arrays(&mut self, arrays: &ArrayFrames<'_>, check: &Check<'_>) -> anyhow::Result<()> {
        let buses = &arrays.layout().buses;
        for (bus, received) in arrays.frames() {
            self.put(&buses[usize::from(bus)], received.t_ns, &received, check)?;
        }
        Ok(())
    }

    fn put(
        &mut self,
        name: &str,
        wall_ns: u64,
        received: &Received,
        check: &Check<'_>,
    ) -> anyhow::Result<()> {
        self.frames += 1;
        if self.frames.is_multiple_of(CHECKED) {
            check()?;
        }
        let written = self.file.put(name, wall_ns, received);
        written.with_context(|| self.path.display().to_string())
    }

    /// Writes what is left; returns how many frames there are.
    pub fn finish(self) -> anyhow::Result<u64> {
        let written = self.file.finish();
        written.with_context(|| self.path.display().to_string())?;
        Ok(self.frames)
    }
}

impl TrafficFile {
    fn create(path: &Path, format: TrafficFormat, command: &str) -> anyhow::Result<Self> {
        let file = create_stream(path)?;
        let file = BufWriter::with_capacity(1 << 20, file);
        if format == TrafficFormat::Candump {
            return Ok(Self::Candump(LogWriter::new(file)));
        }
        let recorder = format!("taxel {} {command}", env!("CARGO_PKG_VERSION"));
        let preamble = Preamble {
            facts: BTreeMap::from([("recorder".into(), recorder)]),
            attached: Vec::new(),
        };
        Ok(Self::Mcap {
            writer: Box::new(RecordingWriter::begin(file, &preamble, 0)?),
            block: CanBlock::default(),
            names: Vec::new(),
            wall_ns: 0,
        })
    }

    fn put(&mut self, name: &str, wall_ns: u64, received: &Received) -> anyhow::Result<()> {
        match self {
            Self::Candump(writer) => Ok(writer.write(wall_ns, name, &received.frame)?),
            Self::Mcap {
                writer,
                block,
                names,
                wall_ns: begins_ns,
            } => {
                let place = match names.iter().position(|known| known == name) {
                    Some(place) => place,
                    None => {
                        names.push(name.into());
                        names.len() - 1
                    }
                };
                let bus = u8::try_from(place).context("more than 256 buses")?;
                if block.is_empty() {
                    *begins_ns = wall_ns;
                }
                if !block.push(bus, received) {
                    put_block(writer, block, names, *begins_ns)?;
                    *begins_ns = wall_ns;
                    block.push(bus, received);
                }
                Ok(())
            }
        }
    }

    fn finish(self) -> anyhow::Result<()> {
        match self {
            Self::Candump(mut writer) => Ok(writer.flush()?),
            Self::Mcap {
                mut writer,
                mut block,
                names,
                wall_ns,
            } => {
                if !block.is_empty() {
                    put_block(&mut writer, &mut block, &names, wall_ns)?;
                }
                Ok((*writer).finish()?.flush()?)
            }
        }
    }
}

fn put_block(
    writer: &mut RecordingWriter<BufWriter<File>>,
    block: &mut CanBlock,
    names: &[String],
    wall_ns: u64,
) -> anyhow::Result<()> {
    let data = block.take(names, &vec![0; names.len()]);
    let topic = Topic::Can;
    Ok(writer.put(&Entry { topic, wall_ns, data })?)
}
