//! Whether the angles that an Allegro hand has shown can be those of the version given: versions 4 and 5 send the same
//! frames, and a count of the one is 17 times a count of the other.

use super::of_joints;
use crate::kind::Kind;
use crate::problem::{Place, Problem};
use taxel_joints::AllegroSource;

/// No joint turns so far, radians; a hand of version 5 says up to 190 degrees.
const IMPOSSIBLE_RAD: f32 = std::f32::consts::TAU;
/// A hand of version 5 that is read as one of version 4 stays within this, radians: 190 degrees by 17.3. One of version
/// 4 does not, since its thumb is never turned in so far.
const SMALL_RAD: f32 = 0.2;
/// A joint that has moved by this much is no noise, radians: six degrees of version 5 as those of version 4.
const MOVED_RAD: f32 = 0.006;

/// The least and the largest angle that each joint has had, radians.
#[derive(Debug, Default)]
pub(crate) struct AnglesUsed {
    ranges: Vec<[f32; 2]>,
}

impl AnglesUsed {
    /// Takes the angles of now; those that are not known say nothing.
    pub(super) fn add(&mut self, angles: &[f32]) {
        self.ranges
            .resize(angles.len(), [f32::INFINITY, f32::NEG_INFINITY]);
        for ([least, most], angle) in self.ranges.iter_mut().zip(angles).filter(|(_, a)| a.is_finite()) {
            (*least, *most) = (least.min(*angle), most.max(*angle));
        }
    }

    /// What is wrong with the version, as far as the angles tell.
    pub(super) fn problem(&self, hand: &AllegroSource) -> Option<Problem> {
        let version = hand.hand.as_ref()?.version;
        let mut known = self
            .ranges
            .iter()
            .enumerate()
            .filter(|(_, [least, most])| least <= most);
        let size = |[least, most]: [f32; 2]| most.max(-least);
        let largest = known
            .clone()
            .max_by(|(_, a), (_, b)| size(**a).total_cmp(&size(**b)));
        let (joint, range) = largest.map(|(joint, range)| (joint, *range))?;
        let degrees = size(range).to_degrees();
        let (found, advice) = if size(range) > IMPOSSIBLE_RAD {
            let advice = match version {
                5 => {
                    "if it is a hand of version 4, write `version = 4`: a count of version 5 is 17 times as much"
                }
                4 => "check `enc_offset`, and that it is a hand of version 4",
                _ => "check `enc_dir` and `enc_offset` against the hand's own zero.yaml",
            };
            (
                format!("joint {joint} of the Allegro hand is said to turn by {degrees:.0} degrees"),
                advice,
            )
        } else if version == 4
            && known.clone().count() == self.ranges.len()
            && size(range) < SMALL_RAD
            && known.any(|(_, [least, most])| most - least > MOVED_RAD)
        {
            (
                format!(
                    "the Allegro hand has moved, and no joint is said to be further than {degrees:.1} degrees from its zero"
                ),
                "if it is a hand of version 5, write `version = 5`: read as version 4 its angles are 17 times too small",
            )
        } else {
            return None;
        };
        Some(of_joints(
            Kind::HandVersion,
            Place::Joints,
            found,
            advice,
            "the angles of the Allegro hand can be those of its version".into(),
        ))
    }
}
