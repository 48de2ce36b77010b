//! Whether the folder of a socket can be trusted.
//!
//! Where a user has no runtime directory, taxeld's sockets are in `/tmp/taxeld-UID`. In `/tmp` anybody may have made
//! that folder first; a display that follows a socket in it would then be moved by somebody else.

use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use taxel_hand::shell_word;

/// Why a folder `/tmp/taxeld-UID` is not to be trusted. The message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum UntrustedFolder {
    /// A link, or a file.
    #[error("{} is not a folder but something else put there in its place; {WHAT_TO_DO}", .0.display())]
    NotAFolder(PathBuf),
    /// Another user's.
    #[error("{} belongs to user {owner}, who can put a socket of his own there; {WHAT_TO_DO}", folder.display())]
    Owner {
        /// The folder.
        folder: PathBuf,
        /// Whose it is.
        owner: u32,
    },
    /// Others may write.
    #[error(
        "{} can be written by others (mode {mode:04o}), who can put a socket of their own there; `chmod 0755 {}`, if \
         what is in it is yours",
        folder.display(), shell_word(folder.display())
    )]
    Writable {
        /// The folder.
        folder: PathBuf,
        /// Its mode.
        mode: u32,
    },
    /// It cannot be looked at.
    #[error("cannot look at {}: {error}", folder.display())]
    Io {
        /// The folder.
        folder: PathBuf,
        /// What the system said.
        error: io::Error,
    },
}

const WHAT_TO_DO: &str =
    "have it removed, set XDG_RUNTIME_DIR to a folder of your own, or choose other socket paths";

/// Refuses a socket in a folder `/tmp/taxeld-UID` that is not a real folder of user UID which nobody else may write.
/// Other folders, and one that is not there, are not looked at.
pub fn check_socket_folder(socket: &Path) -> Result<(), UntrustedFolder> {
    let Some(folder) = socket.parent().filter(|f| f.parent() == Some(Path::new("/tmp"))) else {
        return Ok(());
    };
    let name = folder.file_name().and_then(|name| name.to_str());
    match name.and_then(|name| name.strip_prefix("taxeld-")?.parse().ok()) {
        Some(uid) => check(folder, uid),
        None => Ok(()),
    }
}

fn check(folder: &Path, uid: u32) -> Result<(), UntrustedFolder> {
    let found = match fs::symlink_metadata(folder) {
        Ok(found) => found,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => {
            let folder = folder.to_owned();
            return Err(UntrustedFolder::Io { folder, error });
        }
    };
    let folder = folder.to_owned();
    let mode = found.mode() & 0o7777;
    match () {
        _ if !found.is_dir() => Err(UntrustedFolder::NotAFolder(folder)),
        _ if found.uid() != uid => Err(UntrustedFolder::Owner {
            folder,
            owner: found.uid(),
        }),
        _ if mode & 0o022 != 0 => Err(UntrustedFolder::Writable { folder, mode }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn only_a_real_folder_of_that_user_which_nobody_else_may_write_is_trusted() {
        let dir = tempfile::tempdir().unwrap();
        let uid = fs::metadata(dir.path()).unwrap().uid();
        let folder = dir.path().join("taxeld");
        check(&folder, uid).unwrap();

        fs::create_dir(&folder).unwrap();
        for (mode, trusted) in [
            (0o700, true),
            (0o755, true),
            (0o775, false),
            (0o757, false),
            (0o1777, false),
        ] {
            fs::set_permissions(&folder, fs::Permissions::from_mode(mode)).unwrap();
            assert_eq!(check(&folder, uid).is_ok(), trusted, "{mode:o}");
        }
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o700)).unwrap();
        let error = check(&folder, uid + 1).unwrap_err();
        assert!(
            matches!(error, UntrustedFolder::Owner { owner, .. } if owner == uid),
            "{error}"
        );

        let link = dir.path().join("link");
        std::os::unix::fs::symlink(&folder, &link).unwrap();
        let error = check(&link, uid).unwrap_err();
        assert!(matches!(error, UntrustedFolder::NotAFolder(_)), "{error}");
    }

    #[test]
    fn the_folder_of_a_user_is_known_by_its_name() {
        // A user that no machine has, so that nobody owns it rightly.
        let uid = u32::MAX - 7;
        let folder = PathBuf::from(format!("/tmp/taxeld-{uid}"));
        let socket = folder.join("images.sock");
        check_socket_folder(&socket).unwrap();
        fs::create_dir(&folder).unwrap();
        let refused = check_socket_folder(&socket);
        fs::remove_dir(&folder).unwrap();
        assert!(
            matches!(refused, Err(UntrustedFolder::Owner { .. })),
            "{refused:?}"
        );
        for elsewhere in [
            "images.sock",
            "/run/taxeld/images.sock",
            "/tmp/taxeld-mine/images.sock",
        ] {
            check_socket_folder(Path::new(elsewhere)).unwrap();
        }
    }
}
