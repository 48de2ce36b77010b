//! How a conditioner is set: every switch on its own, with the two presets `robust` and `paper`.

use super::magnitude::MagnitudeMode;
use crate::range::check_ranges;
use serde::{Deserialize, Serialize};
use taxel_hand::{Method, RangeError};

/// Makes the settings twice: as a conditioner has them, and as a configuration states them.
macro_rules! settings {
    ($( $(#[doc = $doc:literal])* pub $name:ident: $kind:ty, )*) => {
        /// Settings of a [`Conditioner`](super::Conditioner). Unknown keys are refused; absent keys take
        /// the values of `preset`, and without one those of `robust`.
        ///
        /// Windows are given in time and counted in new samples, so that one setting fits 1 Hz and 1 kHz.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(from = "ConditionSettings")]
        pub struct ConditionConfig {
            $( $(#[doc = $doc])* pub $name: $kind, )*
        }

        /// What a configuration says of a [`ConditionConfig`]: a preset, and keys that differ from it.
        #[derive(Debug, Clone, Default, PartialEq, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct ConditionSettings {
            /// What the keys that are absent are; without it, what belongs to `method` of `[profile]`.
            pub preset: Option<Preset>,
            $( $(#[doc = $doc])* pub $name: Option<$kind>, )*
        }

        impl ConditionSettings {
            /// The settings as stated, over the preset stated, or else `implied`.
            pub fn over(&self, implied: Preset) -> ConditionConfig {
                let preset = self.preset.unwrap_or(implied).config();
                ConditionConfig {
                    $( $name: self.$name.clone().unwrap_or(preset.$name), )*
                }
            }
        }
    };
}

settings! {
    /// Where the baseline `s_0` comes from.
    pub baseline: BaselineSource,
    /// Length of the calibration window, milliseconds, 1 to 600,000.
    pub calibration_ms: u64,
    /// Fewest frames with new samples the window may hold, 2 to 10,000; it is lengthened until it has them.
    pub calibration_min_frames: u32,
    /// A sample further than this many robust standard deviations (1.4826 MAD, but no less than half a
    /// step of the counts) from the median of its axis is left out of the baseline, 2 to 1,000.
    pub outlier_sigmas: f64,

    /// What a taxel's force is, eq. (1).
    pub magnitude: MagnitudeMode,

    /// Where the contact threshold of eq. (2) comes from.
    pub threshold: ThresholdSource,
    /// Factor on the largest idle magnitude, 1 to 1,000.
    pub threshold_margin: f64,
    /// A contact ends at this share of the threshold, 0 to 1; 1 is no hysteresis.
    pub threshold_release: f64,
    /// The threshold is never below this, counts, 0 to 131,072 (squared in the squared magnitude
    /// modes). Unless it is 0, the threshold of a hand with taxels of 8 bits (the iCub's) is not
    /// below two of their steps either: 32 counts.
    pub threshold_min_counts: f64,
    /// Each taxel has the threshold of its own idle noise instead of the hand's largest.
    pub threshold_per_taxel: bool,

    /// By which rule taxels are found faulty.
    pub fault_rule: FaultRule,
    /// In the rule `paper`: also below the mean, instead of only above as worded.
    pub paper_two_sided: bool,
    /// In the rule `paper`: standard deviations from the mean, above 0 to 1,000; the publication says 1.
    pub paper_sigmas: f64,
    /// Taxels switched off by hand.
    pub masked_taxels: Vec<u16>,
    /// Noisy: idle noise beyond the hand's median by this many robust standard deviations, 2 to 1,000.
    pub noise_sigmas: f64,
    /// Never noisy below this idle noise (root of the sum of the three axes' variances), counts, 0 to 65,535.
    pub noise_floor_counts: f64,
    /// Stuck: no change by one count on any axis for this long, milliseconds, 1 to 600,000, or throughout the calibration;
    /// it is in use again with the first change, above the baseline that it rested at. Not found where counts change so
    /// rarely at rest that healthy taxels keep a value for as long.
    pub stuck_ms: u64,
    /// Dead after this many samples in a row of 0 or 65535 on every axis, 1 to 1,000.
    pub dead_samples: u32,
    /// Alive again after this many good samples in a row, 1 to 1,000.
    pub recover_samples: u32,
    /// Wrapping: more wraps than this within `wrap_window_ms` (leaky count), 1 to 100,000.
    pub wrap_limit: u32,
    /// The window of `wrap_limit`, milliseconds, 1 to 600,000.
    pub wrap_window_ms: u64,

    /// Unwraps counts modulo 2^16.
    pub repair_wraps: bool,
    /// Holds back a lone jump for one sample, until the next confirms it.
    pub reject_glitches: bool,
    /// A jump of one axis beyond this, while the other two are still, has to be confirmed; counts,
    /// 1 to 65,535.
    pub glitch_counts: u32,
    /// A jump beyond this has to be confirmed whatever the other axes do; counts, 1 to 65,535.
    pub jump_counts: u32,

    /// Lets the baseline follow slow drift while a taxel is untouched.
    pub follow_drift: bool,
    /// Time constant of following, milliseconds, 100 to 86,400,000. Drift by more than `drift_quiet_share` of the
    /// threshold within it is taken for a touch.
    pub drift_time_constant_ms: u64,
    /// A taxel counts as untouched after this long without contact, milliseconds, 0 to 600,000.
    pub drift_wait_ms: u64,
    /// ... and while its force, smoothed over that time, is below this share of the threshold,
    /// above 0 to 0.8.
    pub drift_quiet_share: f64,
    /// The baseline follows no further than this from its calibrated value on an axis, counts, 0 to 65,535.
    pub drift_limit_counts: f64,
}

/// Settings that belong together.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Robust against faults, noise and drift ([`ConditionConfig::robust`]).
    #[default]
    Robust,
    /// The publication's equations and its rule for faulty sensors ([`ConditionConfig::paper`]).
    Paper,
}

impl Preset {
    /// Its settings.
    pub fn config(self) -> ConditionConfig {
        match self {
            Self::Robust => ConditionConfig::robust(),
            Self::Paper => ConditionConfig::paper(),
        }
    }
}

impl From<Method> for Preset {
    /// The conditioning that belongs to a method of compression: the publication's to the publication's.
    fn from(method: Method) -> Self {
        match method {
            Method::Paper => Self::Paper,
            Method::Optimal => Self::Robust,
        }
    }
}

impl From<ConditionSettings> for ConditionConfig {
    fn from(stated: ConditionSettings) -> Self {
        stated.over(Preset::Robust)
    }
}

/// Where the baseline `s_0` comes from.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BaselineSource {
    /// Mean over the calibration window, or over its quieter half where the hand moves outside of that, outliers left out.
    #[default]
    Window,
    /// The first complete frame, `rho_0`, as the publication has it.
    FirstFrame,
}

/// Where the contact threshold `theta` comes from.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThresholdSource {
    /// Largest idle magnitude over the calibration window.
    #[default]
    Window,
    /// Largest magnitude of the second frame against the first, `rho_1` against `rho_0`: eq. (2) as printed.
    FirstPair,
}

/// By which rule taxels are found faulty. Missing and masked taxels are faulty under both.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultRule {
    /// Dead, stuck, noisy, wrapping, status error; found in calibration and at run time.
    #[default]
    Robust,
    /// On frame 0, any axis beyond the mean of all present taxels by one population standard deviation.
    Paper,
}

impl FaultRule {
    pub(super) fn is_robust(self) -> bool {
        self == Self::Robust
    }
}

impl Default for ConditionConfig {
    fn default() -> Self {
        Self::robust()
    }
}

impl ConditionConfig {
    /// The default: calibrated baseline and threshold, vector magnitude, robust faults, repair and drift on.
    pub fn robust() -> Self {
        Self {
            baseline: BaselineSource::Window,
            calibration_ms: 1_500,
            calibration_min_frames: 10,
            outlier_sigmas: 5.0,
            magnitude: MagnitudeMode::Vector,
            threshold: ThresholdSource::Window,
            threshold_margin: 1.5,
            threshold_release: 0.8,
            threshold_min_counts: 10.0,
            threshold_per_taxel: false,
            fault_rule: FaultRule::Robust,
            paper_two_sided: false,
            paper_sigmas: 1.0,
            masked_taxels: Vec::new(),
            noise_sigmas: 8.0,
            noise_floor_counts: 150.0,
            stuck_ms: 2_000,
            dead_samples: 3,
            recover_samples: 5,
            wrap_limit: 40,
            wrap_window_ms: 10_000,
            repair_wraps: true,
            reject_glitches: true,
            glitch_counts: 200,
            jump_counts: 8_192,
            follow_drift: true,
            drift_time_constant_ms: 30_000,
            drift_wait_ms: 1_000,
            drift_quiet_share: 0.5,
            drift_limit_counts: 1_000.0,
        }
    }

    /// The publication to the letter: `rho_0` as baseline, squared scalar magnitudes, threshold
    /// from `rho_1` against `rho_0`, faults by mean plus one standard deviation on frame 0; no
    /// repair, no hysteresis, no drift.
    pub fn paper() -> Self {
        Self {
            baseline: BaselineSource::FirstFrame,
            magnitude: MagnitudeMode::LiteralSquared,
            threshold: ThresholdSource::FirstPair,
            threshold_margin: 1.0,
            threshold_release: 1.0,
            threshold_min_counts: 0.0,
            fault_rule: FaultRule::Paper,
            repair_wraps: false,
            reject_glitches: false,
            follow_drift: false,
            ..Self::robust()
        }
    }

    /// Checks every range; `taxels` is the number of taxels of the hand.
    pub fn validate(&self, taxels: usize) -> Result<(), ConditionError> {
        let day_ms = 86_400_000.0;
        let checks = [
            ("calibration_ms", self.calibration_ms as f64, 1.0, 600_000.0),
            (
                "calibration_min_frames",
                f64::from(self.calibration_min_frames),
                2.0,
                10_000.0,
            ),
            ("outlier_sigmas", self.outlier_sigmas, 2.0, 1_000.0),
            ("threshold_margin", self.threshold_margin, 1.0, 1_000.0),
            ("threshold_release", self.threshold_release, 0.0, 1.0),
            ("threshold_min_counts", self.threshold_min_counts, 0.0, 131_072.0),
            ("paper_sigmas", self.paper_sigmas, f64::MIN_POSITIVE, 1_000.0),
            ("noise_sigmas", self.noise_sigmas, 2.0, 1_000.0),
            ("noise_floor_counts", self.noise_floor_counts, 0.0, 65_535.0),
            ("stuck_ms", self.stuck_ms as f64, 1.0, 600_000.0),
            ("dead_samples", f64::from(self.dead_samples), 1.0, 1_000.0),
            ("recover_samples", f64::from(self.recover_samples), 1.0, 1_000.0),
            ("wrap_limit", f64::from(self.wrap_limit), 1.0, 100_000.0),
            ("wrap_window_ms", self.wrap_window_ms as f64, 1.0, 600_000.0),
            ("glitch_counts", f64::from(self.glitch_counts), 1.0, 65_535.0),
            ("jump_counts", f64::from(self.jump_counts), 1.0, 65_535.0),
            (
                "drift_time_constant_ms",
                self.drift_time_constant_ms as f64,
                100.0,
                day_ms,
            ),
            ("drift_wait_ms", self.drift_wait_ms as f64, 0.0, 600_000.0),
            (
                "drift_quiet_share",
                self.drift_quiet_share,
                f64::MIN_POSITIVE,
                0.8,
            ),
            ("drift_limit_counts", self.drift_limit_counts, 0.0, 65_535.0),
        ];
        check_ranges("conditioning: ", &checks)?;
        match self.masked_taxels.iter().find(|t| usize::from(**t) >= taxels) {
            Some(&taxel) => Err(ConditionError::MaskedTaxel { taxel, taxels }),
            None => Ok(()),
        }
    }
}

/// Why a conditioner cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConditionError {
    /// A setting is outside its range, or not a number.
    #[error(transparent)]
    OutOfRange(#[from] RangeError),
    /// A taxel is masked that the hand does not have.
    #[error("conditioning: `masked_taxels` names taxel {taxel}, but the hand has only taxels 0 to {}; remove it or correct the layout", .taxels.saturating_sub(1))]
    MaskedTaxel {
        /// The taxel named.
        taxel: u16,
        /// How many taxels the hand has.
        taxels: usize,
    },
    /// The hand has no taxels, or more than a taxel number can name.
    #[error("conditioning: a hand of {taxels} taxels; 1 to 65536 are possible, check the layout")]
    Taxels {
        /// How many taxels the hand has.
        taxels: usize,
    },
}
