//! What is put aside until a file can be written: little in memory, more on the disk.

use super::number::Number;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use tempfile::SpooledTempFile;

/// Bytes that are put aside in memory.
const IN_MEMORY: usize = 1 << 20;

/// Bytes put aside for a file. On the disk they have no name: they are gone with the process, however it ends.
#[derive(Debug)]
pub(crate) struct Spool {
    bytes: SpooledTempFile,
    /// The folder for temporary files, where they are in that.
    elsewhere: Option<PathBuf>,
}

impl Spool {
    /// In the folder of the file. One of others may have a file of one's own in it; then in that for temporary files.
    pub(crate) fn beside(path: &Path) -> Self {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        match tempfile::tempfile_in(folder) {
            Ok(_) => Self {
                bytes: SpooledTempFile::new_in(IN_MEMORY, folder),
                elsewhere: None,
            },
            Err(_) => Self::elsewhere(std::env::temp_dir()),
        }
    }

    fn elsewhere(folder: PathBuf) -> Self {
        Self {
            bytes: SpooledTempFile::new_in(IN_MEMORY, &folder),
            elsewhere: Some(folder),
        }
    }

    /// Does something with the bytes. An error elsewhere says where, and is no longer one of the file.
    fn with<T>(&mut self, act: impl FnOnce(&mut SpooledTempFile) -> io::Result<T>) -> io::Result<T> {
        act(&mut self.bytes).map_err(|error| match &self.elsewhere {
            None => error,
            Some(folder) => {
                let told = format!("what waits for it in {} (TMPDIR): {error}", folder.display());
                io::Error::new(error.kind(), told)
            }
        })
    }
}

impl Read for Spool {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.with(|spool| spool.read(bytes))
    }
}

impl Write for Spool {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.with(|spool| spool.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.with(Write::flush)
    }
}

impl Seek for Spool {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.with(|spool| spool.seek(to))
    }
}

/// The numbers of an array, put aside one after another.
#[derive(Debug)]
pub(crate) struct Column<T> {
    spool: BufWriter<Spool>,
    len: usize,
    numbers: PhantomData<T>,
}

impl<T: Number> Column<T> {
    /// None yet, for a file of this name.
    pub(crate) fn beside(path: &Path) -> Self {
        Self {
            spool: BufWriter::new(Spool::beside(path)),
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
        self.spool.get_mut().with(|spool| spool.set_len(0))?;
        self.len = 0;
        Ok(())
    }

    #[cfg(test)]
    pub(crate) fn bytes_aside(&mut self) -> u64 {
        self.spool.seek(SeekFrom::End(0)).unwrap()
    }

    #[cfg(test)]
    pub(crate) fn is_on_disk(&self) -> bool {
        self.spool.get_ref().bytes.is_rolled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_for_temporary_files_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let none = folder.path().join("none");
        let mut spool = Spool::beside(&none.join("file.npz"));
        assert_eq!(spool.elsewhere, Some(std::env::temp_dir()));
        spool.write_all(&[1; IN_MEMORY]).unwrap();
        let mut spool = Spool::elsewhere(none.clone());
        let error = spool.write_all(&[1; IN_MEMORY + 1]).unwrap_err();
        let wanted = format!("what waits for it in {} (TMPDIR): No such file", none.display());
        assert!(error.to_string().starts_with(&wanted), "{error}");
    }
}
