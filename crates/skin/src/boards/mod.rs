//! Starting boards, keeping them going and stopping them: what is sent to the buses, and when.
//!
//! Only commands of class 2 and packets to CySkin hubs can be built here. A class-7 frame
//! stops the sampling of every board that takes it for its own (docs/protocols.md, "MTB3 firmware"
//! and "uSkin commands"), so none is sent once boards have been started;
//! [`BoardSupervisor::discover`] comes before.

mod board;
mod config;
mod misplaced_boards;

pub use config::{BoardsConfig, BoardsMode};

use crate::layout::Layout;
use crate::protocol::commands::{BoardCommand, Sequences, TxMode};
use crate::protocol::mtb;
use crate::range::nanoseconds;
use board::{Board, Due, Pace, Sequence};
use misplaced_boards::{BusSet, Search};
use taxel_can::{CanFrame, Received};

/// A command to one board: `SET_TXMODE`, the configuration of an iCub board, or a packet to a
/// CySkin hub. It cannot be a class-7 frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutgoingCommand {
    /// Index of the bus in [`Layout::buses`].
    pub bus: u8,
    /// Index of the board's module in [`taxel_hand::Geometry::modules`]; of a hub's first module.
    pub board: u16,
    /// What the sequence it belongs to is for.
    pub mode: TxMode,
    /// Whether it is sent to start a board because it was silent.
    pub restart: bool,
    command: BoardCommand,
}

impl OutgoingCommand {
    /// The frame to send: standard and of class 2, or a packet to CySkin hubs: extended, or standard and of class 5.
    pub fn frame(&self) -> CanFrame {
        self.command.frame()
    }
}

/// Decides what to send to the boards of every bus, and when. It holds no clock and sends nothing
/// itself: call [`BoardSupervisor::poll_command`] until it has no command, then again at
/// [`BoardSupervisor::poll_due_ns`].
///
/// Boards that take no commands (L3, `cpm-finger`) are left alone in every mode.
///
/// An iCub board takes half a second to start, so a silent one is asked whether it is there, and
/// started when it answers: give what is heard to [`BoardSupervisor::handle_frame`]. One that never
/// answers is started blindly now and then.
///
/// A uSkin board or CySkin hub that was never heard is started on other buses of the hand too, if
/// these have no board of its address and [`BoardSupervisor::allow_search`] was called: wired to
/// another bus it would otherwise stay silent, and [`crate::BusMonitor`] could not say where it is.
/// An iCub board is only asked there whether it is there.
///
/// ```
/// use taxel_skin::{BoardSupervisor, BoardsConfig, Layout};
///
/// let hand = Layout::builtin("uskin-module").expect("built in");
/// let mut supervisor = BoardSupervisor::new(&hand, &BoardsConfig::default());
/// let command = supervisor.poll_command(0, |_| None).expect("the board is not started yet");
/// assert_eq!(command.frame().to_string(), "201#0700");
/// assert_eq!(supervisor.poll_command(0, |_| None), None);
/// // Nothing was heard of it, so it is started again after 100 ms.
/// assert_eq!(supervisor.poll_due_ns(), Some(100_000_000));
/// assert!(supervisor.poll_command(100_000_000, |_| None).is_some_and(|command| command.restart));
/// ```
#[derive(Debug, Clone)]
pub struct BoardSupervisor {
    boards: Vec<Board>,
    /// When the next command may be handed out, by bus.
    bus_free_ns: Vec<u64>,
    bus_gap_ns: u64,
    pace: Pace,
    stopping: bool,
    /// Buses on which boards of other buses may be looked for.
    searched: BusSet,
    /// Whether any command was ever handed out.
    spoken: bool,
}

