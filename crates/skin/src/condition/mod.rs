//! Conditioning: from raw counts to force above baseline, with faulty taxels named and contacts found.
//!
//! Each new sample is repaired (wraps modulo 2^16, single glitches), checked (dead, stuck, noisy,
//! wrapping, status), measured against the taxel's baseline, eq. (1), and compared with the contact
//! threshold, eq. (2). Baseline, noise and threshold come from a calibration window at the start
//! and after each [`Conditioner::rezero`].

mod baseline;
mod calibrate;
mod calibrated;
mod config;
mod contact;
mod drift;
mod faults;
mod feel;
mod magnitude;
mod motion;
mod moved;
mod pair;
mod place;
mod repair;
mod report;
mod spread;
mod step;
mod taxel;
mod threshold;
mod unchanging;
mod usual;

pub use calibrated::Calibrated;
pub use config::{
    BaselineSource, ConditionConfig, ConditionError, ConditionSettings, FaultRule, Preset, ThresholdSource,
};
pub use magnitude::MagnitudeMode;
pub use moved::Movement;
pub use report::{CalibrationReport, ConditionCounters};

use crate::layout::Layout;
use crate::protocol::Protocol;
use calibrate::Calibration;
use contact::Thresholds;
use drift::{DriftLimits, DriftState};
use faults::HealthLimits;
use motion::Motion;
use place::RepairLimits;
use taxel::{Taxel, Track};
use taxel_hand::{Fault, Faults, ForceFrame, Freshness, TactileFrame};
use unchanging::LastingContact;

/// Sample time of a taxel that was never heard.
const NEVER: u64 = u64::MAX;
/// Nanoseconds per millisecond.
const MS: u64 = 1_000_000;

/// Turns tactile frames into force frames. Holds no clock and does no I/O; after
/// [`Conditioner::new`] it allocates nothing, and the same frames give the same results to the bit.
/// Cost is linear in the number of taxels.
///
/// ```
/// use taxel_hand::{ForceFrame, Freshness, TactileFrame};
/// use taxel_skin::{ConditionConfig, Conditioner};
///
/// let mut conditioner = Conditioner::new(2, ConditionConfig { calibration_ms: 100, ..ConditionConfig::robust() })?;
/// let (mut frame, mut force) = (TactileFrame::new(2), ForceFrame::new(2));
/// frame.freshness.fill(Freshness::Fresh);
/// frame.age_ns.fill(0);
/// for i in 0..30u16 {
///     frame.t_ns += 10_000_000;
///     let press = if i > 20 { 900 } else { 0 };
///     frame.counts = vec![[30_000 + i % 3, 30_000, 9_000], [30_000, 30_000 + i % 2, 9_000 - press]];
///     conditioner.process(&frame, &mut force);
/// }
/// assert_eq!(force.contact, [false, true]);
/// # Ok::<(), taxel_skin::ConditionError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Conditioner {
    config: ConditionConfig,
    repair_limits: RepairLimits,
    health_limits: HealthLimits,
    drift_limits: DriftLimits,
    motion: Motion,
    tracks: Vec<Track>,
    taxels: Vec<Taxel>,
    protocols: Vec<Protocol>,
    contact: Vec<bool>,
    lasting: Vec<LastingContact>,
    drift: Vec<DriftState>,
    /// Whether any taxel has eight bits only.
    coarse: bool,
    /// Whether no board measures: nobody says where the skin rests.
    without_boards: bool,
    baseline: Vec<[f64; 3]>,
    faults: Vec<Faults>,
    touched: Vec<bool>,
    /// Taxels of the frame at work that call for a closer look.
    unusual: Vec<usize>,
    thresholds: Thresholds,
    calibration: Calibration,
    counters: ConditionCounters,
    frame_ns: u64,
}

