//! Arrays out to numpy's `.npy` and `.npz`.

use super::npy_header::Header;
use super::number::Number;
use super::spool::{Column, Spool};
use crate::error::RecordError;
use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

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

/// The same of numbers that were put aside, which are there no longer then.
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
    out.flush()?;
    numbers.clear()
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

/// Writes an `.npz`, array by array, of any size: over the file that is there, or put aside until it is complete.
pub struct NpzWriter<'a> {
    path: &'a Path,
    zip: ZipWriter<Archive>,
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
            zip: ZipWriter::new(Archive::of(path)),
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

    /// The same of numbers that were put aside, which are there no longer then.
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
        write: impl FnOnce(&mut ZipWriter<Archive>) -> io::Result<()>,
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
        let archive = self.zip.finish().map_err(io::Error::from);
        let written = archive.and_then(|archive| {
            let mut bytes = archive
                .bytes
                .into_inner()
                .map_err(io::IntoInnerError::into_error)?;
            if archive.is_aside {
                bytes.rewind()?;
                io::copy(&mut bytes, &mut File::create(self.path)?)?;
            }
            Ok(())
        });
        written.map_err(RecordError::io(self.path))
    }
}

trait Storage: Read + Write + Seek + Send {}

impl<S: Read + Write + Seek + Send> Storage for S {}

/// A file on its way. What is written after a failure is nowhere: a writer of zip files that is given up writes its index all
/// the same, and where that fails, too, says so on stderr by itself, unasked.
struct Archive {
    bytes: BufWriter<Box<dyn Storage>>,
    is_aside: bool,
    at: u64,
    len: u64,
    has_failed: bool,
}

impl Archive {
    /// In the file that is there. What cannot be written out of order, such as a pipe, is put aside, and so is a file that is
    /// not there yet.
    fn of(path: &Path) -> Self {
        let is_file = fs::metadata(path).is_ok_and(|file| file.is_file());
        let file = is_file.then(|| File::options().write(true).truncate(true).open(path));
        let (bytes, is_aside): (Box<dyn Storage>, bool) = match file {
            Some(Ok(file)) => (Box::new(file), false),
            Some(Err(_)) | None => (Box::new(Spool::beside(path)), true),
        };
        Self {
            bytes: BufWriter::with_capacity(1 << 16, bytes),
            is_aside,
            at: 0,
            len: 0,
            has_failed: false,
        }
    }

    fn unless_failed<T>(
        &mut self,
        act: impl FnOnce(&mut BufWriter<Box<dyn Storage>>) -> io::Result<T>,
        otherwise: T,
    ) -> io::Result<T> {
        match self.has_failed {
            true => Ok(otherwise),
            false => act(&mut self.bytes).inspect_err(|_| self.has_failed = true),
        }
    }
}

impl Write for Archive {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.unless_failed(|out| out.write(bytes), bytes.len())?;
        self.at += written as u64;
        self.len = self.len.max(self.at);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.unless_failed(Write::flush, ())
    }
}

impl Seek for Archive {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::Current(by) => self.at.saturating_add_signed(by),
            SeekFrom::End(by) => self.len.saturating_add_signed(by),
        };
        self.at = self.unless_failed(|out| out.seek(SeekFrom::Start(at)), at)?;
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

    /// The disk has never more of it than the file and the arrays that are not in it yet.
    #[test]
    fn a_file_that_is_there_is_written_at_once_and_what_was_put_aside_for_it_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("seq.npz");
        fs::write(&path, [1; 100]).unwrap();
        let numbers = 1 << 18;
        let mut seq = Column::beside(&path);
        seq.extend(0..numbers as u64).unwrap();
        assert!(seq.is_on_disk());
        let mut npz = NpzWriter::plain(&path);
        npz.add_column("seq", &[numbers], &mut seq).unwrap();
        assert_eq!((seq.len(), seq.bytes_aside()), (0, 0));
        assert!(fs::metadata(&path).unwrap().len() > 8 * numbers as u64);
        npz.finish().unwrap();
        let array = NumberArray::of_npz(&path, "seq").unwrap().unwrap();
        assert!(array.values.into_iter().eq((0..numbers).map(|n| n as f64)));
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
        let mut aside = Archive::of(&path);
        aside.write_all(&[1; 100]).unwrap();
        aside.has_failed = true;
        assert_eq!(aside.write(&[1; 50]).unwrap(), 50);
        assert_eq!(aside.seek(SeekFrom::Current(-1)).unwrap(), 149);
        assert_eq!(aside.seek(SeekFrom::End(0)).unwrap(), 150);
        assert_eq!(aside.bytes.stream_position().unwrap(), 100);
    }
}
