//! The tables `[socket]` and `[control]`: where the daemon's sockets are, and who may use them.

use crate::within;
use nix::unistd::AccessFlags;
use serde::{Deserialize, Serialize};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Where subscribers connect, and who may.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SocketConfig {
    /// Path of the socket that carries tactile images (`SOCK_SEQPACKET`).
    pub images: PathBuf,
    /// Path of the control socket (newline JSON), for those who may change something.
    pub control: PathBuf,
    /// Path of the socket that answers what changes nothing (newline JSON); empty: `status.sock` beside `control`.
    pub status: PathBuf,
    /// Permissions of the sockets for images and status, octal.
    pub mode: String,
    /// Group that owns them; empty keeps the daemon's own.
    pub group: String,
    /// Most subscribers at once, 1 to 4096.
    pub max_subscribers: u16,
    /// A subscriber that takes nothing for this long is disconnected, 100 to 60,000 ms.
    pub stall_ms: u32,
}

/// Who may change something: re-zero, pause, replace the display profile, mark, move a servo.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControlConfig {
    /// Permissions of the control socket, octal.
    pub mode: String,
    /// Group that owns it; empty keeps the daemon's own.
    pub group: String,
}

impl Default for SocketConfig {
    fn default() -> Self {
        Self {
            images: default_directory().join("images.sock"),
            control: default_directory().join("control.sock"),
            status: PathBuf::new(),
            mode: "0660".into(),
            group: String::new(),
            max_subscribers: 128,
            stall_ms: 5000,
        }
    }
}

impl Default for ControlConfig {
    fn default() -> Self {
        Self {
            mode: "0600".into(),
            group: String::new(),
        }
    }
}

/// Refuses a path that no Unix socket can have.
pub(crate) fn check_path(path: &Path) -> Result<(), String> {
    // sockaddr_un holds 108 bytes with the closing zero; the lock file's path is not bound by it.
    match path.as_os_str().len() {
        1..=107 => Ok(()),
        len => Err(format!(
            "socket path {} has {len} bytes; a Unix socket path has 1 to 107",
            path.display()
        )),
    }
}

impl SocketConfig {
    pub(crate) fn check(&self) -> Result<(), String> {
        self.mode_bits()?;
        within("socket.", "max_subscribers", self.max_subscribers, 1.0..=4096.0)?;
        within("socket.", "stall_ms", self.stall_ms, 100.0..=60_000.0)?;
        let status = self.status_path();
        let paths = [
            ("images", &self.images),
            ("control", &self.control),
            ("status", &status),
        ];
        for (_, path) in &paths {
            check_path(path)?;
        }
        for (i, (key, path)) in paths.iter().enumerate() {
            if let Some((other, _)) = paths[..i].iter().find(|(_, other)| other == path) {
                return Err(format!(
                    "socket.{other} and socket.{key} are both {}",
                    path.display()
                ));
            }
        }
        Ok(())
    }

    /// Where the socket is that answers what changes nothing.
    pub fn status_path(&self) -> PathBuf {
        match self.status.as_os_str().is_empty() {
            true => self.control.with_file_name("status.sock"),
            false => self.status.clone(),
        }
    }

    /// Permissions as bits.
    pub fn mode_bits(&self) -> Result<u32, String> {
        octal("socket", &self.mode)
    }
}

impl ControlConfig {
    /// Permissions as bits.
    pub fn mode_bits(&self) -> Result<u32, String> {
        octal("control", &self.mode)
    }
}

fn octal(table: &str, mode: &str) -> Result<u32, String> {
    match u32::from_str_radix(mode, 8) {
        Ok(bits) if bits <= 0o777 => Ok(bits),
        _ => Err(format!(
            "{table}.mode = \"{mode}\" is not an octal mode such as \"0660\""
        )),
    }
}

/// Where the sockets of root's daemon and of the service are, which systemd gives that folder.
const SYSTEM_DIRECTORY: &str = "/run/taxeld";

