//! What a calibration found, and what conditioning has counted since the start.

use super::moved::Movement;
use taxel_hand::{Fault, Faults};

/// What a calibration window found, kept for status until the next one ends.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct CalibrationReport {
    /// Frames with new samples in the window.
    pub frames: u32,
    /// Length of the window, nanoseconds.
    pub duration_ns: u64,
    /// Samples left out of the baseline.
    pub outliers: u64,
    /// Taxels whose level moved during the window, as under a touch: their baseline is doubtful;
    /// re-zero untouched.
    pub touched: u32,
    /// What moved during the window, so that baseline or threshold are in doubt.
    pub moved: Movement,
    /// Taxels without a baseline, which will find their own once they speak.
    pub without_baseline: u32,
    /// Faulty taxels.
    pub faulty: u32,
    /// Faulty taxels by reason, in the order of [`Fault::ALL`]; a taxel counts under each of its reasons.
    pub faulty_by_reason: [u32; Fault::ALL.len()],
    /// The contact threshold, in the unit of force.
    pub threshold: f64,
    /// Median idle noise over the healthy taxels (root of the sum of the axes' variances), counts.
    pub noise_median_counts: f64,
    /// Noise beyond which a taxel is noisy, counts.
    pub noise_limit_counts: f64,
}

impl CalibrationReport {
    /// Whether the hand was touched while it was calibrated.
    pub fn is_touched(&self) -> bool {
        self.touched > 0
    }

    /// Taxels that are faulty for this reason.
    pub fn faulty_for(&self, fault: Fault) -> u32 {
        Fault::ALL
            .iter()
            .position(|f| *f == fault)
            .map_or(0, |i| self.faulty_by_reason[i])
    }

    pub(super) fn count(&mut self, faults: Faults) {
        self.faulty += u32::from(!faults.is_empty());
        for (n, fault) in self.faulty_by_reason.iter_mut().zip(Fault::ALL) {
            *n += u32::from(faults.contains(fault));
        }
    }
}

/// What conditioning has counted since it was made.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct ConditionCounters {
    /// Frames processed.
    pub frames: u64,
    /// New samples taken in.
    pub samples: u64,
    /// Samples in which an axis crossed the border of 2^16.
    pub wraps: u64,
    /// Steps of doubtful direction that were taken the long way round modulo 2^16, back towards the baseline.
    pub long_ways: u64,
    /// Samples held back for confirmation.
    pub held: u64,
    /// Held samples the next one did not confirm.
    pub glitches: u64,
    /// Taxels pulled back from a wrong multiple of 65536 when they came to rest.
    pub recoveries: u64,
    /// Taxels whose unwrapped counts ran away beyond any motion and were anchored anew.
    pub runaways: u64,
    /// Samples not used because they read 0 or 65535 on every axis.
    pub dead_samples: u64,
    /// Samples not used because of their status byte.
    pub status_errors: u64,
    /// Times a taxel's drift reached its limit.
    pub drift_limited: u64,
    /// Frames refused because they have another number of taxels.
    pub mismatched_frames: u64,
    /// Times the frames' time went backwards.
    pub clock_restarts: u64,
    /// Calibrations that have ended.
    pub calibrations: u64,
}
