//! Sweep assembly: from readings, in any order and with gaps, to tactile frames.
//!
//! A board sends every taxel once per *board sweep*, without sequence number or time stamp, in an
//! order that changes with the load of the bus (docs/protocols.md, "MTB3 firmware"). So everything
//! here goes by taxel, never by order:
//!
//! * The period of each board is the median of the times between two readings of the same taxel, unless it is
//!   configured. The hand's period is that of its slowest living board.
//! * A reading less than half a board period after the one before it of the same taxel is a `duplicate`.
//! * A reading opens its board's next sweep if its taxel was already seen in the sweep under way,
//!   if it comes too late to be the taxel's reading for that sweep, or if that sweep began one and
//!   a half board periods ago or earlier. Taxels not seen by then are `missed`.
//! * A tactile frame is taken either at any time (*timer* mode) or when every awaited taxel was
//!   renewed since the last one, or at a deadline (*sweep* mode). Boards run on clocks of their
//!   own, so such a hand sweep holds parts of two sweeps of most boards.
//! * Boards that send in bursts, with gaps in which the whole hand is quiet, must not be cut in the
//!   middle of a burst: the image would wait a period for the other half. A hand sweep that waits
//!   only for what is overdue ends when a board begins its next sweep (see
//!   [`SweepAssembler::overtaken_by`]), and one that began in the middle of a burst begins anew
//!   with the next burst.
//! * A taxel that is left out of `silent_after_sweeps` hand sweeps in a row is not awaited until it
//!   speaks again, so that a dead board or taxel does not hold up the living.

mod board;
mod config;
mod period;

pub use board::stale_after_ns;
pub use config::SweepConfig;

use crate::board_status::{BoardState, BoardStatus};
use crate::layout::Layout;
use crate::range::nanoseconds;
use crate::reading::{TaxelReading, status_is_error};
use board::{Board, slowest_ns};
use taxel_hand::{Freshness, TactileFrame};

/// What became of one reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Push {
    /// It renewed its taxel.
    Used,
    /// Its taxel was renewed less than half a board period ago. The newest value is kept, and
    /// nothing else changes.
    Duplicate,
    /// It came after its taxel had been published without it: in `sweep` mode after the deadline of
    /// its own sweep, in `timer` mode after the taxel had been published as stale. Its value is
    /// kept with its true age; in `sweep` mode it does not count for the next sweep. Also a reading
    /// older than its taxel's value, which is not kept.
    Late,
    /// Its board has just come up, so it was thrown away.
    Settling,
    /// The layout has no such taxel; the reading was made with another layout.
    NoSuchTaxel,
}

#[derive(Debug, Clone, Copy)]
struct Slot {
    /// When the value was received.
    t_ns: u64,
    /// When it was last heard, thrown-away readings included.
    heard_ns: Option<u64>,
    /// The board sweep it was last seen in; 0 for none.
    sweep: u64,
    counts: [u16; 3],
    board: u16,
    status: u8,
    /// Hand sweeps in a row that ended without it.
    misses: u8,
    /// Whether any value was ever kept.
    seen: bool,
    /// Whether its value is newer than the last frame, late ones not counted.
    new: bool,
    /// Whether it came twice within half a period since the last frame.
    doubled: bool,
    /// Whether the hand sweep under way has it.
    renewed: bool,
    /// Whether the last frame went out without a usable value: not renewed (`sweep` mode) or stale
    /// (`timer` mode).
    left_out: bool,
    /// Whether a sweep waits for it.
    awaited: bool,
}

impl Slot {
    fn is_pending(&self) -> bool {
        self.awaited && !self.renewed
    }
}

