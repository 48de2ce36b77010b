//! Who asks, and the lines of the log that say so.

use std::cell::RefCell;
use std::collections::HashMap;
use std::fmt;
use taxel_serve::{LogLines, and_unsaid};
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

/// User and process of a client, as the kernel tells them; none where it says nothing.
pub(crate) type Process = Option<(u32, Option<i32>)>;

/// Who has connected, as the kernel says, and what the socket allows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Asker {
    pub(crate) access: Access,
    pub(crate) user: Process,
}

impl Asker {
    pub(crate) fn of(stream: &UnixStream, access: Access) -> Self {
        // Processes that this namespace does not see are all called 0.
        let pid = |pid: Option<i32>| pid.filter(|pid| *pid > 0);
        let user = stream.peer_cred().ok().map(|peer| (peer.uid(), pid(peer.pid())));
        Self { access, user }
    }

    /// Whether both are known to be one process.
    pub(crate) fn is_process_of(&self, other: &Self) -> bool {
        self.pid().is_some() && self.user == other.user
    }

    /// Their process; none where the kernel says nothing.
    pub(crate) fn pid(&self) -> Option<i32> {
        self.user.and_then(|(_, pid)| pid)
    }

    #[cfg(test)]
    pub(crate) fn nobody() -> Self {
        Self {
            access: Access::Change,
            user: None,
        }
    }

    #[cfg(test)]
    pub(crate) fn process(uid: u32, pid: Option<i32>) -> Self {
        let user = Some((uid, pid));
        let access = Access::Change;
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

/// What was done, or refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Change {
    /// What was asked for, such as "a mark".
    pub(crate) kind: &'static str,
    /// Whether it was refused.
    pub(crate) refused: bool,
}

/// Says in the log who has changed something. Not each time where a user does so often, and what one user does, or one kind
/// of change, takes no line from another.
#[derive(Debug, Default)]
pub(crate) struct ChangeLog {
    lines: RefCell<HashMap<(Option<u32>, Change), LogLines>>,
    /// Whether a joint's motor was said to be on when something was said of it last.
    motors: RefCell<HashMap<String, bool>>,
}

/// Users and kinds of changes that are told apart. Beyond, those go of whom nothing was left out.
const TOLD_APART: usize = 1000;

impl ChangeLog {
    /// Says what was done, or refused, for whom.
    pub(crate) fn note(&self, change: Change, what: &str, asker: &Asker, now: Instant) {
        self.say(self.line(change, false, what, asker, now));
    }

    /// Says that a joint's motor was switched on or off, and for whom: each time that it is switched. A bus of servos takes
    /// few of these in a second.
    pub(crate) fn note_motor(
        &self,
        change: Change,
        motor: (&str, bool),
        what: &str,
        asker: &Asker,
        now: Instant,
    ) {
        let is_switched = self.is_switched(motor);
        self.say(self.line(change, is_switched, what, asker, now));
    }

    /// Whether a motor that is now on, or off, was not before: one that is started is off for a moment.
    fn is_switched(&self, (joint, is_on): (&str, bool)) -> bool {
        let was_on = self.motors.borrow_mut().insert(joint.to_owned(), is_on);
        is_on || was_on != Some(false)
    }

    fn say(&self, line: Option<String>) {
        if let Some(line) = line {
            tracing::info!("{line}");
        }
    }

    fn line(&self, change: Change, always: bool, what: &str, asker: &Asker, now: Instant) -> Option<String> {
        let mut all = self.lines.borrow_mut();
        if all.len() >= TOLD_APART {
            all.retain(|_, lines| lines.has_left_out());
        }
        let lines = all.entry((asker.user.map(|(uid, _)| uid), change)).or_default();
        let more = and_unsaid(lines.take(always, now)?, "request");
        Some(format!("{what}, by request of {asker}{more}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAUSE: Change = Change {
        kind: "pause",
        refused: false,
    };
    const MARK_REFUSED: Change = Change {
        kind: "a mark",
        refused: true,
    };
    const SERVO: Change = Change {
        kind: "a servo command",
        refused: false,
    };

    fn user(uid: u32) -> Asker {
        Asker {
            access: Access::Change,
            user: Some((uid, Some(42))),
        }
    }

    #[test]
    fn many_changes_fill_no_log_and_those_unsaid_are_counted() {
        let (log, asker, now) = (ChangeLog::default(), user(1000), Instant::now());
        let line = |at| log.line(PAUSE, false, "paused", &asker, at);
        let said: Vec<String> = (0..100).filter_map(|_| line(now)).collect();
        assert_eq!(said.len(), LogLines::BURST as usize);
        assert_eq!(said[0], "paused, by request of user 1000, process 42");
        let later = line(now + LogLines::INTERVAL).unwrap();
        assert!(
            later.ends_with("; 70 such requests before it are not in the log"),
            "{later}"
        );
    }

    #[test]
    fn nobody_keeps_what_another_does_or_another_kind_of_change_out_of_the_log() {
        let (log, now) = (ChangeLog::default(), Instant::now());
        let flood = || (0..1000).filter_map(|_| log.line(MARK_REFUSED, false, "refused", &user(1000), now));
        assert_eq!(flood().count(), LogLines::BURST as usize);
        let refused = |kind| Change { kind, refused: true };
        for (change, uid) in [
            (PAUSE, 1000),
            (refused("pause"), 1000),
            (MARK_REFUSED, 1001),
            (PAUSE, 1001),
        ] {
            let line = log.line(change, false, "done", &user(uid), now);
            assert_eq!(line, Some(format!("done, by request of user {uid}, process 42")));
        }
    }

    #[test]
    fn each_time_that_a_motor_is_switched_is_in_the_log() {
        let (log, asker, now) = (ChangeLog::default(), user(1000), Instant::now());
        let line = |is_on: bool| {
            let is_switched = log.is_switched(("index 0", is_on));
            log.line(SERVO, is_switched, "switched", &asker, now)
        };
        for _ in 0..200 {
            assert!(line(true).is_some() && line(false).is_some());
        }
        let said = (0..200).filter_map(|_| line(false)).count();
        assert_eq!(said, 0, "it was off");
    }
}
