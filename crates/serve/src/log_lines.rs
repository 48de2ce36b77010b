//! What others bring about as often as they like is told in the log a few times, and counted beyond that.

use crate::allowance::Allowance;
use std::time::Duration;
use tokio::time::Instant;

/// Lines of the log on one kind of thing.
#[derive(Debug)]
pub struct LogLines {
    allowance: Allowance,
    unsaid: u64,
}

impl Default for LogLines {
    fn default() -> Self {
        Self::new(Self::BURST, Self::INTERVAL)
    }
}

impl LogLines {
    /// Lines at once, where nothing else is said.
    pub const BURST: u32 = 30;
    /// From one line to the next in the long run, where nothing else is said.
    pub const INTERVAL: Duration = Duration::from_secs(3);

    /// So many lines at once, and one per `interval` in the long run.
    pub fn new(burst: u32, interval: Duration) -> Self {
        Self {
            allowance: Allowance::new(burst, interval),
            unsaid: 0,
        }
    }

    /// Whether a line may be said, or is to be `always`: how many before it were not.
    pub fn take(&mut self, always: bool, now: Instant) -> Option<u64> {
        if !self.allowance.take_now(now) && !always {
            self.unsaid += 1;
            return None;
        }
        Some(std::mem::take(&mut self.unsaid))
    }

    /// How many lines were not said, where that may be said now.
    pub fn take_unsaid(&mut self, now: Instant) -> Option<u64> {
        (self.unsaid > 0 && self.allowance.take_now(now)).then(|| std::mem::take(&mut self.unsaid))
    }

    /// Whether something was not said, and that not yet either.
    pub fn has_left_out(&self) -> bool {
        self.unsaid > 0
    }

    /// Whether a line may be said: what then stands behind it.
    pub(crate) fn take_line(&mut self, now: Instant) -> Option<String> {
        Some(and_unsaid(self.take(false, now)?, "line"))
    }

    /// Says in the log that something has changed.
    pub fn say(&mut self, text: &str, now: Instant) {
        if let Some(unsaid) = self.take(false, now) {
            tracing::info!("{text}{}", and_unsaid(unsaid, "change"));
        }
    }
}

/// What stands behind a line where others before it, `what` in the singular, were not said; nothing where all were.
pub fn and_unsaid(unsaid: u64, what: &str) -> String {
    match unsaid {
        0 => String::new(),
        1 => format!("; 1 such {what} before it is not in the log"),
        _ => format!("; {unsaid} such {what}s before it are not in the log"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_storm_is_told_a_few_times_and_then_with_how_many_were_not() {
        let (mut lines, start) = (LogLines::default(), Instant::now());
        let said = |lines: &mut LogLines, at| {
            (0..1000)
                .filter_map(|_| lines.take(false, at))
                .collect::<Vec<_>>()
        };
        assert_eq!(said(&mut lines, start), [0; LogLines::BURST as usize]);
        assert_eq!(lines.take_unsaid(start), None, "the log is full of it");
        let unsaid = 1000 - u64::from(LogLines::BURST);
        let later = start + LogLines::INTERVAL;
        assert_eq!(said(&mut lines, later), [unsaid]);
        assert_eq!(lines.take(true, later), Some(999));
        assert_eq!(
            lines.take_unsaid(later + 2 * LogLines::INTERVAL),
            None,
            "all is said or counted"
        );
    }

    #[test]
    fn one_line_is_no_lines() {
        let said = |unsaid| and_unsaid(unsaid, "request");
        assert_eq!(said(0), "");
        assert_eq!(said(1), "; 1 such request before it is not in the log");
        assert_eq!(said(2), "; 2 such requests before it are not in the log");
    }

    #[test]
    fn how_many_were_not_told_is_told_once_though_nothing_more_happens() {
        let (mut lines, start) = (LogLines::new(1, LogLines::INTERVAL), Instant::now());
        assert_eq!(lines.take(false, start), Some(0));
        assert_eq!((lines.take(false, start), lines.take(false, start)), (None, None));
        let later = start + LogLines::INTERVAL;
        assert_eq!(
            (lines.take_unsaid(later), lines.take_unsaid(later)),
            (Some(2), None)
        );
        assert_eq!(lines.take(false, later + LogLines::INTERVAL), Some(0));
    }
}
