//! Where a module sits: the keys `pose` and `joint`.

use serde::Deserialize;
use std::ops::Range;
use taxel_hand::{FromMap, Pose, WholeList, why_no_name};
use toml::Spanned;

/// How far from 1 the length of an orientation may be; it is then made 1.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Farthest from the link's origin, millimetres.
const FARTHEST_MM: f64 = 1e6;

/// Where in the file something is wrong with a place, and what.
type Misplaced = (Range<usize>, String);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FilePose {
    #[serde(deserialize_with = "WholeList::read")]
    position_mm: [f64; 3],
    #[serde(deserialize_with = "WholeList::read")]
    orientation: [f64; 4],
}

impl FilePose {
    /// The pose, its orientation of length 1, or what is wrong with it.
    fn check(&self) -> Result<Pose, String> {
        // Neither holds for what is not a number.
        let is_near = self.position_mm.iter().all(|v| v.abs() <= FARTHEST_MM);
        let length = self.orientation.iter().map(|v| v * v).sum::<f64>().sqrt();
        let is_unit = (length - 1.0).abs() <= UNIT_TOLERANCE;
        match (is_near, is_unit) {
            (false, _) => Err("position_mm of its pose is not within 1e6 mm".into()),
            (_, false) => Err(format!(
                "orientation of its pose is a quaternion [w, x, y, z] of length {length}; it must be 1 within {UNIT_TOLERANCE}"
            )),
            (true, true) => Ok(Pose {
                position_mm: self.position_mm.map(|v| v as f32),
                orientation: self.orientation.map(|v| (v / length) as f32),
            }),
        }
    }
}

/// A module's pose and the name of its joint, or what is wrong with one of them, and where. Whether
/// the joint is one of those that are read is not known here: the daemon's configuration says which
/// are.
pub(crate) fn check_place(
    pose: Option<&Spanned<FromMap<FilePose>>>,
    joint: Option<&Spanned<String>>,
) -> Result<(Option<Pose>, Option<String>), Misplaced> {
    let pose = match pose {
        None => None,
        Some(pose) => Some(pose.get_ref().0.check().map_err(|why| (pose.span(), why))?),
    };
    match joint {
        None => Ok((pose, None)),
        Some(joint) => match why_no_name(joint.get_ref()) {
            Some(why) => Err((
                joint.span(),
                format!("joint is {why}; leave the key out where the module sits on the hand's base"),
            )),
            None => Ok((pose, Some(joint.get_ref().clone()))),
        },
    }
}
