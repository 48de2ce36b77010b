//! Angles and touch together.

use crate::error::ForearmError::{self, Angle, Lost, Still, Unlike};
use crate::estimate::{Estimate, Estimator, Seen, Source};
use crate::kinesthetic::Kinesthetic;
use crate::left_out::LeftOut;
use crate::session::Trial;
use crate::squeeze::Squeeze;
use crate::tactile::Tactile;
use serde::{Deserialize, Serialize};

/// Estimates that are farther apart than so many times what their errors explain contradict each other.
const CONTRADICTS: f64 = 3.0;
/// How many standard deviations the half of a 90 % interval is.
const DEVIATIONS: f64 = 1.6449;

/// How the two estimates are weighed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fusion {
    /// How far each is off compared with what its own interval says, kinesthetic and tactile: 1 is as it says.
    off: [f64; 2],
}

impl Fusion {
    /// Weighs by what the intervals say.
    pub fn by_intervals() -> Self {
        Self { off: [1.0; 2] }
    }

    /// Learns how far both are off from squeezes that neither was trained on. What one of them refuses tells nothing of it.
    ///
    /// # Errors
    /// No squeeze that each can estimate.
    pub fn train(
        kinesthetic: &Kinesthetic,
        tactile: &Tactile,
        trials: &[&Trial],
    ) -> Result<Self, ForearmError> {
        let off = |estimator: &dyn Estimator| {
            let square = |trial: &&Trial| {
                let estimate = estimator.estimate(&trial.squeeze).ok()?;
                let deviation = estimate.half_width_90 / DEVIATIONS;
                Some(((estimate.percent - trial.location_percent) / deviation).powi(2))
            };
            let (sum, count) = (trials.iter().filter_map(square))
                .fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
            (sum / count).sqrt()
        };
        let off = [off(kinesthetic), off(tactile)];
        if off.iter().all(|off| off.is_finite() && *off > 0.0) {
            Ok(Self { off })
        } else {
            Err(ForearmError::Untrained {
                what: "fusion needs squeezes that both estimators can estimate, and were not trained on"
                    .into(),
            })
        }
    }

    pub(crate) fn is_whole(&self) -> bool {
        self.off.iter().all(|off| off.is_finite() && *off > 0.0)
    }

    /// Both estimates as one: weighed by the inverse of their variances. Where they contradict each other the surer one is
    /// taken, with the wider of both intervals, and the other is left out. Where angles are lost, or touch is missing or
    /// unlike that of the training, the other is taken as it is. The interval is no narrower than if both erred together,
    /// since a place that is out of order is so for both.
    ///
    /// # Errors
    /// Angles of another gripper, whatever touch says; the first one's, where both are missing.
    pub(crate) fn fuse(
        &self,
        kinesthetic: Result<Estimate, ForearmError>,
        tactile: Result<Estimate, ForearmError>,
    ) -> Result<Estimate, ForearmError> {
        let (angles, touch) = match (kinesthetic, tactile) {
            (Ok(angles), Ok(touch)) => (angles, touch),
            (Err(error @ (Angle { .. } | Still { .. } | Unlike { .. })), _) => return Err(error),
            (Ok(mut angles), Err(error)) => {
                angles.left_out.touch = matches!(error, ForearmError::Touch { .. });
                return Ok(angles);
            }
            (error, Err(_)) => return error,
            (Err(error), Ok(mut touch)) => {
                if let Lost { left_out } = error {
                    touch.left_out = left_out;
                }
                return Ok(touch);
            }
        };
        let [a, b] = [
            self.off[0] * angles.half_width_90,
            self.off[1] * touch.half_width_90,
        ];
        let apart = (angles.percent - touch.percent).abs() * DEVIATIONS;
        if apart > CONTRADICTS * a.hypot(b) {
            let (mut surer, none) = (if a <= b { angles } else { touch }, LeftOut::default());
            surer.half_width_90 = angles.half_width_90.max(touch.half_width_90);
            surer.left_out = match surer.source {
                Source::Tactile => LeftOut {
                    angles: [true; 4],
                    ..none
                },
                _ => LeftOut {
                    touch: true,
                    ..angles.left_out
                },
            };
            return Ok(surer);
        }
        let weight = b * b / (a * a + b * b);
        Ok(Estimate {
            percent: weight * angles.percent + (1.0 - weight) * touch.percent,
            half_width_90: weight * angles.half_width_90 + (1.0 - weight) * touch.half_width_90,
            source: Source::Fused,
            left_out: angles.left_out,
            phase: angles.phase,
        })
    }
}

