//! How much a line on stderr matters, said to systemd's journal in front of it (sd-daemon(3)): `journalctl -p warning`
//! then shows what is wrong, and nothing else.

use nix::sys::stat::fstat;
use std::io::stderr;

/// How much a line matters, as syslog(3) has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Priority {
    /// Something does not work, or ends.
    Error,
    /// Something is lost, missing or waited for.
    Warning,
    /// What happens.
    Info,
    /// For who looks for a fault of the program.
    Debug,
}

/// Whether stderr is the journal's stream. A terminal that a service has opened inherits the variable as well, so it
/// says which file is meant.
pub fn is_stderr() -> bool {
    let stream = std::env::var("JOURNAL_STREAM").unwrap_or_default();
    match fstat(stderr()) {
        Ok(file) => stream == format!("{}:{}", file.st_dev, file.st_ino),
        Err(_) => false,
    }
}

impl Priority {
    /// What stands before a line in the journal.
    pub fn mark(self) -> &'static str {
        match self {
            Self::Error => "<3>",
            Self::Warning => "<4>",
            Self::Info => "<6>",
            Self::Debug => "<7>",
        }
    }

    /// A text as it is written to stderr, with the end of its last line. Where that is the journal, each line has the mark:
    /// there it is an entry of its own.
    pub fn lines(self, text: &str) -> String {
        match is_stderr() {
            true => self.marked(text),
            false => format!("{text}\n"),
        }
    }

    fn marked(self, text: &str) -> String {
        text.lines()
            .map(|line| format!("{}{line}\n", self.mark()))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_line_of_a_text_has_its_priority() {
        assert_eq!(Priority::Error.marked("torn\nat 3"), "<3>torn\n<3>at 3\n");
        assert_eq!(Priority::Warning.marked("full"), "<4>full\n");
    }
}
