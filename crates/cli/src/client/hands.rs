//! The daemons of several hands, where nobody answers at the socket that is taken when none is named. None of them is taken
//! instead, not even the only one: the hand that is moved or calibrated has to be the one that was meant.

use crate::notices;
use anyhow::bail;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use taxel_hand::shell_word;
use taxel_wire::{ReadError, Subscriber, connect_for_requests};

/// The hands whose daemons run, and their sockets of the same name as this one.
pub(crate) fn running(socket: &Path) -> Vec<(String, PathBuf)> {
    let runs = |(_, socket): &(String, PathBuf)| {
        // At its socket of images this would be one more reader.
        let answer = connect_for_requests(&socket.with_file_name("status.sock"));
        // One that this user may not ask is there, and one that hangs.
        answer.map_or_else(|error| !is_absent(&error), |_| true)
    };
    taxeld::config::other_hands(socket)
        .into_iter()
        .filter(runs)
        .collect()
}

fn is_absent(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::ConnectionRefused)
}

/// The hands whose daemons run where nobody answers at this socket, and the options that name the first one's; `None` where
/// there is none.
pub(crate) fn advice(socket: &Path, options: impl Fn(&Path) -> String) -> Option<String> {
    let hands = running(socket);
    let (_, first) = hands.first()?;
    let names: Vec<&str> = hands.iter().map(|(name, _)| name.as_str()).collect();
    Some(format!(
        "taxeld runs as {}: {}",
        names.join(" and "),
        options(first)
    ))
}

/// The option of most commands.
pub(crate) fn socket_option(socket: &Path) -> String {
    format!("--socket {}", shell_word(socket.display()))
}

/// Why there is no connection to a socket of images, and which hands have a daemon.
pub(crate) fn told(error: anyhow::Error) -> anyhow::Error {
    match error.downcast_ref().and_then(advice_on) {
        Some(advice) => {
            let text = format!("{error} {advice}");
            error.context(text)
        }
        None => error,
    }
}

fn advice_on(error: &ReadError) -> Option<String> {
    match error {
        ReadError::Connect { path, source } if is_absent(source) => advice(path, socket_option),
        _ => None,
    }
}

/// Says which hands have a daemon where nobody answers at this socket of images, which is waited for.
pub(crate) fn warn_of_others(images: &Path) {
    let failed = Subscriber::connect(images).err();
    if let Some(advice) = failed.as_ref().and_then(advice_on) {
        notices::warn(&format!(
            "taxel: nobody answers at {}; {advice}",
            images.display()
        ));
    }
}

/// Refuses to go on where nobody answers at this socket and other hands have a daemon; `options` name the sockets of one.
///
/// # Errors
/// Which hands these are.
pub(crate) fn refuse_others(socket: &Path, options: impl Fn(&Path) -> String) -> anyhow::Result<()> {
    let status = socket.with_file_name("status.sock");
    let failed = connect_for_requests(&status).err();
    if failed.as_ref().is_some_and(is_absent)
        && let Some(advice) = advice(socket, options)
    {
        bail!("nobody answers at {}; {advice}", socket.display());
    }
    Ok(())
}