/// The fused estimator.
#[derive(Debug, Clone, PartialEq)]
pub struct Fused {
    /// From angles.
    pub kinesthetic: Kinesthetic,
    /// From tactile images.
    pub tactile: Tactile,
    /// How they are weighed.
    pub fusion: Fusion,
}

impl Estimator for Fused {
    fn estimate(&self, squeeze: &Squeeze) -> Result<Estimate, ForearmError> {
        self.follow(squeeze, &mut Seen::default())
    }

    fn follow(&self, squeeze: &Squeeze, seen: &mut Seen) -> Result<Estimate, ForearmError> {
        let touch = self.tactile.follow(squeeze, seen);
        self.fusion.fuse(self.kinesthetic.estimate(squeeze), touch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::left_out::ANGLES;

    fn estimate(percent: f64, half_width_90: f64, source: Source) -> Result<Estimate, ForearmError> {
        Ok(Estimate {
            percent,
            half_width_90,
            source,
            left_out: LeftOut::default(),
            phase: 2.0,
        })
    }

    #[test]
    fn what_was_lost_or_is_contradicted_is_left_out() {
        let fuse = |a, b| {
            let fused = Fusion::by_intervals().fuse(a, b).unwrap();
            (fused.source, fused.left_out.names().collect::<Vec<_>>())
        };
        let angles = |width| estimate(10.0, width, Source::Kinesthetic);
        let touch = |percent| estimate(percent, 8.0, Source::Tactile);
        assert_eq!(fuse(angles(8.0), touch(12.0)), (Source::Fused, vec![]));
        assert_eq!(
            fuse(angles(7.0), touch(90.0)),
            (Source::Kinesthetic, vec!["touch"])
        );
        assert_eq!(fuse(angles(9.0), touch(90.0)), (Source::Tactile, ANGLES.to_vec()));
        let left_out = LeftOut {
            angles: [false, false, true, true],
            touch: false,
        };
        let other = Fusion::by_intervals().fuse(Err(Unlike { times: 20.0 }), touch(50.0));
        assert!(
            other.is_err(),
            "another gripper's, whatever touch says: {other:?}"
        );
        let lost = fuse(Err(Lost { left_out }), touch(50.0));
        assert_eq!(lost, (Source::Tactile, ANGLES[2..].to_vec()));
    }

    #[test]
    fn the_surer_estimate_weighs_more_and_alone_where_the_other_is_missing_or_contradicts() {
        let angles = |percent| estimate(percent, 8.0, Source::Kinesthetic);
        let touch = |percent| estimate(percent, 16.0, Source::Tactile);
        let fuse = |a, b| {
            Fusion::by_intervals()
                .fuse(a, b)
                .map(|e| (e.percent, e.half_width_90, e.source))
        };
        assert_eq!(
            fuse(angles(40.0), touch(50.0)).unwrap(),
            (42.0, 9.6, Source::Fused)
        );
        assert_eq!(
            fuse(angles(10.0), touch(90.0)).unwrap(),
            (10.0, 16.0, Source::Kinesthetic)
        );
        assert_eq!(
            fuse(angles(40.0), Err(ForearmError::NoTouch)).unwrap(),
            (40.0, 8.0, Source::Kinesthetic)
        );
        assert_eq!(
            fuse(Err(ForearmError::NoTouch), touch(50.0)).unwrap(),
            (50.0, 16.0, Source::Tactile)
        );
        assert!(fuse(Err(ForearmError::NoTouch), Err(ForearmError::NoTouch)).is_err());
        // An estimator that is farther off than it says weighs less.
        let learnt = Fusion { off: [4.0, 1.0] };
        assert_eq!(learnt.fuse(angles(40.0), touch(50.0)).unwrap().percent, 48.0);
    }
}
