//! The way from CAN frames to a force frame, without I/O and without a clock; what displays are given is made of that
//! in `display.rs`.
//!
//! The daemon, the demo and `taxel compress` all run this code; only where frames and times come from differs. That
//! is why a recording gives the same bytes every time, live or offline.

use crate::config::{Config, TickMode};
use crate::display::Display;
use taxel_can::Received;
use taxel_hand::{ForceFrame, ProfileError, TactileFrame, TactileImage};
use taxel_joints::{JointFeed, JointHistory, JointsError, JointsSnapshot};
use taxel_skin::{
    ConditionError, Conditioner, Decoded, Decoder, Layout, Readings, SweepAssembler, TrafficWatch,
};

/// Decoders, assembly and conditioning of one hand, and the decision when an image is due.
pub struct Pipeline {
    decoders: Vec<Decoder>,
    readings: Readings,
    sweep: SweepAssembler,
    conditioner: Conditioner,
    joints: JointFeed,
    watch: TrafficWatch,
    schedule: Schedule,
    paused: bool,
    frames: Frames,
}

/// What one tick felt. The buffers are used again at the next tick.
#[derive(Debug, Clone, PartialEq)]
pub struct Frames {
    /// The instant the image was due: the timer tick, the frame that completed the sweep or began the one after it, or
    /// its deadline. Nanoseconds.
    pub due_ns: u64,
    /// Raw counts with their ages.
    pub tactile: TactileFrame,
    /// Force above baseline, contacts and faults. Without contacts while the pipeline is paused.
    pub force: ForceFrame,
}

/// What one tick of [`run_recorded`] made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs<'a> {
    /// The instant the image was due, nanoseconds.
    pub due_ns: u64,
    /// Raw counts with their ages.
    pub tactile: &'a TactileFrame,
    /// Force above baseline, contacts and faults.
    pub force: &'a ForceFrame,
    /// What a display of the configured profile is given.
    pub image: &'a TactileImage,
}

/// When images are due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Schedule {
    Timer { next_ns: u64, period_ns: u64 },
    Sweep { silent_ns: u64 },
}

