//! What people are told, however often somebody makes it happen.

use std::time::{Duration, Instant};

/// Lines within [`WITHIN`].
const LINES: u32 = 10;
const WITHIN: Duration = Duration::from_secs(10);

/// Lets through a few lines in a while, and says how many it did not.
#[derive(Debug)]
pub(crate) struct Remarks {
    since: Instant,
    said: u32,
    unsaid: u64,
}

impl Remarks {
    pub(crate) fn new(now: Instant) -> Self {
        let (since, said, unsaid) = (now, 0, 0);
        Self { since, said, unsaid }
    }

    /// What is to be said of a line.
    pub(crate) fn of(&mut self, line: String, now: Instant) -> Option<String> {
        if now.saturating_duration_since(self.since) >= WITHIN {
            *self = Self {
                unsaid: self.unsaid,
                ..Self::new(now)
            };
        }
        if self.said == LINES {
            self.unsaid += 1;
            return None;
        }
        self.said += 1;
        Some(match std::mem::take(&mut self.unsaid) {
            0 => line,
            unsaid => format!("{line} (and {unsaid} lines before that were left out)"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_lines_is_a_few_and_their_number() {
        let began = Instant::now();
        let mut remarks = Remarks::new(began);
        let mut say = |seconds| remarks.of("line".into(), began + Duration::from_secs(seconds));
        let said = (0..100).filter_map(|_| say(0)).count();
        assert_eq!(said, LINES as usize);
        assert_eq!(say(10).unwrap(), "line (and 90 lines before that were left out)");
        assert_eq!(say(11).unwrap(), "line");
    }
}
