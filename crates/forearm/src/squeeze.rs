//! One squeeze, as plain columns.

use crate::error::ForearmError;
use taxel_gripper::FULL_PWM;

/// Underactuated fingers of the gripper.
pub const FINGERS: usize = 2;
/// Rows of a tactile image.
pub const TACTILE_ROWS: usize = 28;
/// Columns of a tactile image.
pub const TACTILE_COLUMNS: usize = 50;
/// Tactels of a tactile image.
pub const TACTELS: usize = TACTILE_ROWS * TACTILE_COLUMNS;
/// Columns of the publication's files.
pub const COLUMNS: usize = 10;
/// From sample to sample a file's times may go by so much, in the middle; what does not is seconds or microseconds.
const PERIODS_MS: std::ops::RangeInclusive<f64> = 1.0..=10_000.0;

/// What the gripper knows at one instant. What is not known is not a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time since the squeeze began, ms.
    pub time_ms: f64,
    /// Angle between the phalanges of each finger, degrees, from its potentiometer.
    pub theta_p_deg: [f64; FINGERS],
    /// Angle of each finger's motor, degrees.
    pub theta_a_deg: [f64; FINGERS],
    /// PWM that both motors are commanded, of 885; above 0 closes.
    pub pwm: f64,
}

/// One squeeze and release, or as much of it as there is: columns of equal length, a row per sample.
///
/// The publication documents none of its columns. They were told apart by their ranges and steps: theta_p by the
/// potentiometer's step of 0.33 degrees, theta_a by the servo's of 0.088. theta_a grows as a finger closes. Which finger
/// is left, and where the angles have their zero, is not known: estimates hold for the gripper of the training squeezes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Squeeze {
    /// Time since the squeeze began, ms, strictly increasing.
    pub time_ms: Vec<f64>,
    /// Angle between the phalanges of each finger, degrees, from its potentiometer; not a number where it is lost.
    pub theta_p_deg: [Vec<f64>; FINGERS],
    /// Angle of each finger's motor, degrees; not a number where it is lost.
    pub theta_a_deg: [Vec<f64>; FINGERS],
    /// PWM that both motors are commanded, of 885; above 0 closes.
    pub pwm: Vec<f64>,
    /// The tenth column of the publication's files, an angle in degrees of which nothing is said. Not a number where
    /// there is none. Kept so that files come back whole; nothing is estimated from it.
    pub undocumented_deg: Vec<f64>,
    /// Tactile images, [`TACTELS`] counts each, row by row, one after another; one for each sample.
    pub tactile: Option<Vec<u16>>,
}

impl Squeeze {
    /// How many samples there are.
    pub fn len(&self) -> usize {
        self.time_ms.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.time_ms.is_empty()
    }

    /// Adds a sample without touch.
    pub fn push(&mut self, sample: Sample) {
        self.time_ms.push(sample.time_ms);
        for finger in 0..FINGERS {
            self.theta_p_deg[finger].push(sample.theta_p_deg[finger]);
            self.theta_a_deg[finger].push(sample.theta_a_deg[finger]);
        }
        self.pwm.push(sample.pwm);
        self.undocumented_deg.push(f64::NAN);
    }

    /// Adds the tactile image of the newest sample, [`TACTELS`] counts; each sample before it has to have one.
    pub fn push_image(&mut self, counts: &[u16]) {
        self.tactile.get_or_insert_default().extend_from_slice(counts);
    }

