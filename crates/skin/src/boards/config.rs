//! How boards are started and watched.

use crate::range::check_ranges;
use serde::{Deserialize, Serialize};
use taxel_hand::{RangeError, check_range};

/// How boards are started and watched: the `[boards]` table of the configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BoardsConfig {
    /// Who sets the pace of the boards.
    pub mode: BoardsMode,
    /// `triggered` mode: start commands per second and board, 1 to 200 Hz. Only uSkin boards are
    /// triggered; those of the iCub and CySkin hubs have a period of their own.
    pub trigger_hz: f64,
    /// A board not heard for this long is started again, ms, 20 to 60,000; in `triggered` mode for
    /// three trigger periods if these are longer, an iCub board for three of its own, a CySkin hub
    /// for 150 ms.
    pub silence_ms: f64,
    /// Pause before the second attempt to start a silent board, ms, 10 to 60,000; it doubles with
    /// each further one.
    pub restart_first_ms: f64,
    /// Longest pause between two attempts, ms, from `restart_first_ms` to 600,000.
    pub restart_longest_ms: f64,
    /// Least time between two commands on one bus, ms, 0.1 to 100. Two commands to one board are
    /// never less than 2 ms apart (10 ms for the iCub's): its receive buffer holds five and is
    /// emptied newest first.
    pub command_gap_ms: f64,
}

/// Who sets the pace of the boards (docs/protocols.md, "uSkin commands").
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoardsMode {
    /// Boards are started once and send on their own timer.
    #[default]
    FreeRunning,
    /// Each board is started anew for every sweep, as the Waseda readers do.
    Triggered,
    /// Nothing is sent: a recording is played, or another program controls the boards.
    Passive,
}

impl Default for BoardsConfig {
    fn default() -> Self {
        Self {
            mode: BoardsMode::FreeRunning,
            trigger_hz: 30.0,
            silence_ms: 100.0,
            restart_first_ms: 100.0,
            restart_longest_ms: 250.0,
            command_gap_ms: 0.5,
        }
    }
}

impl BoardsConfig {
    /// Refuses values outside their ranges.
    pub fn check(&self) -> Result<(), RangeError> {
        check_ranges(
            "boards: ",
            &[
                ("trigger_hz", self.trigger_hz, 1.0, 200.0),
                ("silence_ms", self.silence_ms, 20.0, 60_000.0),
                ("restart_first_ms", self.restart_first_ms, 10.0, 60_000.0),
                ("restart_longest_ms", self.restart_longest_ms, 10.0, 600_000.0),
                ("command_gap_ms", self.command_gap_ms, 0.1, 100.0),
            ],
        )?;
        // Of two that do not go together the one is at fault that was written.
        let (first, longest) = (self.restart_first_ms, self.restart_longest_ms);
        if longest == Self::default().restart_longest_ms {
            let most = "ms, the restart_longest_ms";
            return check_range("boards: ", "restart_first_ms", first, 10.0..=longest, most);
        }
        let least = "ms, from restart_first_ms on";
        check_range(
            "boards: ",
            "restart_longest_ms",
            longest,
            first..=600_000.0,
            least,
        )
    }
}
