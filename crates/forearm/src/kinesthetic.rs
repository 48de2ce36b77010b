//! Where a gripper holds, from the angles of its fingers.

use crate::error::ForearmError;
use crate::estimate::{Estimate, Estimator, Source};
use crate::phase::{Course, PHASES, step_at};
use crate::regression::{Regression, Rows, Tried, try_all};
use crate::session::Trial;
use crate::squeeze::Squeeze;
use serde::{Deserialize, Serialize};

/// What errors call the angles, in the order in which they are kept.
const ANGLES: [&str; 4] = [
    "theta_p of finger 0",
    "theta_p of finger 1",
    "theta_a of finger 0",
    "theta_a of finger 1",
];
/// Which angles are there: all, one lost, both potentiometers lost, one finger lost. The two fingers' angles are added up:
/// the sum does not change where the arm lies nearer to one of them.
const READINGS: [[bool; 4]; 8] = [
    [true, true, true, true],
    [false, true, true, true],
    [true, false, true, true],
    [true, true, false, true],
    [true, true, true, false],
    [false, false, true, true],
    [false, true, false, true],
    [true, false, true, false],
];
/// An angle this far beyond those of the training squeezes is none of the gripper's, degrees.
const BEYOND_DEG: f64 = 10.0;
/// An angle that moves by no more than this until the peak is stuck, degrees: less than a step of either sensor.
const STUCK_DEG: f64 = 0.05;
/// A squeeze whose peak is higher by more than this share of the training's, or lower by more than the other, is of
/// another PWM profile. The peak may be in a gap of seconds, which hides a quarter of it.
const HIGHER_PEAK: f64 = 0.15;
const LOWER_PEAK: f64 = 0.3;
/// Where angles are lost there is a line for every so many steps only.
const STAGE_OF_FEWER: usize = 6;
/// Least samples of a squeeze.
const LEAST: usize = 2;
/// Least places of a training, and squeezes at each.
const LEAST_PLACES: usize = 3;
const LEAST_SQUEEZES: usize = 2;

/// The kinesthetic estimator: partial least squares on the fingers' angles at phases of the squeeze. What is looked at is
/// chosen on the training squeezes alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kinesthetic {
    /// Highest PWM of a training squeeze, median.
    peak_pwm: f64,
    /// Smallest and largest angle of the training squeezes, degrees, in the order of `ANGLES`.
    range_deg: [[f64; 2]; 4],
    chosen: Tried,
    /// In the order of `READINGS`.
    readings: Vec<Regression>,
}

impl Kinesthetic {
    /// Trains on squeezes: tries all choices on them, and takes the one of least [`Tried::score`].
    ///
    /// # Errors
    /// Fewer than three places, or a place of one squeeze; a squeeze that does not come to its end, lacks an angle, or is
    /// of another PWM profile.
    pub fn train(trials: &[&Trial]) -> Result<Self, ForearmError> {
        Self::train_by(trials, Tried::score)
    }

    /// The same by another score of what was tried; the least is taken.
    ///
    /// # Errors
    /// As [`Kinesthetic::train`].
    pub fn train_by(trials: &[&Trial], score: impl Fn(&Tried) -> f64) -> Result<Self, ForearmError> {
        let set = Training::of(trials)?;
        let mut tried = try_all(&set.rows(READINGS[0]));
        tried.sort_by(|a, b| score(a).total_cmp(&score(b)));
        let chosen = tried.first().copied();
        chosen
            .map(|chosen| set.model(chosen))
            .ok_or(ForearmError::Untrained {
                what: "nothing to choose from".into(),
            })
    }

    /// What was chosen, and its errors on the training squeezes.
    pub fn chosen(&self) -> Tried {
        self.chosen
    }

    /// Half-width of the 90 % interval of a whole squeeze, percent of the forearm.
    pub fn half_width_90(&self) -> f64 {
        self.readings.first().map_or(f64::NAN, Regression::half_width_90)
    }

    /// Whether a model that was read is one.
    pub(crate) fn is_whole(&self) -> bool {
        let mut fit = self
            .readings
            .iter()
            .zip(READINGS)
            .map(|(r, reading)| r.is_whole(columns_of(reading).count()));
        let ranges = self.range_deg.iter().all(|[low, high]| low < high);
        self.readings.len() == READINGS.len() && ranges && self.peak_pwm > 0.0 && fit.all(|f| f)
    }