/// Why a pipeline could not be built.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The profile describes no display.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// The conditioning cannot be done.
    #[error(transparent)]
    Condition(#[from] ConditionError),
    /// The joints cannot be read.
    #[error(transparent)]
    Joints(#[from] JointsError),
}

impl Pipeline {
    /// A pipeline for the hand of `config`, whose time starts at `origin_ns`: timer ticks are due at
    /// `origin_ns + k * period`, `k = 1, 2, ...`.
    pub fn new(config: &Config, origin_ns: u64) -> Result<Self, PipelineError> {
        let layout = &config.layout;
        let schedule = match config.tick.mode {
            TickMode::Sweep => Schedule::Sweep {
                silent_ns: u64::from(config.tick.silent_ms) * 1_000_000,
            },
            TickMode::Timer => {
                let period_ns = config.tick.period_ns();
                Schedule::Timer {
                    next_ns: origin_ns + period_ns,
                    period_ns,
                }
            }
        };
        if let Some(joints) = &config.joints {
            joints.check_beside(layout, &config.sources)?;
        }
        let joints = joint_feed(config, false)?;
        let mut frames = Frames {
            due_ns: origin_ns,
            ..Frames::new(layout.len())
        };
        joints.prepare(&mut frames.tactile);
        Ok(Self {
            decoders: (0..layout.buses.len())
                .map(|bus| Decoder::new(layout, bus as u8))
                .collect(),
            readings: Readings::default(),
            sweep: SweepAssembler::new(layout, &config.sweep, config.tick.mode == TickMode::Sweep),
            conditioner: Conditioner::for_layout(layout, config.conditioning.clone())?,
            joints,
            watch: TrafficWatch::new(layout),
            schedule,
            paused: false,
            frames,
        })
    }

    /// Has every frame carry the angles that a thread reads as well; [`Pipeline::handle_joints`] brings them.
    pub fn with_read_joints(mut self, config: &Config) -> Result<Self, PipelineError> {
        self.joints = joint_feed(config, true)?;
        self.joints.prepare(&mut self.frames.tactile);
        Ok(self)
    }

    /// Has the readings of the joints that a thread reads brought up to date: `update` is given those known so far.
    pub fn handle_joints(&mut self, update: impl FnOnce(&mut JointHistory)) {
        self.joints.handle_joints(0, update);
    }

    /// Takes one CAN frame of bus number `bus` (that of the joints alone has the number after
    /// the skin's last), after making the frames of every tick that was due before it arrived.
    /// CAN frames of all buses come in the order of their times.
    pub fn push(&mut self, bus: u8, received: &Received, emit: &mut impl FnMut(&Frames)) {
        self.advance(received.t_ns.saturating_sub(1), emit);
        self.watch.frame(bus, &received.frame);
        if self.joints.handle_frame(bus, received) {
            return;
        }
        let Some(decoder) = self.decoders.get_mut(bus as usize) else {
            return;
        };
        if let Decoded::Readings = decoder.decode_at(received.t_ns, &received.frame, &mut self.readings) {
            for i in 0..self.readings.len() {
                let reading = self.readings[i];
                if self.sweep.overtaken_by(&reading, received.t_ns) {
                    self.tick(received.t_ns, emit);
                }
                self.sweep.push(&reading, received.t_ns);
                self.watch.reading(&reading);
            }
            if self.is_sweep() && self.sweep.is_complete() {
                self.tick(received.t_ns, emit);
            }
        }
    }

    /// Makes the frames of every tick that is due by `now_ns`.
    pub fn advance(&mut self, now_ns: u64, emit: &mut impl FnMut(&Frames)) {
        self.watch.advance(now_ns);
        while let Some(due_ns) = self.due_ns().filter(|due| *due <= now_ns) {
            if let Schedule::Timer { next_ns, period_ns } = &mut self.schedule {
                *next_ns += *period_ns;
            }
            self.tick(due_ns, emit);
        }
    }

    /// When the next image is due without another frame coming: the next timer tick, the deadline of the sweep
    /// under way, or, while the whole hand is silent, an image that says so.
    pub fn due_ns(&self) -> Option<u64> {
        match self.schedule {
            Schedule::Timer { next_ns, .. } => Some(next_ns),
            // A display must be able to tell a silent hand from a dead daemon.
            Schedule::Sweep { silent_ns } => {
                let silent_ns = silent_ns.max(self.sweep.hand_period_ns().saturating_mul(2));
                self.sweep.deadline_ns().or(Some(self.frames.due_ns + silent_ns))
            }
        }
    }

    /// Gives up timer ticks that are more than one period overdue at `now_ns`, and returns how many. A live daemon
    /// that was held up calls this, since old images are of no use to a display; a replay never does.
    pub fn skip_overdue(&mut self, now_ns: u64) -> u64 {
        let Schedule::Timer { next_ns, period_ns } = &mut self.schedule else {
            return 0;
        };
        let overdue = now_ns.saturating_sub(*next_ns) / *period_ns;
        *next_ns += overdue * *period_ns;
        overdue
    }

    fn tick(&mut self, now_ns: u64, emit: &mut impl FnMut(&Frames)) {
        let Frames {
            due_ns,
            tactile,
            force,
        } = &mut self.frames;
        *due_ns = now_ns;
        self.sweep.take(now_ns, tactile);
        self.joints.fill(tactile);
        self.conditioner.process(tactile, force);
        if self.paused {
            force.contact.fill(false);
        }
        emit(&self.frames);
    }

    /// Starts a new calibration window: the hand must not be touched until it ends.
    pub fn rezero(&mut self) {
        self.conditioner.rezero();
    }

    /// While paused, force frames have no contact at all, so that every display lets go.
    pub fn set_paused(&mut self, paused: bool) {
        self.paused = paused;
    }

    /// Whether images are made without contacts.
    pub fn is_paused(&self) -> bool {
        self.paused
    }

    /// What the last tick felt.
    pub fn frames(&self) -> &Frames {
        &self.frames
    }

    /// The joints, with the commands that their sources are to be sent.
    pub fn joints(&mut self) -> &mut JointFeed {
        &mut self.joints
    }

    /// Copies what is known of the joints.
    pub fn joints_snapshot(&self, into: &mut JointsSnapshot) {
        self.joints.snapshot(&self.frames.tactile, into);
    }

    fn is_sweep(&self) -> bool {
        matches!(self.schedule, Schedule::Sweep { .. })
    }

    /// The decoder of each bus, with its counters.
    pub fn decoders(&self) -> &[Decoder] {
        &self.decoders
    }

    /// What the traffic on the buses shows.
    pub fn watch(&self) -> &TrafficWatch {
        &self.watch
    }

    /// The sweep assembly, with its counters per board.
    pub fn sweep(&self) -> &SweepAssembler {
        &self.sweep
    }

    /// The conditioning, with its baseline and faults.
    pub fn conditioner(&self) -> &Conditioner {
        &self.conditioner
    }
}

/// The joints of a configuration; `is_read` says that a thread reads those that do not come over CAN.
fn joint_feed(config: &Config, is_read: bool) -> Result<JointFeed, JointsError> {
    let bus = config.joints_bus().map(|bus| bus.index);
    match &config.joints {
        Some(joints) => Ok(JointFeed::new(joints, bus, is_read)?),
        None => Ok(JointFeed::none()),
    }
}

impl Frames {
    /// Empty frames of so many taxels, with all their memory.
    pub fn new(taxels: usize) -> Self {
        Self {
            due_ns: 0,
            tactile: TactileFrame::new(taxels),
            force: ForceFrame::new(taxels),
        }
    }
}

/// Runs a whole recording through a pipeline and compresses it for the configured profile, in the recording's own
/// time: the offline path of `taxel compress`, and bit for bit what the daemon makes of the same recording.
///
/// `frames` are in the order of their times, which start at zero. After the last frame, images go on until
/// `end_ns`.
pub fn run_recorded<'a>(
    config: &Config,
    frames: impl IntoIterator<Item = (u8, Received)> + 'a,
    end_ns: Option<u64>,
    mut emit: impl FnMut(&Layout, &Outputs<'_>),
) -> Result<(), PipelineError> {
    let mut pipeline = Pipeline::new(config, 0)?;
    let mut display = Display::new(config.profile.clone(), None, &config.layout)?;
    let mut emit = |frames: &Frames| {
        let outputs = Outputs {
            due_ns: frames.due_ns,
            tactile: &frames.tactile,
            force: &frames.force,
            image: display.compress(frames),
        };
        emit(&config.layout, &outputs);
    };
    let mut last_ns = 0;
    for (bus, received) in frames {
        last_ns = received.t_ns;
        pipeline.push(bus, &received, &mut emit);
    }
    pipeline.advance(end_ns.unwrap_or(last_ns).max(last_ns), &mut emit);
    Ok(())
}
