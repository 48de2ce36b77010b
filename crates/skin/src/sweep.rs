//! Sweep assembly: from readings, in any order and with gaps, to tactile frames.
//!
//! A board sends every taxel once per *board sweep*, without sequence number or time stamp, in an order that changes
//! with the load of the bus (protocols.md 0.5). So everything here goes by taxel, never by order:
//!
//! * A reading opens its board's next sweep if its taxel was already seen in the sweep under way, or if that sweep
//!   began 7/8 of a board period ago or earlier. Taxels not seen by then are `missed`.
//! * A reading less than half a board period after the one before it of the same taxel is a `duplicate`.
//! * A tactile frame is taken either at any time (*timer* mode) or when every awaited taxel was renewed since the
//!   last one, or at a deadline (*sweep* mode). Boards run on clocks of their own, so such a hand sweep holds parts of
//!   two sweeps of most boards.
//! * A taxel that is left out of `silent_after_sweeps` hand sweeps in a row is not awaited until it speaks again, so
//!   that a dead board or taxel does not hold up the living.

use crate::counters::{BoardCounters, BoardState, RangeError, check_ranges};
use crate::uskin::status_is_error;
use crate::{Freshness, Layout, TactileFrame, TaxelReading};
use serde::{Deserialize, Serialize};

/// A board heard again after at least this silence may have been powered up anew, so it settles again. Ten board
/// periods where these are longer.
const SETTLE_AGAIN_NS: u64 = 1_000_000_000;

/// How sweeps are assembled: the `[sweep]` table of the configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SweepConfig {
    /// Time between two sweeps of a board, ms, 1 to 10,000: 10 for uSkin's 100 Hz, 12 for XELA's 83 Hz, the trigger's
    /// period for triggered boards.
    pub board_period_ms: f64,
    /// `sweep` mode: a frame is made this long after the first reading for it even if taxels are missing, ms, 0.1 to
    /// 10,000. By default one and a half board periods, since boards that run freely need a whole one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deadline_ms: Option<f64>,
    /// A value older than this is stale, ms, 1 to 60,000. By default three board periods.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stale_after_ms: Option<f64>,
    /// A board or taxel that is missing in this many sweeps in a row is not waited for, 1 to 250; in `timer` mode, a
    /// board not heard for this many board periods is reported as silent.
    pub silent_after_sweeps: u8,
    /// What a board sends in this time after it is heard for the first time, or again after a second of silence, is
    /// thrown away, ms, 0 to 60,000: chips that are still being set up answer 0xFF, and the answers to their set-up
    /// look like taxel frames (protocols.md 2.6).
    pub settle_ms: f64,
}

impl Default for SweepConfig {
    fn default() -> Self {
        Self {
            board_period_ms: 10.0,
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
            ("board_period_ms", self.board_period_ms, 1.0, 10_000.0),
            ("silent_after_sweeps", self.silent_after_sweeps as f64, 1.0, 250.0),
            ("settle_ms", self.settle_ms, 0.0, 60_000.0),
        ];
        ranges.extend(self.deadline_ms.map(|v| ("deadline_ms", v, 0.1, 10_000.0)));
        ranges.extend(self.stale_after_ms.map(|v| ("stale_after_ms", v, 1.0, 60_000.0)));
        check_ranges("sweep", &ranges)
    }

    /// Time between two sweeps of a board, nanoseconds.
    pub fn board_period_ns(&self) -> u64 {
        nanoseconds(self.board_period_ms)
    }

    /// Time from the first reading of a hand sweep to its deadline, nanoseconds.
    pub fn deadline_ns(&self) -> u64 {
        nanoseconds(self.deadline_ms.unwrap_or(1.5 * self.board_period_ms))
    }

    /// Age over which a value is stale, nanoseconds.
    pub fn stale_after_ns(&self) -> u64 {
        nanoseconds(self.stale_after_ms.unwrap_or(3.0 * self.board_period_ms))
    }
}

pub(crate) fn nanoseconds(ms: f64) -> u64 {
    (ms * 1e6).round() as u64
}