impl BoardSupervisor {
    /// A supervisor for the boards of a layout; every board is due to be started at once.
    pub fn new(layout: &Layout, config: &BoardsConfig) -> Self {
        let trigger_ns = (1e9 / config.trigger_hz).round() as u64;
        let silence_ns = nanoseconds(config.silence_ms);
        let (trigger, silence_ns) = match config.mode {
            BoardsMode::Triggered => (Some((trigger_ns, None)), silence_ns.max(3 * trigger_ns)),
            BoardsMode::FreeRunning | BoardsMode::Passive => (None, silence_ns),
        };
        let mut boards: Vec<(Option<u8>, Board)> = Vec::new();
        if config.mode != BoardsMode::Passive {
            for (index, _, wiring) in layout.boards() {
                let of_hub = |(hub, _): &&mut (Option<u8>, Board)| hub.is_some() && *hub == wiring.hub;
                if let Some((_, board)) = boards.iter_mut().find(of_hub) {
                    board.modules.push(index);
                } else if let Some(sequences) = wiring.protocol.0.sequences(&layout.wired_board(index)) {
                    let asks_only = !sequences.ask.is_empty();
                    let mut board = Board::new(vec![index], wiring.bus, sequences);
                    board.search = Search::new(layout, wiring, asks_only);
                    boards.push((wiring.hub, board));
                }
            }
        }
        // Boards in the order of the layout, then hubs in theirs.
        boards.sort_by_key(|(hub, _)| *hub);
        let boards = boards.into_iter().map(|(_, board)| board).collect();
        Self {
            boards,
            bus_free_ns: vec![0; layout.buses.len()],
            bus_gap_ns: nanoseconds(config.command_gap_ms),
            pace: Pace {
                trigger,
                silence_ns,
                first_pause_ns: nanoseconds(config.restart_first_ms),
                longest_pause_ns: nanoseconds(config.restart_longest_ms),
            },
            stopping: false,
            searched: BusSet::default(),
            spoken: false,
        }
    }

    /// Whether any command was handed out yet.
    pub(crate) fn has_spoken(&self) -> bool {
        self.spoken
    }

    /// The buses and addresses of the MTBs it starts, with their modules.
    pub(crate) fn mtbs(&self) -> impl Iterator<Item = (u8, u16, &Sequences)> {
        self.boards
            .iter()
            .filter(|b| {
                matches!(
                    b.sequences.stop.first().map(|s| s.command),
                    Some(BoardCommand::Mtb(_))
                )
            })
            .map(|b| (b.bus, b.modules[0], &b.sequences))
    }

    /// The next command that is due at `now_ns`, if any. `last_heard_ns` tells when a board (module
    /// index) was last heard, as [`crate::SweepAssembler::last_heard_ns`] does.
    pub fn poll_command(
        &mut self,
        now_ns: u64,
        last_heard_ns: impl Fn(u16) -> Option<u64>,
    ) -> Option<OutgoingCommand> {
        if let Some(command) = self.poll_search(now_ns) {
            return Some(command);
        }
        loop {
            let bus_free_ns = &self.bus_free_ns;
            let board = self
                .boards
                .iter_mut()
                .filter(|b| b.ready_ns(bus_free_ns).is_some_and(|ready| ready <= now_ns))
                .min_by_key(|b| b.under_way.map_or(b.due_ns, |u| u.at_ns))?;
            let (sequence, step) = if let Some(under_way) = board.under_way {
                if board.skips_question(&under_way) {
                    continue;
                }
                (under_way.sequence, under_way.step)
            } else if self.stopping {
                if board.sequences.stop.is_empty() {
                    board.stopped = true;
                    continue;
                }
                (Sequence::Stop, 0)
            } else {
                let heard_ns = board.modules.iter().filter_map(|m| last_heard_ns(*m)).max();
                match board.poll_sequence(now_ns, heard_ns, &mut self.pace) {
                    Due::Nothing => continue,
                    Due::Start(sequence) => (sequence, 0),
                }
            };
            let command = board.take_step(sequence, step, now_ns, &self.pace);
            let tries = board.retry.map_or(0, |retry| retry.tries);
            match sequence {
                Sequence::Stop => board.search.stop(command),
                Sequence::Wake | Sequence::StartAgain | Sequence::Ask
                    if board.answered_ns.is_none() && last_heard_ns(board.modules[0]).is_none() =>
                {
                    board.search.try_again(tries, command, self.searched);
                }
                _ => {}
            }
            self.bus_free_ns[board.bus as usize] = now_ns + self.bus_gap_ns;
            self.spoken = true;
            return Some(OutgoingCommand {
                bus: board.bus,
                board: board.modules[0],
                mode: match sequence {
                    Sequence::Stop => TxMode::Stop,
                    _ => TxMode::Start,
                },
                restart: matches!(sequence, Sequence::Wake | Sequence::StartAgain),
                command,
            });
        }
    }

