//! A joint of the gripper, whose angle is taken at the end of each sample.

use super::super::angles::{FRESH_US, JointAngles};
use anyhow::bail;
use taxel_forearm::MOST_UNKNOWN;

/// A joint, followed through a squeeze.
#[derive(Debug)]
pub(super) struct Followed<'a> {
    name: &'a str,
    /// Its number among the daemon's joints.
    joint: usize,
    is_motor: bool,
    /// Samples since the last one whose angle is known.
    unknown: usize,
}

impl<'a> Followed<'a> {
    /// From the beginning of a squeeze on.
    pub(super) fn new(name: &'a str, joint: usize, is_motor: bool) -> Self {
        Self {
            name,
            joint,
            is_motor,
            unknown: 0,
        }
    }

    /// The angle at the end of a sample, degrees; not a number where it is unknown, or was read too long before.
    ///
    /// # Errors
    /// An angle that is missing in more than [`MOST_UNKNOWN`] samples in a row; a motor's that the daemon does not know at all.
    pub(super) fn angle(&mut self, angles: &JointAngles) -> anyhow::Result<f64> {
        let degrees = angles.degrees(self.joint, FRESH_US);
        self.unknown = if degrees.is_nan() { self.unknown + 1 } else { 0 };
        let is_too_long = self.unknown > MOST_UNKNOWN;
        let Self { name, unknown, .. } = self;
        match angles.late_ms(self.joint) {
            Some(late_ms) if is_too_long => bail!(
                "the angle of {name} is unknown at the end of {unknown} samples: it was read {late_ms:.0} ms before the last, \
                 and at most {} ms are of a sample; `taxel status` says why",
                FRESH_US / 1000
            ),
            None if degrees.is_nan() && (is_too_long || self.is_motor) => {
                bail!("the angle of {name} is unknown; `taxel status` says why")
            }
            _ => Ok(degrees),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_of_another_sample_is_not_a_number_and_ends_the_squeeze_when_it_stays_so() {
        let of = |angle: f32, age_ms: u32| JointAngles::from_iter([(angle, 1000 * age_ms)]);
        let late = "left is unknown at the end of 9 samples: it was read 500 ms before the last, and at most 60 ms are";
        // Whether it is a motor's; the angle that comes for ever, its age; so many samples it is done without; what is said.
        for (is_motor, angle, age_ms, done_without, words) in [
            (true, 1.0, 500, 8, late),
            (false, 1.0, 500, 8, late),
            (true, f32::NAN, 0, 0, "the angle of left is unknown"),
            (false, f32::NAN, 0, 8, "the angle of left is unknown"),
        ] {
            let mut followed = Followed::new("left", 0, is_motor);
            for _ in 0..2 {
                assert_eq!(followed.angle(&of(0.5, 60)).unwrap(), 0.5_f64.to_degrees());
                for _ in 0..done_without {
                    assert!(followed.angle(&of(angle, age_ms)).unwrap().is_nan());
                }
            }
            let error = followed.angle(&of(angle, age_ms)).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
