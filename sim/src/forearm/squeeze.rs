//! Squeezes of a simulated forearm, as the gripper would record them.

use super::grip::{Grip, NoPlace, PASSIVE_DEG};
use super::touch::Touch;
use crate::random::{bell, bits};
use taxel_gripper::Ramp;

/// Spread of what is not modelled, as the publication's squeezes have it, degrees. Of a place: how far the mean angles
/// of its squeezes are from the model's, both fingers alike, and its potentiometers from each other place's. Of a
/// squeeze: how far its angles are from the mean of its place, the motors' with a correlation of 0.8.
const PLACE_ACTUATED_DEG: f64 = 2.8;
const PLACE_PASSIVE_DEG: f64 = 3.6;
const SQUEEZE_ACTUATED_DEG: f64 = 1.0;
const SQUEEZE_TOGETHER: f64 = 0.8;
const SQUEEZE_PASSIVE_DEG: f64 = 1.5;
/// By how much the arm is off its place, as a share of the forearm, and beside the sensor's middle, by place and by
/// squeeze, mm. Assumptions.
const PLACE_MISSED: f64 = 0.02;
const PLACE_BESIDE_MM: f64 = 2.0;
const SQUEEZE_BESIDE_MM: f64 = 0.5;
/// Steps of the sensors, degrees.
const ACTUATED_STEP_DEG: f64 = 360.0 / 4096.0;
const PASSIVE_STEP_DEG: f64 = 333.3 / 1023.0;
/// Between samples, ms, beside the ramp's period: the publication's are 121, half of them within 111 and 132.
const PERIOD_SPREAD_MS: f64 = 16.0;
const PERIOD_LIMITS_MS: [f64; 2] = [78.0, 187.0];
/// Random numbers of places, squeezes, times, commands and tactile images.
const PLACE_STREAM: u64 = 0x6661_726D;
const SQUEEZE_STREAM: u64 = 0x6661_726E;
const TIME_STREAM: u64 = 0x6661_726F;
const PWM_STREAM: u64 = 0x6661_7270;
const NOISE_STREAM: u64 = 0x6661_7271;

/// One squeeze and release: columns of equal length, a row per sample.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedSqueeze {
    /// Time since the squeeze began, ms.
    pub time_ms: Vec<f64>,
    /// Angle between the phalanges of each finger, degrees.
    pub passive_deg: [Vec<f64>; 2],
    /// Angle of each finger's motor, degrees.
    pub actuated_deg: [Vec<f64>; 2],
    /// PWM that both motors are commanded, of 885.
    pub pwm: Vec<f64>,
    /// Tactile images, [`TOUCH_ROWS`](super::TOUCH_ROWS) by [`TOUCH_COLUMNS`](super::TOUCH_COLUMNS) counts each, row by
    /// row, one after another.
    pub touch: Vec<u16>,
}

/// A forearm and a gripper, the same for the same seed: how each place is missed, and each tactel's gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SimulatedForearm {
    seed: u64,
    ramp: Ramp,
}

impl SimulatedForearm {
    /// A forearm that is squeezed by a ramp of PWM.
    pub fn new(seed: u64, ramp: Ramp) -> Self {
        Self { seed, ramp }
    }

