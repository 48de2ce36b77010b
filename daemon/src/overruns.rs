//! Says in the log that ticks are given up: a machine that is busy for hours is not to fill it.

use std::time::Duration;
use tokio::time::Instant;

/// Between two lines while it goes on.
const PERIOD: Duration = Duration::from_secs(10);

/// What was said of the ticks that were given up.
#[derive(Debug, Default)]
pub(crate) struct Overruns {
    told: u64,
    /// When more may be said; none while no tick is given up.
    next_at: Option<Instant>,
}

impl Overruns {
    /// What is to be said where so many were given up since the start: at once where it begins, then how many there were,
    /// until there were none.
    pub(crate) fn look(&mut self, overruns: u64, now: Instant) -> Option<String> {
        if self.next_at.is_some_and(|at| now < at) {
            return None;
        }
        let new = overruns.saturating_sub(self.told);
        self.told = overruns;
        let goes_on = self.next_at.take().is_some();
        if new == 0 {
            return None;
        }
        self.next_at = Some(now + PERIOD);
        let ticks = if new == 1 { "tick" } else { "ticks" };
        Some(match goes_on {
            false => format!("{new} {ticks} given up: the daemon was held up"),
            true => format!("{new} more {ticks} given up in {} s", PERIOD.as_secs()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_when_ticks_begin_to_be_given_up_and_then_every_ten_seconds_how_many() {
        let (mut overruns, start) = (Overruns::default(), Instant::now());
        let mut given_up = 0;
        let mut said = Vec::new();
        // Looked at in tenths of a second: one in each for 15 s, and one a minute later.
        for tenth in 0..900 {
            given_up += u64::from(tenth < 150 || tenth == 750);
            if let Some(line) = overruns.look(given_up, start + tenth * Duration::from_millis(100)) {
                said.push((tenth, line));
            }
        }
        let said: Vec<(u32, &str)> = said.iter().map(|(at, line)| (*at, line.as_str())).collect();
        assert_eq!(
            said,
            [
                (0, "1 tick given up: the daemon was held up"),
                (100, "100 more ticks given up in 10 s"),
                (200, "49 more ticks given up in 10 s"),
                (750, "1 tick given up: the daemon was held up"),
            ]
        );
    }
}
