//! A name that stays while the pseudo terminal behind it changes, as `/dev/serial/by-id` gives real adapters.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// A symbolic link to a terminal; removed when dropped, unless it leads elsewhere by then.
#[derive(Debug)]
pub struct StableLink {
    link: PathBuf,
    target: PathBuf,
}

impl StableLink {
    /// Makes the link, or turns one that is there to `target`. Anything there that is no link
    /// stays, and is an error.
    pub fn new(link: &Path, target: &Path) -> io::Result<Self> {
        match std::fs::symlink_metadata(link) {
            Ok(there) if !there.is_symlink() => return Err(ErrorKind::AlreadyExists.into()),
            _ => {}
        }
        // Made beside it and put in its place, so that the name is never gone.
        let mut beside = link.as_os_str().to_owned();
        beside.push(format!(".{}", std::process::id()));
        let _ = std::fs::remove_file(&beside);
        std::os::unix::fs::symlink(target, &beside)?;
        std::fs::rename(&beside, link).inspect_err(|_| {
            let _ = std::fs::remove_file(&beside);
        })?;
        Ok(Self {
            link: link.into(),
            target: target.into(),
        })
    }
}

impl Drop for StableLink {
    fn drop(&mut self) {
        if std::fs::read_link(&self.link).is_ok_and(|target| target == self.target) {
            let _ = std::fs::remove_file(&self.link);
        }
    }
}
