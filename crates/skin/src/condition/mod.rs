//! Conditioning: from raw counts to force above baseline, with faulty taxels named and contacts found.
//!
//! Each new sample is repaired (wraps modulo 2^16, single glitches), checked (dead, stuck, noisy, wrapping, status), measured
//! against the taxel's baseline, eq. (1), and compared with the contact threshold, eq. (2). Baseline, noise and threshold come
//! from a calibration window at the start and after each [`Conditioner::rezero`].

mod baseline;
mod calibrate;
mod config;
mod contact;
mod drift;
mod faults;
mod magnitude;
mod pair;
mod repair;
mod report;
mod taxel;

pub use config::{BaselineSource, ConditionConfig, ConditionError, FaultRule, ThresholdSource};
pub use magnitude::MagnitudeMode;
pub use report::{CalibrationReport, ConditionCounters};

use crate::Layout;
use crate::frame::{Fault, Faults, ForceFrame, Freshness, TactileFrame};
use crate::uskin::status_is_error;
use calibrate::Calibration;
use contact::Thresholds;
use drift::DriftLimits;
use faults::HealthLimits;
use repair::RepairLimits;
use taxel::{Rules, Taxel};

/// Sample time of a taxel that was never heard.
const NEVER: u64 = u64::MAX;
/// Nanoseconds per millisecond.
const MS: u64 = 1_000_000;

/// Turns tactile frames into force frames. Holds no clock and does no I/O; after [`Conditioner::new`] it allocates nothing, and
/// the same frames give the same results to the bit. Cost is linear in the number of taxels.
///
/// ```
/// use taxel_skin::{ConditionConfig, Conditioner, ForceFrame, Freshness, TactileFrame};
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
    taxels: Vec<Taxel>,
    /// Whether any taxel has eight bits only.
    coarse: bool,
    baseline: Vec<[f64; 3]>,
    faults: Vec<Faults>,
    touched: Vec<bool>,
    thresholds: Thresholds,
    calibration: Calibration,
    counters: ConditionCounters,
    frame_ns: u64,
}

