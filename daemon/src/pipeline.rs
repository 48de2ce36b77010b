//! The way from CAN frames to a tactile image, without I/O and without a clock.
//!
//! The daemon, the demo and `taxel compress` all run this code; only where frames and times come from differs. That
//! is why a recording gives the same bytes every time, live or offline.

use crate::config::{Config, TickMode};
use taxel_can::Received;
use taxel_compress::{Compressor, ProfileError, TactileImage};
use taxel_skin::{
    ConditionError, Conditioner, Decoded, Decoder, ForceFrame, Layout, Readings, SweepAssembler, TactileFrame,
};

/// Decoders, assembly, conditioning and compression of one hand, and the decision when an image is due.
pub struct Pipeline {
    decoders: Vec<Decoder>,
    readings: Readings,
    sweep: SweepAssembler,
    conditioner: Conditioner,
    compressor: Compressor,
    schedule: Schedule,
    paused: bool,
    outputs: Outputs,
}

/// What one tick made. The buffers are used again at the next tick.
#[derive(Debug, Clone, PartialEq)]
pub struct Outputs {
    /// The instant the image was due: the timer tick, the frame that completed the sweep or began the one after it, or
    /// its deadline. Nanoseconds.
    pub due_ns: u64,
    /// Raw counts with their ages.
    pub tactile: TactileFrame,
    /// Force above baseline, contacts and faults.
    pub force: ForceFrame,
    /// What displays are given.
    pub image: TactileImage,
}

/// In `sweep` mode, a hand that says nothing still gives an image this often, or every two of its periods where these
/// are longer, in which every taxel is missing: a display must be able to tell a silent hand from a dead daemon.
const SILENT_NS: u64 = 100_000_000;

/// When images are due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Schedule {
    Timer { next_ns: u64, period_ns: u64 },
    Sweep,
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
}

impl Pipeline {
    /// A pipeline for the hand and display of `config`, whose time starts at `origin_ns`: timer ticks are due at
    /// `origin_ns + k * period`, `k = 1, 2, ...`.
    pub fn new(config: &Config, origin_ns: u64) -> Result<Self, PipelineError> {
        let layout = &config.layout;
        let compressor = Compressor::new(config.profile.clone(), layout)?;
        let image = compressor.new_image();
        let schedule = match config.tick.mode {
            TickMode::Sweep => Schedule::Sweep,
            TickMode::Timer => {
                let period_ns = config.tick.period_ns();
                Schedule::Timer {
                    next_ns: origin_ns + period_ns,
                    period_ns,
                }
            }
        };
        Ok(Self {
            decoders: (0..layout.buses.len())
                .map(|bus| Decoder::new(layout, bus as u8))
                .collect(),
            readings: Readings::default(),
            sweep: SweepAssembler::new(layout, &config.sweep, config.tick.mode == TickMode::Sweep),
            conditioner: Conditioner::new(layout.len(), config.conditioning.clone())?,
            compressor,
            schedule,
            paused: false,
            outputs: Outputs {
                due_ns: origin_ns,
                tactile: TactileFrame::new(layout.len()),
                force: ForceFrame::new(layout.len()),
                image,
            },
        })
    }

    /// Takes one frame of bus number `bus`, after making every image that was due before it arrived. Frames of all
    /// buses come in the order of their times.
    pub fn push(&mut self, bus: u8, received: &Received, emit: &mut impl FnMut(&Outputs)) {
        self.advance(received.t_ns.saturating_sub(1), emit);
        let Some(decoder) = self.decoders.get_mut(bus as usize) else {
            return;
        };
        if let Decoded::Readings = decoder.decode(&received.frame, &mut self.readings) {
            for i in 0..self.readings.len() {
                let reading = self.readings[i];
                if self.sweep.overtaken_by(&reading, received.t_ns) {
                    self.tick(received.t_ns, emit);
                }
                self.sweep.push(&reading, received.t_ns);
            }
            if self.schedule == Schedule::Sweep && self.sweep.is_complete() {
                self.tick(received.t_ns, emit);
            }
        }
    }

    /// Makes every image that is due by `now_ns`.
    pub fn advance(&mut self, now_ns: u64, emit: &mut impl FnMut(&Outputs)) {
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
            Schedule::Sweep => {
                let silent_ns = SILENT_NS.max(self.sweep.hand_period_ns().saturating_mul(2));
                self.sweep.deadline_ns().or(Some(self.outputs.due_ns + silent_ns))
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

    fn tick(&mut self, now_ns: u64, emit: &mut impl FnMut(&Outputs)) {
        let Outputs {
            due_ns,
            tactile,
            force,
            image,
        } = &mut self.outputs;
        *due_ns = now_ns;
        self.sweep.take(now_ns, tactile);
        self.conditioner.process(tactile, force);
        if self.paused {
            force.contact.fill(false);
        }
        self.compressor.compress(force, image);
        emit(&self.outputs);
    }

    /// Starts a new calibration window: the hand must not be touched until it ends.
    pub fn rezero(&mut self) {
        self.conditioner.rezero();
    }

    /// While paused, images are made with no contact at all, so that every display lets go.
    pub fn set_paused(&mut self, paused: bool) {
        self.paused = paused;
    }

    /// Puts another compressor in place and returns the old one. The image changes its size with the next tick.
    pub fn replace_compressor(&mut self, compressor: Compressor) -> Compressor {
        std::mem::replace(&mut self.compressor, compressor)
    }

    /// Whether images are made without contacts.
    pub fn is_paused(&self) -> bool {
        self.paused
    }

    /// What the last tick made.
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// The decoder of each bus, with its counters.
    pub fn decoders(&self) -> &[Decoder] {
        &self.decoders
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

/// Runs a whole recording through a pipeline in the recording's own time: the offline path of `taxel compress`, and
/// bit for bit what the daemon makes of the same recording.
///
/// `frames` are in the order of their times, which start at zero. After the last frame, images go on until
/// `end_ns`.
pub fn run_recorded<'a>(
    config: &Config,
    frames: impl IntoIterator<Item = (u8, Received)> + 'a,
    end_ns: Option<u64>,
    mut emit: impl FnMut(&Layout, &Outputs),
) -> Result<(), PipelineError> {
    let mut pipeline = Pipeline::new(config, 0)?;
    let mut emit = |outputs: &Outputs| emit(&config.layout, outputs);
    let mut last_ns = 0;
    for (bus, received) in frames {
        last_ns = received.t_ns;
        pipeline.push(bus, &received, &mut emit);
    }
    pipeline.advance(end_ns.unwrap_or(last_ns).max(last_ns), &mut emit);
    Ok(())
}
