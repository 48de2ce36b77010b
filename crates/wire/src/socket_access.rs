//! Who may open a socket that this user may not, and how to become one of them.

use nix::unistd::{Gid, Group, Uid, User};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// What permissions call it, where a socket is written to.
const WRITE: u32 = 0o2;
/// And where a folder is passed through.
const SEARCH: u32 = 0o1;

/// Who may open a socket that was denied, as a clause: the group and the command that joins it, or that its owner is
/// alone. Where the socket cannot be seen, the folder that hides it is meant.
pub fn who_may_open(socket: &Path) -> String {
    let Some((path, denied)) = socket
        .ancestors()
        .find_map(|path| Some((path, fs::metadata(path).ok()?)))
    else {
        return "a folder above it is closed".into();
    };
    let what = match path == socket {
        true => "it".into(),
        false => path.display().to_string(),
    };
    let needed = if path == socket { WRITE } else { SEARCH };
    let (uid, gid) = (denied.uid(), denied.gid());
    let group = Group::from_gid(Gid::from_raw(gid)).ok().flatten();
    match group {
        // Nobody is to join root's group for a socket.
        Some(group) if gid != 0 && denied.mode() >> 3 & needed != 0 => format!(
            "the group {0} may open {what}: `sudo adduser $USER {0}`, then log in anew",
            group.name
        ),
        _ => {
            let owner = User::from_uid(Uid::from_raw(uid)).ok().flatten();
            let owner = owner.map_or(format!("user {uid}"), |owner| owner.name);
            format!("{owner} alone may open {what}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::{PermissionsExt, chown};
    use std::os::unix::net::UnixListener;

    #[test]
    fn the_group_to_join_is_named_where_a_group_may() {
        let dir = tempfile::tempdir().unwrap();
        let socket = dir.path().join("images.sock");
        let _listener = UnixListener::bind(&socket).unwrap();
        let mode = |mode| fs::set_permissions(&socket, fs::Permissions::from_mode(mode)).unwrap();
        let owner = User::from_uid(Uid::current()).unwrap().unwrap().name;
        mode(0o600);
        assert_eq!(who_may_open(&socket), format!("{owner} alone may open it"));
        // Only root may give it away.
        let dialout = Group::from_name("dialout").ok().flatten();
        let Some(group) = dialout.filter(|group| chown(&socket, None, Some(group.gid.as_raw())).is_ok())
        else {
            return;
        };
        assert_eq!(who_may_open(&socket), format!("{owner} alone may open it"));
        mode(0o660);
        assert_eq!(
            who_may_open(&socket),
            format!(
                "the group {0} may open it: `sudo adduser $USER {0}`, then log in anew",
                group.name
            )
        );
    }

    #[test]
    fn nobody_is_told_to_join_the_group_of_root() {
        let told = who_may_open(Path::new("/none/images.sock"));
        assert_eq!(told, "root alone may open /");
    }
}