impl Conditioner {
    /// Makes a conditioner for a hand of `taxels` taxels, with all its memory (about 2 KiB per taxel). It calibrates on the
    /// first frames.
    ///
    /// # Errors
    /// [`ConditionError`] where a setting is out of range, a masked taxel does not exist, or the hand has no taxels.
    pub fn new(taxels: usize, config: ConditionConfig) -> Result<Self, ConditionError> {
        if taxels == 0 || taxels > usize::from(u16::MAX) + 1 {
            return Err(ConditionError::Taxels { taxels });
        }
        config.validate(taxels)?;
        let mut standing = vec![Faults::NONE; taxels];
        for t in &config.masked_taxels {
            standing[usize::from(*t)].insert(Fault::Masked);
        }
        let (glitch, jump) = (config.glitch_counts as i32, config.jump_counts as i32);
        let mut conditioner = Self {
            repair_limits: RepairLimits {
                unwrap: config.repair_wraps,
                reject: config.reject_glitches,
                glitch_counts: glitch,
                jump_counts: jump,
                calm_counts: if config.reject_glitches {
                    glitch.min(jump)
                } else {
                    i32::MAX
                },
            },
            health_limits: HealthLimits::new(&config),
            drift_limits: DriftLimits::new(
                config.drift_time_constant_ms,
                config.drift_wait_ms,
                config.drift_limit_counts,
            ),
            coarse: false,
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

    /// Makes a conditioner for the taxels of a layout, as [`Conditioner::new`] does, and takes account of how their boards
    /// measure: counts of one axis are neither unwrapped nor held back as glitches, and where they have eight bits, a
    /// taxel that keeps one value is not stuck.
    pub fn for_layout(layout: &Layout, config: ConditionConfig) -> Result<Self, ConditionError> {
        let mut conditioner = Self::new(layout.len(), config)?;
        for (taxel, place) in conditioner.taxels.iter_mut().zip(&layout.taxels) {
            let protocol = layout.modules[usize::from(place.module)].protocol;
            (taxel.scalar, taxel.coarse) = (protocol.is_scalar(), protocol.is_coarse());
            conditioner.coarse |= taxel.coarse;
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

    /// Baseline `s_0` of each taxel, counts, as drift has moved it; zeros before the first calibration has ended.
    pub fn baseline(&self) -> &[[f64; 3]] {
        &self.baseline
    }

    /// Repaired counts of a taxel: its raw counts plus a multiple of 65536 on each axis; the last good ones while a sample is
    /// held back. Zeros for a taxel the hand does not have.
    pub fn repaired_counts(&self, taxel: usize) -> [i32; 3] {
        self.taxels.get(taxel).map_or([0; 3], |t| t.repair.counts())
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

    /// How many taxels have drifted to the limit, so that their baseline follows no further: a re-zero is due.
    pub fn drifted(&self) -> usize {
        self.taxels.iter().filter(|t| t.drift.is_at_limit()).count()
    }

    /// Takes a frame in and writes what the skin feels into `out`, which is given the right length if it has another.
    ///
    /// A taxel whose sample is no newer than the last one keeps its force and is not counted again. A frame with another number of
    /// taxels is counted, and every taxel is reported missing.
    pub fn process(&mut self, frame: &TactileFrame, out: &mut ForceFrame) {
        let taxels = self.taxels();
        self.counters.frames += 1;
        (out.seq, out.t_ns) = (frame.seq, frame.t_ns);
        out.force.resize(taxels, 0.0);
        out.contact.resize(taxels, false);
        out.faults.resize(taxels, Faults::NONE);
        out.repaired.resize(taxels, false);
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
        self.feel(frame, out);
        let heard = self.counters.samples != samples;
        self.calibrate(frame, heard, tick_ns);
    }

    /// Takes every taxel of a frame through repair, faults, magnitude, contact and drift.
    fn feel(&mut self, frame: &TactileFrame, out: &mut ForceFrame) {
        let taxels = self.taxels.len();
        let rules = Rules {
            robust: self.config.fault_rule.is_robust(),
            calibrating: self.calibration.is_running(),
            dead_samples: self.config.dead_samples,
            repair: self.repair_limits,
            scalar_repair: RepairLimits {
                unwrap: false,
                reject: false,
                calm_counts: i32::MAX,
                ..self.repair_limits
            },
            health: self.health_limits,
        };
        let mode = self.config.magnitude;
        let quiet_share = self.config.drift_quiet_share;
        let (follow_drift, drift_limits) = (self.config.follow_drift, self.drift_limits);
        let mut counters = self.counters;
        // Slices of one length, so that no index below needs a check.
        let (counts, status) = (&frame.counts[..taxels], &frame.status[..taxels]);
        let (age_ns, freshness) = (&frame.age_ns[..taxels], &frame.freshness[..taxels]);
        let (force_out, contact_out) = (&mut out.force[..taxels], &mut out.contact[..taxels]);
        let (faults_out, repaired_out) = (&mut out.faults[..taxels], &mut out.repaired[..taxels]);
        let (baselines, known_faults) = (&mut self.baseline[..taxels], &mut self.faults[..taxels]);
        for (n, taxel) in self.taxels.iter_mut().enumerate() {
            let baseline = &mut baselines[n];
            let mut faults;
            let (mut force, mut contact, mut repaired) = (0.0, false, false);
            if freshness[n] == Freshness::Fresh {
                let status_error = rules.robust && status_is_error(status[n]);
                let t_ns = frame.t_ns.saturating_sub(age_ns[n]);
                let is_new = taxel.last_ns == NEVER || t_ns > taxel.last_ns;
                let (dt_ns, accepted, repaired_counts);
                if is_new {
                    counters.samples += 1;
                    (dt_ns, accepted, repaired_counts) =
                        taxel.hear(counts[n], t_ns, status_error, baseline, &rules, &mut counters);
                    if accepted && self.calibration.collects(taxel.has_baseline) {
                        self.calibration.collect(n, repaired_counts, t_ns);
                    }
                } else {
                    (dt_ns, accepted, repaired_counts) = (0, false, taxel.repair.counts());
                }
                faults = taxel.faults(rules.robust);
                if status_error {
                    faults.insert(Fault::Status);
                }
                if !taxel.has_baseline && !rules.calibrating && faults.is_empty() {
                    faults.insert(Fault::Missing);
                }
                repaired = taxel.repair.is_repaired(repaired_counts);
                let mut quiet = false;
                if faults.is_empty() && !rules.calibrating {
                    force = mode.of(repaired_counts, *baseline);
                    contact = self.thresholds.is_contact(n, force, taxel.contact);
                    quiet = !contact;
                    if quiet && follow_drift && accepted {
                        let (sample, times) = ((force, repaired_counts), (t_ns, dt_ns));
                        let quiet_force = quiet_share * self.thresholds.of(n);
                        let limited = taxel
                            .drift
                            .follow(baseline, sample, times, quiet_force, &drift_limits);
                        counters.drift_limited += u64::from(limited);
                    }
                }
                if !quiet {
                    taxel.drift.disturb();
                }
            } else {
                faults = taxel.faults(rules.robust);
                faults.insert(Fault::Missing);
                taxel.drift.disturb();
            }
            taxel.contact = contact;
            known_faults[n] = faults;
            force_out[n] = force;
            contact_out[n] = contact;
            faults_out[n] = faults;
            repaired_out[n] = repaired;
        }
        self.counters = counters;
    }

    /// No taxel has a usable value in this frame.
    fn miss_all(&mut self, out: &mut ForceFrame) {
        let robust = self.config.fault_rule.is_robust();
        for (taxel, known) in self.taxels.iter_mut().zip(&mut self.faults) {
            *known = taxel.faults(robust);
            known.insert(Fault::Missing);
            taxel.contact = false;
            taxel.drift.disturb();
        }
        out.force.fill(0.0);
        out.contact.fill(false);
        out.faults.copy_from_slice(&self.faults);
        out.repaired.fill(false);
    }

    /// The frames' time went backwards, as when a recording starts again.
    fn restart_clock(&mut self) {
        self.counters.clock_restarts += 1;
        self.frame_ns = 0;
        for taxel in &mut self.taxels {
            taxel.restart_clock();
        }
        self.calibration.restart_clock();
    }
}