/// Where the daemon's sockets are unless the configuration says otherwise: `/run/taxeld` for root and where that folder
/// is this user's to write to, else `taxeld` in the user's own runtime directory, else `/tmp/taxeld-UID`.
///
/// In a service it is the folder that systemd has made for it (`RuntimeDirectory=`).
fn default_directory() -> PathBuf {
    if let Some(told) = told_directory() {
        return told;
    }
    let is_ours = || nix::unistd::access(SYSTEM_DIRECTORY, AccessFlags::W_OK).is_ok();
    if nix::unistd::geteuid().is_root() || is_ours() {
        return SYSTEM_DIRECTORY.into();
    }
    match std::env::var_os("XDG_RUNTIME_DIR") {
        // The standard has it ignored where it is relative: it would be another folder for each program.
        Some(dir) if Path::new(&dir).is_absolute() => PathBuf::from(dir).join("taxeld"),
        _ => PathBuf::from(format!("/tmp/taxeld-{}", nix::unistd::getuid())),
    }
}

/// The folder that a service was told is that of its daemon's sockets, such as `/run/taxeld-left` for one of several hands.
fn told_directory() -> Option<PathBuf> {
    let told = std::env::var_os("RUNTIME_DIRECTORY").filter(|told| !told.is_empty())?;
    // A service with several has them in one variable.
    Some(
        told.to_string_lossy()
            .split(':')
            .next()
            .unwrap_or_default()
            .into(),
    )
}

/// The socket of this name, such as `images.sock`, of the daemon that this user has started, or else of the system's. Of a
/// service (`RUNTIME_DIRECTORY`) it is its own daemon's also while that is down: the system's is another hand.
pub fn running_socket(name: &str) -> PathBuf {
    let system = Path::new(SYSTEM_DIRECTORY);
    running_in(&default_directory(), told_directory().is_some(), system, name)
}

/// The socket in a daemon's own folder, or in the system's where it is not there, unless the former was told.
fn running_in(own: &Path, is_told: bool, system: &Path, name: &str) -> PathBuf {
    let socket = own.join(name);
    match is_told || socket.exists() || !system.is_dir() {
        true => socket,
        false => system.join(name),
    }
}

/// The sockets of the same name of other hands on this machine, each of which has a daemon of its own (`taxeld@left` in
/// `/run/taxeld-left`), and what these hands are called; in that order. None where the socket is in none of the folders
/// where it is looked for unless it is named. A daemon that has ended may have left its socket behind.
pub fn other_hands(socket: &Path) -> Vec<(String, PathBuf)> {
    let (Some(folder), Some(name)) = (socket.parent(), socket.file_name()) else {
        return Vec::new();
    };
    let system = Path::new(SYSTEM_DIRECTORY);
    let mut folders = match folder == system || folder == default_directory() {
        true => vec![folder],
        false => return Vec::new(),
    };
    if folder != system && told_directory().is_none() {
        folders.push(system);
    }
    let mut hands: Vec<_> = folders.into_iter().flat_map(folders_of_hands).collect();
    hands.sort();
    let socket = |(hand, folder): (String, PathBuf)| (hand, folder.join(name));
    hands.into_iter().map(socket).collect()
}

/// The folders of several hands beside `taxeld`. Beside one of another name there are none: it is one hand's itself, as that
/// of `taxel-record@left`, or one of several users'.
fn folders_of_hands(folder: &Path) -> Vec<(String, PathBuf)> {
    let beside = folder
        .parent()
        .filter(|_| folder.file_name() == Some(OsStr::new("taxeld")));
    let entries = beside.and_then(|beside| std::fs::read_dir(beside).ok());
    let hand = |entry: std::fs::DirEntry| {
        let name = entry.file_name().into_string().ok()?;
        let hand = name.strip_prefix("taxeld-").filter(|hand| !hand.is_empty())?;
        Some((hand.to_owned(), entry.path()))
    };
    entries.into_iter().flatten().flatten().filter_map(hand).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_daemon_of_a_service_is_never_the_one_of_another_hand() {
        let folder = tempfile::tempdir().unwrap();
        let [left, system] = ["taxeld-left", "taxeld"].map(|name| folder.path().join(name));
        for folder in [&left, &system] {
            std::fs::create_dir(folder).unwrap();
        }
        let running = |is_told| running_in(&left, is_told, &system, "images.sock");
        let [own, other] = [&left, &system].map(|folder| folder.join("images.sock"));
        // The left hand's daemon is down, and the other one runs.
        std::fs::write(&other, "").unwrap();
        assert_eq!(running(true), own);
        // A user who has started none is shown the system's.
        assert_eq!(running(false), other);
        std::fs::write(&own, "").unwrap();
        assert_eq!([running(true), running(false)], [own.clone(), own]);
    }
}