/// Collects readings and gives tactile frames. Its memory is allocated once; `push` and
/// `is_complete` take constant time but for a look at every taxel once per burst, `take` takes time
/// in the number of taxels.
///
/// ```
/// use taxel_can::CanFrame;
/// use taxel_hand::TactileFrame;
/// use taxel_skin::{Decoder, Layout, Readings, SweepAssembler, SweepConfig};
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
    hand_period_ns: u64,
    configured_deadline_ns: Option<u64>,
    configured_stale_ns: Option<u64>,
    silent_after: u8,
    /// Awaited taxels that the hand sweep under way lacks.
    pending: usize,
    /// Time of the first reading of the hand sweep under way.
    first_ns: Option<u64>,
    /// Time of the newest value kept since the last frame.
    newest_ns: Option<u64>,
    /// Time of the newest reading that was not thrown away.
    last_reading_ns: u64,
    /// Time of the first reading after the last gap.
    burst_start_ns: u64,
    last_take_ns: u64,
    /// Whether the hand sweep under way is given up.
    cut: bool,
    seq: u64,
    last_frame_ns: u64,
}

impl SweepAssembler {
    /// An assembler for the taxels of a layout. `sweep_mode` says how frames will be taken: when a
    /// sweep is complete or at its deadline (`true`), or at the caller's own times (`false`).
    pub fn new(layout: &Layout, config: &SweepConfig, sweep_mode: bool) -> Self {
        let slots: Vec<Slot> = layout
            .taxels
            .iter()
            .map(|taxel| Slot {
                t_ns: 0,
                heard_ns: None,
                sweep: 0,
                counts: [0; 3],
                board: taxel.module,
                status: 0,
                misses: 0,
                seen: false,
                new: false,
                doubled: false,
                renewed: false,
                left_out: false,
                awaited: true,
            })
            .collect();
        let period_ns = config.board_period_ms.map(nanoseconds);
        let settle_ns = nanoseconds(config.settle_ms);
        let boards = layout
            .boards()
            .map(|(_, module, wiring)| {
                let settle_ns = if wiring.protocol.settles() { settle_ns } else { 0 };
                Board::new(
                    module.first_taxel as usize,
                    module.taxels as usize,
                    period_ns,
                    settle_ns,
                )
            })
            .collect();
        Self {
            pending: slots.len(),
            slots,
            boards,
            sweep_mode,
            hand_period_ns: config.board_period_ns(),
            configured_deadline_ns: config.deadline_ms.map(nanoseconds),
            configured_stale_ns: config.stale_after_ms.map(nanoseconds),
            silent_after: config.silent_after_sweeps,
            first_ns: None,
            newest_ns: None,
            last_reading_ns: 0,
            burst_start_ns: 0,
            last_take_ns: 0,
            cut: false,
            seq: 0,
            last_frame_ns: 0,
        }
    }

    /// Goes on in the middle of the traffic: boards of which a taxel `had_value` before do not settle when they are first heard.
    #[must_use]
    pub fn going_on(mut self, had_value: impl Fn(usize) -> bool) -> Self {
        for board in &mut self.boards {
            board.spoke_before = (board.first..board.first + board.taxels).any(&had_value);
        }
        self
    }

    /// `sweep` mode: whether a reading that is about to be pushed belongs to the next hand sweep,
    /// and all that the one under way still waits for is lost: the caller takes a frame at `t_ns`,
    /// and then pushes the reading.
    ///
    /// So it is if the reading's taxel was already renewed in this hand sweep, and every taxel
    /// waited for has not come for one and a half periods of its board, or came twice within half a
    /// period. Boards that lose nothing never get there. Each board has one say per hand sweep,
    /// with the first of its taxels that comes again; otherwise the deadline decides.
    pub fn overtaken_by(&mut self, reading: &TaxelReading, t_ns: u64) -> bool {
        if !self.sweep_mode || self.pending == 0 {
            return false;
        }
        let Some(slot) = self.slots.get(reading.taxel as usize) else {
            return false;
        };
        let board = &mut self.boards[slot.board as usize];
        let repeats = slot.renewed && t_ns >= slot.t_ns.saturating_add(board.period_ns() / 2);
        if !repeats || std::mem::replace(&mut board.repeated, true) {
            return false;
        }
        let boards = &self.boards;
        self.cut = self.slots.iter().filter(|s| s.is_pending()).all(|s| {
            let board = &boards[s.board as usize];
            let since_ns = s.t_ns.max(board.streaming_since_ns);
            s.doubled || t_ns.saturating_sub(since_ns) >= board.period_ns() / 2 * 3
        });
        self.cut
    }

