//! Settings of sweep assembly.

use super::period::START_NS;
use crate::range::{check_ranges, nanoseconds};
use serde::{Deserialize, Serialize};
use taxel_hand::RangeError;

/// How sweeps are assembled: the `[sweep]` table of the configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SweepConfig {
    /// Time between two sweeps of a board, ms, 1 to 10,000. By default each board's own is
    /// measured, which takes it about one sweep when the board comes up and some more when its rate
    /// changes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub board_period_ms: Option<f64>,
    /// `sweep` mode: a frame is made this long after the first reading for it even if taxels are
    /// missing, ms, 0.1 to 10,000 and no more than `stale_after_ms`. By default one and a half
    /// periods of the slowest board, since boards that run freely need a whole one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deadline_ms: Option<f64>,
    /// A value older than this is stale, ms, 1 to 60,000. By default three periods of its board, and 30 ms at least.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stale_after_ms: Option<f64>,
    /// A board or taxel that is missing in this many sweeps in a row is not waited for, 1 to 250;
    /// in `timer` mode, a board not heard for this many board periods is reported as silent.
    pub silent_after_sweeps: u8,
    /// What a board sends in this time after it is heard for the first time, or again after a
    /// second of silence, is thrown away, ms, 0 to 60,000: chips that are still being set up answer
    /// 0xFF, and the answers to their set-up look like taxel frames (docs/protocols.md, "uSkin
    /// values"). Not of iCub boards, which are calibrated before they speak.
    pub settle_ms: f64,
}

impl Default for SweepConfig {
    fn default() -> Self {
        Self {
            board_period_ms: None,
            deadline_ms: None,
            stale_after_ms: None,
            silent_after_sweeps: 3,
            settle_ms: 200.0,
        }
    }
}

impl SweepConfig {
    /// Refuses values outside their ranges.
    pub fn check(&self) -> Result<(), RangeError> {
        let mut ranges = vec![
            ("silent_after_sweeps", self.silent_after_sweeps as f64, 1.0, 250.0),
            ("settle_ms", self.settle_ms, 0.0, 60_000.0),
        ];
        ranges.extend(
            self.board_period_ms
                .map(|v| ("board_period_ms", v, 1.0, 10_000.0)),
        );
        // A value may not be stale before the frame it is for is made.
        let latest = self.stale_after_ms.unwrap_or(10_000.0).min(10_000.0);
        ranges.extend(self.deadline_ms.map(|v| ("deadline_ms", v, 0.1, latest)));
        ranges.extend(self.stale_after_ms.map(|v| ("stale_after_ms", v, 1.0, 60_000.0)));
        check_ranges("sweep: ", &ranges)
    }

    /// Time between two sweeps of a board, nanoseconds; where it is to be measured, what is assumed
    /// until then: the 10 ms of uSkin's 100 Hz.
    pub fn board_period_ns(&self) -> u64 {
        self.board_period_ms.map_or(START_NS, nanoseconds)
    }
}
