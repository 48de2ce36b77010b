//! Arrays out to numpy's `.npy` and `.npz`.

use crate::error::RecordError;
use crate::npy_header::Header;
use std::io::{self, BufWriter, Cursor, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// A number that arrays are written of.
pub trait Number: Copy {
    /// Its type, in numpy's notation.
    const DESCRIPTOR: &str;

    /// Writes its bytes, the least significant first.
    fn write(self, out: &mut impl Write) -> io::Result<()>;
}

macro_rules! number {
    ($($number:ident $descriptor:literal),*) => {$(
        impl Number for $number {
            const DESCRIPTOR: &str = $descriptor;

            #[inline]
            fn write(self, out: &mut impl Write) -> io::Result<()> {
                out.write_all(&self.to_le_bytes())
            }
        }
    )*};
}

impl Number for bool {
    const DESCRIPTOR: &str = "|b1";

    fn write(self, out: &mut impl Write) -> io::Result<()> {
        u8::from(self).write(out)
    }
}

number!(u8 "|u1", u16 "<u2", u64 "<u8", f32 "<f4", f64 "<f8");

/// Writes an `.npy`: numbers in the order of their indices, the last of which moves fastest.
///
/// # Panics
/// Where there are not as many numbers as the shape has.
pub fn write_npy<T: Number>(
    out: impl Write,
    shape: &[usize],
    numbers: impl IntoIterator<Item = T>,
) -> io::Result<()> {
    let header = Header {
        descriptor: Some(T::DESCRIPTOR.into()),
        fortran_order: false,
        shape: shape.to_vec(),
    };
    let mut out = BufWriter::new(out);
    out.write_all(&header.to_bytes())?;
    let mut written = 0;
    for number in numbers {
        number.write(&mut out)?;
        written += 1;
    }
    assert_eq!(written, shape.iter().product::<usize>(), "numbers of {shape:?}");
    out.flush()
}

/// Writes an `.npz`, array by array. It is in memory until it is complete: a writer of zip files that meets a full disk says
/// so on stderr by itself, unasked.
pub struct NpzWriter<'a> {
    path: &'a Path,
    zip: ZipWriter<Cursor<Vec<u8>>>,
    options: SimpleFileOptions,
}

impl<'a> NpzWriter<'a> {
    /// Arrays as they are.
    pub fn plain(path: &'a Path) -> Self {
        Self::with(path, CompressionMethod::Stored)
    }

    /// Arrays that are compressed.
    pub fn compressed(path: &'a Path) -> Self {
        Self::with(path, CompressionMethod::Deflated)
    }

    fn with(path: &'a Path, method: CompressionMethod) -> Self {
        Self {
            path,
            zip: ZipWriter::new(Cursor::default()),
            options: SimpleFileOptions::default().compression_method(method),
        }
    }

    /// Adds an array, as [`write_npy`] does.
    ///
    /// # Panics
    /// Where there are not as many numbers as the shape has.
    pub fn add<T: Number>(
        &mut self,
        name: &str,
        shape: &[usize],
        numbers: impl IntoIterator<Item = T>,
    ) -> Result<(), RecordError> {
        let begun = self.zip.start_file(format!("{name}.npy"), self.options);
        let written = begun
            .map_err(io::Error::from)
            .and_then(|()| write_npy(&mut self.zip, shape, numbers));
        written.map_err(RecordError::io(self.path))
    }

    /// Writes the file.
    pub fn finish(self) -> Result<(), RecordError> {
        let bytes = self.zip.finish().map_err(io::Error::from);
        let written = bytes.and_then(|bytes| std::fs::write(self.path, bytes.into_inner()));
        written.map_err(RecordError::io(self.path))
    }
}
