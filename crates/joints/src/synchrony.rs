//! The joints' angles at the instant of a tactile frame: between two readings, on the line that joins them.

/// A joint's angle at an instant that was asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AngleAt {
    /// The angle, radians.
    pub angle_rad: f64,
    /// Time from the instant to the nearest reading, nanoseconds. Between two readings at most half
    /// their distance.
    pub age_ns: u64,
    /// Whether the instant lies after the newest reading, so that the angle is a guess from the
    /// last movement.
    pub extrapolated: bool,
}

/// How a joint moved and what its motor took at its newest reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointMotion {
    /// Velocity in the joint's direction, rad/s; not a number where unknown.
    pub velocity_rad_s: f32,
    /// Motor current in the joint's direction, amperes; not a number where unknown.
    pub current_a: f32,
}

impl JointMotion {
    /// Nothing known.
    pub const UNKNOWN: Self = Self {
        velocity_rad_s: f32::NAN,
        current_a: f32::NAN,
    };
}

/// The last readings of every joint.
///
/// The memory is fixed when it is made: `depth` readings per joint.
#[derive(Debug, Clone)]
pub struct JointHistory {
    readings: Vec<(u64, f64)>,
    filled: Vec<(usize, usize)>,
    /// Of the newest reading of each joint.
    motion: Vec<JointMotion>,
    depth: usize,
}

/// How far beyond the newest reading a movement is carried on at most, nanoseconds: twice a cycle at 100 Hz.
pub const EXTRAPOLATE_NS: u64 = 20_000_000;
/// ... and at most so many times as far as the two newest readings are apart. Two that came in one
/// burst, or of which one was stamped late, lie close together, and the line through them tells
/// next to nothing of the time after them.
const EXTRAPOLATE_SPACINGS: u64 = 2;

impl JointHistory {
    /// Room for `depth` readings (at least 2) of each of `joints` joints.
    pub fn new(joints: usize, depth: usize) -> Self {
        let depth = depth.max(2);
        Self {
            readings: vec![(0, 0.0); joints * depth],
            filled: vec![(0, 0); joints],
            motion: vec![JointMotion::UNKNOWN; joints],
            depth,
        }
    }

    /// Takes over the readings of another history. Allocates nothing if both were made for as many
    /// joints and readings.
    pub fn copy_from(&mut self, other: &Self) {
        self.readings.clone_from(&other.readings);
        self.filled.clone_from(&other.filled);
        self.motion.clone_from(&other.motion);
        self.depth = other.depth;
    }

    /// Says how a joint moved at its newest reading. Joints that it does not have are passed over.
    pub fn set_motion(&mut self, joint: usize, motion: JointMotion) {
        if let Some(place) = self.motion.get_mut(joint) {
            *place = motion;
        }
    }

    /// How each joint moved at its newest reading.
    pub fn motion(&self) -> &[JointMotion] {
        &self.motion
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.filled.len()
    }

    /// Takes a reading. One that is not newer than the newest of its joint changes nothing, so the
    /// same one may be given again and again.
    pub fn push(&mut self, joint: usize, t_ns: u64, angle_rad: f64) {
        if joint >= self.filled.len() || !angle_rad.is_finite() {
            return;
        }
        if self.reading(joint, 0).is_some_and(|(newest, _)| t_ns <= newest) {
            return;
        }
        let (next, len) = self.filled[joint];
        self.readings[joint * self.depth + next] = (t_ns, angle_rad);
        self.filled[joint] = ((next + 1) % self.depth, (len + 1).min(self.depth));
    }

