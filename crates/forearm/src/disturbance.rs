//! What goes wrong with squeezes, to see what an estimator makes of it without being told.

use crate::squeeze::{Sample, Squeeze};
use taxel_cluster::Random;

/// A count of the converter that reads potentiometers, degrees.
const COUNT_DEG: f64 = 333.3 / 1023.0;

/// Something that happens to a squeeze.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Disturbance {
    /// Each sample is lost with this probability.
    Missing(f64),
    /// No samples for a time that begins anywhere, ms.
    Gap(f64),
    /// Normal noise on every angle, standard deviation in degrees.
    Noise(f64),
    /// So many times as fast, sampled at the same rate.
    Faster(usize),
    /// So many times as slow, sampled at the same rate.
    Slower(usize),
    /// One of the four angles has its zero elsewhere, degrees, up or down.
    Zero(f64),
    /// One sample of a potentiometer is off by 5 to 20 degrees, up or down.
    Glitch,
    /// A potentiometer says the same all the time: what it says at one of its samples.
    PotentiometerStuck,
    /// A potentiometer says the same from one of its samples on.
    PotentiometerSticks,
    /// A potentiometer says the same all the time, but for one count of its converter in a tenth of its samples: what it
    /// says at one of its samples.
    PotentiometerStuckNoisy,
    /// The same, at any angle from 30 to 60 degrees.
    PotentiometerElsewhere,
    /// The wire of a potentiometer hangs free: each sample is anything from 30 to 60 degrees.
    PotentiometerFloats,
    /// A potentiometer says nothing.
    PotentiometerLost,
    /// A potentiometer says 0 degrees all the time.
    PotentiometerDead,
    /// Tactels count so many times as much, and no more than the largest count of the squeeze.
    Gain(f64),
}

impl std::fmt::Display for Disturbance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Missing(share) => write!(f, "{:.0} % of samples missing", 100.0 * share),
            Self::Gap(ms) => write!(f, "gap of {} s", ms / 1000.0),
            Self::Noise(deg) => write!(f, "noise of {deg} degrees"),
            Self::Faster(times) => write!(f, "{times} times as fast"),
            Self::Slower(times) => write!(f, "{times} times as slow"),
            Self::Zero(deg) => write!(f, "a zero off by {deg} degrees"),
            Self::Glitch => f.write_str("one sample of a potentiometer off by 5 to 20 degrees"),
            Self::PotentiometerStuck => f.write_str("a potentiometer stuck"),
            Self::PotentiometerSticks => f.write_str("one that sticks midway"),
            Self::PotentiometerStuckNoisy => f.write_str("one stuck, with a count of noise"),
            Self::PotentiometerElsewhere => f.write_str("one stuck anywhere, with a count of noise"),
            Self::PotentiometerFloats => f.write_str("one whose wire hangs free"),
            Self::PotentiometerLost => f.write_str("a potentiometer lost"),
            Self::PotentiometerDead => f.write_str("a potentiometer at 0"),
            Self::Gain(times) => write!(f, "{times} times the gain"),
        }
    }
}

