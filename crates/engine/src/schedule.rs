//! When ticks are due.

use crate::config::{TickConfig, TickMode};

/// When ticks are due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Schedule {
    Timer { next_ns: u64, period_ns: u64 },
    Sweep { silent_ns: u64 },
}

impl Schedule {
    /// Timer ticks are due at `origin_ns + k * period`, `k = 1, 2, ...`.
    pub(crate) fn new(tick: &TickConfig, origin_ns: u64) -> Self {
        match tick.mode {
            TickMode::Sweep => Self::Sweep {
                silent_ns: u64::from(tick.silent_ms) * 1_000_000,
            },
            TickMode::Timer => {
                let period_ns = tick.period_ns();
                Self::Timer {
                    next_ns: origin_ns + period_ns,
                    period_ns,
                }
            }
        }
    }

    pub(crate) fn is_sweep(&self) -> bool {
        matches!(self, Self::Sweep { .. })
    }

    /// The tick that was due is made.
    pub(crate) fn advance(&mut self) {
        if let Self::Timer { next_ns, period_ns } = self {
            *next_ns += *period_ns;
        }
    }

    /// Gives up timer ticks that are more than one period overdue at `now_ns`, and returns how many.
    pub(crate) fn skip_overdue(&mut self, now_ns: u64) -> u64 {
        let Self::Timer { next_ns, period_ns } = self else {
            return 0;
        };
        let overdue = now_ns.saturating_sub(*next_ns) / *period_ns;
        *next_ns += overdue * *period_ns;
        overdue
    }
}
