//! How hard the gripper is driven during a squeeze: two ramps of PWM, up and down again.

use std::fmt;
use std::str::FromStr;
use taxel_cluster::Random;

/// The PWM at which a motor is driven with all it has; commands count in steps of it (Dynamixel XM430).
pub const FULL_PWM: f64 = 885.0;

/// A ramp of PWM, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ramp {
    /// What the publication says: 10 % of full PWM, 5 % more every half second to 90 %, and down again the same way; each
    /// step off by up to 2 % of full PWM.
    Article,
    /// What its files hold: 400 counts less 10 for each sample before or after the 51st, off by up to 5, where that is
    /// more than 0: 95 samples of 121 ms, of which the first ten and the last five are 0. A repetition has the same ramp
    /// at every place.
    Data,
}

/// Steps of the publication's ramp from its beginning to the peak, and samples of each.
const STEPS: usize = 16;
const SAMPLES_PER_STEP: usize = 4;
/// Samples of the files' ramp, and its peak.
const SAMPLES: usize = 95;
const PEAK: usize = 50;

impl Ramp {
    /// Time from one sample to the next, ms.
    pub fn period_ms(self) -> f64 {
        match self {
            Ramp::Article => 500.0 / SAMPLES_PER_STEP as f64,
            Ramp::Data => 121.0,
        }
    }

    /// The most that it can ask for, counts of 885.
    pub fn most(self) -> f64 {
        match self {
            Ramp::Article => 0.92 * FULL_PWM,
            Ramp::Data => 405.0,
        }
    }

    /// Goal PWM of each sample, whole counts of 885; `seed` decides the random part.
    pub fn pwm(self, seed: u64) -> Vec<f64> {
        let mut random = Random::new(seed);
        match self {
            Ramp::Article => (0..=2 * STEPS)
                .flat_map(|step| {
                    let percent = 10.0 + 5.0 * (STEPS - STEPS.abs_diff(step)) as f64;
                    let off = 4.0 * random.unit() - 2.0;
                    [((percent + off) / 100.0 * FULL_PWM).round(); SAMPLES_PER_STEP]
                })
                .collect(),
            Ramp::Data => (0..SAMPLES)
                .map(|sample| {
                    let off = random.below(11) as f64 - 5.0;
                    match 400.0 - 10.0 * PEAK.abs_diff(sample) as f64 {
                        0.0 if sample < PEAK => off.abs().max(1.0),
                        pwm if pwm > 0.0 => pwm + off,
                        _ => 0.0,
                    }
                })
                .collect(),
        }
    }
}

impl fmt::Display for Ramp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Ramp::Article => "article",
            Ramp::Data => "data",
        })
    }
}

impl FromStr for Ramp {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "article" => Ok(Ramp::Article),
            "data" => Ok(Ramp::Data),
            _ => Err(format!("{name} is no ramp; there are data and article")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_of_the_files_rises_and_falls_by_ten_counts_around_sample_51() {
        let mut offs = [0; 11];
        for seed in 0..100 {
            let pwm = Ramp::Data.pwm(seed);
            assert_eq!(pwm.len(), 95);
            for (sample, pwm) in pwm.iter().enumerate() {
                match sample {
                    0..10 | 90.. => assert_eq!(*pwm, 0.0, "{sample}"),
                    10 => assert!((1.0..=5.0).contains(pwm), "{pwm}"),
                    _ => {
                        let off = pwm - (400.0 - 10.0 * PEAK.abs_diff(sample) as f64);
                        assert!(off.abs() <= 5.0 && off.fract() == 0.0, "{sample}: {pwm}");
                        offs[(off + 5.0) as usize] += 1;
                    }
                }
            }
            assert!(pwm.iter().all(|pwm| *pwm <= Ramp::Data.most()));
        }
        // 7900 draws of eleven numbers.
        assert!(offs.iter().all(|count| (500..=940).contains(count)), "{offs:?}");
        assert_eq!(Ramp::Data.pwm(3), Ramp::Data.pwm(3));
        assert_ne!(Ramp::Data.pwm(3), Ramp::Data.pwm(4));
    }

    #[test]
    fn the_ramp_of_the_article_takes_half_a_second_for_each_step_from_10_to_90_percent_and_back() {
        let pwm = Ramp::Article.pwm(1);
        let steps: Vec<f64> = pwm.chunks(4).map(|step| step[0]).collect();
        assert!(pwm.chunks(4).all(|step| step == [step[0]; 4]));
        assert_eq!(
            (pwm.len() as f64 * Ramp::Article.period_ms(), steps.len()),
            (16_500.0, 33)
        );
        for (n, step) in steps.iter().enumerate() {
            let percent = 10.0 + 5.0 * if n <= 16 { n } else { 32 - n } as f64;
            assert!((step / FULL_PWM * 100.0 - percent).abs() <= 2.06, "{n}: {step}");
            assert!(*step <= Ramp::Article.most().round());
        }
        assert!(steps.windows(2).take(16).all(|two| two[0] < two[1]));
    }
}
