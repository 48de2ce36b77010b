//! The PWM profile that squeezes are made with, and where the training's squeezes were made.

use crate::error::ForearmError;
use crate::phase::Course;
use crate::session::Trial;
use crate::shape::{OTHER_REST, Shape};
use crate::squeeze::Squeeze;
use serde::{Deserialize, Serialize};

/// A squeeze whose peak is higher by more than this share of the training's, or lower by more than the other, is of
/// another profile. The peak may be in a gap of seconds, which hides a quarter of it.
const HIGHER_PEAK: f64 = 0.15;
const LOWER_PEAK: f64 = 0.3;
/// A squeeze of the training comes at least to this phase: a random profile need not come to 2.
pub(crate) const WHOLE: f64 = 1.9;
/// Least samples of a squeeze.
const LEAST_SAMPLES: usize = 2;
/// Least places of a training, and squeezes at each.
const LEAST_PLACES: usize = 3;
const LEAST_SQUEEZES: usize = 2;

/// Samples are missing where the next one comes after more than this many times the median time between two.
const GAP: f64 = 4.0;

/// First, lowest and highest PWM of the training's squeezes, medians.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Profile {
    first_pwm: f64,
    least_pwm: f64,
    peak_pwm: f64,
}

fn first(squeeze: &Squeeze) -> f64 {
    squeeze.pwm.first().copied().unwrap_or(f64::NAN)
}

fn least(squeeze: &Squeeze) -> f64 {
    squeeze.pwm.iter().copied().fold(f64::INFINITY, f64::min)
}

fn peak(squeeze: &Squeeze) -> f64 {
    squeeze.pwm.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

impl Profile {
    /// The profile of training squeezes.
    pub(crate) fn of(trials: &[&Trial]) -> Result<Self, ForearmError> {
        let median = |of: fn(&Squeeze) -> f64| {
            let mut values: Vec<f64> = trials.iter().map(|trial| of(&trial.squeeze)).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0)
        };
        let profile = Self {
            first_pwm: median(first),
            least_pwm: median(least),
            peak_pwm: median(peak),
        };
        if profile.is_one() {
            Ok(profile)
        } else {
            Err(ForearmError::Untrained {
                what: "PWM does not rise in the squeezes".into(),
            })
        }
    }

    pub(crate) fn is_one(&self) -> bool {
        self.first_pwm.is_finite() && self.least_pwm < self.peak_pwm && self.peak_pwm > 0.0
    }

    /// How far each sample of a squeeze has come.
    ///
    /// # Errors
    /// What is damaged, and what is no squeeze of this profile from its beginning on.
    pub(crate) fn course(&self, squeeze: &Squeeze) -> Result<Course, ForearmError> {
        squeeze.check()?;
        let samples = squeeze.len();
        if samples < LEAST_SAMPLES {
            let least = LEAST_SAMPLES;
            return Err(ForearmError::TooShort { samples, least });
        }
        let shape = Shape::of(&squeeze.pwm, [self.least_pwm, self.peak_pwm]);
        shape.check(self.first_pwm)?;
        let course = Course::of(&squeeze.time_ms, &shape);
        let peak = peak(squeeze);
        if peak > (1.0 + HIGHER_PEAK) * self.peak_pwm {
            return Err(self.other(peak));
        }
        if peak < (1.0 - LOWER_PEAK) * self.peak_pwm && course.reached() > 1.0 {
            return Err(self.too_low(squeeze, shape.top));
        }
        Ok(course)
    }

    /// Whether the first sample of a squeeze is beyond where those of the training begin: what was before is not known.
    pub(crate) fn begins_late(&self, squeeze: &Squeeze) -> bool {
        first(squeeze) - self.first_pwm > OTHER_REST * (self.peak_pwm - self.least_pwm)
    }

    /// The same of a squeeze that is to be trained on: it must be whole.
    pub(crate) fn whole(&self, squeeze: &Squeeze) -> Result<Course, ForearmError> {
        let course = self.course(squeeze)?;
        let reached = course.reached();
        // One that ends on its way up had not come to its peak.
        let is_on_its_way = (0.0..=1.0).contains(&reached);
        if !is_on_its_way && peak(squeeze) < (1.0 - HIGHER_PEAK) * self.peak_pwm {
            return Err(self.too_low(squeeze, course.row_at(1.0)));
        }
        if reached < WHOLE {
            return Err(ForearmError::NoEnd { reached });
        }
        Ok(course)
    }

    fn other(&self, peak: f64) -> ForearmError {
        let expected = self.peak_pwm;
        ForearmError::Profile { peak, expected }
    }

    /// Why the highest PWM, in this row, is too low: another profile, or a gap that hides the peak.
    fn too_low(&self, squeeze: &Squeeze, row: usize) -> ForearmError {
        let mut steps_ms: Vec<f64> = squeeze.time_ms.windows(2).map(|two| two[1] - two[0]).collect();
        let beside = &steps_ms[row.saturating_sub(1)..(row + 1).min(steps_ms.len())];
        let gap_ms = beside.iter().copied().fold(0.0, f64::max);
        steps_ms.sort_by(f64::total_cmp);
        let (peak, expected) = (peak(squeeze), self.peak_pwm);
        if gap_ms > GAP * steps_ms[steps_ms.len() / 2] {
            ForearmError::PeakMissing {
                row,
                gap_ms,
                peak,
                expected,
            }
        } else {
            self.other(peak)
        }
    }
}

/// What errors call a squeeze of the training.
pub(crate) fn within(trial: &Trial) -> impl Fn(ForearmError) -> ForearmError + use<> {
    let at = format!("the {}", trial.name());
    move |source| ForearmError::In {
        at: at.clone(),
        source: Box::new(source),
    }
}

/// The place of each squeeze as a number, and where the places are, ascending.
pub(crate) fn places(trials: &[&Trial]) -> Result<(Vec<usize>, Vec<f64>), ForearmError> {
    let mut percents: Vec<f64> = trials.iter().map(|trial| trial.location_percent).collect();
    percents.sort_by(f64::total_cmp);
    percents.dedup();
    let mut counts = vec![0; percents.len()];
    let place = |trial: &&Trial| {
        let place = percents
            .iter()
            .position(|p| *p == trial.location_percent)
            .unwrap_or(0);
        counts[place] += 1;
        place
    };
    let places = trials.iter().map(place).collect();
    if counts.len() < LEAST_PLACES || counts.iter().any(|count| *count < LEAST_SQUEEZES) {
        let (squeezes, places) = (trials.len(), percents.len());
        let what = format!(
            "{squeezes} squeezes at {places} places; it takes at least 3 places and 2 squeezes at each"
        );
        return Err(ForearmError::Untrained { what });
    }
    Ok((places, percents))
}