    /// Takes one reading, received at `t_ns`. Readings of one board come in the order of their times.
    pub fn push(&mut self, reading: &TaxelReading, t_ns: u64) -> Push {
        let Some(slot) = self.slots.get_mut(reading.taxel as usize) else {
            return Push::NoSuchTaxel;
        };
        let board = &mut self.boards[slot.board as usize];
        board.counters.status_errors += status_is_error(reading.status) as u64;
        if slot.heard_ns.is_none_or(|heard| t_ns >= heard)
            && let Some(heard_ns) = slot.heard_ns.replace(t_ns)
        {
            board.measure(t_ns - heard_ns);
        }
        if board.is_settling(t_ns) {
            board.counters.settling += 1;
            return Push::Settling;
        }
        if t_ns.saturating_sub(self.last_reading_ns) >= self.hand_period_ns / 4 {
            self.begin_burst(t_ns);
        }
        self.last_reading_ns = self.last_reading_ns.max(t_ns);

        let slot = &mut self.slots[reading.taxel as usize];
        let board = &mut self.boards[slot.board as usize];
        board.heard = true;
        if slot.seen && t_ns < slot.t_ns {
            board.counters.late += 1;
            return Push::Late;
        }
        let before = (slot.sweep > 0).then_some((slot.t_ns, slot.sweep));
        let duplicate = slot.seen && t_ns - slot.t_ns < board.period_ns() / 2;
        slot.counts = reading.counts;
        slot.status = reading.status;
        slot.t_ns = t_ns;
        slot.seen = true;
        self.newest_ns = self.newest_ns.max(Some(t_ns));
        if duplicate {
            slot.new = true;
            slot.doubled = true;
            board.counters.duplicate += 1;
            return Push::Duplicate;
        }
        board.place(t_ns, before);
        slot.sweep = board.sweep;

        // What was lost was the taxel's reading before this one, if that was due.
        let skipped_one = before.is_some_and(|(before_ns, _)| t_ns - before_ns >= board.period_ns() / 2 * 3);
        let late =
            slot.left_out && (!self.sweep_mode || (board.sweep == board.sweep_at_take && !skipped_one));
        slot.left_out = false;
        if late {
            board.counters.late += 1;
            if self.sweep_mode {
                self.pending += !slot.awaited as usize;
                slot.awaited = true;
                return Push::Late;
            }
        } else {
            board.counters.used += 1;
        }

        self.pending -= slot.is_pending() as usize;
        slot.renewed = true;
        slot.new = true;
        slot.awaited = true;
        slot.misses = 0;
        if self.first_ns.is_none() {
            self.first_ns = Some(t_ns);
        }
        if board.counters.state != BoardState::Streaming {
            board.counters.state = BoardState::Streaming;
            board.streaming_since_ns = t_ns;
            self.pending += await_all(&mut self.slots[board.first..board.first + board.taxels]);
            self.hand_period_ns = slowest_ns(&self.boards).unwrap_or(self.hand_period_ns);
        }
        if late { Push::Late } else { Push::Used }
    }

    /// The whole hand was quiet for a quarter of its period and speaks again. If the burst that
    /// ended there held the end of one hand sweep and the beginning of the next, that beginning is
    /// forgotten: every taxel was in the burst, so it is in the next one too.
    fn begin_burst(&mut self, t_ns: u64) {
        let ended_ns = self.burst_start_ns;
        self.burst_start_ns = t_ns;
        let split = self.sweep_mode
            && self.pending > 0
            && self.first_ns.is_some()
            && self.last_take_ns >= ended_ns
            && (self.slots.iter().filter(|s| s.is_pending())).all(|s| s.seen && s.t_ns >= ended_ns);
        if split {
            self.first_ns = None;
            self.pending = 0;
            for slot in &mut self.slots {
                slot.renewed = false;
                self.pending += slot.awaited as usize;
            }
        }
    }

