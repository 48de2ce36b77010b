//! What people are told by a program that must not wait for them: lines on stderr, which a parent process may never
//! read.

use std::io::stderr;
use std::sync::{Mutex, MutexGuard, PoisonError};
use taxel_journal::Priority;
use taxel_playback::remarks;
use taxeld::log::{Flush, Log};

/// Where lines are put from the first one on, and what sees the last of them out.
static LOG: Mutex<Option<(Log, Flush)>> = Mutex::new(None);

fn log() -> MutexGuard<'static, Option<(Log, Flush)>> {
    LOG.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Says a line and does not wait for whoever reads stderr: what finds no room is left out, and how many lines are is
/// said once there is room again.
pub(crate) fn say(line: &str) {
    tell(Priority::Info, line);
}

/// The same of what is wrong, lost or waited for.
pub(crate) fn warn(line: &str) {
    tell(Priority::Warning, line);
}

/// The same of what matters so much.
pub(crate) fn tell(priority: Priority, line: &str) {
    let mut log = log();
    if log.is_none() {
        *log = Log::start(stderr()).ok();
    }
    put(&log, priority, line);
}

/// Says why the program ends, behind what was said before. It waits only where nothing was said in this way.
pub(crate) fn say_last(line: &str) {
    put(&log(), Priority::Error, line);
}

fn put(log: &Option<(Log, Flush)>, priority: Priority, line: &str) {
    match log {
        Some((log, _)) => log.say(priority.lines(line)),
        None => remarks::say(priority, line.to_owned()),
    }
}

/// Has the last lines written, but waits for no reader who reads nothing.
pub(crate) fn end() {
    drop(log().take());
}
