//! One board's side of sweep assembly: where its sweeps begin and end, how long they take, whether
//! it is alive.

use super::period::Period;
use crate::board_status::{BoardState, BoardStatus};

/// A board heard again after at least this silence may have been powered up anew, so it settles
/// again. Ten board periods where these are longer.
const SETTLE_AGAIN_NS: u64 = 1_000_000_000;
/// A silence that is shorter is not counted, three periods of a board of 100 Hz: of a faster one an adapter that keeps frames
/// back makes such.
const SHORTEST_SILENCE_NS: u64 = 30_000_000;

/// How old a value of a board is when it is stale, nanoseconds, where nothing is configured: three of its periods, and never
/// less than the shortest silence.
pub fn stale_after_ns(period_ns: u64) -> u64 {
    (3 * period_ns).max(SHORTEST_SILENCE_NS)
}

#[derive(Debug, Clone)]
pub(crate) struct Board {
    pub(crate) first: usize,
    pub(crate) taxels: usize,
    /// Number of the sweep under way, from 1, wholly lost ones included; meaningful while `seen > 0`.
    pub(crate) sweep: u64,
    sweep_start_ns: u64,
    /// Taxels seen in the sweep under way.
    pub(crate) seen: usize,
    /// The sweep that was under way and incomplete when the last frame was taken; 0 for none.
    pub(crate) sweep_at_take: u64,
    /// How long what it says is thrown away after it has come up.
    settle_ns: u64,
    settled_at_ns: u64,
    /// It spoke before the first frame that is seen of it.
    pub(crate) spoke_before: bool,
    /// Since when it is streaming; 0 if it never was.
    pub(crate) streaming_since_ns: u64,
    /// Whether it was heard since the last frame.
    pub(crate) heard: bool,
    /// Whether one of its taxels came twice since the last frame.
    pub(crate) repeated: bool,
    misses: u8,
    /// A streaming board that says nothing for longer than this is silent.
    silence_ns: u64,
    /// Whether the silence under way was counted.
    is_counted: bool,
    configured_ns: Option<u64>,
    measured: Period,
    pub(crate) counters: BoardStatus,
}

impl Board {
    pub(crate) fn new(first: usize, taxels: usize, configured_ns: Option<u64>, settle_ns: u64) -> Self {
        Self {
            first,
            taxels,
            sweep: 0,
            sweep_start_ns: 0,
            seen: 0,
            sweep_at_take: 0,
            settle_ns,
            settled_at_ns: 0,
            spoke_before: false,
            streaming_since_ns: 0,
            heard: false,
            repeated: false,
            misses: 0,
            silence_ns: u64::MAX,
            is_counted: false,
            configured_ns,
            measured: Period::new(taxels),
            counters: BoardStatus::default(),
        }
    }

    /// Time between two of its sweeps, nanoseconds: as configured, or else as measured.
    pub(crate) fn period_ns(&self) -> u64 {
        self.configured_ns.unwrap_or(self.measured.ns())
    }

    /// How old its values are when they are stale, nanoseconds, where nothing is configured.
    pub(crate) fn stale_after_ns(&self) -> u64 {
        stale_after_ns(self.period_ns())
    }

    /// Takes the time between two readings of one of its taxels.
    pub(crate) fn measure(&mut self, interval_ns: u64) {
        self.measured.measure(interval_ns);
        self.counters.period_ns = self.measured.measured_ns();
    }

    /// Takes note that it speaks, and returns whether what it says is to be thrown away because it
    /// has just come up.
    pub(crate) fn is_settling(&mut self, t_ns: u64) -> bool {
        let settle_ns = self.settle_ns;
        let power_up_ns = SETTLE_AGAIN_NS.max(10 * self.period_ns());
        let came_up = match self.counters.last_ns {
            None => !self.spoke_before,
            Some(last) => {
                let quiet_ns = t_ns.saturating_sub(last);
                // A silence between two frames taken, which neither saw.
                let unseen = quiet_ns > self.silence_ns && self.counters.state == BoardState::Streaming;
                if unseen || self.counters.state == BoardState::Silent {
                    self.count_silence(quiet_ns);
                }
                self.is_counted = false;
                quiet_ns >= power_up_ns
            }
        };
        if came_up && settle_ns > 0 {
            self.end_sweep();
            self.settled_at_ns = t_ns.saturating_add(settle_ns);
            self.counters.state = BoardState::Settling;
        }
        self.counters.last_ns = self.counters.last_ns.max(Some(t_ns));
        t_ns < self.settled_at_ns
    }

