//! The course of a calibration: collect, judge taxel by taxel, settle on threshold and faults.
//!
//! Judging a taxel sorts its samples, so it is spread over the frames of [`JUDGING_NS`]: at 30 Hz
//! it takes two frames, at 1 kHz fifty, and no tick waits for the whole hand.

use super::baseline::{TaxelIdle, Windows};
use super::config::{BaselineSource, FaultRule, ThresholdSource};
use super::faults::paper_rule;
use super::pair::FirstPair;
use super::report::CalibrationReport;
use super::spread::robust_spread;
use super::unchanging::LastingContact;
use super::{Conditioner, MS, NEVER};
use taxel_hand::{Fault, Faults, Freshness, TactileFrame};

/// Judging all taxels is spread over this much time.
const JUDGING_NS: u64 = 50 * MS;
/// Fewest taxels judged in a frame.
const JUDGED_AT_LEAST: usize = 4;
/// Fewest samples from which a taxel is called stuck.
const STUCK_SAMPLES: u32 = 8;
/// A taxel whose counts change so often at rest that this many changes are due within `stuck_ms` does not keep one value
/// for as long by chance: once in a million times.
const CHANGES_DUE: f64 = 14.0;
/// Times the noise limit, a step and its reversal are unsteady at run time.
const UNSTEADY_NOISES: f64 = 3.0;
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Waiting,
    Collecting { start_ns: u64 },
    Judging { next: usize },
    Done,
}

/// The state of calibration.
#[derive(Debug, Clone)]
pub(super) struct Calibration {
    phase: Phase,
    frames: u32,
    progress: f64,
    last_ns: u64,
    windows: Windows,
    pair: FirstPair,
    pub(super) idle: Vec<TaxelIdle>,
    pub(super) scratch: Vec<f64>,
    paper_faulty: Vec<bool>,
    /// Whether the hand rests as in one half of the window.
    pub(super) rests_in_half: bool,
    /// How often a taxel of the hand changes at rest, per nanosecond: the median.
    changes_per_ns: f64,
    /// Taxels without a baseline after the last calibration; they find their own when they speak.
    late: usize,
    next_late: usize,
    /// What the running calibration has found so far, or the last one did.
    pub(super) report: CalibrationReport,
    /// What the last one found that has ended.
    ended: Option<CalibrationReport>,
}

impl Calibration {
    pub(super) fn new(taxels: usize) -> Self {
        Self {
            phase: Phase::Waiting,
            frames: 0,
            progress: 0.0,
            last_ns: 0,
            windows: Windows::new(taxels),
            pair: FirstPair::new(taxels),
            idle: vec![TaxelIdle::default(); taxels],
            scratch: Vec::with_capacity(taxels),
            paper_faulty: vec![false; taxels],
            rests_in_half: false,
            changes_per_ns: 0.0,
            late: 0,
            next_late: 0,
            report: CalibrationReport::default(),
            ended: None,
        }
    }

    pub(super) fn is_running(&self) -> bool {
        self.phase != Phase::Done
    }

    /// Whether a taxel's samples go into its window.
    #[inline]
    pub(super) fn collects(&self, has_baseline: bool) -> bool {
        match self.phase {
            Phase::Waiting | Phase::Collecting { .. } => true,
            Phase::Judging { .. } => false,
            Phase::Done => !has_baseline,
        }
    }

    pub(super) fn collect(&mut self, taxel: usize, counts: [i32; 3], t_ns: u64) {
        self.windows.push(taxel, counts, t_ns);
    }

    pub(super) fn report(&self) -> Option<&CalibrationReport> {
        self.ended.as_ref()
    }

    /// There is nothing to be measured, but for `late` taxels that have no baseline.
    pub(super) fn skip(&mut self, late: usize) {
        (self.phase, self.progress) = (Phase::Done, 1.0);
        (self.late, self.next_late) = (late, 0);
    }

    pub(super) fn restart_clock(&mut self) {
        if matches!(self.phase, Phase::Waiting | Phase::Collecting { .. }) {
            self.phase = Phase::Waiting;
            self.frames = 0;
            self.pair.restart();
        }
        for n in 0..self.idle.len() {
            self.windows.clear(n);
        }
        if let Phase::Judging { .. } = self.phase {
            self.phase = Phase::Waiting;
            self.frames = 0;
            self.pair.restart();
        }
    }
}