    /// Takes a frame that was received, whatever it is: an answer of a board that was asked whether
    /// it is there.
    #[inline]
    pub fn handle_frame(&mut self, bus: u8, received: &Received) {
        if let Some(address) = mtb::answering(&received.frame) {
            self.handle_answer(bus, address, received.t_ns);
        }
    }

    #[cold]
    fn handle_answer(&mut self, bus: u8, address: u8, t_ns: u64) {
        let asked = |b: &&mut Board| {
            b.bus == bus && b.sequences.ask.first().is_some_and(|s| s.command.is_to(address))
        };
        if let Some(board) = self.boards.iter_mut().find(asked) {
            board.handle_answer(t_ns);
        }
    }

    /// The next command of a search that is due.
    fn poll_search(&mut self, now_ns: u64) -> Option<OutgoingCommand> {
        let Self {
            boards, bus_free_ns, ..
        } = self;
        let due = |b: &&mut Board| b.search.at_ns(bus_free_ns).is_some_and(|at| at <= now_ns);
        let board = boards.iter_mut().find(due)?;
        let (bus, mode, command) = board.search.take()?;
        self.bus_free_ns[usize::from(bus)] = now_ns + self.bus_gap_ns;
        Some(OutgoingCommand {
            bus,
            board: board.modules[0],
            mode,
            restart: false,
            command,
        })
    }

    /// When to poll again, nanoseconds; `None` if nothing will ever be due (passive, or stopped).
    pub fn poll_due_ns(&self) -> Option<u64> {
        let starts = self.boards.iter().filter_map(|b| b.ready_ns(&self.bus_free_ns));
        let searches = self
            .boards
            .iter()
            .filter_map(|b| b.search.at_ns(&self.bus_free_ns));
        starts.chain(searches).min()
    }

    /// Says that a command could not be handed to its bus. The board is tried again after the first
    /// pause, and the attempt is not counted as a restart.
    pub fn not_sent(&mut self, command: &OutgoingCommand, now_ns: u64) {
        let of_command = |b: &&mut Board| b.modules[0] == command.board && b.bus == command.bus;
        let Some(board) = self.boards.iter_mut().find(of_command) else {
            // A search goes on with the next attempt.
            return;
        };
        board.restarts = board.restarts.saturating_sub(command.restart as u64);
        board.start_at(now_ns + self.pace.first_pause_ns);
    }

    /// Says that a bus can be reached again. Its boards may have lost their power with it, so they
    /// are started at once, whatever pause they were in.
    pub fn bus_restored(&mut self, bus: u8, now_ns: u64) {
        for board in self.boards.iter_mut().filter(|b| b.bus == bus) {
            board.start_at(now_ns);
        }
    }

    /// Says whether boards of other buses may be looked for on this one. Not where anything speaks
    /// that is not of the hand: the command to a board has a meaning of its own to an Allegro hand
    /// (docs/protocols.md, "Allegro 4 and 5").
    pub fn allow_search(&mut self, bus: u8, allowed: bool) {
        self.searched.set(bus, allowed);
    }

    /// Begins to stop every board: from now on [`BoardSupervisor::poll_command`] gives stop
    /// commands, one for each board, until [`BoardSupervisor::is_stopped`].
    pub fn stop(&mut self) {
        self.stopping = true;
        for board in &mut self.boards {
            board.due_ns = 0;
            board.under_way = None;
            board.search.give_up();
        }
    }

    /// Whether every board was given its stop command; at once where nothing is sent to any board.
    pub fn is_stopped(&self) -> bool {
        self.stopping && self.boards.iter().all(|b| b.stopped && b.search.is_over())
    }

    /// How often a board (module index) was started because it was silent.
    pub fn restarts(&self, board: u16) -> u64 {
        self.boards
            .iter()
            .find(|b| b.modules.contains(&board))
            .map_or(0, |b| b.restarts)
    }
}
