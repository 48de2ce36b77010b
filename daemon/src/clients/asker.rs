//! Who asks, and the lines of the log that say so.

use super::allowance::Allowance;
use std::cell::{Cell, RefCell};
use std::fmt;
use std::time::Duration;
use tokio::net::UnixStream;
use tokio::time::Instant;

/// What a socket's clients may.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    /// Be told.
    Look,
    /// Move and change something as well.
    Change,
}

/// Who has connected, as the kernel says, and what the socket allows.
#[derive(Debug)]
pub(crate) struct Asker {
    pub(crate) access: Access,
    /// User and process; none where the kernel says nothing.
    user: Option<(u32, Option<i32>)>,
}

impl Asker {
    pub(crate) fn of(stream: &UnixStream, access: Access) -> Self {
        let user = stream.peer_cred().ok().map(|peer| (peer.uid(), peer.pid()));
        Self { access, user }
    }
}

impl fmt::Display for Asker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.user {
            Some((uid, Some(pid))) => write!(f, "user {uid}, process {pid}"),
            Some((uid, None)) => write!(f, "user {uid}"),
            None => f.write_str("nobody knows whom"),
        }
    }
}

/// Says in the log who has changed something. Not each time where that is often.
#[derive(Debug)]
pub(crate) struct ChangeLog {
    allowance: RefCell<Allowance>,
    unsaid: Cell<u64>,
}

/// Lines of the log at once, and in the long run.
const LINES: u32 = 30;
const LINE_INTERVAL: Duration = Duration::from_secs(3);

impl Default for ChangeLog {
    fn default() -> Self {
        Self {
            allowance: RefCell::new(Allowance::new(LINES, LINE_INTERVAL)),
            unsaid: Cell::new(0),
        }
    }
}

impl ChangeLog {
    /// Says what was done, or refused, for whom.
    pub(crate) fn note(&self, what: &str, asker: &Asker, now: Instant) {
        if let Some(line) = self.line(what, asker, now) {
            tracing::info!("{line}");
        }
    }

    fn line(&self, what: &str, asker: &Asker, now: Instant) -> Option<String> {
        if !self.allowance.borrow_mut().take_now(now) {
            self.unsaid.set(self.unsaid.get() + 1);
            return None;
        }
        Some(match self.unsaid.take() {
            0 => format!("{what}, by request of {asker}"),
            unsaid => {
                format!("{what}, by request of {asker}; {unsaid} requests before it are not in the log")
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_changes_fill_no_log_and_those_unsaid_are_counted() {
        let log = ChangeLog::default();
        let asker = Asker {
            access: Access::Change,
            user: Some((1000, Some(42))),
        };
        let now = Instant::now();
        let said: Vec<String> = (0..100).filter_map(|_| log.line("paused", &asker, now)).collect();
        assert_eq!(said.len(), LINES as usize);
        assert_eq!(said[0], "paused, by request of user 1000, process 42");
        let later = log.line("resumed", &asker, now + LINE_INTERVAL).unwrap();
        assert!(
            later.ends_with("; 70 requests before it are not in the log"),
            "{later}"
        );
    }
}