impl Conditioner {
    /// Starts a new calibration on the next frame, without restart. Until it has ended no taxel is
    /// in contact and every force is zero; the old baseline and threshold can still be read.
    pub fn rezero(&mut self) {
        let calibration = &mut self.calibration;
        (calibration.phase, calibration.frames, calibration.progress) = (Phase::Waiting, 0, 0.0);
        calibration.pair.restart();
        for n in 0..self.taxels.len() {
            calibration.windows.clear(n);
            self.taxels[n].repair.reset();
            self.taxels[n].health.recalibrate();
            self.taxels[n].standing.remove(Fault::PaperRule);
            self.motion.rest(n);
            self.drift[n].disturb();
            self.tracks[n].start_anew();
        }
        self.contact.fill(false);
        self.lasting.fill(LastingContact::NONE);
        let floor = self.config.noise_floor_counts;
        self.health_limits.unsteady_counts = (UNSTEADY_NOISES * floor.max(1.0)) as i32;
    }

    /// Whether a calibration is running.
    pub fn is_calibrating(&self) -> bool {
        self.calibration.is_running()
    }

    /// How far the running calibration is, 0 to 1; 1 when none is running.
    pub fn calibration_progress(&self) -> f64 {
        self.calibration.progress
    }

    /// Whether anything is asked of the window; if not, the first two frames are enough.
    fn needs_window(&self) -> bool {
        let c = &self.config;
        c.baseline == BaselineSource::Window
            || c.threshold == ThresholdSource::Window
            || c.fault_rule == FaultRule::Robust
    }

    fn needs_pair(&self) -> bool {
        let c = &self.config;
        c.baseline == BaselineSource::FirstFrame
            || c.threshold == ThresholdSource::FirstPair
            || c.fault_rule == FaultRule::Paper
    }

    /// Takes calibration one frame further. `heard`: the frame had new samples.
    pub(super) fn calibrate(&mut self, frame: &TactileFrame, heard: bool, tick_ns: u64) {
        let taxels = self.baseline.len();
        match self.calibration.phase {
            Phase::Waiting if heard => {
                self.calibration.phase = Phase::Collecting { start_ns: frame.t_ns };
                self.gather(frame, frame.t_ns);
            }
            Phase::Collecting { start_ns } if heard => self.gather(frame, start_ns),
            Phase::Waiting | Phase::Collecting { .. } => {}
            Phase::Judging { next } => {
                let share = (tick_ns as f64 / JUDGING_NS as f64).min(1.0);
                let count = ((taxels as f64 * share).ceil() as usize).max(JUDGED_AT_LEAST);
                let end = (next + count).min(taxels);
                for n in next..end {
                    self.judge(n);
                }
                self.calibration.phase = Phase::Judging { next: end };
                if end == taxels {
                    self.settle();
                }
            }
            Phase::Done if self.calibration.late > 0 && heard => self.judge_late(),
            Phase::Done => {}
        }
    }

    fn gather(&mut self, frame: &TactileFrame, start_ns: u64) {
        let needs_pair = self.needs_pair();
        let calibration = &mut self.calibration;
        calibration.frames += 1;
        calibration.last_ns = frame.t_ns;
        if needs_pair && !calibration.pair.is_done() {
            let (tracks, counts) = (&self.tracks, self.motion.counts());
            calibration.pair.take(|n| {
                let heard = frame.freshness[n] == Freshness::Fresh && tracks[n].last_ns != NEVER;
                heard.then(|| (frame.counts[n], counts[n]))
            });
        }
        let pair_done = !needs_pair || self.calibration.pair.is_done();
        let (frames, elapsed) = (self.calibration.frames, frame.t_ns.saturating_sub(start_ns));
        let window_ns = self.config.calibration_ms * MS;
        let window_done = frames >= self.config.calibration_min_frames && elapsed >= window_ns;
        self.calibration.progress = if self.needs_window() {
            let by_frames = f64::from(frames) / f64::from(self.config.calibration_min_frames);
            by_frames.min(elapsed as f64 / window_ns as f64).min(0.99)
        } else {
            0.5
        };
        if pair_done && (window_done || !self.needs_window()) {
            self.begin_report(elapsed);
            self.calibration.windows.find_steps();
            self.calibration.phase = Phase::Judging { next: 0 };
            if !self.needs_window() {
                for n in 0..self.baseline.len() {
                    self.judge(n);
                }
                self.settle();
            }
        }
    }