    /// Which angles can be used.
    fn healthy(&self, squeeze: &Squeeze, course: &Course) -> Result<[bool; 4], ForearmError> {
        let mut healthy = [true; 4];
        for (n, column) in angles(squeeze).into_iter().enumerate() {
            let [low, high] = self.bounds(n);
            let known = column.iter().copied().filter(|v| v.is_finite());
            let (mut least, mut most, mut inside, mut outside) = (f64::INFINITY, f64::NEG_INFINITY, 0, None);
            for value in known {
                (least, most) = (value.min(least), value.max(most));
                if (low..=high).contains(&value) {
                    inside += 1;
                } else {
                    outside = Some(value);
                }
            }
            let stuck = most - least <= STUCK_DEG;
            let lost = 2 * inside < column.len();
            if let Some(value) = outside.filter(|_| lost && !stuck) {
                let name = ANGLES[n];
                return Err(ForearmError::Angle {
                    name,
                    value,
                    low,
                    high,
                });
            }
            healthy[n] = !(lost || stuck && course.reached() >= 1.0);
        }
        Ok(healthy)
    }

    fn bounds(&self, angle: usize) -> [f64; 2] {
        let [low, high] = self.range_deg[angle];
        [low - BEYOND_DEG, high + BEYOND_DEG]
    }
}

impl Estimator for Kinesthetic {
    fn estimate(&self, squeeze: &Squeeze) -> Result<Estimate, ForearmError> {
        squeeze.check()?;
        let samples = squeeze.len();
        if samples < LEAST {
            return Err(ForearmError::TooShort {
                samples,
                least: LEAST,
            });
        }
        let course = Course::of(&squeeze.time_ms, &squeeze.pwm, self.peak_pwm);
        let peak = squeeze.pwm.iter().copied().fold(0.0, f64::max);
        let (least, most) = (
            (1.0 - LOWER_PEAK) * self.peak_pwm,
            (1.0 + HIGHER_PEAK) * self.peak_pwm,
        );
        if peak > most || peak < least && course.reached() > 1.0 {
            let expected = self.peak_pwm;
            return Err(ForearmError::Profile { peak, expected });
        }
        let healthy = self.healthy(squeeze, &course)?;
        let usable = |reading: &&[bool; 4]| reading.iter().zip(&healthy).all(|(needs, has)| *has || !needs);
        let at = READINGS.iter().position(|reading| usable(&reading));
        let (Some(reading), Some(regression)) =
            (at.map(|n| READINGS[n]), at.and_then(|n| self.readings.get(n)))
        else {
            let lost = (0..4).filter(|n| !healthy[*n]).map(|n| ANGLES[n]);
            return Err(ForearmError::Lost {
                what: lost.collect::<Vec<_>>().join(", "),
            });
        };
        let mut features = Vec::with_capacity(2 * PHASES);
        let columns = angles(squeeze);
        for pair in columns_of(reading) {
            let value = |n: usize, row: usize| {
                let [low, high] = self.bounds(n);
                let value = columns[n][row];
                if (low..=high).contains(&value) {
                    value
                } else {
                    f64::NAN
                }
            };
            course.at_phases(|row| pair.iter().map(|n| value(*n, row)).sum(), &mut features);
        }
        let steps = course.steps();
        let estimate = regression
            .estimate(&features, steps)
            .filter(|_| features.len() % PHASES == 0);
        let (percent, half_width_90) = estimate.ok_or(ForearmError::TooShort {
            samples,
            least: LEAST,
        })?;
        Ok(Estimate {
            percent,
            half_width_90,
            source: Source::Kinesthetic,
            phase: course.reached(),
        })
    }
}

fn angles(squeeze: &Squeeze) -> [&Vec<f64>; 4] {
    let ([p0, p1], [a0, a1]) = (&squeeze.theta_p_deg, &squeeze.theta_a_deg);
    [p0, p1, a0, a1]
}

/// The angles of a reading that are added up, as numbers of `ANGLES`: the motors', then the potentiometers'.
fn columns_of(reading: [bool; 4]) -> impl Iterator<Item = Vec<usize>> {
    let of = move |pair: [usize; 2]| pair.into_iter().filter(|n| reading[*n]).collect::<Vec<_>>();
    [[2, 3], [0, 1]]
        .into_iter()
        .map(of)
        .filter(|pair| !pair.is_empty())
}