    /// The joint's angle at `t_ns`: on the line between the readings around it; after the newest on
    /// the line through the last two, carried on for a bounded time (at most [`EXTRAPOLATE_NS`],
    /// and twice the time between the two) and held from there; before the oldest that is kept, the
    /// oldest. `None` if there is no reading.
    pub fn at(&self, joint: usize, t_ns: u64) -> Option<AngleAt> {
        let (newest_ns, newest) = self.reading(joint, 0)?;
        if t_ns >= newest_ns {
            let after = t_ns - newest_ns;
            let carried_on = self.reading(joint, 1).map_or(0.0, |(t, angle)| {
                let spacing = newest_ns - t;
                let ahead = after
                    .min(EXTRAPOLATE_NS)
                    .min(spacing.saturating_mul(EXTRAPOLATE_SPACINGS));
                (newest - angle) / spacing as f64 * ahead as f64
            });
            return Some(AngleAt {
                angle_rad: newest + carried_on,
                age_ns: after,
                extrapolated: after > 0,
            });
        }
        let mut later = (newest_ns, newest);
        for back in 1..self.depth {
            let Some(earlier) = self.reading(joint, back) else {
                break;
            };
            if earlier.0 <= t_ns {
                let part = (t_ns - earlier.0) as f64 / (later.0 - earlier.0) as f64;
                return Some(AngleAt {
                    angle_rad: earlier.1 + (later.1 - earlier.1) * part,
                    age_ns: (t_ns - earlier.0).min(later.0 - t_ns),
                    extrapolated: false,
                });
            }
            later = earlier;
        }
        Some(AngleAt {
            angle_rad: later.1,
            age_ns: later.0 - t_ns,
            extrapolated: false,
        })
    }

