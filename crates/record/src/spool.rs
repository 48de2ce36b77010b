//! What is put aside until a file can be written: little in memory, more on the disk.

use crate::npz_writer::Number;
use std::io::{self, BufWriter, Read, Seek};
use std::marker::PhantomData;
use std::path::Path;
use tempfile::SpooledTempFile;

/// Bytes that are put aside in memory.
const IN_MEMORY: usize = 1 << 20;

/// Bytes put aside for a file. On the disk they have no name: they are gone with the process, however it ends.
pub(crate) fn spool_beside(path: &Path) -> SpooledTempFile {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    // A folder of others may have a file of one's own in it.
    match tempfile::tempfile_in(folder) {
        Ok(_) => SpooledTempFile::new_in(IN_MEMORY, folder),
        Err(_) => SpooledTempFile::new(IN_MEMORY),
    }
}

/// The numbers of an array, put aside one after another.
#[derive(Debug)]
pub(crate) struct Column<T> {
    spool: BufWriter<SpooledTempFile>,
    len: usize,
    numbers: PhantomData<T>,
}

impl<T: Number> Column<T> {
    /// None yet, for a file of this name.
    pub(crate) fn beside(path: &Path) -> Self {
        Self {
            spool: BufWriter::new(spool_beside(path)),
            len: 0,
            numbers: PhantomData,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn extend(&mut self, numbers: impl IntoIterator<Item = T>) -> io::Result<()> {
        for number in numbers {
            number.write(&mut self.spool)?;
            self.len += 1;
        }
        Ok(())
    }

    /// All of their bytes, the least significant of each number first.
    pub(crate) fn bytes(&mut self) -> io::Result<&mut impl Read> {
        self.spool.rewind()?;
        Ok(self.spool.get_mut())
    }

    /// Gives back what they take of the disk.
    pub(crate) fn clear(&mut self) -> io::Result<()> {
        self.spool.rewind()?;
        self.spool.get_mut().set_len(0)?;
        self.len = 0;
        Ok(())
    }

    #[cfg(test)]
    pub(crate) fn bytes_aside(&mut self) -> u64 {
        self.spool.seek(io::SeekFrom::End(0)).unwrap()
    }

    #[cfg(test)]
    pub(crate) fn is_on_disk(&self) -> bool {
        self.spool.get_ref().is_rolled()
    }
}
