//! A simulated servo that closes a finger on the forearm.

use super::grip::{Grip, NoPlace};
use crate::servo::Load;

const PULSES_PER_DEGREE: f64 = 4096.0 / 360.0;

/// What the motor of a finger works against where the finger holds a forearm. Friction is in where the motor stands: at
/// the same PWM it may stand anywhere between where the tissue just gives way and where it just pushes back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldFinger {
    touching: Grip,
    /// Where the motor stands at 0 degrees, pulses.
    zero: f64,
    /// 1 where pulses grow as the finger closes, or -1.
    closing: f64,
}

impl HeldFinger {
    /// A finger at a location, 0 (wrist) to 1 (elbow), whose motor stands at `zero` pulses at 0 degrees. The motors of a
    /// gripper's two fingers turn against each other: for one `is_turned` is true, and its PWM below 0 closes.
    ///
    /// # Errors
    /// A place that is on no forearm.
    pub fn new(location: f64, zero: f64, is_turned: bool) -> Result<Self, NoPlace> {
        Ok(Self {
            touching: Grip::at(location)?,
            zero,
            closing: if is_turned { -1.0 } else { 1.0 },
        })
    }
}

impl Load for HeldFinger {
    fn rest(&self, from: f64, pwm: f64) -> f64 {
        let [least, most] = self.touching.resting_deg(pwm * self.closing);
        let from_deg = (from - self.zero) * self.closing / PULSES_PER_DEGREE;
        self.zero + self.closing * PULSES_PER_DEGREE * from_deg.max(least).min(most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_servo_comes_to_rest_where_the_finger_does_whatever_was_before() {
        for (is_turned, closing) in [(false, 1.0), (true, -1.0)] {
            let finger = HeldFinger::new(0.3, 2048.0, is_turned).unwrap();
            let mut grip = Grip::at(0.3).unwrap();
            let mut at = finger.rest(2048.0, 0.0);
            for pwm in [
                0.0, 50.0, 400.0, 200.0, 90.0, 60.0, 150.0, 0.0, -100.0, 885.0, 300.0, 0.0,
            ] {
                at = finger.rest(at, closing * pwm);
                grip = grip.under(pwm);
                let angle = (at - 2048.0) * closing / PULSES_PER_DEGREE;
                let off = angle - grip.angles().actuated_deg;
                assert!(off.abs() < 1e-6, "{pwm}: {off}");
            }
        }
        assert!(HeldFinger::new(2.0, 0.0, false).is_err());
    }
}
