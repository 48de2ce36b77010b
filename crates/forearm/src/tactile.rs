//! Where a gripper holds, from the tactile images of its third finger.

use crate::error::ForearmError;
use crate::estimate::{Estimate, Estimator, Seen, Source};
use crate::left_out::LeftOut;
use crate::phase::{Course, PHASES};
use crate::plausibility::likeness::Likeness;
use crate::profile::{Profile, places, within};
use crate::regression::{Regression, Rows, Tried, try_all};
use crate::session::Trial;
use crate::squeeze::{Squeeze, TACTELS};
use serde::{Deserialize, Serialize};
use taxel_palpation::{Matrix, PalpationError, Pca, Solver};

/// Principal components that an image is reduced to.
const COMPONENTS: usize = 6;
/// Images that components come from, at most.
const IMAGES: usize = 600;
/// Phases that these images are taken at, evenly from 0 to 2.
const MOMENTS: usize = 9;

/// Images that are so many times as far from those of the training as the furthest of its squeezes is are not of the array
/// as it was. Sound ones of the simulated forearm are 1.8 times as far at most, and 3.7 at a place that was not trained on.
const UNLIKE: f64 = 5.0;

/// The tactile estimator: principal components of the images at phases of the squeeze, and partial least squares on
/// them as on the angles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tactile {
    profile: Profile,
    /// The mean image, [`TACTELS`] counts.
    mean: Vec<f64>,
    /// Loadings, [`TACTELS`] for each component.
    components: Vec<f64>,
    /// What scores are like where the array feels a forearm.
    likeness: Likeness,
    chosen: Tried,
    regression: Regression,
}

impl Tactile {
    /// Trains on squeezes with touch. What is looked at is chosen on them alone.
    ///
    /// # Errors
    /// As [`Kinesthetic::train`](crate::Kinesthetic::train); squeezes without touch, or in which nothing is felt.
    pub fn train(trials: &[&Trial]) -> Result<Self, ForearmError> {
        let (places, percents) = places(trials)?;
        let profile = Profile::of(trials)?;
        let mut courses = Vec::with_capacity(trials.len());
        for trial in trials {
            let squeeze = &trial.squeeze;
            let course = squeeze.tactile.as_ref().ok_or(ForearmError::NoTouch);
            courses.push(
                course
                    .and_then(|_| profile.whole(squeeze))
                    .map_err(within(trial))?,
            );
        }
        let pca =
            Pca::fit(&images(trials, &courses), COMPONENTS, Solver::Auto).map_err(|error| match error {
                PalpationError::Constant { .. } => ForearmError::SameTouch {
                    squeezes: trials.len(),
                },
                error => error.into(),
            })?;
        let mean = pca.mean().to_vec();
        let components = pca.components().as_slice().to_vec();
        let mut features = Vec::with_capacity(trials.len() * COMPONENTS * PHASES);
        let mut residuals = Vec::with_capacity(trials.len() * PHASES);
        let mut totals = Vec::with_capacity(trials.len() * PHASES);
        for (trial, course) in trials.iter().zip(&courses) {
            let (squeeze, to) = (&trial.squeeze, (&mut features, &mut residuals, &mut totals));
            let mut seen = Seen::default();
            seen.look(&mean, &components, squeeze);
            seen.at_phases(course, to);
        }
        let likeness = Likeness::of(COMPONENTS, &features, &residuals, &totals);
        let rows = Rows {
            columns: COMPONENTS,
            features,
            places,
            percents,
        };
        let mut tried = try_all(&rows);
        tried.sort_by(|a, b| a.score().total_cmp(&b.score()));
        let chosen = *tried.first().ok_or(ForearmError::NoTouch)?;
        Ok(Self {
            profile,
            mean,
            components,
            likeness,
            chosen,
            regression: Regression::train(&rows, chosen.choice, 2),
        })
    }

    /// What was chosen, and its errors on the training squeezes.
    pub fn chosen(&self) -> Tried {
        self.chosen
    }

