//! What estimators have in common.

use crate::error::ForearmError;
use crate::left_out::LeftOut;
use crate::squeeze::Squeeze;

/// What an estimate was made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Angles of the fingers.
    Kinesthetic,
    /// Tactile images.
    Tactile,
    /// Both.
    Fused,
}

impl std::fmt::Display for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Source::Kinesthetic => "kinesthetic",
            Source::Tactile => "tactile",
            Source::Fused => "fused",
        })
    }
}

/// Where a squeeze was made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// From 0 (wrist) to 100 (elbow).
    pub percent: f64,
    /// Nine of ten places, also of those that no training squeeze was made at, are within this of the estimate.
    pub half_width_90: f64,
    /// What it was made from.
    pub source: Source,
    /// What it was made without.
    pub left_out: LeftOut,
    /// How far the squeeze had come: 0 as PWM begins to rise, 1 at its peak, 2 where it is back at rest.
    pub phase: f64,
}

/// Something that was trained on squeezes and says where others were made.
pub trait Estimator {
    /// The place of a squeeze, or of as much of it as there is.
    ///
    /// # Errors
    /// A squeeze that is too short or damaged, or of another gripper.
    fn estimate(&self, squeeze: &Squeeze) -> Result<Estimate, ForearmError>;

    /// The same of a squeeze that goes on, equal to the bit, without looking at its earlier images again: what was seen in
    /// them is kept in `seen`, which is new for each squeeze.
    ///
    /// # Errors
    /// As [`Estimator::estimate`].
    fn follow(&self, squeeze: &Squeeze, seen: &mut Seen) -> Result<Estimate, ForearmError> {
        let _ = seen;
        self.estimate(squeeze)
    }
}

/// What an estimator has seen in the images of a squeeze so far.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Seen {
    /// Components of each row's image, row after row.
    pub(crate) scores: Vec<f64>,
    /// What they leave of each row's squares.
    pub(crate) rests: Vec<f64>,
    /// Total of each row's image.
    pub(crate) totals: Vec<f64>,
}
