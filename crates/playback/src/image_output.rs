//! Where compressed images go: a file, in the format its name tells.

use crate::image_line;
use crate::output_file::{OutputFile, create_stream};
use anyhow::{Context, bail};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use taxel_hand::{Profile, TactileImage};
use taxel_record::ImageStack;
use taxel_skin::Layout;
use taxel_wire::{Flags, Header, ImageView, encode_image_payload};

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
        let extension = path
            .extension()
            .and_then(|e| e.to_str())
            .unwrap_or("")
            .to_ascii_lowercase();
        Ok(match extension.as_str() {
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
    format: OutputFormat,
    file: Option<BufWriter<File>>,
    stack: ImageStack,
    payload: Vec<u8>,
}

impl ImageOutput {
    /// Creates the file of images of this hand for this display.
    pub fn create(
        path: &Path,
        format: OutputFormat,
        layout: &Layout,
        profile: &Profile,
    ) -> anyhow::Result<Self> {
        let whole = OutputFile::stream(path)?;
        let file = match format {
            OutputFormat::Jsonl | OutputFormat::Bin => {
                let file = create_stream(whole.path()).with_context(|| path.display().to_string())?;
                Some(BufWriter::new(file))
            }
            _ => None,
        };
        Ok(Self {
            whole,
            format,
            file,
            stack: ImageStack::new(
                layout.width,
                layout.height,
                profile.level_count(),
                profile.actuators,
            ),
            payload: Vec::new(),
        })
    }

    /// Writes an image; `more_flags` are those that the image does not tell itself.
    pub fn push(&mut self, image: &TactileImage, more_flags: Flags) -> anyhow::Result<()> {
        let Some(file) = &mut self.file else {
            self.stack.push(image);
            return Ok(());
        };
        // Both formats hold what a subscriber is given, so both are made from the message's bytes.
        encode_image_payload(image, &mut self.payload)?;
        let mut header = Header::of_image(image, self.payload.len());
        header.flags |= more_flags;
        let written = match self.format {
            OutputFormat::Bin => file
                .write_all(&header.to_bytes())
                .and_then(|()| file.write_all(&self.payload)),
            _ => {
                let view = ImageView::decode(&self.payload)?;
                writeln!(file, "{}", image_line::json(&header, &view, None))
            }
        };
        written.with_context(|| self.whole.path().display().to_string())
    }

    /// Writes what is left. Without it there is no file.
    pub fn finish(&mut self) -> anyhow::Result<()> {
        let path = self.whole.path();
        match self.format {
            OutputFormat::Npz => self.stack.write_npz(path)?,
            OutputFormat::Npy => self.stack.write_npy(path)?,
            OutputFormat::Csv => self.stack.write_csv(path)?,
            OutputFormat::Jsonl | OutputFormat::Bin => {
                let flushed = self.file.as_mut().map_or(Ok(()), Write::flush);
                flushed.with_context(|| path.display().to_string())?;
            }
        }
        self.whole.finish()
    }
}