/// What became of one reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Push {
    /// It renewed its taxel.
    Used,
    /// Its taxel was renewed less than half a board period ago. The newest value is kept, and nothing else changes.
    Duplicate,
    /// It came after its taxel had been published without it: in `sweep` mode after the deadline of its own sweep, in
    /// `timer` mode after the taxel had been published as stale. Its value is kept with its true age; in `sweep` mode
    /// it does not count for the next sweep. Also a reading older than its taxel's value, which is not kept.
    Late,
    /// Its board has just come up, so it was thrown away.
    Settling,
    /// The layout has no such taxel; the reading was made with another layout.
    NoSuchTaxel,
}

#[derive(Debug, Clone, Copy)]
struct Slot {
    t_ns: u64,
    /// The board sweep it was last seen in.
    sweep: u64,
    counts: [u16; 3],
    board: u16,
    status: u8,
    /// Hand sweeps in a row that ended without it.
    misses: u8,
    /// Whether any value was ever kept.
    seen: bool,
    /// Whether it was renewed since the last frame.
    renewed: bool,
    /// Whether the last frame went out without a usable value: not renewed (`sweep` mode) or stale (`timer` mode).
    left_out: bool,
    /// Whether a sweep waits for it.
    awaited: bool,
}

#[derive(Debug, Clone)]
struct Board {
    first: usize,
    taxels: usize,
    /// Number of the sweep under way, from 1; meaningful while `seen > 0`.
    sweep: u64,
    sweep_start_ns: u64,
    /// Taxels seen in the sweep under way.
    seen: usize,
    /// The sweep that was under way and incomplete when the last frame was taken; 0 for none.
    sweep_at_take: u64,
    settled_at_ns: u64,
    /// Whether it renewed a taxel since the last frame.
    heard: bool,
    misses: u8,
    counters: BoardCounters,
}

/// Collects readings and gives tactile frames. Its memory is allocated once; `push` and `is_complete` take constant
/// time, `take` takes time in the number of taxels.
///
/// ```
/// use taxel_can::CanFrame;
/// use taxel_skin::{Decoder, Layout, Readings, SweepAssembler, SweepConfig, TactileFrame};
///
/// let hand = Layout::builtin("uskin-module").expect("built in");
/// let config = SweepConfig { settle_ms: 0.0, ..SweepConfig::default() };
/// let mut decoder = Decoder::new(&hand, 0);
/// let mut sweep = SweepAssembler::new(&hand, &config, true);
/// let mut readings = Readings::new();
/// let mut tactile = TactileFrame::new(hand.len());
///
/// let t_ns = 1_000_000;
/// let frame = CanFrame::standard(0x713, &[0x82, 0x80, 0x10, 0x7F, 0xF0, 0x30, 0x39, 1])?;
/// decoder.decode(&frame, &mut readings);
/// for reading in readings.iter() {
///     sweep.push(reading, t_ns);
/// }
/// assert!(!sweep.is_complete(), "fifteen taxels are missing");
/// let deadline_ns = sweep.deadline_ns().expect("a sweep is under way");
/// sweep.take(deadline_ns, &mut tactile);
/// assert_eq!(tactile.counts[3], [0x8010, 0x7FF0, 0x3039]);
/// assert_eq!(tactile.missing(), 15);
/// # Ok::<(), taxel_can::FrameError>(())
/// ```
#[derive(Debug, Clone)]
pub struct SweepAssembler {
    slots: Vec<Slot>,
    boards: Vec<Board>,
    sweep_mode: bool,
    period_ns: u64,
    deadline_after_ns: u64,
    stale_after_ns: u64,
    settle_ns: u64,
    silent_after: u8,
    /// Awaited taxels that were not renewed since the last frame.
    pending: usize,
    /// Time of the first reading used since the last frame.
    first_ns: Option<u64>,
    /// Time of the newest value kept since the last frame.
    newest_ns: Option<u64>,
    seq: u64,
    last_frame_ns: u64,
}

