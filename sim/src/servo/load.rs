//! What holds against a motor under PWM, so that it comes to rest at an angle as a real gripper does.

use crate::forearm::{Grip, NoPlace};
use std::fmt::Debug;

/// What holds against a motor under PWM: the place where its torque, the load and the friction between them balance.
pub trait Load: Debug + Send + Sync {
    /// Where a motor that stands at `from` comes to rest under `pwm`; both places in pulses, `pwm` in counts, -885 to
    /// 885, 0 for one that is switched off.
    fn rest(&self, from: f64, pwm: f64) -> f64;
}

/// A finger that closes freely up to something springy, through a gear with friction; without PWM a spring of its own
/// opens it.
///
/// Closing, the gear passes on the share [`SpringWall::efficiency`] of the torque. Opening, the wall has to overcome the
/// motor's torque divided by it. Between the two it stands: the angle freezes when the PWM sinks after the peak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpringWall {
    /// Where it stands open, pulses.
    pub open: f64,
    /// Where it touches, pulses; the way it closes is from `open` to there.
    pub touch: f64,
    /// How much PWM presses it in by one pulse, without friction, counts.
    pub counts_per_pulse: f64,
    /// Share of the torque that the gear passes on, above 0 to 1.
    pub efficiency: f64,
}

impl Load for SpringWall {
    fn rest(&self, from: f64, pwm: f64) -> f64 {
        let closing = if self.touch < self.open { -1.0 } else { 1.0 };
        let torque = pwm * closing;
        if torque <= 0.0 {
            return self.open;
        }
        let pressed = |torque: f64| torque / self.counts_per_pulse;
        // Pulses behind the place where it touches.
        let behind = (from - self.touch) * closing;
        let rest = behind.clamp(
            pressed(torque * self.efficiency),
            pressed(torque / self.efficiency),
        );
        self.touch + closing * rest
    }
}

/// A finger of the forearm gripper on one place of a simulated forearm ([`Grip`]), its angle in pulses from 2048.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForearmFinger(Grip);

impl ForearmFinger {
    /// A finger on a place from 0 (wrist) to 1 (elbow).
    ///
    /// # Errors
    /// A place that is on no forearm.
    pub fn at(location: f64) -> Result<Self, NoPlace> {
        Grip::at(location).map(Self)
    }

    /// Where it stands while it just touches, pulses.
    pub fn open(&self) -> f64 {
        pulses(self.0)
    }

    /// The angle between its phalanges, degrees, which a potentiometer reads; its motor does not change it.
    pub fn passive_deg(&self) -> f64 {
        self.0.angles().passive_deg
    }
}

impl Load for ForearmFinger {
    fn rest(&self, from: f64, pwm: f64) -> f64 {
        // Where it comes to from below, and where it stays that was closed further.
        let closing = pulses(self.0.under(pwm));
        let opening = pulses(self.0.under(FULL_PWM).under(pwm));
        from.clamp(closing, opening.max(closing))
    }
}

const FULL_PWM: f64 = 885.0;

fn pulses(grip: Grip) -> f64 {
    2048.0 + grip.angles().actuated_deg * 4096.0 / 360.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finger_on_a_forearm_goes_where_its_grip_does() {
        let finger = ForearmFinger::at(0.5).unwrap();
        let (mut at, mut grip) = (finger.open(), Grip::at(0.5).unwrap());
        for pwm in [0.0, 10.0, 200.0, 400.0, 300.0, 95.0, 80.0, 20.0, 150.0, 0.0] {
            at = finger.rest(at, pwm);
            grip = grip.under(pwm);
            assert!((at - pulses(grip)).abs() < 1e-6, "{pwm}: {at}");
        }
        assert_eq!(at, finger.open());
    }

    #[test]
    fn it_presses_in_stands_while_the_torque_sinks_and_opens_late() {
        for closing in [1.0, -1.0] {
            let wall = SpringWall {
                open: 2048.0,
                touch: 2048.0 + closing * 500.0,
                counts_per_pulse: 2.0,
                efficiency: 0.5,
            };
            let mut at = 2048.0;
            for (pwm, behind) in [
                (0.0, -500.0),
                (40.0, 10.0),
                (400.0, 100.0),
                (200.0, 100.0),
                (100.0, 100.0),
                (90.0, 90.0),
                (40.0, 40.0),
                (0.0, -500.0),
                (-100.0, -500.0),
            ] {
                at = wall.rest(at, closing * pwm);
                assert_eq!((at - wall.touch) * closing, behind, "{closing} {pwm}");
            }
        }
    }
}
