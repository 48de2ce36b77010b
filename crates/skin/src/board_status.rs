//! How a board fares: whether it speaks, and what became of every frame of it.

use serde::Serialize;

/// Whether a board speaks. Status reports call [`BoardState::NeverSeen`] "unheard" and
/// [`BoardState::Streaming`] "living".
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BoardState {
    /// Never heard.
    #[default]
    #[serde(rename = "unheard")]
    NeverSeen,
    /// Heard, but its first values are still thrown away.
    Settling,
    /// Sends its sweeps.
    #[serde(rename = "living")]
    Streaming,
    /// Was heard once and is no longer.
    Silent,
}

impl BoardState {
    /// The state in one word, as status reports print it.
    pub const fn name(self) -> &'static str {
        match self {
            BoardState::NeverSeen => "unheard",
            BoardState::Settling => "settling",
            BoardState::Streaming => "living",
            BoardState::Silent => "silent",
        }
    }
}

/// What one board has sent, since the start. Every count only grows.
///
/// Each reading of the board is in exactly one of `used`, `duplicate`, `late` and `settling`; each frame without
/// readings in one of `malformed` and `queue_overflows`.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct BoardStatus {
    /// Readings that renewed a taxel.
    pub used: u64,
    /// Readings of a taxel that came again within half a board period; the newest value is kept.
    pub duplicate: u64,
    /// Readings that came after their taxel had been published without them; the value is kept.
    pub late: u64,
    /// Readings thrown away because the board had just come up.
    pub settling: u64,
    /// Frames with a taxel's id and not 8 data bytes.
    pub malformed: u64,
    /// How often the board threw its transmit queue away.
    pub queue_overflows: u64,
    /// Readings that never came in a sweep of the board that has ended.
    pub missed: u64,
    /// Sweeps of the board that have ended.
    pub sweeps: u64,
    /// Readings, used or not, whose status byte reports an error.
    pub status_errors: u64,
    /// How often the board calibrated a part of its skin anew by itself
    /// ([`crate::Decoder::recalibrations`]): its baseline holds no longer, a re-zero is due.
    pub recalibrations: u64,
    /// How often it fell silent, for 30 ms or more.
    pub silences: u64,
    /// How long the newest of them lasted, or has lasted so far, nanoseconds; 0 while there was none.
    pub silence_ns: u64,
    /// Times it was told to start because it was silent.
    pub restarts: u64,
    /// Time between two sweeps of the board as measured, nanoseconds, 1 ms to 10 s; `None` until a
    /// taxel came twice.
    pub period_ns: Option<u64>,
    /// When the board was last heard, nanoseconds.
    pub last_ns: Option<u64>,
    /// Whether it speaks.
    pub state: BoardState,
}

impl BoardStatus {
    /// Frames of the board that are accounted for, where each carries one reading.
    pub fn frames(&self) -> u64 {
        self.used + self.duplicate + self.late + self.settling + self.malformed + self.queue_overflows
    }
}
