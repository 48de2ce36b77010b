//! Arrays out to numpy's `.npy` and `.npz`.

use crate::error::RecordError;
use crate::npy_header::Header;
use crate::spool::{Column, spool_beside};
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;
use tempfile::SpooledTempFile;
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
    let mut out = BufWriter::new(out);
    write_header::<T>(&mut out, shape)?;
    let mut written = 0;
    for number in numbers {
        number.write(&mut out)?;
        written += 1;
    }
    assert_eq!(written, shape.iter().product::<usize>(), "numbers of {shape:?}");
    out.flush()
}

/// The same of numbers that were put aside.
pub(crate) fn write_column<T: Number>(
    mut out: impl Write,
    shape: &[usize],
    numbers: &mut Column<T>,
) -> io::Result<()> {
    assert_eq!(
        numbers.len(),
        shape.iter().product::<usize>(),
        "numbers of {shape:?}"
    );
    write_header::<T>(&mut out, shape)?;
    io::copy(numbers.bytes()?, &mut out)?;
    out.flush()
}

fn write_header<T: Number>(out: &mut impl Write, shape: &[usize]) -> io::Result<()> {
    let header = Header {
        descriptor: Some(T::DESCRIPTOR.into()),
        fortran_order: false,
        shape: shape.to_vec(),
    };
    out.write_all(&header.to_bytes())
}

/// An array of more bytes may have 4 GiB in the archive, compressed or not.
const LARGE: usize = 0xF000_0000;

/// Writes an `.npz`, array by array, of any size. It is put aside until it is complete.
pub struct NpzWriter<'a> {
    path: &'a Path,
    zip: ZipWriter<Aside>,
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
            zip: ZipWriter::new(Aside::beside(path)),
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
        self.add_file::<T>(name, shape, |zip| write_npy(zip, shape, numbers))
    }

    /// The same of numbers that were put aside.
    pub(crate) fn add_column<T: Number>(
        &mut self,
        name: &str,
        shape: &[usize],
        numbers: &mut Column<T>,
    ) -> Result<(), RecordError> {
        self.add_file::<T>(name, shape, |zip| write_column(zip, shape, numbers))
    }

    fn add_file<T: Number>(
        &mut self,
        name: &str,
        shape: &[usize],
        write: impl FnOnce(&mut ZipWriter<Aside>) -> io::Result<()>,
    ) -> Result<(), RecordError> {
        let bytes = shape.iter().product::<usize>().saturating_mul(size_of::<T>());
        // Not every reader of zip files knows the sizes of large ones.
        let options = self.options.large_file(bytes > LARGE);
        let begun = self.zip.start_file(format!("{name}.npy"), options);
        let written = begun.map_err(io::Error::from).and_then(|()| write(&mut self.zip));
        written.map_err(RecordError::io(self.path))
    }

    /// Writes the file.
    pub fn finish(self) -> Result<(), RecordError> {
        let aside = self.zip.finish().map_err(io::Error::from);
        let written = aside.and_then(|aside| {
            let mut spool = aside.spool.into_inner().map_err(io::IntoInnerError::into_error)?;
            spool.rewind()?;
            io::copy(&mut spool, &mut File::create(self.path)?)
        });
        written.map(drop).map_err(RecordError::io(self.path))
    }
}

/// A file on its way. What is written after a failure is nowhere: a writer of zip files that is given up writes its index all
/// the same, and where that fails, too, says so on stderr by itself, unasked.
struct Aside {
    spool: BufWriter<SpooledTempFile>,
    at: u64,
    len: u64,
    has_failed: bool,
}

impl Aside {
    fn beside(path: &Path) -> Self {
        Self {
            spool: BufWriter::with_capacity(1 << 16, spool_beside(path)),
            at: 0,
            len: 0,
            has_failed: false,
        }
    }

    fn unless_failed<T>(
        &mut self,
        act: impl FnOnce(&mut BufWriter<SpooledTempFile>) -> io::Result<T>,
        otherwise: T,
    ) -> io::Result<T> {
        match self.has_failed {
            true => Ok(otherwise),
            false => act(&mut self.spool).inspect_err(|_| self.has_failed = true),
        }
    }
}

impl Write for Aside {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.unless_failed(|spool| spool.write(bytes), bytes.len())?;
        self.at += written as u64;
        self.len = self.len.max(self.at);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.unless_failed(Write::flush, ())
    }
}

impl Seek for Aside {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::Current(by) => self.at.saturating_add_signed(by),
            SeekFrom::End(by) => self.len.saturating_add_signed(by),
        };
        self.at = self.unless_failed(|spool| spool.seek(SeekFrom::Start(at)), at)?;
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NumberArray;

    /// To write one takes minutes where nothing is optimized.
    #[test]
    fn there_is_room_for_the_sizes_of_an_array_of_more_than_four_gib() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("seq.npz");
        for begin in [NpzWriter::plain, NpzWriter::compressed] {
            let mut npz = begin(&path);
            npz.add_file::<u64>("seq", &[1 << 29], |zip| write_npy(zip, &[2], [7_u64, 9]))
                .unwrap();
            npz.finish().unwrap();
            let bytes = std::fs::read(&path).unwrap();
            // The version that is needed to read it, 4.5, and behind the name the extra field of two sizes of 8 bytes.
            assert_eq!((&bytes[..4], &bytes[4..6]), (&b"PK\x03\x04"[..], &[45, 0][..]));
            assert_eq!(bytes[30 + "seq.npy".len()..][..4], [1, 0, 16, 0]);
            let array = NumberArray::of_npz(&path, "seq").unwrap().unwrap();
            assert_eq!(array.values, [7.0, 9.0]);
        }
    }

    #[test]
    fn what_is_smaller_is_read_by_those_who_know_no_large_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("seq.npz");
        let mut npz = NpzWriter::plain(&path);
        npz.add("seq", &[2], [7_u64, 9]).unwrap();
        npz.finish().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let name = "seq.npy".len();
        let number = |at: usize, of: usize| {
            bytes[at..][..of]
                .iter()
                .rev()
                .fold(0, |n, b| n << 8 | usize::from(*b))
        };
        let array = number(18, 4);
        let entry = 30 + name + array;
        // Both sizes, the length of the name, and no extra field; in the index as before the array.
        assert_eq!((number(22, 4), number(26, 2), number(28, 2)), (array, name, 0));
        assert_eq!(&bytes[entry..][..4], b"PK\x01\x02");
        assert_eq!((number(entry + 20, 4), number(entry + 24, 4)), (array, array));
        assert_eq!((number(entry + 28, 2), number(entry + 30, 2)), (name, 0));
        assert_eq!(&bytes[entry + 46 + name..][..4], b"PK\x05\x06");
    }

    #[test]
    fn what_is_given_up_leaves_no_file_and_says_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("given-up.npz");
        let mut npz = NpzWriter::compressed(&path);
        npz.add("seq", &[1], [7_u64]).unwrap();
        npz.zip.start_file("half.npy", npz.options).unwrap();
        npz.zip.write_all(&[1; 100]).unwrap();
        drop(npz);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let mut aside = Aside::beside(&path);
        aside.write_all(&[1; 100]).unwrap();
        aside.has_failed = true;
        assert_eq!(aside.write(&[1; 50]).unwrap(), 50);
        assert_eq!(aside.seek(SeekFrom::Current(-1)).unwrap(), 149);
        assert_eq!(aside.seek(SeekFrom::End(0)).unwrap(), 150);
        assert_eq!(aside.spool.stream_position().unwrap(), 100);
    }
}
