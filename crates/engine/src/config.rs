//! What an engine has to know, checked.

use serde::{Deserialize, Serialize};
use taxel_hand::{Fault, RangeError, check_range};
use taxel_joints::JointsConfig;
use taxel_skin::{
    BoardsConfig, Calibrated, ConditionConfig, ConditionError, Conditioner, Layout, SweepAssembler,
    SweepConfig,
};

/// A hand, and how its frames become tactile frames.
#[derive(Debug, Clone)]
pub struct EngineConfig {
    /// The hand.
    pub layout: Layout,
    /// When frames are made.
    pub tick: TickConfig,
    /// How boards are started and watched.
    pub boards: BoardsConfig,
    /// How sweeps are assembled.
    pub sweep: SweepConfig,
    /// Baseline, contact threshold, faults and repair.
    pub conditioning: ConditionConfig,
    /// What was known before the first frame, as where a part of a recording begins in a touch; `None` where the first
    /// frames are calibrated on.
    pub calibrated: Option<Calibrated>,
    /// Where joint angles come from, if any are read.
    pub joints: Option<EngineJoints>,
}

/// The joints of a hand.
#[derive(Debug, Clone)]
pub struct EngineJoints {
    /// Their source.
    pub config: JointsConfig,
    /// Number of the CAN bus that their angles come over: that of a bus of the skin, or the one
    /// after the last of these; `None` where they come over none.
    pub bus: Option<u8>,
    /// Whether somebody reads those that come over no CAN bus, and calls [`crate::Engine::handle_joints`].
    pub is_read: bool,
}

/// When frames are made.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TickConfig {
    /// What sets the pace.
    pub mode: TickMode,
    /// Images per second in `timer` mode, 1 to 1000 Hz.
    pub rate_hz: f64,
    /// `sweep` mode: while no reading comes, an image that says so is made this often, 10 to 60,000
    /// ms, or every two sweeps of the slowest board where these take longer.
    pub silent_ms: u32,
}

/// When an image is made.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TickMode {
    /// At a fixed rate.
    #[default]
    Timer,
    /// As soon as every taxel of a sweep has arrived, or at its deadline.
    Sweep,
}

impl Default for TickConfig {
    fn default() -> Self {
        Self {
            mode: TickMode::Timer,
            rate_hz: 30.0,
            silent_ms: 100,
        }
    }
}

impl TickConfig {
    /// Refuses what is out of its range.
    pub fn check(&self) -> Result<(), RangeError> {
        check_range("tick.", "rate_hz", self.rate_hz, 1.0..=1000.0, "Hz")?;
        check_range("tick.", "silent_ms", self.silent_ms, 10.0..=60_000.0, "ms")
    }

    /// Time between two ticks in `timer` mode, nanoseconds.
    pub fn period_ns(&self) -> u64 {
        (1e9 / self.rate_hz).round() as u64
    }
}

impl EngineConfig {
    /// Everything at its default, for this hand.
    pub fn new(layout: Layout) -> Self {
        Self {
            layout,
            tick: TickConfig::default(),
            boards: BoardsConfig::default(),
            sweep: SweepConfig::default(),
            conditioning: ConditionConfig::default(),
            calibrated: None,
            joints: None,
        }
    }
    /// The sweep assembly; boards do not settle that had spoken before.
    pub(crate) fn sweep(&self, sweep_mode: bool) -> SweepAssembler {
        let sweep = SweepAssembler::new(&self.layout, &self.sweep, sweep_mode);
        let Some(known) = &self.calibrated else {
            return sweep;
        };
        let had_value = |taxel: usize| {
            known
                .faults
                .get(taxel)
                .is_some_and(|faults| !faults.contains(Fault::Missing))
        };
        sweep.going_on(had_value)
    }

    /// The conditioning, calibrated where it is.
    pub(crate) fn conditioner(&self) -> Result<Conditioner, ConditionError> {
        let mut conditioner = Conditioner::for_layout(&self.layout, self.conditioning.clone())?;
        if let Some(known) = &self.calibrated {
            conditioner.go_on_from(known);
        }
        Ok(conditioner)
    }
}
