//! How many files may be open, and whose they are: of what buses and threads leave, those who see images never get all.
//!
//! The sockets of those who ask and command have a share that no reader can take, since "torque off" comes by them.

use crate::clients::MOST_CLIENTS;
use nix::sys::resource::{Resource, getrlimit, setrlimit};

/// Kept for what is opened later: threads, buses and ports that come back, readers beyond the places.
const SPARE: usize = 32;

/// Least that must be left when all threads run: for a reader, who commands, and what is opened for a moment.
const LEAST: usize = 8;

/// What is to be done where too few files may be open.
pub const MORE_FILES: &str = "LimitNOFILE= in the unit, or `ulimit -Hn`, allows more";

/// So few files may be open that nobody could connect.
#[derive(Debug, thiserror::Error)]
#[error(
    "only {limit} files may be open, and with fewer than {needed} nobody could tell taxeld to switch a motor off; {MORE_FILES}"
)]
pub struct TooFewFiles {
    /// How many may be open.
    pub limit: usize,
    /// The least that there have to be.
    pub needed: usize,
}

/// How many connections there may be.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Descriptors {
    pub(crate) subscribers: usize,
    /// To each of the two control sockets.
    pub(crate) clients: usize,
}

impl Descriptors {
    /// Shares those out that are not in use, of `limit`, where so many subscribers are wanted.
    pub(crate) fn share(limit: usize, in_use: usize, subscribers: usize) -> Self {
        let free = limit.saturating_sub(in_use);
        let free = free - SPARE.min(free / 4);
        let clients = MOST_CLIENTS.min(free / 4);
        Self {
            subscribers: subscribers.min(free - 2 * clients).max(1),
            clients: clients.max(1),
        }
    }

    /// Raises the limit to the highest that is allowed, and shares out what it leaves.
    pub(crate) fn take(subscribers: usize) -> Self {
        let limit = raise_limit();
        let shared = Self::share(limit, in_use(limit), subscribers);
        if shared.subscribers < subscribers {
            tracing::warn!(
                "[socket] max_subscribers = {subscribers}, but only {} will be let in: {limit} files may be open, and some \
                 are kept for who asks and commands; {MORE_FILES}",
                shared.subscribers
            );
        }
        shared
    }
}

/// Refuses to serve where so few are left, now that all threads run and nobody is let in yet, that nobody could switch a
/// motor off.
pub(crate) fn check() -> Result<(), TooFewFiles> {
    let limit = raise_limit();
    let needed = in_use(limit).saturating_add(LEAST);
    match needed <= limit {
        true => Ok(()),
        false => Err(TooFewFiles { limit, needed }),
    }
}

fn in_use(limit: usize) -> usize {
    match std::fs::read_dir("/proc/self/fd") {
        Ok(open) => open.count(),
        Err(error) if error.raw_os_error() == Some(nix::libc::EMFILE) => limit,
        Err(_) => 0,
    }
}

/// Raises the limit to the highest that is allowed, and tells it. It is low by default for the sake of programs that use
/// select(2).
pub(crate) fn raise_limit() -> usize {
    // Where it cannot be told it is what POSIX grants.
    let (limit, most) = getrlimit(Resource::RLIMIT_NOFILE).unwrap_or((20, 20));
    let raised = setrlimit(Resource::RLIMIT_NOFILE, most, most);
    let limit = raised.map_or(limit, |()| most);
    limit.try_into().unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_the_limit_those_who_command_have_a_share_and_all_together_fit() {
        for (limit, in_use, wanted, subscribers, clients) in [
            // As the unit has it.
            (16_384, 40, 4096, 4096, 128),
            (16_384, 40, 128, 128, 128),
            // As a shell has it.
            (1024, 40, 4096, 696, 128),
            (1024, 40, 128, 128, 128),
            (100, 30, 128, 27, 13),
            (32, 12, 128, 9, 3),
            (16, 20, 128, 1, 1),
        ] {
            let shared = Descriptors::share(limit, in_use, wanted);
            let expected = Descriptors { subscribers, clients };
            assert_eq!(shared, expected, "{limit}, {in_use}, {wanted}");
            assert!(limit < in_use || in_use + subscribers + 2 * clients < limit);
        }
    }
}
