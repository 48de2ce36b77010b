//! A connection to the daemon's image socket that is made anew when the daemon is back.

use super::hands;
use crate::notices;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use std::os::fd::AsFd;
use std::path::Path;
use std::time::Duration;
use taxel_wire::{ReadError, Subscriber};

/// Between two looks whether the daemon is back.
const LOOK: Duration = Duration::from_millis(500);
/// How long the first message of a daemon may take.
pub(crate) const PATIENCE: Duration = Duration::from_secs(5);
/// What is said of one that has taken so long.
pub(crate) const SAYS_NOTHING: &str =
    "taxeld says nothing; its log says what it does, and where it hangs, restart it";

/// Reads a connection to the daemon of this socket, or to the one that runs here, until `read` is done. With `reconnect` a
/// daemon is waited for, at the start and whenever it is gone, and read anew. One that says nothing is waited for in any
/// case, and that is said.
///
/// # Errors
/// What `read` says; without `reconnect` also that there is no daemon, or none any more.
pub(crate) fn with_daemon(
    socket: Option<&Path>,
    reconnect: bool,
    mut read: impl FnMut(Subscriber, &Path) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut socket = socket.map(Path::to_path_buf);
    let mut is_waiting = false;
    loop {
        // Until a daemon was there, one may start in this user's folder as well as in the system's.
        let tried = socket
            .clone()
            .unwrap_or_else(|| taxeld::config::running_socket("images.sock"));
        let connected = Subscriber::connect(&tried).map_err(anyhow::Error::from);
        let outcome = connected.and_then(|subscriber| {
            is_waiting = false;
            let mut first = [PollFd::new(subscriber.as_fd(), PollFlags::POLLIN)];
            let patience = PollTimeout::try_from(PATIENCE).unwrap_or(PollTimeout::ZERO);
            if poll(&mut first, patience) == Ok(0) {
                notices::warn(&format!("taxel: {SAYS_NOTHING}; waiting for it"));
            }
            read(subscriber, socket.insert(tried))
        });
        match outcome {
            Err(error) if reconnect && is_gone(&error) => {
                if !std::mem::replace(&mut is_waiting, true) {
                    notices::warn(&format!(
                        "taxel: {}; waiting for it",
                        crate::errors::describe(&hands::told(error))
                    ));
                }
                std::thread::sleep(LOOK);
            }
            outcome => return outcome.map_err(hands::told),
        }
    }
}

/// Whether it is the connection that failed.
fn is_gone(error: &anyhow::Error) -> bool {
    let error = error.downcast_ref::<ReadError>();
    error.is_some_and(|error| matches!(error, ReadError::Connect { .. }) || error.is_end())
}
