//! The angles of a frame's joints, and how long before it each was read.

use taxel_wire::RawView;

/// An angle read longer than this before its frame, half a sample of the publication's, is of another sample: microseconds.
pub(super) const FRESH_US: u32 = 60_000;

/// The angles of a frame, radians, not a number where unknown; and their ages, microseconds.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct JointAngles(Vec<(f32, u32)>);

impl JointAngles {
    /// Those of a frame. Of a daemon that tells no ages all are new.
    pub(super) fn of(raw: &RawView<'_>) -> Self {
        let ages = raw.joint_ages_us().into_iter().flatten();
        raw.joints().zip(ages.chain(std::iter::repeat(0))).collect()
    }

    /// The angle of a joint, degrees; not a number where it is unknown, or was read longer before than this.
    pub(super) fn degrees(&self, joint: usize, oldest_us: u32) -> f64 {
        match self.known(joint) {
            Some((angle_rad, age_us)) if age_us <= oldest_us => f64::from(angle_rad).to_degrees(),
            _ => f64::NAN,
        }
    }

    /// How long before the frame an angle was read that is known, and of another sample: milliseconds.
    pub(super) fn late_ms(&self, joint: usize) -> Option<f64> {
        let (_, age_us) = self.known(joint)?;
        (age_us > FRESH_US).then(|| f64::from(age_us) / 1e3)
    }

    fn known(&self, joint: usize) -> Option<(f32, u32)> {
        self.0.get(joint).copied().filter(|(angle, _)| angle.is_finite())
    }
}

impl FromIterator<(f32, u32)> for JointAngles {
    fn from_iter<I: IntoIterator<Item = (f32, u32)>>(angles: I) -> Self {
        Self(angles.into_iter().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{ForceFrame, TactileFrame};
    use taxel_wire::encode_raw_payload;

    #[test]
    fn an_angle_that_was_read_long_before_its_frame_is_of_another_sample() {
        let mut frame = TactileFrame::new(1);
        frame.joints = vec![1.0, 2.0, 3.0, f32::NAN];
        let mut angles = |ages_ms: &[u64]| {
            frame.joint_age_ns = ages_ms.iter().map(|ms| ms * 1_000_000).collect();
            let mut payload = Vec::new();
            encode_raw_payload(&frame, &ForceFrame::new(1), None, &mut payload).unwrap();
            JointAngles::of(&RawView::decode(&payload).unwrap())
        };
        let seen = |angles: &JointAngles| [0, 1, 2, 3, 4].map(|n| angles.degrees(n, FRESH_US).to_radians());
        let some = angles(&[10, 60, 61, 0]);
        let [a, b, late, unknown, none] = seen(&some);
        assert_eq!([a, b], [1.0, 2.0]);
        assert!(late.is_nan() && unknown.is_nan() && none.is_nan());
        assert_eq!(
            [0, 1, 2, 3, 4].map(|n| some.late_ms(n)),
            [None, None, Some(61.0), None, None]
        );
        assert_eq!(some.degrees(2, 61_000).to_radians(), 3.0);
        assert_eq!(
            seen(&angles(&[]))[..3],
            [1.0, 2.0, 3.0],
            "a daemon that tells no ages"
        );
    }
}
