//! The gripper's two fingers on one place of a forearm.

use super::section::{STALL_NM, Section};
use taxel_gripper::{FULL_PWM, FiveBar};

/// The angle between the phalanges, degrees: in the publication's squeezes 39 to 48, which PWM hardly changes.
pub(super) const PASSIVE_DEG: f64 = 42.0;
/// What is left of a motor's torque behind its gears and the finger's joints when it closes. In the publication's
/// squeezes fingers stay where they are until PWM has fallen from 400 to about 90, at all places: `eta^2 = 90 / 400`.
const EFFICIENCY: f64 = 0.47;

/// A place that is on no forearm.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{0} is no place on the forearm; give one from 0 (wrist) to 1 (elbow)")]
pub struct NoPlace(pub f64);

/// The angles of a finger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerAngles {
    /// Of the motor, degrees, by the linkage's zero ([`FiveBar`]): more is more closed.
    pub actuated_deg: f64,
    /// Between the phalanges, degrees.
    pub passive_deg: f64,
}

/// A finger that closes on one place of a forearm and has come to rest: a value, so that what it did before is in it.
///
/// Friction makes it matter what was before. While a motor closes, the tissue is pressed with `eta` of its torque; the
/// finger opens only when the tissue has more than `1 / eta` of it. Between the two it stays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grip {
    section: Section,
    held_nm: f64,
}

impl Grip {
    /// A finger that just touches the forearm at a location, 0 (wrist) to 1 (elbow).
    ///
    /// # Errors
    /// A place that is on no forearm.
    pub fn at(location: f64) -> Result<Self, NoPlace> {
        if !(0.0..=1.0).contains(&location) {
            return Err(NoPlace(location));
        }
        Ok(Self::beyond(location))
    }

    /// Beyond wrist and elbow too, by as little as a place is missed.
    pub(super) fn beyond(location: f64) -> Self {
        Self {
            section: Section::at(location),
            held_nm: 0.0,
        }
    }

    /// The finger once it has come to rest under a PWM, of 885; below 0 opens. It never leaves the forearm: at 0 and
    /// below it just touches.
    pub fn under(self, pwm: f64) -> Self {
        let [least, most] = held_nm(pwm);
        Self {
            held_nm: self.held_nm.clamp(least, most),
            ..self
        }
    }

    /// Its angles. They depend on the torque that is held and on nothing else of the past.
    pub fn angles(&self) -> FingerAngles {
        let passive_rad = PASSIVE_DEG.to_radians();
        let proximal_rad = self.section.touched_rad(passive_rad, self.held_nm);
        // No forearm between wrist and elbow is out of the fingers' reach, whatever the PWM: there is a test.
        let actuated_rad = FiveBar::FINGER
            .actuated_rad(proximal_rad, passive_rad)
            .unwrap_or_default();
        FingerAngles {
            actuated_deg: actuated_rad.to_degrees(),
            passive_deg: PASSIVE_DEG,
        }
    }

    /// The torque by which the tissue is pressed, as a share of what a PWM of 400 presses with.
    pub(super) fn pressed(&self) -> f64 {
        self.held_nm / (EFFICIENCY * STALL_NM * 400.0 / FULL_PWM)
    }
}

/// Between which torques, N m, the tissue may hold a finger under a PWM.
fn held_nm(pwm: f64) -> [f64; 2] {
    let torque_nm = STALL_NM * (pwm / FULL_PWM).clamp(0.0, 1.0);
    [EFFICIENCY * torque_nm, torque_nm / EFFICIENCY]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn closed_deg(grip: Grip) -> f64 {
        grip.angles().actuated_deg
    }

    #[test]
    fn a_thin_wrist_lets_a_finger_close_further_than_a_thick_elbow() {
        let at = |n: u32| closed_deg(Grip::at(f64::from(n) / 12.0).unwrap().under(400.0));
        let closed: Vec<f64> = (0..=12).map(at).collect();
        assert!(closed.windows(2).all(|pair| pair[1] < pair[0]), "{closed:?}");
        // The publication's squeezes: 65 and 75 degrees at the wrist, 38 and 45 at the elbow.
        assert!(
            (60.0..75.0).contains(&closed[0]) && (37.0..47.0).contains(&closed[12]),
            "{closed:?}"
        );
    }

    #[test]
    fn friction_holds_a_finger_until_the_pwm_has_fallen_to_less_than_a_quarter() {
        for location in [0.0, 0.5, 1.0] {
            let closed = Grip::at(location).unwrap().under(400.0);
            assert_eq!(closed_deg(closed.under(90.0)), closed_deg(closed));
            assert!(closed_deg(closed.under(80.0)) < closed_deg(closed));
            assert_eq!(closed.under(0.0), Grip::at(location).unwrap());
            // Up again from there, as if it had never been closed further.
            let again = closed.under(0.0).under(200.0);
            assert_eq!(again, Grip::at(location).unwrap().under(200.0));
            assert!(closed_deg(again) < closed_deg(closed.under(200.0)));
        }
    }

    #[test]
    fn every_place_is_within_the_fingers_reach_at_every_pwm() {
        for location in (-10..=110).map(|n| f64::from(n) / 100.0) {
            let mut before = f64::NEG_INFINITY;
            for pwm in (0..=885).step_by(15) {
                // Also under the torque at which the finger opens, the most that it ever holds.
                let [held, most] = held_nm(f64::from(pwm));
                let section = Section::at(location);
                let passive_rad = PASSIVE_DEG.to_radians();
                let opens_rad = section.touched_rad(passive_rad, most);
                assert!(
                    FiveBar::FINGER.actuated_rad(opens_rad, passive_rad).is_ok(),
                    "{location} {pwm}"
                );
                let proximal_rad = section.touched_rad(passive_rad, held);
                let actuated = FiveBar::FINGER.actuated_rad(proximal_rad, passive_rad);
                let angle = actuated.unwrap().to_degrees();
                assert!(
                    (-5.0..90.0).contains(&angle) && angle >= before,
                    "{location} {pwm}: {angle}"
                );
                before = angle;
            }
        }
        assert_eq!(Grip::at(0.5).unwrap().under(-300.0), Grip::at(0.5).unwrap());
        assert_eq!(
            Grip::at(1.01).unwrap_err().to_string(),
            "1.01 is no place on the forearm; give one from 0 (wrist) to 1 (elbow)"
        );
        assert!(Grip::at(f64::NAN).is_err());
    }
}