    fn begin_report(&mut self, duration_ns: u64) {
        let frames = self.calibration.frames;
        self.calibration.report = CalibrationReport {
            frames,
            duration_ns,
            ..CalibrationReport::default()
        };
    }

    /// Judges one taxel's window and takes over its baseline.
    fn judge(&mut self, n: usize) {
        let calibration = &mut self.calibration;
        let from_frame = self.config.baseline == BaselineSource::FirstFrame;
        let pair = &calibration.pair;
        let zero = (from_frame && pair.present[n]).then(|| pair.zero[n].map(f64::from));
        let enough = from_frame && !self.config.fault_rule.is_robust();
        let fewest = if enough {
            1
        } else {
            self.config.calibration_min_frames.min(STUCK_SAMPLES)
        };
        let (samples, _) = calibration.windows.extent(n);
        let judged = calibration.windows.judge(
            n,
            zero,
            self.config.magnitude,
            self.config.outlier_sigmas,
            self.taxels[n].coarse,
        );
        self.touched[n] = false;
        self.taxels[n].has_baseline = false;
        let Some(mut idle) = judged.filter(|_| samples >= fewest) else {
            calibration.idle[n] = TaxelIdle::default();
            return;
        };
        calibration.report.outliers += u64::from(idle.outliers);
        idle.constant &= samples >= STUCK_SAMPLES;
        self.take_rest(n, idle, zero);
        self.touched[n] = idle.touched;
    }

    /// Takes over what a taxel's window says, and its baseline, `zero` where given. One that did not change is stuck
    /// until it does. It shows nothing meanwhile, and has moved away from what it rested at once it changes.
    fn take_rest(&mut self, n: usize, mut idle: TaxelIdle, zero: Option<[f64; 3]>) {
        idle.constant &= self.config.fault_rule.is_robust() && !self.taxels[n].coarse;
        if idle.constant && self.motion.counts()[n].map(f64::from) == idle.rest.baseline {
            self.taxels[n].health.judge_stuck();
        }
        self.take_baseline(n, zero.unwrap_or(idle.rest.baseline));
        self.calibration.idle[n] = idle;
    }

    pub(super) fn take_baseline(&mut self, n: usize, baseline: [f64; 3]) {
        self.taxels[n].has_baseline = true;
        self.drift[n].calibrated(baseline);
        self.baseline[n] = baseline;
    }

    /// All taxels are judged: noise limit, faults and threshold of the hand.
    fn settle(&mut self) {
        let taxels = self.baseline.len();
        if self.config.fault_rule.is_robust() {
            self.judge_noise();
            self.judge_stillness();
        } else {
            let c = &mut self.calibration;
            let (sigmas, two_sided) = (self.config.paper_sigmas, self.config.paper_two_sided);
            paper_rule(
                &c.pair.zero_raw,
                &c.pair.present,
                sigmas,
                two_sided,
                &mut c.paper_faulty,
            );
            for n in 0..taxels {
                if c.paper_faulty[n] {
                    self.taxels[n].standing.insert(Fault::PaperRule);
                }
            }
        }
        if self.config.threshold == ThresholdSource::Window && self.config.baseline == BaselineSource::Window
        {
            self.judge_movement();
            self.take_noise_of_parts();
        }
        if self.config.threshold == ThresholdSource::FirstPair {
            let pair = &self.calibration.pair;
            for n in 0..taxels {
                let zero = pair.zero[n].map(f64::from);
                self.calibration.idle[n].rest.peak = if pair.present[n] {
                    self.config.magnitude.of(pair.one[n], zero)
                } else {
                    0.0
                };
            }
        }
        let theta = self.hand_threshold();
        self.thresholds.set_theta(theta);
        for n in 0..taxels {
            let own = self.own_threshold(self.calibration.idle[n].rest.peak);
            self.thresholds.set_taxel(n, own);
            self.judge_zero(n);
        }

        let mut report = std::mem::take(&mut self.calibration.report);
        report.threshold = theta;
        let mut late = 0;
        for n in 0..taxels {
            report.touched += u32::from(self.touched[n]);
            late += usize::from(!self.taxels[n].has_baseline);
            report.count(self.settled_faults(n));
        }
        report.without_baseline = late as u32;
        self.calibration.ended = Some(report.clone());
        self.calibration.report = report;
        self.calibration.late = late;
        self.calibration.next_late = 0;
        for n in 0..taxels {
            self.calibration.windows.clear(n);
        }
        (self.calibration.phase, self.calibration.progress) = (Phase::Done, 1.0);
        self.counters.calibrations += 1;
    }