/// Squeezes with their angles at phases.
struct Training {
    peak_pwm: f64,
    range_deg: [[f64; 2]; 4],
    /// Four angles at phases for each squeeze.
    angles: Vec<f64>,
    places: Vec<usize>,
    percents: Vec<f64>,
}

impl Training {
    fn of(trials: &[&Trial]) -> Result<Self, ForearmError> {
        let mut percents: Vec<f64> = trials.iter().map(|trial| trial.location_percent).collect();
        percents.sort_by(f64::total_cmp);
        percents.dedup();
        let place = |trial: &&Trial| {
            percents
                .iter()
                .position(|p| *p == trial.location_percent)
                .unwrap_or(0)
        };
        let places: Vec<usize> = trials.iter().map(place).collect();
        let few = |n: &usize| places.iter().filter(|place| *place == n).count() < LEAST_SQUEEZES;
        if percents.len() < LEAST_PLACES || (0..percents.len()).any(|n| few(&n)) {
            let what = format!(
                "{} squeezes at {} places; it takes at least 3 places and 2 squeezes at each",
                trials.len(),
                percents.len()
            );
            return Err(ForearmError::Untrained { what });
        }
        let peak = |trial: &&Trial| trial.squeeze.pwm.iter().copied().fold(0.0, f64::max);
        let mut peaks: Vec<f64> = trials.iter().map(peak).collect();
        peaks.sort_by(f64::total_cmp);
        let peak_pwm = peaks[peaks.len() / 2];
        let mut set = Self {
            peak_pwm,
            range_deg: [[f64::INFINITY, f64::NEG_INFINITY]; 4],
            angles: Vec::with_capacity(trials.len() * 4 * PHASES),
            places,
            percents,
        };
        for trial in trials {
            set.add(trial).map_err(|source| ForearmError::In {
                at: format!(
                    "the squeeze {} at {:.1} %",
                    trial.repetition, trial.location_percent
                ),
                source: Box::new(source),
            })?;
        }
        Ok(set)
    }

    fn add(&mut self, trial: &Trial) -> Result<(), ForearmError> {
        let squeeze = &trial.squeeze;
        squeeze.check()?;
        let peak = squeeze.pwm.iter().copied().fold(0.0, f64::max);
        let expected = self.peak_pwm;
        if peak <= 0.0 || (peak - expected).abs() > HIGHER_PEAK * expected {
            return Err(ForearmError::Profile { peak, expected });
        }
        let course = Course::of(&squeeze.time_ms, &squeeze.pwm, expected);
        if course.steps() <= step_at(2.0) {
            let reached = course.reached();
            return Err(ForearmError::NoEnd { reached });
        }
        for (n, column) in angles(squeeze).into_iter().enumerate() {
            if !course.at_phases(|row| column[row], &mut self.angles) {
                return Err(ForearmError::Lost {
                    what: ANGLES[n].into(),
                });
            }
            let known = || column.iter().copied().filter(|v| v.is_finite());
            let [low, high] = self.range_deg[n];
            self.range_deg[n] = [known().fold(low, f64::min), known().fold(high, f64::max)];
        }
        Ok(())
    }

    fn rows(&self, reading: [bool; 4]) -> Rows {
        let pairs: Vec<Vec<usize>> = columns_of(reading).collect();
        let mut features = Vec::with_capacity(self.places.len() * pairs.len() * PHASES);
        for angles in self.angles.chunks_exact(4 * PHASES) {
            for pair in &pairs {
                features.extend(
                    (0..PHASES).map(|step| pair.iter().map(|n| angles[n * PHASES + step]).sum::<f64>()),
                );
            }
        }
        Rows {
            columns: pairs.len(),
            features,
            places: self.places.clone(),
            percents: self.percents.clone(),
        }
    }

    fn model(&self, chosen: Tried) -> Kinesthetic {
        let reading = |reading: [bool; 4]| {
            let every = if reading == READINGS[0] { 1 } else { STAGE_OF_FEWER };
            Regression::train(&self.rows(reading), chosen.choice, every)
        };
        Kinesthetic {
            peak_pwm: self.peak_pwm,
            range_deg: self.range_deg,
            chosen,
            readings: READINGS.map(reading).into(),
        }
    }
}