    /// Half-width of the 90 % interval of a whole squeeze, percent of the forearm.
    pub fn half_width_90(&self) -> f64 {
        self.regression.half_width_90()
    }

    /// Whether a model that was read is one.
    pub(crate) fn is_whole(&self) -> bool {
        self.mean.len() == TACTELS
            && self.components.len() == TACTELS * COMPONENTS
            && self.likeness.is_whole(COMPONENTS)
            && self.profile.is_one()
            && self.regression.is_whole(COMPONENTS)
    }
}

impl Estimator for Tactile {
    fn estimate(&self, squeeze: &Squeeze) -> Result<Estimate, ForearmError> {
        self.follow(squeeze, &mut Seen::default())
    }

    fn follow(&self, squeeze: &Squeeze, seen: &mut Seen) -> Result<Estimate, ForearmError> {
        let course = self.profile.course(squeeze)?;
        if squeeze.tactile.is_none() {
            return Err(ForearmError::NoTouch);
        }
        let mut features = Vec::with_capacity(COMPONENTS * PHASES);
        let mut residuals = Vec::with_capacity(PHASES);
        let mut totals = Vec::with_capacity(PHASES);
        let to = (&mut features, &mut residuals, &mut totals);
        seen.look(&self.mean, &self.components, squeeze);
        seen.at_phases(&course, to);
        let steps = course.steps();
        let times = self.likeness.times_as_far(&features, &residuals, &totals, steps);
        if times > UNLIKE {
            return Err(ForearmError::Touch { times });
        }
        let (percent, half_width_90) = self.regression.estimate(&features, steps);
        Ok(Estimate {
            percent,
            half_width_90,
            source: Source::Tactile,
            left_out: LeftOut::default(),
            phase: course.reached(),
        })
    }
}

/// Images of the training to find components in, one in each column.
fn images(trials: &[&Trial], courses: &[Course]) -> Matrix {
    let every = (trials.len() * MOMENTS).div_ceil(IMAGES);
    let mut columns = Vec::new();
    let mut count = 0;
    for (trial, course) in trials.iter().zip(courses).step_by(every) {
        for moment in 0..MOMENTS {
            let row = course.row_at(2.0 * moment as f64 / (MOMENTS - 1) as f64);
            if let Some(image) = trial.squeeze.tactile_image(row) {
                columns.extend(image.iter().map(|count| f64::from(*count)));
                count += 1;
            }
        }
    }
    Matrix::new(TACTELS, count, columns)
}

impl Seen {
    /// Looks at the images of a squeeze that were not looked at before.
    fn look(&mut self, mean: &[f64], components: &[f64], squeeze: &Squeeze) {
        let mut centred = vec![0.0; TACTELS];
        for row in self.rests.len()..squeeze.len() {
            let image = squeeze.tactile_image(row).unwrap_or_default();
            let differences = image
                .iter()
                .zip(mean)
                .map(|(count, mean)| f64::from(*count) - mean);
            centred
                .iter_mut()
                .zip(differences)
                .for_each(|(place, difference)| *place = difference);
            for loadings in components.chunks_exact(TACTELS) {
                let products = loadings.iter().zip(&centred).map(|(a, b)| a * b);
                self.scores.push(products.sum::<f64>());
            }
            let squares = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>();
            let rest = squares(&centred) - squares(&self.scores[row * COMPONENTS..]);
            self.rests.push(rest.max(0.0));
            self.totals
                .push(image.iter().map(|count| f64::from(*count)).sum());
        }
    }

    /// Adds the components at all phases, component after component, what they leave of the images' squares, and the
    /// images' totals.
    fn at_phases(
        &self,
        course: &Course,
        (features, residuals, totals): (&mut Vec<f64>, &mut Vec<f64>, &mut Vec<f64>),
    ) {
        for component in 0..COMPONENTS {
            course.at_phases(|row| self.scores[row * COMPONENTS + component], features);
        }
        course.at_phases(|row| self.rests[row], residuals);
        course.at_phases(|row| self.totals[row], totals);
    }
}