    /// Begins the next sweep if a reading of a taxel does not belong to the one under way. `before`
    /// is the time and the sweep of the reading before it of the same taxel.
    ///
    /// A loaded bus spreads a sweep over a whole period, so its age alone does not end it. If it is
    /// 3/4 of a period old and the taxel's last reading is half a period older than that reading's
    /// sweep explains, then the taxel was lost in this sweep, and leads the next one.
    pub(crate) fn place(&mut self, t_ns: u64, before: Option<(u64, u64)>) {
        let period_ns = self.period_ns();
        let sweep_age_ns = t_ns.saturating_sub(self.sweep_start_ns);
        let over = self.seen == 0
            || sweep_age_ns >= period_ns / 2 * 3
            || match before {
                None => sweep_age_ns >= period_ns / 8 * 7,
                Some((_, sweep)) if sweep == self.sweep => true,
                Some((before_ns, sweep)) => {
                    let explained_ns = period_ns.saturating_mul(self.sweep - sweep) + period_ns / 2;
                    sweep_age_ns >= period_ns / 4 * 3 && t_ns.saturating_sub(before_ns) >= explained_ns
                }
            };
        if over {
            self.end_sweep();
            let sweeps = sweep_age_ns.saturating_add(period_ns / 2) / period_ns;
            self.sweep += if self.sweep == 0 { 1 } else { sweeps.max(1) };
            self.sweep_start_ns = t_ns;
        }
        self.seen += 1;
    }

    fn end_sweep(&mut self) {
        if self.seen > 0 {
            self.counters.sweeps += 1;
            self.counters.missed += (self.taxels - self.seen) as u64;
            self.seen = 0;
        }
    }

    /// A frame was taken. `count_misses` says that it did not wait any longer for what is missing.
    pub(crate) fn at_take(&mut self, now_ns: u64, count_misses: bool, silent_after: u8, sweep_mode: bool) {
        self.sweep_at_take = if self.seen > 0 && self.seen < self.taxels {
            self.sweep
        } else {
            0
        };
        if self.heard {
            self.misses = 0;
        } else if count_misses {
            self.misses = self.misses.saturating_add(1);
        }
        self.heard = false;
        self.repeated = false;
        let Some(last_ns) = self.counters.last_ns else {
            return;
        };
        let quiet_ns = now_ns.saturating_sub(last_ns);
        self.silence_ns = (silent_after as u64).saturating_mul(self.period_ns());
        let silent = match self.counters.state {
            BoardState::Streaming if sweep_mode => self.misses >= silent_after,
            BoardState::Streaming | BoardState::Settling => quiet_ns > self.silence_ns,
            BoardState::NeverSeen | BoardState::Silent => false,
        };
        if silent {
            self.counters.state = BoardState::Silent;
        }
        if self.counters.state == BoardState::Silent {
            self.count_silence(quiet_ns);
        }
    }

    /// Counts a silence, which has lasted so long, once.
    fn count_silence(&mut self, quiet_ns: u64) {
        if quiet_ns >= SHORTEST_SILENCE_NS {
            self.counters.silences += u64::from(!self.is_counted);
            self.counters.silence_ns = quiet_ns;
            self.is_counted = true;
        }
    }
}

/// The period of the hand: that of the slowest living board; `None` while none lives.
pub(crate) fn slowest_ns(boards: &[Board]) -> Option<u64> {
    let streaming = boards
        .iter()
        .filter(|b| b.counters.state == BoardState::Streaming);
    streaming.map(Board::period_ns).max()
}