impl Conditioner {
    /// Makes a conditioner for a hand of `taxels` taxels, with all its memory (about 2 KiB per
    /// taxel). It calibrates on the first frames.
    ///
    /// # Errors
    /// [`ConditionError`] where a setting is out of range, a masked taxel does not exist, or the
    /// hand has no taxels.
    pub fn new(taxels: usize, config: ConditionConfig) -> Result<Self, ConditionError> {
        if taxels == 0 || taxels > usize::from(u16::MAX) + 1 {
            return Err(ConditionError::Taxels { taxels });
        }
        config.validate(taxels)?;
        let mut standing = vec![Faults::NONE; taxels];
        for t in &config.masked_taxels {
            standing[usize::from(*t)].insert(Fault::Masked);
        }
        let mut conditioner = Self {
            repair_limits: RepairLimits {
                unwrap: config.repair_wraps,
                reject: config.reject_glitches,
                glitch_counts: config.glitch_counts as i32,
                jump_counts: config.jump_counts as i32,
            },
            health_limits: HealthLimits::new(&config),
            drift_limits: DriftLimits::new(
                config.drift_time_constant_ms,
                config.drift_wait_ms,
                config.drift_limit_counts,
            ),
            coarse: false,
            without_boards: false,
            motion: Motion::new(taxels),
            tracks: vec![Track::new(); taxels],
            protocols: vec![Protocol::OFFLINE; taxels],
            contact: vec![false; taxels],
            lasting: vec![LastingContact::NONE; taxels],
            unusual: Vec::with_capacity(taxels),
            drift: vec![DriftState::default(); taxels],
            taxels: standing.iter().map(|s| Taxel::new(*s)).collect(),
            baseline: vec![[0.0; 3]; taxels],
            faults: standing,
            touched: vec![false; taxels],
            thresholds: Thresholds::new(taxels, config.threshold_per_taxel, config.threshold_release),
            calibration: Calibration::new(taxels),
            counters: ConditionCounters::default(),
            frame_ns: 0,
            config,
        };
        conditioner.rezero();
        Ok(conditioner)
    }

    /// Makes a conditioner for the taxels of a layout, as [`Conditioner::new`] does, and takes
    /// account of how their boards measure: counts of one axis are neither unwrapped nor held back
    /// as glitches, where they have eight bits, a taxel that keeps one value is not stuck, and where they rest at 0, one
    /// that reads 0 is not dead. A taxel of a skin without boards rests at 0 where that is no contact above its baseline,
    /// and until it has one, where the skin's first frame says nothing else.
    pub fn for_layout(layout: &Layout, config: ConditionConfig) -> Result<Self, ConditionError> {
        let mut conditioner = Self::new(layout.len(), config)?;
        conditioner.without_boards = true;
        for n in 0..layout.len() {
            let protocol = layout.wiring_of(n).protocol;
            conditioner.protocols[n] = protocol;
            conditioner.without_boards &= protocol == Protocol::OFFLINE;
            let measures = protocol.measures();
            conditioner.taxels[n].scalar = measures.axes == 1;
            conditioner.taxels[n].coarse = measures.has_coarse_steps();
            conditioner.tracks[n].may_rest = measures.has_coarse_steps();
            conditioner.taxels[n].rests_at_zero = measures.rests_at_zero;
            conditioner.coarse |= measures.has_coarse_steps() && !measures.rests_at_zero;
        }
        Ok(conditioner)
    }

    /// Number of taxels of the hand.
    pub fn taxels(&self) -> usize {
        self.baseline.len()
    }

    /// The settings it was made with.
    pub fn config(&self) -> &ConditionConfig {
        &self.config
    }

    /// Baseline `s_0` of each taxel, counts, as drift has moved it; zeros before the first
    /// calibration has ended.
    pub fn baseline(&self) -> &[[f64; 3]] {
        &self.baseline
    }

    /// Whether a taxel's baseline is known; never so before the first calibration has ended, nor
    /// for a taxel the hand does not have.
    pub fn has_baseline(&self, taxel: usize) -> bool {
        self.taxels.get(taxel).is_some_and(|t| t.has_baseline)
    }

    /// Repaired counts of a taxel: its raw counts plus a multiple of 65536 on each axis; the last
    /// good ones while a sample is held back. Zeros for a taxel the hand does not have.
    pub fn repaired_counts(&self, taxel: usize) -> [i32; 3] {
        self.motion.counts().get(taxel).copied().unwrap_or_default()
    }

    /// The contact threshold `theta`, in the unit of force; zero before the first calibration has ended.
    pub fn threshold(&self) -> f64 {
        self.thresholds.theta()
    }

    /// The threshold that holds for one taxel, in the unit of force.
    pub fn threshold_of(&self, taxel: usize) -> f64 {
        if taxel < self.baseline.len() {
            self.thresholds.of(taxel)
        } else {
            0.0
        }
    }

    /// Why each taxel was not used in the last frame.
    pub fn faults(&self) -> &[Faults] {
        &self.faults
    }

    /// Whose level moved during the last calibration, as under a touch.
    pub fn touched(&self) -> &[bool] {
        &self.touched
    }

    /// What the last calibration found; `None` before the first has ended.
    pub fn report(&self) -> Option<&CalibrationReport> {
        self.calibration.report()
    }