    /// A sample.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn sample(&self, row: usize) -> Sample {
        Sample {
            time_ms: self.time_ms[row],
            theta_p_deg: [0, 1].map(|finger| self.theta_p_deg[finger][row]),
            theta_a_deg: [0, 1].map(|finger| self.theta_a_deg[finger][row]),
            pwm: self.pwm[row],
        }
    }

    /// The tactile image of a sample, [`TACTELS`] counts, where the squeeze has touch.
    pub fn tactile_image(&self, row: usize) -> Option<&[u16]> {
        self.tactile.as_ref()?.get(row * TACTELS..(row + 1) * TACTELS)
    }

    /// The samples that `keep` wants, by their row, touch included.
    pub fn filtered(&self, mut keep: impl FnMut(usize) -> bool) -> Self {
        let rows: Vec<usize> = (0..self.len()).filter(|row| keep(*row)).collect();
        let take = |column: &[f64]| rows.iter().map(|row| column[*row]).collect();
        let images = |all: &Vec<u16>| {
            let image = |row: &usize| &all[row * TACTELS..(row + 1) * TACTELS];
            rows.iter().flat_map(image).copied().collect()
        };
        Self {
            time_ms: take(&self.time_ms),
            theta_p_deg: [0, 1].map(|finger| take(&self.theta_p_deg[finger])),
            theta_a_deg: [0, 1].map(|finger| take(&self.theta_a_deg[finger])),
            pwm: take(&self.pwm),
            undocumented_deg: take(&self.undocumented_deg),
            tactile: self.tactile.as_ref().map(images),
        }
    }

    /// The first `len` samples, or all.
    pub fn prefix(&self, len: usize) -> Self {
        self.filtered(|row| row < len)
    }

    /// The columns of the publication's files: time, theta_p twice, theta_a twice, PWM three times, its negative, and the
    /// angle of which nothing is said.
    pub fn columns(&self) -> [Vec<f64>; COLUMNS] {
        let [p, a] = [&self.theta_p_deg, &self.theta_a_deg];
        let negative = self.pwm.iter().map(|pwm| 0.0 - pwm).collect();
        [
            self.time_ms.clone(),
            p[0].clone(),
            p[1].clone(),
            a[0].clone(),
            a[1].clone(),
            self.pwm.clone(),
            self.pwm.clone(),
            self.pwm.clone(),
            negative,
            self.undocumented_deg.clone(),
        ]
    }

    /// A squeeze of the publication's columns, without touch. Three of the four columns of PWM are not looked at.
    ///
    /// # Errors
    /// As [`Squeeze::check`]; times that are in another unit.
    pub(crate) fn from_columns(columns: [Vec<f64>; COLUMNS]) -> Result<Self, ForearmError> {
        let [time_ms, p0, p1, a0, a1, pwm, _, _, _, undocumented_deg] = columns;
        let squeeze = Self {
            time_ms,
            theta_p_deg: [p0, p1],
            theta_a_deg: [a0, a1],
            pwm,
            undocumented_deg,
            tactile: None,
        };
        squeeze.check()?;
        match squeeze.period_ms() {
            Some(period_ms) if !PERIODS_MS.contains(&period_ms) => Err(ForearmError::Period { period_ms }),
            _ => Ok(squeeze),
        }
    }

    /// Median time from sample to sample; none of fewer than two.
    fn period_ms(&self) -> Option<f64> {
        let mut steps_ms: Vec<f64> = self.time_ms.windows(2).map(|two| two[1] - two[0]).collect();
        steps_ms.sort_by(f64::total_cmp);
        steps_ms.get(steps_ms.len() / 2).copied()
    }

    /// Whether columns have one length, times are finite and increase, and PWM is within what a motor takes. Angles may
    /// be anything: what cannot be an angle counts as lost where a place is estimated.
    ///
    /// # Errors
    /// The first that is not so, with its row.
    pub fn check(&self) -> Result<(), ForearmError> {
        let rows = self.len();
        let [p, a] = [&self.theta_p_deg, &self.theta_a_deg];
        for column in [&p[0], &p[1], &a[0], &a[1], &self.pwm, &self.undocumented_deg] {
            if column.len() != rows {
                let found = column.len();
                return Err(ForearmError::Columns { found, rows });
            }
        }
        if let Some(images) = self.tactile.as_ref().filter(|t| t.len() != rows * TACTELS) {
            let counts = images.len();
            return Err(ForearmError::Images { counts, rows });
        }
        for (row, time_ms) in self.time_ms.iter().copied().enumerate() {
            let before_ms = row.checked_sub(1).map_or(f64::NEG_INFINITY, |r| self.time_ms[r]);
            if !time_ms.is_finite() || time_ms <= before_ms {
                return Err(ForearmError::Time {
                    row,
                    time_ms,
                    before_ms,
                });
            }
        }
        match self
            .pwm
            .iter()
            .position(|pwm| pwm.is_nan() || pwm.abs() > FULL_PWM)
        {
            Some(row) => Err(ForearmError::Pwm {
                row,
                pwm: self.pwm[row],
            }),
            None => Ok(()),
        }
    }
}
