//! What people should know besides what comes out: on stderr, or with whoever draws on the terminal.
//!
//! A process has one terminal. So who draws on it says so once, for all that is said meanwhile, wherever that is. A
//! recording is looked at more than once, and may be played again and again; what is remarked on it is said once.
//! Where stderr is systemd's journal, a remark is a warning.

use crate::stand_in::as_named;
use std::io::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};
pub use taxel_journal::Priority;

static SAID: Mutex<Said> = Mutex::new(Said {
    lines: Vec::new(),
    gathered_from: None,
});

/// What was said by this process.
struct Said {
    /// Each remark once, and what else is gathered.
    lines: Vec<String>,
    /// The first line that is gathered, while the terminal is drawn on.
    gathered_from: Option<usize>,
}

/// While it is there, what is for people is gathered instead of printed, and no progress is shown. Dropped, it
/// prints what was gathered: first the terminal is to be given back.
#[derive(Debug)]
pub struct Remarks {
    told: usize,
}

impl Remarks {
    /// Gathers what is said from now on.
    pub fn gather() -> Self {
        let mut said = said();
        let told = said.lines.len();
        said.gathered_from.get_or_insert(told);
        Self { told }
    }

    /// What was said since this was asked last, a line each.
    pub fn news(&mut self) -> Vec<String> {
        let news = said().lines[self.told..].to_vec();
        self.told += news.len();
        news
    }
}

impl Drop for Remarks {
    fn drop(&mut self) {
        let mut said = said();
        if let Some(from) = said.gathered_from.take() {
            // It is a terminal, and knows no priorities.
            said.lines[from..]
                .iter()
                .for_each(|line| print(Priority::Info, line));
        }
    }
}

fn said() -> MutexGuard<'static, Said> {
    SAID.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether somebody draws on the terminal.
pub(crate) fn are_gathered() -> bool {
    said().gathered_from.is_some()
}

/// Says a line, with the names that people gave files, if it was not said before: a remark on a recording, or on what
/// the command was asked.
pub fn remark(line: String) {
    let line = as_named(line);
    let mut said = said();
    if said.lines.contains(&line) {
        return;
    }
    if said.gathered_from.is_none() {
        print(Priority::Warning, &line);
    }
    said.lines.push(line);
}

/// Says a line, with the names that people gave files, as often as it is said: an answer, or something that has happened.
pub fn say(priority: Priority, line: String) {
    let line = as_named(line);
    let mut said = said();
    match said.gathered_from {
        None => print(priority, &line),
        Some(_) => said.lines.push(line),
    }
}

fn print(priority: Priority, line: &str) {
    // Unlike with `eprintln!`, where the terminal is gone or the disk full this is no panic.
    let _ = std::io::stderr().write_all(priority.lines(line).as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::buses::recorded_buses::read_ahead;
    use crate::buses::traffic::Traffic;

    #[test]
    fn who_draws_is_given_once_what_is_said_by_whichever_thread() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("half-a-log.log");
        std::fs::write(&path, "(1.000000) can0 001#\nno frame\n").unwrap();
        let names = ["can0".to_owned()];
        let mut remarks = Remarks::gather();
        let mut news_of_a_pass = || -> Vec<String> {
            // The file is read on a thread of its own.
            read_ahead(
                &Traffic::candump(&path),
                &names,
                None,
                |frames| Ok(frames.count()),
            )
            .unwrap();
            // Tests beside this one speak, too.
            let mut news = remarks.news();
            news.retain(|line| line.contains("half-a-log.log"));
            news
        };
        let news = news_of_a_pass();
        let is_it = |line: &str| line.contains("1 line without a classic CAN frame");
        assert!(matches!(&news[..], [line] if is_it(line)), "{news:?}");
        assert_eq!(news_of_a_pass(), Vec::<String>::new());
        // An answer is no remark: it is given as often as it is asked for.
        for _ in 0..2 {
            crate::say!("half-a-log.log is no board");
        }
        let answers = remarks.news();
        let same = answers
            .iter()
            .filter(|line| *line == "half-a-log.log is no board");
        assert_eq!(same.count(), 2, "{answers:?}");
    }
}