impl SweepAssembler {
    /// An assembler for the taxels of a layout. `sweep_mode` says how frames will be taken: when a sweep is complete
    /// or at its deadline (`true`), or at the caller's own times (`false`).
    pub fn new(layout: &Layout, config: &SweepConfig, sweep_mode: bool) -> Self {
        let slots: Vec<Slot> = layout
            .taxels
            .iter()
            .map(|taxel| Slot {
                t_ns: 0,
                sweep: 0,
                counts: [0; 3],
                board: taxel.module,
                status: 0,
                misses: 0,
                seen: false,
                renewed: false,
                left_out: false,
                awaited: true,
            })
            .collect();
        let boards = layout
            .modules
            .iter()
            .map(|module| Board {
                first: module.first_taxel as usize,
                taxels: module.taxels as usize,
                sweep: 0,
                sweep_start_ns: 0,
                seen: 0,
                sweep_at_take: 0,
                settled_at_ns: 0,
                heard: false,
                misses: 0,
                counters: BoardCounters::default(),
            })
            .collect();
        Self {
            pending: slots.len(),
            slots,
            boards,
            sweep_mode,
            period_ns: config.board_period_ns(),
            deadline_after_ns: config.deadline_ns(),
            stale_after_ns: config.stale_after_ns(),
            settle_ns: nanoseconds(config.settle_ms),
            silent_after: config.silent_after_sweeps,
            first_ns: None,
            newest_ns: None,
            seq: 0,
            last_frame_ns: 0,
        }
    }

    /// Takes one reading, received at `t_ns`. Readings of one board come in the order of their times.
    pub fn push(&mut self, reading: &TaxelReading, t_ns: u64) -> Push {
        let Some(slot) = self.slots.get_mut(reading.taxel as usize) else {
            return Push::NoSuchTaxel;
        };
        let board = &mut self.boards[slot.board as usize];
        board.counters.status_errors += status_is_error(reading.status) as u64;

        let settle_again_ns = SETTLE_AGAIN_NS.max(10 * self.period_ns);
        let came_up = match board.counters.last_ns {
            None => true,
            Some(last) => t_ns.saturating_sub(last) >= settle_again_ns,
        };
        if came_up && self.settle_ns > 0 {
            board.end_sweep();
            board.settled_at_ns = t_ns.saturating_add(self.settle_ns);
            board.counters.state = BoardState::Settling;
        }
        board.counters.last_ns = board.counters.last_ns.max(Some(t_ns));
        if t_ns < board.settled_at_ns {
            board.counters.settling += 1;
            return Push::Settling;
        }

        if slot.seen && t_ns < slot.t_ns {
            board.counters.late += 1;
            return Push::Late;
        }
        let since_last_ns = t_ns - slot.t_ns;
        let duplicate = slot.seen && since_last_ns < self.period_ns / 2;
        slot.counts = reading.counts;
        slot.status = reading.status;
        slot.t_ns = t_ns;
        slot.seen = true;
        self.newest_ns = self.newest_ns.max(Some(t_ns));
        if duplicate {
            board.counters.duplicate += 1;
            return Push::Duplicate;
        }

        let seen_in_this_sweep = slot.sweep == board.sweep;
        let sweep_is_over = t_ns.saturating_sub(board.sweep_start_ns) >= self.period_ns / 8 * 7;
        if board.seen == 0 || seen_in_this_sweep || sweep_is_over {
            board.end_sweep();
            board.sweep += 1;
            board.sweep_start_ns = t_ns;
        }
        slot.sweep = board.sweep;
        board.seen += 1;

        let late = slot.left_out && (!self.sweep_mode || board.sweep == board.sweep_at_take);
        slot.left_out = false;
        if late {
            board.counters.late += 1;
            if self.sweep_mode {
                return Push::Late;
            }
        } else {
            board.counters.used += 1;
        }

        if !slot.renewed {
            slot.renewed = true;
            self.pending -= slot.awaited as usize;
        }
        slot.awaited = true;
        slot.misses = 0;
        board.heard = true;
        if self.first_ns.is_none() {
            self.first_ns = Some(t_ns);
        }
        if board.counters.state != BoardState::Living {
            board.counters.state = BoardState::Living;
            self.pending += await_all(&mut self.slots[board.first..board.first + board.taxels]);
        }
        if late { Push::Late } else { Push::Used }
    }

    /// Whether every awaited taxel was renewed since the last frame. Constant time.
    pub fn is_complete(&self) -> bool {
        self.pending == 0 && self.first_ns.is_some()
    }

    /// `sweep` mode: when the frame under way must be taken even if it is incomplete, nanoseconds; `None` while no
    /// reading for it has come, and in `timer` mode.
    ///
    /// With every board dead there is no deadline and so no frame: a caller that wants to say so takes one now and
    /// then without being asked, in which every value is stale.
    pub fn deadline_ns(&self) -> Option<u64> {
        let first = self.first_ns.filter(|_| self.sweep_mode)?;
        Some(first.saturating_add(self.deadline_after_ns))
    }

