//! Whether a socket path could be had, as far as that can be told without making anything.

use super::{SocketPathError, group_id, refuse_other_files};
use nix::errno::Errno;
use nix::unistd::{AccessFlags, Gid, access, getegid, geteuid, getgroups};
use std::path::Path;
use taxel_wire::check_socket_folder;

/// Refuses a socket path that this user could not have, now or later: for its folder, or for what is there.
///
/// # Errors
/// That of [`super::SocketPath::take`].
pub fn check_socket_path(path: &Path) -> Result<(), SocketPathError> {
    check_socket_folder(path)?;
    let folder_of = |path: &Path| match path.parent() {
        Some(folder) if folder.as_os_str().is_empty() => Path::new(".").to_owned(),
        Some(folder) => folder.to_owned(),
        None => path.to_owned(),
    };
    // What would be made first: the file, or the topmost of its folders that is missing.
    let (mut first, mut folder) = (path.to_owned(), folder_of(path));
    while !folder.exists() && folder.parent().is_some() {
        (first, folder) = (folder.clone(), folder_of(&folder));
    }
    let allowed = match folder.is_dir() {
        true => access(&folder, AccessFlags::W_OK | AccessFlags::X_OK),
        false => Err(Errno::ENOTDIR),
    };
    allowed.map_err(|errno| SocketPathError::making(&first, errno.into()))?;
    refuse_other_files(path).map(drop)
}

/// Refuses a group that this machine does not know, or that this user may give nothing to; the empty name is that
/// of the program's own.
///
/// # Errors
/// That of [`super::SocketPath::take`] or of [`super::SocketPath::bind`].
pub fn check_group(path: &Path, name: &str) -> Result<(), SocketPathError> {
    let Some(group) = group_id(name)? else {
        return Ok(());
    };
    let own: Vec<Gid> = getgroups().unwrap_or_default();
    match geteuid().is_root() || group == getegid() || own.contains(&group) {
        true => Ok(()),
        false => Err(SocketPathError::GroupNotOurs {
            path: path.into(),
            group: name.into(),
        }),
    }
}