    /// The reasons against a taxel as they stand at the end of a calibration.
    pub(super) fn settled_faults(&self, n: usize) -> Faults {
        let mut faults = self.taxels[n].faults(self.config.fault_rule.is_robust());
        if !self.taxels[n].has_baseline && faults.is_empty() {
            faults.insert(Fault::Missing);
        }
        faults
    }

    /// Flags taxels whose noise is far above the hand's.
    fn judge_noise(&mut self) {
        let calibration = &mut self.calibration;
        let noise = &mut calibration.scratch;
        noise.clear();
        let idle = &calibration.idle;
        let usable = |n: &usize| {
            let taxel = &self.taxels[*n];
            taxel.has_baseline && taxel.standing.is_empty() && !idle[*n].constant
        };
        let usable = (0..self.baseline.len()).filter(usable);
        noise.extend(usable.map(|n| idle[n].noise_counts));
        let (median, sigma) = robust_spread(noise);
        let limit = (median + self.config.noise_sigmas * sigma).max(self.config.noise_floor_counts);
        calibration.report.noise_median_counts = median;
        calibration.report.noise_limit_counts = limit;
        self.health_limits.unsteady_counts = (UNSTEADY_NOISES * limit.max(1.0)) as i32;
        for n in 0..self.baseline.len() {
            let noisy = self.taxels[n].has_baseline && calibration.idle[n].noise_counts > limit;
            self.taxels[n].health.judge_noise(noisy);
        }
    }

    /// Finds which taxels may keep one value for long.
    fn judge_stillness(&mut self) {
        let calibration = &mut self.calibration;
        let rates = &mut calibration.scratch;
        rates.clear();
        let heard = (0..self.baseline.len()).filter(|n| self.taxels[*n].has_baseline);
        rates.extend(heard.map(|n| calibration.idle[n].changes_per_ns));
        calibration.changes_per_ns = robust_spread(rates).0;
        for n in 0..self.baseline.len() {
            self.tracks[n].may_rest = self.may_rest(n);
        }
    }

    /// Whether a taxel that keeps one value for `stuck_ms` may be healthy: its steps are coarse, or counts change so rarely
    /// at rest, those of the hand or its own. One that did not change at all in a hand that does is no proof of that.
    fn may_rest(&self, n: usize) -> bool {
        let idle = &self.calibration.idle[n];
        let hand = self.calibration.changes_per_ns;
        let rate = if idle.constant {
            hand
        } else {
            hand.min(idle.changes_per_ns)
        };
        self.taxels[n].coarse || rate * ((self.config.stuck_ms * MS) as f64) < CHANGES_DUE
    }

    /// Gives taxels that spoke too late for the calibration a baseline of their own, a few per frame.
    fn judge_late(&mut self) {
        let taxels = self.baseline.len();
        let mut budget = JUDGED_AT_LEAST;
        for _ in 0..taxels {
            let n = self.calibration.next_late;
            self.calibration.next_late = (n + 1) % taxels;
            let (samples, length_ns) = self.calibration.windows.extent(n);
            let full = samples >= self.config.calibration_min_frames.max(STUCK_SAMPLES)
                && length_ns >= self.config.calibration_ms.saturating_mul(MS);
            if self.taxels[n].has_baseline || !full {
                continue;
            }
            self.judge_alone(n);
            budget -= 1;
            if budget == 0 {
                break;
            }
        }
    }

    fn judge_alone(&mut self, n: usize) {
        let calibration = &mut self.calibration;
        let robust = self.config.fault_rule.is_robust();
        let idle = calibration.windows.judge(
            n,
            None,
            self.config.magnitude,
            self.config.outlier_sigmas,
            self.taxels[n].coarse,
        );
        calibration.windows.clear(n);
        let Some(idle) = idle else { return };
        calibration.late -= 1;
        let limit = calibration.report.noise_limit_counts;
        self.taxels[n].health.baseline_found();
        self.take_rest(n, idle, None);
        self.tracks[n].may_rest = self.may_rest(n);
        self.taxels[n]
            .health
            .judge_noise(robust && limit > 0.0 && idle.noise_counts > limit);
        let own = self.own_threshold(idle.rest.peak);
        self.thresholds.set_taxel(n, own);
        if self.config.threshold_per_taxel && self.settled_faults(n).is_empty() {
            self.thresholds.set_theta(own.max(self.thresholds.theta()));
        }
        self.judge_zero(n);
    }
}