    /// Writes the newest values into `frame` and begins the next sweep. `frame.joints` is left as it is.
    ///
    /// Frames are numbered from 0. `t_ns` is the time of the newest reading since the last frame, or `now_ns` where
    /// none came, and never goes back; ages count from it. A value is fresh if it is not older than `stale_after_ms`
    /// at `now_ns` and, in `sweep` mode, was renewed since the last frame: a value is never shown as new twice there.
    pub fn take(&mut self, now_ns: u64, frame: &mut TactileFrame) {
        let taxels = self.slots.len();
        frame.counts.resize(taxels, [0; 3]);
        frame.status.resize(taxels, 0);
        frame.age_ns.resize(taxels, u64::MAX);
        frame.freshness.resize(taxels, Freshness::Missing);
        frame.seq = self.seq;
        frame.t_ns = self.newest_ns.unwrap_or(now_ns).max(self.last_frame_ns);
        self.seq += 1;
        self.last_frame_ns = frame.t_ns;

        let sweep_ended = match self.first_ns {
            Some(first) => now_ns >= first.saturating_add(self.deadline_after_ns),
            None => true,
        };
        let count_misses = self.sweep_mode && sweep_ended;
        self.pending = 0;
        for (i, slot) in self.slots.iter_mut().enumerate() {
            let fresh = slot.seen
                && now_ns.saturating_sub(slot.t_ns) <= self.stale_after_ns
                && (slot.renewed || !self.sweep_mode);
            frame.freshness[i] = match (slot.seen, fresh) {
                (false, _) => Freshness::Missing,
                (true, false) => Freshness::Stale,
                (true, true) => Freshness::Fresh,
            };
            frame.age_ns[i] = if slot.seen {
                frame.t_ns.saturating_sub(slot.t_ns)
            } else {
                u64::MAX
            };
            frame.counts[i] = slot.counts;
            frame.status[i] = slot.status;

            slot.left_out = if self.sweep_mode {
                !slot.renewed
            } else {
                slot.seen && !fresh
            };
            if count_misses && !slot.renewed {
                slot.misses = slot.misses.saturating_add(1);
                slot.awaited &= slot.misses < self.silent_after;
            }
            slot.renewed = false;
            self.pending += slot.awaited as usize;
        }
        for board in &mut self.boards {
            board.at_take(
                now_ns,
                count_misses,
                self.silent_after,
                self.sweep_mode,
                self.period_ns,
            );
        }
        self.first_ns = None;
        self.newest_ns = None;
    }

    /// When a board (module index) was last heard, thrown-away readings included; nanoseconds.
    pub fn last_heard_ns(&self, board: u16) -> Option<u64> {
        self.boards.get(board as usize)?.counters.last_ns
    }

    /// What a board (module index) has sent, as far as the assembly knows: without malformed frames, queue overflows
    /// and restarts, which [`BoardCounters::gather`] adds.
    pub fn board(&self, board: u16) -> BoardCounters {
        self.boards
            .get(board as usize)
            .map_or_else(BoardCounters::default, |b| b.counters)
    }
}

impl Board {
    fn end_sweep(&mut self) {
        if self.seen > 0 {
            self.counters.sweeps += 1;
            self.counters.missed += (self.taxels - self.seen) as u64;
            self.seen = 0;
        }
    }

    fn at_take(
        &mut self,
        now_ns: u64,
        count_misses: bool,
        silent_after: u8,
        sweep_mode: bool,
        period_ns: u64,
    ) {
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
        let Some(last_ns) = self.counters.last_ns else {
            return;
        };
        let quiet_ns = now_ns.saturating_sub(last_ns);
        let silent = match self.counters.state {
            BoardState::Living if sweep_mode => self.misses >= silent_after,
            BoardState::Living | BoardState::Settling => quiet_ns > silent_after as u64 * period_ns,
            BoardState::Unheard | BoardState::Silent => false,
        };
        if silent {
            self.counters.state = BoardState::Silent;
        }
    }
}

/// Makes a sweep wait for all of a board's taxels again, and returns how many more it waits for.
fn await_all(slots: &mut [Slot]) -> usize {
    let mut more = 0;
    for slot in slots {
        slot.misses = 0;
        if !slot.awaited {
            slot.awaited = true;
            more += !slot.renewed as usize;
        }
    }
    more
}
