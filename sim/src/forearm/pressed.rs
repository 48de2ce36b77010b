//! What the third finger feels while fingers stand where servos have brought them.

use super::grip::{Grip, NoPlace};
use super::touch::Touch;
use crate::random::bits;

/// Random numbers of tactile images.
const NOISE_STREAM: u64 = 0x6661_7272;
/// Full PWM, in this many steps.
const FULL_PWM: f64 = 885.0;
const STEPS: u32 = 177;

/// The tactile finger under one place of the forearm, for servos that squeeze it ([`crate::servo::ForearmFinger`]).
#[derive(Debug)]
pub struct ForearmTouch {
    touch: Touch,
    /// Angles of a finger's motor, degrees, with how hard the tissue is pressed there.
    presses: Vec<(f64, f64)>,
    seed: u64,
}

impl ForearmTouch {
    /// The finger under a place from 0 (wrist) to 1 (elbow).
    ///
    /// # Errors
    /// A place that is on no forearm.
    pub fn at(location: f64, seed: u64) -> Result<Self, NoPlace> {
        let open = Grip::at(location)?;
        let pressed = |step: u32| {
            let grip = open.under(FULL_PWM * f64::from(step) / f64::from(STEPS));
            (grip.angles().actuated_deg, grip.pressed())
        };
        Ok(Self {
            touch: Touch::new(location, 0.0, seed),
            presses: (0..=STEPS).map(pressed).collect(),
            seed,
        })
    }

    /// The tactile image with both motors at this angle, degrees: 28 x 50 counts from 0 to 255, row by row. `frame` gives it
    /// noise of its own.
    pub fn counts(&self, actuated_deg: f64, frame: u64) -> Vec<u16> {
        let next = self.presses.partition_point(|(angle, _)| *angle < actuated_deg);
        let pressed = match (
            next.checked_sub(1).map(|n| self.presses[n]),
            self.presses.get(next),
        ) {
            (Some((before, less)), Some((after, more))) => {
                less + (more - less) * (actuated_deg - before) / (after - before)
            }
            (Some((_, most)), None) => most,
            (None, _) => 0.0,
        };
        let felt = self.touch.pressures_kpa(pressed);
        self.touch.counts(&felt, bits(self.seed, NOISE_STREAM, frame))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_feels_as_much_as_the_fingers_press() {
        let touch = ForearmTouch::at(0.5, 1).unwrap();
        let open = Grip::at(0.5).unwrap();
        let sum = |angle: f64| touch.counts(angle, 0).into_iter().map(u64::from).sum::<u64>();
        let rest = open.angles().actuated_deg;
        let mut before = sum(rest);
        assert_eq!(sum(rest - 20.0), before, "the arm's weight alone");
        for pwm in [100.0, 203.0, 400.0, 885.0] {
            let now = sum(open.under(pwm).angles().actuated_deg);
            assert!(now > before + 100, "{pwm}: {now} after {before}");
            before = now;
        }
        assert_eq!(sum(180.0), before);
        assert!(ForearmTouch::at(1.1, 1).is_err());
    }
}
