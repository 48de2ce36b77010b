//! Where compressed images go: a file, in the format its name tells.

use super::image_line;
use super::output_file::{OutputFile, create_stream};
use crate::mcap::recorded::ShownImages;
use anyhow::{Context, bail};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use taxel_hand::{Profile, TactileImage};
use taxel_record::{ImageStack, ImageTable, ending_of};
use taxel_skin::Layout;
use taxel_wire::{Header, ImageView, encode_image_payload};

/// What a file of images looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutputFormat {
    /// Images with everything about them.
    Npz,
    /// Images alone.
    Npy,
    /// Images alone, one a line.
    Csv,
    /// The objects of `taxel watch --json`.
    Jsonl,
    /// IMAGE messages as published.
    Bin,
}

impl OutputFormat {
    /// By the file's name; on stdout (`-`), JSON.
    pub fn of(path: &Path) -> anyhow::Result<Self> {
        if path.as_os_str() == "-" {
            return Ok(Self::Jsonl);
        }
        Ok(match ending_of(path).as_str() {
            "npz" => Self::Npz,
            "npy" => Self::Npy,
            "csv" => Self::Csv,
            "jsonl" => Self::Jsonl,
            "bin" => Self::Bin,
            _ => bail!("images are written as .npz, .npy, .csv, .jsonl or .bin, or as JSON lines to -"),
        })
    }
}

/// A file that images are written to, one after another.
#[derive(Debug)]
pub struct ImageOutput {
    whole: OutputFile,
    sink: Sink,
    payload: Vec<u8>,
}

#[derive(Debug)]
enum Sink {
    Npz(Box<ImageStack>),
    Npy(Box<ImageStack>),
    Csv(ImageTable<BufWriter<File>>),
    Jsonl(BufWriter<File>),
    Bin(BufWriter<File>),
}

impl ImageOutput {
    /// Creates the file of images of this hand for this display.
    pub fn create(
        path: &Path,
        format: OutputFormat,
        layout: &Layout,
        profile: &Profile,
    ) -> anyhow::Result<Self> {
        let shape = [layout.width, layout.height];
        let most = [profile.level_count(), profile.actuators];
        Self::of_shape(OutputFile::stream(path)?, format, shape, most)
    }

    /// Of images as they were shown.
    pub fn of_shown(whole: OutputFile, format: OutputFormat, shown: &ShownImages) -> anyhow::Result<Self> {
        let shape = shown
            .images
            .first()
            .map_or([0, 0], |image| [image.width, image.height]);
        Self::of_shape(whole, format, shape, [shown.levels, shown.actuators])
    }

    fn of_shape(
        whole: OutputFile,
        format: OutputFormat,
        [width, height]: [u16; 2],
        [levels, actuators]: [u16; 2],
    ) -> anyhow::Result<Self> {
        let path = whole.path();
        let stack = || Box::new(ImageStack::new(path, width, height, levels, actuators));
        let stream = || {
            let file = create_stream(path).with_context(|| path.display().to_string())?;
            anyhow::Ok(BufWriter::new(file))
        };
        let sink = match format {
            OutputFormat::Npz => Sink::Npz(stack()),
            OutputFormat::Npy => Sink::Npy(stack()),
            OutputFormat::Csv => Sink::Csv(ImageTable::new(stream()?, width, height)),
            OutputFormat::Jsonl => Sink::Jsonl(stream()?),
            OutputFormat::Bin => Sink::Bin(stream()?),
        };
        Ok(Self {
            whole,
            sink,
            payload: Vec::new(),
        })
    }

    /// Writes an image.
    pub fn push(&mut self, image: &TactileImage) -> anyhow::Result<()> {
        let written = match &mut self.sink {
            Sink::Npz(stack) | Sink::Npy(stack) => return Ok(stack.push(image)?),
            Sink::Csv(table) => table.push(image),
            Sink::Jsonl(file) => {
                let header = encode(image, &mut self.payload)?;
                let view = ImageView::decode(&self.payload)?;
                writeln!(file, "{}", image_line::json(&header, &view, None))
            }
            Sink::Bin(file) => {
                let header = encode(image, &mut self.payload)?;
                file.write_all(&header.to_bytes())
                    .and_then(|()| file.write_all(&self.payload))
            }
        };
        written.with_context(|| self.whole.path().display().to_string())
    }

    /// Writes what is left. Without it there is no file.
    pub fn finish(&mut self) -> anyhow::Result<()> {
        let written = match &mut self.sink {
            Sink::Npz(stack) => {
                stack.write_npz()?;
                Ok(())
            }
            Sink::Npy(stack) => {
                stack.write_npy()?;
                Ok(())
            }
            Sink::Csv(table) => table.finish(),
            Sink::Jsonl(file) | Sink::Bin(file) => file.flush(),
        };
        written.with_context(|| self.whole.path().display().to_string())?;
        self.whole.finish()
    }
}

/// What a subscriber is given, of which both formats are made.
fn encode(image: &TactileImage, payload: &mut Vec<u8>) -> anyhow::Result<Header> {
    encode_image_payload(image, payload)?;
    Ok(Header::of_image(image, payload.len()))
}