impl Disturbance {
    /// The squeeze as it is where this happens, touch left out where it does not happen to touch; `seed` says where, how and to which finger.
    pub fn apply(self, squeeze: &Squeeze, seed: u64) -> Squeeze {
        let mut random = Random::new(seed);
        let finger = random.below(2);
        let mut other = Squeeze {
            tactile: None,
            ..squeeze.clone()
        };
        match self {
            Self::Missing(share) => return other.filtered(|_| random.unit() >= share),
            Self::Gap(ms) => {
                let last = squeeze.time_ms.last().copied().unwrap_or(0.0);
                let from = random.unit() * (last - ms).max(0.0);
                let time_ms = squeeze.time_ms.clone();
                return other.filtered(|row| !(from..from + ms).contains(&time_ms[row]));
            }
            Self::Noise(deg) => {
                for column in other.theta_p_deg.iter_mut().chain(&mut other.theta_a_deg) {
                    column
                        .iter_mut()
                        .for_each(|angle| *angle += deg * random.normal());
                }
            }
            Self::Faster(times) => {
                other = other.filtered(|row| row % times.max(1) == 0);
                other
                    .time_ms
                    .iter_mut()
                    .for_each(|time| *time /= times.max(1) as f64);
            }
            Self::Slower(times) => return slower(squeeze, times.max(1)),
            Self::Zero(deg) => {
                let by = if random.below(2) == 0 { deg } else { -deg };
                let angles = if random.below(2) == 0 {
                    &mut other.theta_p_deg
                } else {
                    &mut other.theta_a_deg
                };
                angles[finger].iter_mut().for_each(|angle| *angle += by);
            }
            Self::Glitch => {
                let off = (5.0 + 15.0 * random.unit()) * if random.below(2) == 0 { 1.0 } else { -1.0 };
                let at = random.below(squeeze.len().max(1));
                if let Some(angle) = other.theta_p_deg[finger].get_mut(at) {
                    *angle += off;
                }
            }
            Self::PotentiometerStuck => {
                let at = random.below(squeeze.len().max(1));
                let value = squeeze.theta_p_deg[finger].get(at).copied().unwrap_or(f64::NAN);
                other.theta_p_deg[finger].fill(value);
            }
            Self::PotentiometerSticks => {
                let at = random.below(squeeze.len().max(1));
                let from = other.theta_p_deg[finger].get_mut(at..).unwrap_or_default();
                let value = from.first().copied().unwrap_or(f64::NAN);
                from.fill(value);
            }
            Self::PotentiometerStuckNoisy => {
                let at = random.below(squeeze.len().max(1));
                let value = squeeze.theta_p_deg[finger].get(at).copied().unwrap_or(f64::NAN);
                stuck(&mut other.theta_p_deg[finger], value, &mut random);
            }
            Self::PotentiometerElsewhere => {
                let value = anywhere(&mut random);
                stuck(&mut other.theta_p_deg[finger], value, &mut random);
            }
            Self::PotentiometerFloats => {
                let column = &mut other.theta_p_deg[finger];
                column.fill_with(|| anywhere(&mut random));
            }
            Self::PotentiometerLost => other.theta_p_deg[finger].fill(f64::NAN),
            Self::PotentiometerDead => other.theta_p_deg[finger].fill(0.0),
            Self::Gain(times) => {
                let most = squeeze.tactile.iter().flatten().max().copied().unwrap_or(0);
                let gained = |count: &u16| (f64::from(*count) * times).round().min(f64::from(most)) as u16;
                other.tactile = (squeeze.tactile.as_ref()).map(|counts| counts.iter().map(gained).collect());
            }
        }
        other
    }
}

/// An angle that a potentiometer may have, degrees.
fn anywhere(random: &mut Random) -> f64 {
    30.0 + 30.0 * random.unit()
}

/// One value, but for a count more in a tenth of the samples.
fn stuck(column: &mut [f64], value: f64, random: &mut Random) {
    column.fill_with(|| value + if random.unit() < 0.1 { COUNT_DEG } else { 0.0 });
}

/// Samples between samples, on straight lines.
fn slower(squeeze: &Squeeze, times: usize) -> Squeeze {
    let mut slow = Squeeze::default();
    for row in 0..squeeze.len() {
        let now = squeeze.sample(row);
        let next = if row + 1 < squeeze.len() {
            squeeze.sample(row + 1)
        } else {
            now
        };
        let between = if row + 1 < squeeze.len() { times } else { 1 };
        for part in 0..between {
            let share = part as f64 / times as f64;
            let mix = |a: f64, b: f64| a + share * (b - a);
            let pair = |a: [f64; 2], b: [f64; 2]| [mix(a[0], b[0]), mix(a[1], b[1])];
            slow.push(Sample {
                time_ms: times as f64 * mix(now.time_ms, next.time_ms),
                theta_p_deg: pair(now.theta_p_deg, next.theta_p_deg),
                theta_a_deg: pair(now.theta_a_deg, next.theta_a_deg),
                pwm: mix(now.pwm, next.pwm),
            });
        }
    }
    slow
}