    /// Newest reading, or the one `back` before it.
    fn reading(&self, joint: usize, back: usize) -> Option<(u64, f64)> {
        let (next, len) = *self.filled.get(joint)?;
        if back >= len {
            return None;
        }
        let at = (next + self.depth - 1 - back) % self.depth;
        Some(self.readings[joint * self.depth + at])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const MS: u64 = 1_000_000;

    fn sine(t_ns: u64, hz: f64) -> f64 {
        (TAU * hz * t_ns as f64 * 1e-9).sin()
    }

    #[test]
    fn between_two_readings_the_angle_is_on_their_line() {
        let mut h = JointHistory::new(2, 4);
        for (t, angle) in [(10, 1.0), (20, 3.0), (30, 0.0)] {
            h.push(1, t * MS, angle);
        }
        assert_eq!(h.at(0, 0), None);
        assert_eq!(h.at(2, 0), None);
        for (t, angle, age, extrapolated) in [
            (5, 1.0, 5, false),
            (10, 1.0, 0, false),
            (12, 1.4, 2, false),
            (20, 3.0, 0, false),
            (29, 0.3, 1, false),
            (30, 0.0, 0, false),
            (31, -0.3, 1, true),
            (50, -6.0, 20, true),
            (1050, -6.0, 1020, true),
        ] {
            let at = h.at(1, t * MS).unwrap();
            assert!((at.angle_rad - angle).abs() < 1e-12, "at {t}: {at:?}");
            assert_eq!((at.age_ns, at.extrapolated), (age * MS, extrapolated), "at {t}");
        }
    }

    #[test]
    fn two_readings_close_together_are_not_carried_on_far() {
        // A finger at 1 rad/s, read every 3 ms; an adapter that was held up hands the last two over
        // in one burst.
        let mut h = JointHistory::new(1, 8);
        for t in [0, 3, 6] {
            h.push(0, t * MS, 0.001 * t as f64);
        }
        h.push(0, 12 * MS, 0.009);
        h.push(0, 12 * MS + 10_000, 0.012);
        for after in [0, 1, 5, 20, 100] {
            let at = h.at(0, (12 + after) * MS).unwrap();
            assert!((at.angle_rad - 0.012).abs() < 0.01, "{after} ms after: {at:?}");
        }
    }

    #[test]
    fn one_reading_is_held_and_old_ones_are_forgotten() {
        let mut h = JointHistory::new(1, 3);
        h.push(0, 10 * MS, 1.0);
        assert_eq!(h.at(0, 15 * MS).unwrap().angle_rad, 1.0);
        for t in 2..9 {
            h.push(0, 10 * t * MS, t as f64);
        }
        // Kept: 60, 70, 80.
        let at = h.at(0, 20 * MS).unwrap();
        assert_eq!((at.angle_rad, at.age_ns), (6.0, 40 * MS));
    }

    #[test]
    fn a_copy_answers_as_its_original_does() {
        let mut original = JointHistory::new(2, 4);
        for t in 0..7 {
            original.push(0, t * MS, t as f64);
            original.push(1, t * MS, -(t as f64));
        }
        let mut copy = JointHistory::new(2, 4);
        copy.copy_from(&original);
        for (joint, t) in [(0, 4), (1, 5), (0, 0), (1, 6)] {
            assert!(copy.at(joint, t * MS + 1).is_some());
            assert_eq!(copy.at(joint, t * MS + 1), original.at(joint, t * MS + 1));
        }
    }

    #[test]
    fn repeated_late_and_impossible_readings_change_nothing() {
        let mut h = JointHistory::new(1, 4);
        h.push(0, 10, 1.0);
        h.push(0, 20, 2.0);
        let before = h.at(0, 15);
        for (joint, t, angle) in [(0, 20, 9.0), (0, 5, 9.0), (0, 30, f64::NAN), (7, 30, 1.0)] {
            h.push(joint, t, angle);
        }
        assert_eq!(h.at(0, 15), before);
        assert_eq!(h.at(0, 20).unwrap().angle_rad, 2.0);
    }

    /// Readings every `period_ns` of a sine of 1 rad, frames in between: largest error of interpolating, of
    /// taking the newest reading, and of extrapolating by up to one period.
    fn errors(hz: f64, period_ns: u64) -> [f64; 3] {
        let mut h = JointHistory::new(1, 8);
        let mut worst = [0.0_f64; 3];
        for cycle in 0..400_u64 {
            let t = cycle * period_ns;
            if cycle > 2 {
                for part in 0..10 {
                    let ahead = t - period_ns + period_ns * part / 10;
                    let guess = h.at(0, ahead).unwrap();
                    worst[2] = worst[2].max((guess.angle_rad - sine(ahead, hz)).abs());
                    let newest = h.at(0, t - period_ns).unwrap().angle_rad;
                    worst[1] = worst[1].max((newest - sine(ahead, hz)).abs());
                }
            }
            h.push(0, t, sine(t, hz));
            if cycle > 2 {
                for part in 0..=10 {
                    let between = t - period_ns + period_ns * part / 10;
                    let at = h.at(0, between).unwrap();
                    worst[0] = worst[0].max((at.angle_rad - sine(between, hz)).abs());
                }
            }
        }
        worst
    }

    #[test]
    fn the_error_on_a_known_motion_is_within_its_bound() {
        // A finger that swings 1 rad to either side twice a second, read 100 times a second.
        let [interpolated, newest, extrapolated] = errors(2.0, 10 * MS);
        // A line misses a curve by its second derivative times an eighth of the distance squared.
        let bound = (TAU * 2.0 * 0.01_f64).powi(2) / 8.0;
        println!(
            "2 Hz, 1 rad, read at 100 Hz: interpolated {interpolated:.6} rad (bound {bound:.6}), extrapolated {extrapolated:.6} rad, newest reading {newest:.6} rad"
        );
        assert!(interpolated <= bound, "{interpolated} over {bound}");
        assert!(bound < 0.002);
        // The bound is tight: the test would see an instant that is off by a tenth of a period.
        assert!(interpolated > 0.9 * bound);
        assert!(newest > 50.0 * interpolated);
        assert!(extrapolated > interpolated && extrapolated < newest / 5.0);
    }

    #[test]
    fn the_error_falls_with_the_square_of_the_period() {
        let slow = errors(1.0, 20 * MS)[0];
        let fast = errors(1.0, 5 * MS)[0];
        assert!((slow / fast - 16.0).abs() < 0.5, "{slow} / {fast}");
    }
}
