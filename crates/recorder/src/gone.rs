//! What others did to a file while it was recorded into.

use std::fmt;
use std::fs::File;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// A file that did not stay as it was recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Gone {
    /// As it was called.
    pub path: PathBuf,
    how: How,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum How {
    /// No file has its name.
    Moved,
    /// Another file has its name.
    Replaced,
    /// It has another length than what was written into it.
    Changed { bytes: u64, written: u64 },
}

impl Gone {
    /// Looks what became of `file`, which was made as `path` and has taken so many bytes; none where it is as it was, or the
    /// system does not say.
    pub(crate) fn look(path: &Path, file: &File, written: u64) -> Option<Self> {
        let bytes = file.metadata().ok()?.len();
        let how = match is_at(path, file) {
            Ok(true) if bytes == written => return None,
            Ok(true) => How::Changed { bytes, written },
            Ok(false) => How::Replaced,
            Err(error) if error.kind() == io::ErrorKind::NotFound => How::Moved,
            Err(_) => return None,
        };
        let path = path.into();
        Some(Self { path, how })
    }
}

/// Whether it is this file that has this name.
pub(crate) fn is_at(path: &Path, file: &File) -> io::Result<bool> {
    let (named, open) = (std::fs::metadata(path)?, file.metadata()?);
    Ok((named.dev(), named.ino()) == (open.dev(), open.ino()))
}

impl fmt::Display for Gone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path.display();
        match self.how {
            How::Moved => write!(
                f,
                "{path} was removed or renamed while it was recorded into: what came until then is in no file of that name"
            ),
            How::Replaced => write!(
                f,
                "{path} is now another file than the one that was recorded into, which was removed or renamed: what came \
                 until then is not in it"
            ),
            How::Changed { bytes, written } => write!(
                f,
                "{path} was changed by another program while it was recorded into: it has {bytes} bytes, and {written} \
                 were written; what came until then may not be readable"
            ),
        }
    }
}
