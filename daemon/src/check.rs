//! Whether a daemon could start, as far as that can be told beforehand.

use crate::image_maker::check_profile;
use crate::{Config, SocketPathError, StartError, sources};
use nix::unistd::Group;
use std::path::{Path, PathBuf};
use taxel_config::line_of;
use taxel_engine::Engine;
use taxel_serve::{check_group, check_socket_path};

/// The service's user, and its folder in `/run`.
const SERVICE: &str = "taxeld";

/// Whether a daemon could start on this machine, as far as that can be told without its buses: where its sockets
/// are to be and whose, recordings, scenes, and what hand and display ask of each other. `text` is that of the
/// configuration, in `file`, to tell the line.
pub fn check(config: &Config, text: &str, file: &Path) -> Result<(), StartError> {
    let at = |table, names: &str, error: StartError| match line_of(text, table, names) {
        Some(line) => StartError::At {
            file: file.display().to_string(),
            line,
            error: error.into(),
        },
        None => error,
    };
    let (socket, control) = (&config.socket, &config.control);
    let status = socket.status_path();
    for (key, path, table, group) in [
        ("images", &socket.images, "socket", &socket.group),
        ("control", &socket.control, "control", &control.group),
        ("status", &status, "socket", &socket.group),
    ] {
        // Where they are otherwise is for whoever runs the daemon, who need not be the one who checks.
        if line_of(text, "socket", key).is_some() && !is_folder_of_service(path) {
            check_socket_path(path).map_err(|error| at("socket", key, error.into()))?;
        }
        match check_group(path, group) {
            Err(SocketPathError::GroupNotOurs { .. }) if is_group_of_service(group) => {}
            checked => checked.map_err(|error| at(table, "group", error.into()))?,
        }
    }
    check_boards(config).map_err(|error| at("", "layout", error))?;
    sources::check(config).map_err(|error| {
        let of = |name: &String| matches!(&error, StartError::Source { bus, .. } if bus == name);
        match config.layout.buses.iter().position(of) {
            Some(bus) => at("bus", &format!("bus[{bus}].source"), error),
            None => at("joints", "source", error),
        }
    })?;
    check_profile(&config.layout, &config.profile)
        .map_err(|message| at("profile", &message, StartError::ProfileUnfit(message.clone())))?;
    Engine::new(&config.engine(true)?, 0)?;
    Ok(())
}

/// Refuses a hand of which nothing comes over any bus, of boards or of joints.
pub(crate) fn check_boards(config: &Config) -> Result<(), StartError> {
    let layout = &config.layout;
    match layout.without_board().count() == layout.modules.len() && config.joints_bus().is_none() {
        true => Err(StartError::NoBoard(layout.name.clone())),
        false => Ok(()),
    }
}

/// A stated socket that [`check`] leaves to the service, whose folder systemd makes, and why whoever checks could not
/// have it.
pub fn left_to_service(config: &Config, text: &str) -> Option<(PathBuf, SocketPathError)> {
    let socket = &config.socket;
    let sockets = [
        ("images", socket.images.clone()),
        ("control", socket.control.clone()),
        ("status", socket.status_path()),
    ];
    let mut left = sockets
        .into_iter()
        .filter(|(key, path)| line_of(text, "socket", key).is_some() && is_folder_of_service(path));
    left.find_map(|(_, path)| check_socket_path(&path).err().map(|error| (path, error)))
}

/// Whether systemd makes the folder of this socket for the service, or for an instance of it, when that starts.
fn is_folder_of_service(socket: &Path) -> bool {
    let folder = socket.parent().unwrap_or(socket);
    let name = folder.strip_prefix("/run").unwrap_or(Path::new("")).to_str();
    name.is_some_and(|name| name == SERVICE || name.starts_with("taxeld-") && !name.contains('/'))
}

/// Whether the service's user may give sockets to this group, even though whoever checks may not.
fn is_group_of_service(name: &str) -> bool {
    let group = Group::from_name(name).ok().flatten();
    group.is_some_and(|group| group.mem.iter().any(|member| member == SERVICE))
}
