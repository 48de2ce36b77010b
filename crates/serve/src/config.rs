//! What a program that serves says of its socket: the `[socket]` and `[profiles]` tables of its
//! configuration.

use serde::{Deserialize, Serialize};
use taxel_hand::{RangeError, check_range};

/// How many subscribers there may be, and how patient the program is with them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Most subscribers at once. Up to a quarter more, eight at most, are served for half a second, until one of all leaves.
    pub max_subscribers: usize,
    /// A subscriber that takes nothing for this long is disconnected, ms.
    pub stall_ms: u32,
}

/// How many display profiles are made at once, and what they may cost. A subscriber that states a
/// profile beyond these limits is refused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ProfilesConfig {
    /// Share of the time between two images that all profiles together may take, 0.001 to 100 %. In
    /// `sweep` mode that time is `sweep.board_period_ms`.
    pub budget_percent: f64,
    /// Most different profiles at once, the program's own among them, 1 to 256.
    pub max: u16,
}

impl Default for ProfilesConfig {
    fn default() -> Self {
        Self {
            budget_percent: 50.0,
            max: 16,
        }
    }
}

impl ProfilesConfig {
    /// Refuses what is out of its range.
    pub fn check(&self) -> Result<(), RangeError> {
        check_range(
            "profiles.",
            "budget_percent",
            self.budget_percent,
            0.001..=100.0,
            "%",
        )?;
        check_range("profiles.", "max", self.max, 1.0..=256.0, "")
    }
}