    /// Whether every awaited taxel was renewed since the last frame. Constant time.
    pub fn is_complete(&self) -> bool {
        self.pending == 0 && self.first_ns.is_some()
    }

    /// How many taxels are still to be renewed before [`SweepAssembler::is_complete`]. Constant time.
    pub fn awaited(&self) -> usize {
        self.pending
    }

    /// `sweep` mode: when the frame under way must be taken even if it is incomplete, nanoseconds;
    /// `None` while no reading for it has come, and in `timer` mode.
    ///
    /// With every board dead there is no deadline and so no frame: a caller that wants to say so
    /// takes one now and then without being asked, in which every value is stale.
    pub fn deadline_ns(&self) -> Option<u64> {
        let first = self.first_ns.filter(|_| self.sweep_mode)?;
        Some(first.saturating_add(self.deadline_after_ns()))
    }

    fn deadline_after_ns(&self) -> u64 {
        self.configured_deadline_ns.unwrap_or(self.hand_period_ns / 2 * 3)
    }

    /// Time between two sweeps of the slowest living board, nanoseconds: as configured, or else as measured.
    pub fn hand_period_ns(&self) -> u64 {
        self.hand_period_ns
    }

    /// Writes the newest values into `frame` and begins the next sweep. `frame.joints` is left as it is.
    ///
    /// Frames are numbered from 0. `t_ns` is the time of the newest reading since the last frame,
    /// or `now_ns` where none came, and never goes back; ages count from it. A value is fresh if it
    /// is not older than `stale_after_ms` at `now_ns` and, in `sweep` mode, came after the last
    /// frame and not late, or is younger than half a period of its board: what was lost is never
    /// shown as new by repeating what was there before.
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
            Some(first) => self.cut || now_ns >= first.saturating_add(self.deadline_after_ns()),
            None => true,
        };
        let count_misses = self.sweep_mode && sweep_ended;
        self.pending = 0;
        for (i, slot) in self.slots.iter_mut().enumerate() {
            let board = &self.boards[slot.board as usize];
            let age_ns = now_ns.saturating_sub(slot.t_ns);
            let young = slot.seen && age_ns < board.period_ns() / 2;
            let of_this_sweep = slot.new || young;
            let stale_after_ns = self.configured_stale_ns.unwrap_or(board.stale_after_ns());
            let fresh = slot.seen && age_ns <= stale_after_ns && (of_this_sweep || !self.sweep_mode);
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
                !of_this_sweep
            } else {
                slot.seen && !fresh
            };
            if count_misses && !of_this_sweep {
                slot.misses = slot.misses.saturating_add(1);
                slot.awaited &= slot.misses < self.silent_after;
            }
            slot.renewed = false;
            slot.new = false;
            slot.doubled = false;
            self.pending += slot.awaited as usize;
        }
        for board in &mut self.boards {
            board.at_take(now_ns, count_misses, self.silent_after, self.sweep_mode);
        }
        self.hand_period_ns = slowest_ns(&self.boards).unwrap_or(self.hand_period_ns);
        self.last_take_ns = now_ns;
        self.cut = false;
        self.first_ns = None;
        self.newest_ns = None;
    }

    /// When a board (module index) was last heard, thrown-away readings included; nanoseconds.
    pub fn last_heard_ns(&self, board: u16) -> Option<u64> {
        self.boards.get(board as usize)?.counters.last_ns
    }

    /// What a board (module index) has sent, as far as the assembly knows: without malformed
    /// frames, queue overflows and restarts, which [`BoardStatus::gather`] adds.
    pub fn board(&self, board: u16) -> BoardStatus {
        self.boards
            .get(board as usize)
            .map_or_else(BoardStatus::default, |b| b.counters)
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
