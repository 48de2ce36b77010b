//! Which daemon is asked: that of the configuration's socket, or, where the configuration names none, that of several hands
//! (`taxeld@left`) which reads the configuration's buses or joints.

use super::daemon::{self, Daemon};
use super::finding::Check;
use crate::client::hands;
use std::path::{Path, PathBuf};
use taxel_can::SourceAddress;
use taxel_wire::status::Status;
use taxeld::Config;

/// A daemon, and what is to be said of where it was found.
pub(super) struct Asked {
    pub(super) socket: PathBuf,
    pub(super) daemon: Daemon,
    pub(super) found: Vec<Check>,
}

/// Looks for the daemon that has the hand of this configuration. One that runs at the configuration's socket is it, unless the
/// buses were `named` and are others.
pub(super) fn look(config: &Config, named: bool) -> Asked {
    let socket = config.socket.status_path();
    let daemon = daemon::ask(&socket);
    let has = |status: &Status| daemon::has_any(status, config);
    let is_it = match &daemon {
        Daemon::Running(status) => has(status),
        Daemon::Forbidden | Daemon::Hung => true,
        Daemon::Absent | Daemon::Strange(_) => false,
    };
    let mut asked = Asked {
        socket,
        daemon,
        found: Vec::new(),
    };
    if is_it {
        return asked;
    }
    let mut untold = None;
    for (hand, socket) in taxeld::config::other_hands(&asked.socket) {
        match daemon::ask(&socket) {
            Daemon::Running(status) if has(&status) => {
                let why = format!(
                    "reads buses or joints of this hand, and is asked at {}",
                    socket.display()
                );
                return Asked {
                    socket,
                    daemon: Daemon::Running(status),
                    found: vec![taxeld_of(&hand, why)],
                };
            }
            Daemon::Running(status) => {
                let why = format!(
                    "runs with layout {} on other buses, and is not asked",
                    status.layout
                );
                asked.found.push(taxeld_of(&hand, why));
            }
            daemon @ (Daemon::Forbidden | Daemon::Hung) => untold = untold.or(Some((socket, daemon))),
            Daemon::Absent | Daemon::Strange(_) => {}
        }
    }
    // Whose buses these are is not known, and they are left alone unless another daemon is taken for theirs.
    let is_left_alone = matches!(asked.daemon, Daemon::Running(_)) && !named;
    let is_live = |source: &SourceAddress| !matches!(source, SourceAddress::Log { .. });
    if let Some((socket, daemon)) = untold
        && !is_left_alone
        && (config.joints.is_some() || config.sources.iter().any(is_live))
    {
        asked.socket = socket;
        asked.daemon = daemon;
    }
    asked
}

fn taxeld_of(hand: &str, found: String) -> Check {
    Check::ok("daemon", "taxeld", hand, found)
}

/// The status of the only daemon that runs where it is looked for, of one hand or of several.
pub(super) fn only(socket: &Path) -> Option<Box<Status>> {
    match daemon::ask(socket) {
        Daemon::Running(status) => Some(status),
        Daemon::Absent => {
            let hands = hands::running(socket);
            let [(_, hand)] = &hands[..] else { return None };
            match daemon::ask(hand) {
                Daemon::Running(status) => Some(status),
                _ => None,
            }
        }
        _ => None,
    }
}

/// The services that may run on this machine, for one hand and for several, and their status sockets.
pub(crate) fn services() -> Vec<(String, PathBuf)> {
    let single = taxeld::config::running_socket("status.sock");
    let several = taxeld::config::other_hands(&single).into_iter();
    let several = several.map(|(hand, socket)| (format!("taxeld@{hand}"), socket));
    let mut services: Vec<_> = several.collect();
    services.insert(0, ("taxeld".into(), single));
    services
}
