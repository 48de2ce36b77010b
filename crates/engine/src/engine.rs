//! The engine: CAN frames, joint readings and times in; tactile frames and commands to boards out.

use crate::change::{Change, Changes};
use crate::command::Command;
use crate::config::EngineConfig;
use crate::frames::Frames;
use crate::schedule::Schedule;
use taxel_can::Received;
use taxel_joints::{JointFeed, JointHistory, JointsConfigError, JointsSnapshot};
use taxel_skin::{
    BoardStatus, BoardSupervisor, BusMonitor, ConditionError, Conditioner, Decoded, Decoder, Readings,
    SweepAssembler, TaxelReading,
};

/// One hand: decoders, sweep assembly, conditioning, joints and the supervision of its boards.
///
/// It does no I/O and has no clock. Frames of all buses come in the order of their times:
///
/// ```
/// # use taxel_engine::{Engine, EngineConfig};
/// # use taxel_can::{CanFrame, Received};
/// let config = EngineConfig::new(taxel_skin::Layout::builtin("uskin-module").unwrap());
/// let mut engine = Engine::new(&config, 0)?;
/// let received = Received { t_ns: 40_000_000, frame: CanFrame::standard(0x710, &[0x80, 1, 2, 3, 4, 5, 6, 1]).unwrap() };
/// engine.handle_frame(0, &received);
/// while let Some(frames) = engine.poll_output() {
///     assert_eq!(frames.tactile.missing(), 16); // the tick before it came
/// }
/// engine.handle_time(100_000_000);
/// while let Some(frames) = engine.poll_output() {
///     println!("{} taxels in contact", frames.force.contacts());
/// }
/// while let Some(command) = engine.poll_command(100_000_000) {
///     println!("bus {}: send {}", command.bus, command.frame);
/// }
/// # Ok::<(), taxel_engine::EngineError>(())
/// ```
pub struct Engine {
    decoders: Vec<Decoder>,
    readings: Readings,
    sweep: SweepAssembler,
    conditioner: Conditioner,
    joints: JointFeed,
    bus_monitor: BusMonitor,
    boards: BoardSupervisor,
    /// Whether each bus could be reached when that was told last.
    reached: Vec<bool>,
    /// The bus that joint angles come over.
    joints_bus: Option<u8>,
    schedule: Schedule,
    paused: bool,
    /// What a recorded daemon was told.
    changes: Changes,
    frames: Frames,
    /// Up to when ticks are made before what is at hand is looked at.
    until_ns: u64,
    at_hand: AtHand,
    /// What the last frame of the skin was.
    decoded: Option<Decoded>,
}

/// What [`Engine::poll_output`] goes on with.
#[derive(Clone, Copy)]
enum AtHand {
    Nothing,
    /// A frame of a bus, after the ticks that were due before it.
    Frame(u8, Received),
    /// The readings of a frame, from the `next`th on; `has_ticked` says that the sweep was cut
    /// before that one.
    Readings {
        next: usize,
        has_ticked: bool,
        t_ns: u64,
    },
}