    /// A squeeze at a location, 0 (wrist) to 1 (elbow). Squeezes of one location are of one placing of the arm, as the
    /// publication's are.
    ///
    /// # Errors
    /// A place that is on no forearm.
    pub fn squeeze(&self, location: f64, repetition: u64) -> Result<SimulatedSqueeze, NoPlace> {
        Grip::at(location)?;
        let place = location.to_bits();
        let index = bits(place, SQUEEZE_STREAM, repetition);
        let of_place = |what: u64| bell(bits(self.seed ^ place, PLACE_STREAM, what));
        let of_squeeze = |what: u64| bell(bits(self.seed ^ index, SQUEEZE_STREAM, what));
        let is_at = location + PLACE_MISSED * of_place(0);
        let beside_mm = PLACE_BESIDE_MM * of_place(1) + SQUEEZE_BESIDE_MM * of_squeeze(1);
        let offset = |finger: u64| {
            let squeeze = SQUEEZE_TOGETHER.sqrt() * of_squeeze(0)
                + (1.0 - SQUEEZE_TOGETHER).sqrt() * of_squeeze(2 + finger);
            let actuated = PLACE_ACTUATED_DEG * of_place(2) + SQUEEZE_ACTUATED_DEG * squeeze;
            let passive =
                PLACE_PASSIVE_DEG * of_place(3 + finger) + SQUEEZE_PASSIVE_DEG * of_squeeze(4 + finger);
            (actuated, PASSIVE_DEG + passive)
        };
        let offsets = [offset(0), offset(1)];
        let touch = Touch::new(is_at, beside_mm, self.seed);
        // As in the publication's data, a repetition has the same ramp at every place.
        let pwm = self.ramp.pwm(bits(self.seed, PWM_STREAM, repetition));
        let mut squeeze = SimulatedSqueeze {
            time_ms: Vec::with_capacity(pwm.len()),
            passive_deg: Default::default(),
            actuated_deg: Default::default(),
            pwm: Vec::with_capacity(pwm.len()),
            touch: Vec::new(),
        };
        let (mut grip, mut time_ms) = (Grip::beyond(is_at), 0.0);
        let mut felt = touch.pressures_kpa(grip.pressed());
        for (sample, pwm) in pwm.into_iter().enumerate() {
            let before = grip;
            grip = grip.under(pwm);
            if grip != before {
                felt = touch.pressures_kpa(grip.pressed());
            }
            squeeze.time_ms.push(time_ms);
            squeeze.pwm.push(pwm);
            let angles = grip.angles();
            for (finger, (actuated, passive)) in offsets.into_iter().enumerate() {
                let stepped = |angle: f64, step: f64| (angle / step).round() * step;
                let actuated = stepped(angles.actuated_deg + actuated, ACTUATED_STEP_DEG);
                squeeze.actuated_deg[finger].push(actuated);
                squeeze.passive_deg[finger].push(stepped(passive, PASSIVE_STEP_DEG));
            }
            squeeze
                .touch
                .extend(touch.counts(&felt, bits(index, NOISE_STREAM, sample as u64)));
            let spread = PERIOD_SPREAD_MS * bell(bits(self.seed ^ index, TIME_STREAM, sample as u64));
            let [least, most] = PERIOD_LIMITS_MS;
            time_ms += (self.ramp.period_ms() + spread).clamp(least, most).round();
        }
        Ok(squeeze)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_squeeze_rises_and_falls_as_the_recorded_ones() {
        let forearm = SimulatedForearm::new(1, Ramp::Data);
        let squeeze = forearm.squeeze(0.5, 0).unwrap();
        assert_eq!((squeeze.pwm.len(), squeeze.touch.len()), (95, 95 * 1400));
        assert!(
            squeeze.pwm[..10]
                .iter()
                .chain(&squeeze.pwm[90..])
                .all(|pwm| *pwm == 0.0)
        );
        assert!((395.0..=405.0).contains(&squeeze.pwm[50]));
        assert!(
            squeeze
                .time_ms
                .windows(2)
                .all(|pair| (78.0..=187.0).contains(&(pair[1] - pair[0])))
        );
        for finger in 0..2 {
            let angles = &squeeze.actuated_deg[finger];
            assert!(angles[50] > angles[9] + 10.0, "it closes");
            assert_eq!(angles[50], angles[70], "friction holds it");
            assert_eq!(angles[94], angles[9], "it opens");
        }
    }

    #[test]
    fn the_articles_ramp_goes_to_nine_tenths_and_back() {
        let squeeze = SimulatedForearm::new(1, Ramp::Article).squeeze(0.2, 3).unwrap();
        let most = squeeze.pwm.iter().fold(0.0, |a: f64, b| a.max(*b)) / 8.85;
        assert!((88.0..=92.0).contains(&most), "{most}");
        for end in [squeeze.pwm[0], squeeze.pwm[squeeze.pwm.len() - 1]] {
            assert!((8.0..=12.1).contains(&(end / 8.85)), "{end}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_squeeze_and_nothing_else_does() {
        let squeeze = |seed, location, repetition| {
            SimulatedForearm::new(seed, Ramp::Data)
                .squeeze(location, repetition)
                .unwrap()
        };
        assert_eq!(squeeze(1, 0.25, 2), squeeze(1, 0.25, 2));
        for other in [squeeze(2, 0.25, 2), squeeze(1, 0.5, 2), squeeze(1, 0.25, 3)] {
            assert_ne!(other, squeeze(1, 0.25, 2));
        }
        assert!(SimulatedForearm::new(1, Ramp::Data).squeeze(-0.1, 0).is_err());
    }
}