    /// What was counted since the start.
    pub fn counters(&self) -> ConditionCounters {
        self.counters
    }

    /// How many taxels have drifted to the limit, so that their baseline follows no further: a
    /// re-zero is due.
    pub fn drifted(&self) -> usize {
        self.drift.iter().filter(|d| d.is_at_limit()).count()
    }

    /// Whether a taxel has been in contact for two minutes or more in which its force has not changed:
    /// something rests on it, or its baseline has drifted faster than it was followed. Never for a taxel
    /// the hand does not have.
    ///
    /// No change is one of up to half its contact threshold within some ten seconds, and that noise ends the contact for a
    /// moment.
    pub fn is_unchanging(&self, taxel: usize) -> bool {
        self.lasting.get(taxel).is_some_and(|l| l.is_long(self.frame_ns))
    }

    /// Takes a frame in and writes what the skin feels into `out`, which is given the right length
    /// if it has another.
    ///
    /// A taxel whose sample is no newer than the last one keeps its force and is not counted again.
    /// A frame with another number of taxels is counted, and every taxel is reported missing.
    pub fn process(&mut self, frame: &TactileFrame, out: &mut ForceFrame) {
        let taxels = self.taxels();
        self.counters.frames += 1;
        (out.seq, out.t_ns) = (frame.seq, frame.t_ns);
        out.force.resize(taxels, 0.0);
        out.contact.resize(taxels, false);
        out.faults.resize(taxels, Faults::NONE);
        out.repaired.resize(taxels, false);
        out.saturated.resize(taxels, false);
        out.calibrating = self.is_calibrating();
        out.threshold = self.thresholds.theta();
        let lengths = [
            frame.counts.len(),
            frame.status.len(),
            frame.age_ns.len(),
            frame.freshness.len(),
        ];
        if lengths != [taxels; 4] {
            self.counters.mismatched_frames += 1;
            self.miss_all(out);
            return;
        }
        if frame.t_ns < self.frame_ns {
            self.restart_clock();
        }
        let tick_ns = frame.t_ns - self.frame_ns;
        self.frame_ns = frame.t_ns;
        let samples = self.counters.samples;
        if samples == 0 && self.without_boards {
            self.look_for_rest(frame);
        }
        self.feel(frame, out);
        let heard = self.counters.samples != samples;
        self.calibrate(frame, heard, tick_ns);
    }

    /// Takes a skin whose first values are all 0 to rest there, but for taxels whose baseline is known.
    fn look_for_rest(&mut self, frame: &TactileFrame) {
        let fresh = frame.freshness.iter().map(|f| *f == Freshness::Fresh);
        let mut values = fresh
            .zip(&frame.counts)
            .filter(|(is_fresh, _)| *is_fresh)
            .peekable();
        if values.peek().is_some() && values.all(|(_, counts)| *counts == [0; 3]) {
            for taxel in self.taxels.iter_mut().filter(|taxel| !taxel.has_baseline) {
                taxel.rests_at_zero = true;
            }
        }
    }

    /// Says by its baseline whether a taxel of a skin without boards rests at 0: where that is no contact.
    fn judge_zero(&mut self, n: usize) {
        if self.without_boards && self.taxels[n].has_baseline {
            let at_zero = self.config.magnitude.of([0; 3], self.baseline[n]);
            self.taxels[n].rests_at_zero = at_zero <= self.thresholds.of(n);
        }
    }

    /// No taxel has a usable value in this frame.
    fn miss_all(&mut self, out: &mut ForceFrame) {
        let robust = self.config.fault_rule.is_robust();
        for (n, known) in self.faults.iter_mut().enumerate() {
            *known = self.taxels[n].faults(robust);
            known.insert(Fault::Missing);
            self.drift[n].disturb();
        }
        self.contact.fill(false);
        self.lasting.fill(LastingContact::NONE);
        out.force.fill(0.0);
        out.contact.fill(false);
        out.faults.copy_from_slice(&self.faults);
        out.repaired.fill(false);
        out.saturated.fill(false);
    }

    /// The frames' time went backwards, as when a recording starts again.
    fn restart_clock(&mut self) {
        self.counters.clock_restarts += 1;
        self.frame_ns = 0;
        self.lasting.fill(LastingContact::NONE);
        for (track, drift) in self.tracks.iter_mut().zip(&mut self.drift) {
            track.restart_clock();
            drift.disturb();
        }
        self.calibration.restart_clock();
    }
}
