//! Which file is at a path: ours, or another one of the same name.

use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// What tells a file from another one of the same name. No other file has it as long as this one is open, which a bound
/// socket keeps its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FileId {
    device: u64,
    inode: u64,
}

impl FileId {
    pub(super) fn of(file: &Metadata) -> Self {
        Self {
            device: file.dev(),
            inode: file.ino(),
        }
    }

    /// That of what is at the path; a link is not followed.
    pub(super) fn at(path: &Path) -> Option<Self> {
        Some(Self::of(&fs::symlink_metadata(path).ok()?))
    }

    /// Removes the file where it is still the one at the path. Whoever has cleared the folder may have let another
    /// daemon in, whose files have the same names.
    pub(super) fn remove_from(self, path: &Path) {
        if Self::at(path) == Some(self) {
            let _ = fs::remove_file(path);
        }
    }
}
