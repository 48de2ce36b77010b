//! Chunks that other programs compress with zstd.

use mcap::sans_io::decompressor::{DecompressResult, Decompressor};
use mcap::{McapError, McapResult};
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};
use std::io::Read;

/// Unpacks a chunk whose bytes all are there from the first call on. A block at a time: what is damaged may be of any length.
pub(crate) struct Zstd(FrameDecoder);

impl Zstd {
    /// Takes no frame that wants to look back over more than so many bytes.
    pub(crate) fn with_window(bytes: u64) -> Self {
        let mut decoder = FrameDecoder::new();
        decoder.set_max_window_size(bytes);
        Self(decoder)
    }

    /// Unpacks the block that `packed` begins with, or reads the head of the next frame.
    fn go_on(&mut self, packed: &mut &[u8]) -> Result<(), FrameDecoderError> {
        if !self.0.is_finished() {
            let one = BlockDecodingStrategy::UptoBlocks(1);
            return self.0.decode_blocks(packed, one).map(drop);
        }
        match self.0.init(&mut *packed) {
            Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame {
                length, ..
            })) => {
                let rest = packed.get(length as usize..);
                *packed = rest.ok_or(FrameDecoderError::FailedToSkipFrame)?;
                Ok(())
            }
            begun => begun,
        }
    }
}

impl Decompressor for Zstd {
    fn next_read_size(&self) -> usize {
        0
    }

    fn decompress(&mut self, packed: &[u8], plain: &mut [u8]) -> McapResult<DecompressResult> {
        let mut rest = packed;
        if self.0.can_collect() == 0 {
            let done = self.go_on(&mut rest);
            done.map_err(|error| McapError::DecompressionError(error.to_string()))?;
        }
        Ok(DecompressResult {
            consumed: packed.len() - rest.len(),
            wrote: self.0.read(plain)?,
        })
    }

    fn reset(&mut self) -> McapResult<()> {
        *self = Self::with_window(self.0.max_window_size());
        Ok(())
    }

    fn name(&self) -> &'static str {
        "zstd"
    }
}