/// Why an engine could not be built.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// The conditioning cannot be done.
    #[error(transparent)]
    Condition(#[from] ConditionError),
    /// The joints cannot be read.
    #[error(transparent)]
    Joints(#[from] JointsConfigError),
}

impl Engine {
    /// An engine whose time starts at `origin_ns`: timer ticks are due at `origin_ns + k * period`,
    /// `k = 1, 2, ...`. It takes all its memory here.
    pub fn new(config: &EngineConfig, origin_ns: u64) -> Result<Self, EngineError> {
        let layout = &config.layout;
        let schedule = Schedule::new(&config.tick, origin_ns);
        let joints = match &config.joints {
            Some(joints) => JointFeed::new(&joints.config, joints.bus, joints.is_read)?,
            None => JointFeed::none(),
        };
        let mut frames = Frames {
            due_ns: origin_ns,
            ..Frames::new(layout.len())
        };
        // Whoever waits for the baseline does not go on before the first frame.
        frames.force.calibrating = true;
        joints.prepare(&mut frames.tactile);
        Ok(Self {
            decoders: (0..layout.buses.len())
                .map(|bus| Decoder::new(layout, bus as u8))
                .collect(),
            readings: Readings::default(),
            sweep: config.sweep(schedule.is_sweep()),
            conditioner: config.conditioner()?,
            joints,
            bus_monitor: BusMonitor::new(layout),
            boards: BoardSupervisor::new(layout, &config.boards),
            reached: vec![false; layout.buses.len()],
            joints_bus: config.joints.as_ref().and_then(|joints| joints.bus),
            schedule,
            paused: false,
            changes: Changes::default(),
            frames,
            until_ns: 0,
            at_hand: AtHand::Nothing,
            decoded: None,
        })
    }

    /// Goes on with boards that were spoken to before, such as by [`BoardSupervisor::discover`].
    #[must_use]
    pub fn with_boards(mut self, boards: BoardSupervisor) -> Self {
        self.boards = boards;
        self
    }

    /// Takes one CAN frame of bus number `bus` (that of the joints alone has the number after the
    /// skin's last). What becomes of it, and the ticks that were due before it, come from
    /// [`Engine::poll_output`], which has to be called until it gives nothing more.
    pub fn handle_frame(&mut self, bus: u8, received: &Received) {
        debug_assert!(matches!(self.at_hand, AtHand::Nothing), "outputs were not polled");
        self.boards.handle_frame(bus, received);
        self.reach(received.t_ns.saturating_sub(1));
        self.at_hand = AtHand::Frame(bus, *received);
    }

    /// Time has come to `now_ns`. The ticks that are due come from [`Engine::poll_output`].
    pub fn handle_time(&mut self, now_ns: u64) {
        self.reach(now_ns);
    }

    fn reach(&mut self, now_ns: u64) {
        self.bus_monitor.advance(now_ns);
        self.until_ns = now_ns;
    }

    /// From the first tick on that feels what came at `t_ns` or later, the hand is felt as a recorded daemon's was after this
    /// change. It takes memory, and is for recordings.
    pub(crate) fn handle_change(&mut self, t_ns: u64, change: Box<Change>) {
        self.changes.push(t_ns, change);
    }

    /// Has the readings of a source of joints (0 the joints' own, 1 the potentiometers beside it) that come over no CAN bus
    /// brought up to date: `update` is given those known so far.
    pub fn handle_joints(&mut self, source: usize, update: impl FnOnce(&mut JointHistory)) {
        self.joints.handle_joints(source, update);
    }

    /// Whether a bus can be reached, told at every round before [`Engine::poll_command`]: `is_up`
    /// if its link is there, `is_active` if its controller takes part in the bus.
    pub fn handle_link(&mut self, bus: u8, is_up: bool, is_active: bool, now_ns: u64) {
        self.joints.handle_link(bus, is_up);
        let reached = is_up && is_active;
        if let Some(before) = self.reached.get_mut(usize::from(bus)) {
            if reached && !*before {
                self.boards.bus_restored(bus, now_ns);
            }
            *before = reached;
            let alone = !self.bus_monitor.strangers(bus) && self.joints_bus != Some(bus);
            self.boards.allow_search(bus, alone);
        }
    }

    /// What the next tick felt, of those that have become due; `None` when there is no other.
    pub fn poll_output(&mut self) -> Option<&Frames> {
        loop {
            match self.at_hand {
                AtHand::Nothing | AtHand::Frame(..) => {
                    if let Some(due_ns) = self.output_due_ns().filter(|due| *due <= self.until_ns) {
                        self.schedule.advance();
                        return Some(self.tick(due_ns));
                    }
                    let AtHand::Frame(bus, received) = self.at_hand else {
                        return None;
                    };
                    self.at_hand = self.decode(bus, &received);
                }
                AtHand::Readings {
                    next,
                    has_ticked,
                    t_ns,
                } => {
                    let Some(reading) = self.readings.get(next) else {
                        self.at_hand = AtHand::Nothing;
                        // Ticks that have become due with the sweep wait for their time.
                        self.until_ns = 0;
                        if self.schedule.is_sweep() && self.sweep.is_complete() {
                            return Some(self.tick(t_ns));
                        }
                        return None;
                    };
                    let overtaken = !has_ticked && self.sweep.overtaken_by(reading, t_ns);
                    if !overtaken {
                        self.sweep.push(reading, t_ns);
                        self.bus_monitor.handle_reading(reading);
                    }
                    self.at_hand = AtHand::Readings {
                        next: next + usize::from(!overtaken),
                        has_ticked: overtaken,
                        t_ns,
                    };
                    if overtaken {
                        return Some(self.tick(t_ns));
                    }
                }
            }
        }
    }

    /// Gives every output that has become due to `emit`.
    pub fn drain(&mut self, emit: &mut impl FnMut(&Frames)) {
        while let Some(frames) = self.poll_output() {
            emit(frames);
        }
    }

    fn decode(&mut self, bus: u8, received: &Received) -> AtHand {
        let Received { t_ns, frame } = received;
        self.bus_monitor.handle_frame(bus, received);
        self.decoded = if self.joints.handle_frame(bus, received) {
            None
        } else {
            let decoder = self.decoders.get_mut(usize::from(bus));
            decoder.map(|decoder| decoder.decode_at(*t_ns, frame, &mut self.readings))
        };
        match self.decoded {
            Some(Decoded::Readings) => AtHand::Readings {
                next: 0,
                has_ticked: false,
                t_ns: *t_ns,
            },
            _ => AtHand::Nothing,
        }
    }

    fn tick(&mut self, now_ns: u64) -> &Frames {
        self.frames.due_ns = now_ns;
        self.sweep.take(now_ns, &mut self.frames.tactile);
        self.joints.fill(&mut self.frames.tactile);
        let t_ns = self.frames.tactile.t_ns;
        self.changes.make(t_ns, &mut self.conditioner, &mut self.paused);
        self.frames.feel(&mut self.conditioner, self.paused);
        &self.frames
    }

    /// The next frame to be sent on a bus now. One that could not be sent is told to
    /// [`Engine::handle_unsent`].
    pub fn poll_command(&mut self, now_ns: u64) -> Option<Command> {
        let sweep = &self.sweep;
        if let Some(command) = self
            .boards
            .poll_command(now_ns, |board| sweep.last_heard_ns(board))
        {
            return Some(Command::of_board(command));
        }
        self.joints.poll_command(now_ns).map(Command::of_joint)
    }

    /// A command could not be sent. It is given again when its time has come.
    pub fn handle_unsent(&mut self, command: &Command, now_ns: u64) {
        match command.origin() {
            crate::command::Origin::Board(command) => self.boards.not_sent(command, now_ns),
            crate::command::Origin::Joint(command) => self.joints.command_not_sent(command),
        }
    }

    /// From now on [`Engine::poll_command`] gives what leaves boards and joints as they were found:
    /// silent. Done when [`Engine::command_due_ns`] is `None`.
    pub fn stop(&mut self) {
        self.joints.stop();
        self.boards.stop();
    }

    /// When something is due without a frame coming before: a tick or a command, nanoseconds.
    pub fn poll_due_ns(&self) -> Option<u64> {
        self.output_due_ns()
            .into_iter()
            .chain(self.command_due_ns())
            .min()
    }

    /// When the next tick is due without a frame coming before: the next timer tick, the deadline
    /// of the sweep under way, or, while the whole hand is silent, a tick that says so.
    pub fn output_due_ns(&self) -> Option<u64> {
        match self.schedule {
            Schedule::Timer { next_ns, .. } => Some(next_ns),
            // A display must be able to tell a silent hand from a dead daemon.
            Schedule::Sweep { silent_ns } => {
                let silent_ns = silent_ns.max(self.sweep.hand_period_ns().saturating_mul(2));
                self.sweep.deadline_ns().or(Some(self.frames.due_ns + silent_ns))
            }
        }
    }

    /// When the next command is due without a frame coming before.
    pub fn command_due_ns(&self) -> Option<u64> {
        self.boards
            .poll_due_ns()
            .into_iter()
            .chain(self.joints.poll_due_ns())
            .min()
    }

    /// Gives up timer ticks that are more than one period overdue at `now_ns`, and returns how
    /// many. A live program that was held up calls this, since old images are of no use to a
    /// display; a replay never does.
    pub fn skip_overdue(&mut self, now_ns: u64) -> u64 {
        self.schedule.skip_overdue(now_ns)
    }

    /// Starts a new calibration window: the hand must not be touched until it ends.
    pub fn rezero(&mut self) {
        self.conditioner.rezero();
    }

    /// While paused, force frames have no contact at all, so that every display lets go.
    pub fn set_paused(&mut self, paused: bool) {
        self.paused = paused;
    }

    /// Whether frames are made without contacts.
    pub fn is_paused(&self) -> bool {
        self.paused
    }

    /// What the last tick felt.
    pub fn frames(&self) -> &Frames {
        &self.frames
    }

    /// Number of buses of the skin. That of joints alone has this number.
    pub fn skin_buses(&self) -> usize {
        self.decoders.len()
    }

    /// The bus that joint angles come over.
    pub fn joints_bus(&self) -> Option<u8> {
        self.joints_bus
    }

    /// Copies what is known of the joints. Allocates nothing once the snapshot has its memory.
    pub fn joints_into(&self, snapshot: &mut JointsSnapshot) {
        self.joints.snapshot(&self.frames.tactile, snapshot);
    }

    /// What the last frame was to the skin, and its readings if it had any; `None` where it was a joint's.
    pub fn last_frame(&self) -> Option<(Decoded, &[TaxelReading])> {
        let decoded = self.decoded?;
        let readings: &[TaxelReading] = match decoded {
            Decoded::Readings => &self.readings,
            _ => &[],
        };
        Some((decoded, readings))
    }

    /// Everything known of one board (module index).
    pub fn board(&self, module: u16) -> BoardStatus {
        BoardStatus::gather(module, &self.sweep, &self.decoders, Some(&self.boards))
    }

    /// The decoder of each bus, with its counters.
    pub fn decoders(&self) -> &[Decoder] {
        &self.decoders
    }

    /// What the traffic on the buses shows.
    pub fn bus_monitor(&self) -> &BusMonitor {
        &self.bus_monitor
    }

    /// The sweep assembly, with its counters per board.
    pub fn sweep(&self) -> &SweepAssembler {
        &self.sweep
    }

    /// The conditioning, with its baseline and faults.
    pub fn conditioner(&self) -> &Conditioner {
        &self.conditioner
    }

    /// The supervision of the boards.
    pub fn boards(&self) -> &BoardSupervisor {
        &self.boards
    }
}
