//! Where a gripper holds, from the angles of its fingers.

mod angles;
mod training;

use self::angles::{
    LEAST_MOVED, MOTORS, READINGS, STUCK_DEG, angle, as_read, columns_of, covers, range, without,
};
use self::training::Training;
use crate::error::ForearmError;
use crate::estimate::{Estimate, Estimator, Source};
use crate::left_out::{ANGLES, LeftOut};
use crate::phase::{Course, PHASES};
use crate::plausibility::domain::Domain;
use crate::plausibility::stillness::Stillness;
use crate::profile::{Profile, WHOLE};
use crate::regression::{Regression, Tried, try_all};
use crate::session::Trial;
use crate::squeeze::Squeeze;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// An angle this far beyond those of the training squeezes is none of the gripper's, degrees.
const BEYOND_DEG: f64 = 10.0;
/// Half of the steps from sample to sample are this share of what an angle goes through in all squeezes, or less: more
/// is a wire that hangs free. Sound potentiometers make steps of 0 to 0.01.
const JUMPS: f64 = 0.1;
/// Steps that it takes to see that.
const STEPS: usize = 8;
/// So many samples in a row an angle may be missing: a machine that was busy with something else. With one more it is lost,
/// in a squeeze that goes on, and `taxel forearm record` ends the squeeze.
pub const MOST_UNKNOWN: usize = 8;
/// An angle that was one of the gripper's, and then stands still within this where none is, degrees, has lost its wire: its
/// converter is at an end, to a count.
const OFF_DEG: f64 = 0.5;
/// Where angles are lost there is a line for every so many steps only.
const STAGE_OF_FEWER: usize = 6;
/// Whole squeezes that are so many times as far from those of the training as the furthest of these is are another
/// gripper's. Public ones, whatever happens to them in `taxel forearm eval`, are 3 times as far at most, and one of some
/// thousand is this far where four squeezes a place are trained on; those under models of simulated forearms are all
/// further.
const UNLIKE: f64 = 10.0;
/// Whole is what begins where the training's squeezes do and comes to their end, to this phase.
const ABOUT: f64 = 0.02;

/// The kinesthetic estimator: partial least squares on the fingers' angles at phases of the squeeze. What is looked at is
/// chosen on the training squeezes alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kinesthetic {
    profile: Profile,
    /// Smallest and largest angle of the training squeezes, degrees, in the order of `ANGLES`. None of an angle that the
    /// training's gripper does not have.
    range_deg: [Option<[f64; 2]>; 4],
    /// The phase that all training squeezes came to.
    reached: f64,
    chosen: Tried,
    /// In the order of `READINGS`. None where such an angle is needed.
    readings: Vec<Option<Reading>>,
    /// Of the potentiometers.
    stillness: [Stillness; 2],
}

/// What is made of the angles that are there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Reading {
    regression: Regression,
    /// None where all training squeezes are the same to it.
    domain: Option<Domain>,
}

impl Reading {
    fn is_whole(&self, columns: usize) -> bool {
        self.regression.is_whole(columns) && self.domain.iter().all(|domain| domain.is_whole(columns))
    }
}

impl Kinesthetic {
    /// Trains on squeezes: tries all choices on them, and takes the one of least [`Tried::score`]. An angle that all of them
    /// lack, as of a gripper without potentiometers, is done without.
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
        let reading = set.reading()?;
        let stillness = [0, 1].map(|n| Stillness::of(trials.iter().map(|t| angle(&t.squeeze, n))));
        let mut tried = try_all(&set.rows(reading));
        tried.sort_by(|a, b| score(a).total_cmp(&score(b)));
        let chosen = tried.first().copied();
        chosen
            .map(|chosen| Self::of(&set, chosen, reading, stillness))
            .ok_or(ForearmError::Untrained {
                what: "nothing to choose from".into(),
            })
    }

    /// What is trained with this choice; `best` are the angles that every squeeze has.
    fn of(set: &Training, chosen: Tried, best: [bool; 4], stillness: [Stillness; 2]) -> Self {
        let there = set.range_deg.map(|range| range.is_some());
        let reading = |reading: [bool; 4]| {
            let every = if reading == best { 1 } else { STAGE_OF_FEWER };
            covers(there, reading).then(|| {
                let rows = set.rows(reading);
                Reading {
                    regression: Regression::train(&rows, chosen.choice, every),
                    domain: Domain::of(&rows),
                }
            })
        };
        Self {
            profile: set.profile,
            range_deg: set.range_deg,
            reached: set.reached,
            chosen,
            readings: READINGS.map(reading).into(),
            stillness,
        }
    }

    /// What was chosen, and its errors on the training squeezes.
    pub fn chosen(&self) -> Tried {
        self.chosen
    }

    /// Half-width of the 90 % interval of a whole squeeze, percent of the forearm.
    pub fn half_width_90(&self) -> f64 {
        let widest = self.readings.iter().flatten().next();
        widest.map_or(f64::NAN, |reading| reading.regression.half_width_90())
    }

    /// Names of the angles that no training squeeze had, so that estimates never look at them.
    pub fn never_there(&self) -> impl Iterator<Item = &'static str> {
        without(self.range_deg.map(|range| range.is_some())).names()
    }

    /// Whether a model that was read is one.
    pub(crate) fn is_whole(&self) -> bool {
        let there = self.range_deg.map(|range| range.is_some());
        let mut fit = self
            .readings
            .iter()
            .zip(READINGS)
            .map(|(made, reading)| match made {
                Some(r) => covers(there, reading) && r.is_whole(columns_of(reading).count()),
                None => !covers(there, reading),
            });
        let ranges = self.range_deg.iter().flatten().all(|[low, high]| low < high);
        self.readings.len() == READINGS.len()
            && self.readings.iter().any(Option::is_some)
            && ranges
            && self.profile.is_one()
            && self.reached.is_finite()
            && self.stillness.iter().all(|of| of.is_whole())
            && fit.all(|f| f)
    }

    /// Which angles can be used.
    fn healthy(
        &self,
        squeeze: &Squeeze,
        columns: &[Cow<'_, [f64]>; 4],
        course: &Course,
    ) -> Result<[bool; 4], ForearmError> {
        let mut healthy = [true; 4];
        for (n, column) in columns.iter().enumerate() {
            let Some([low, high]) = self.bounds(n) else {
                healthy[n] = false;
                continue;
            };
            let numbers = column.iter().copied().filter(|v| v.is_finite());
            let (within, outside): (Vec<f64>, Vec<f64>) = numbers.partition(|v| (low..=high).contains(v));
            let (inside, known) = (within.len(), within.len() + outside.len());
            let moves = |[least, most]: [f64; 2]| most - least;
            let [least, most] = range(column);
            let stuck = moves([least, most]) <= STUCK_DEG;
            let elsewhere = 2 * inside < known;
            let came_off = inside > 0 && moves(range(&outside)) <= OFF_DEG;
            if let Some(&value) = outside.last().filter(|_| elsewhere && !stuck && !came_off) {
                let name = ANGLES[n];
                return Err(ForearmError::Angle {
                    name,
                    value,
                    low,
                    high,
                });
            }
            let whole = course.reached() >= 1.0;
            let (moved, span) = (most - least, high - low - 2.0 * BEYOND_DEG);
            if MOTORS.contains(&n) && whole && !stuck && moved < LEAST_MOVED * span {
                let name = ANGLES[n];
                return Err(ForearmError::Still { name, moved, span });
            }
            let is_over = course.reached() >= WHOLE;
            // As long as more samples come, one without an angle says nothing of the next.
            let lost = match is_over {
                true => 2 * inside < column.len(),
                false => elsewhere || known == 0 || falls_silent(column),
            } || came_off && outside.len() > MOST_UNKNOWN;
            let stands = is_over && self.stillness.get(n).is_some_and(|of| of.is_stuck(column));
            healthy[n] = !(lost || stands || whole && (stuck || jumps(as_read(squeeze, n), span)));
        }
        Ok(healthy)
    }

    /// The columns of a reading at all phases. None where two angles that are added up are known in no sample both.
    fn features(
        &self,
        columns: &[Cow<'_, [f64]>; 4],
        course: &Course,
        reading: [bool; 4],
    ) -> Option<Vec<f64>> {
        let mut features = Vec::with_capacity(2 * PHASES);
        for pair in columns_of(reading) {
            let value = |n: usize, row: usize| {
                let value = columns[n][row];
                match self.bounds(n) {
                    Some([low, high]) if (low..=high).contains(&value) => value,
                    _ => f64::NAN,
                }
            };
            if !course.at_phases(|row| pair.iter().map(|n| value(*n, row)).sum(), &mut features) {
                return None;
            }
        }
        Some(features)
    }

    /// What an angle may be; None where the training's gripper does not have it.
    fn bounds(&self, angle: usize) -> Option<[f64; 2]> {
        self.range_deg[angle].map(|[low, high]| [low - BEYOND_DEG, high + BEYOND_DEG])
    }
}

impl Estimator for Kinesthetic {
    fn estimate(&self, squeeze: &Squeeze) -> Result<Estimate, ForearmError> {
        let course = self.profile.course(squeeze)?;
        let columns = std::array::from_fn(|n| angle(squeeze, n));
        let healthy = self.healthy(squeeze, &columns, &course)?;
        let usable = READINGS
            .into_iter()
            .zip(&self.readings)
            .filter(|(reading, _)| covers(healthy, *reading))
            .find_map(|(reading, made)| {
                let features = self.features(&columns, &course, reading)?;
                Some((reading, made.as_ref()?, features))
            });
        let never = self.range_deg.map(|range| range.is_none());
        let lacks = |used: [bool; 4]| LeftOut {
            angles: std::array::from_fn(|n| !used[n] && !never[n]),
            touch: false,
        };
        let Some((reading, made, features)) = usable else {
            let left_out = lacks(healthy);
            return Err(ForearmError::Lost { left_out });
        };
        let compared = made
            .domain
            .as_ref()
            .filter(|_| course.reached() >= self.reached - ABOUT && !self.profile.begins_late(squeeze));
        let times = compared.map_or(0.0, |domain| domain.times_as_far(&features));
        if times > UNLIKE {
            return Err(ForearmError::Unlike { times });
        }
        let (percent, half_width_90) = made.regression.estimate(&features, course.steps());
        Ok(Estimate {
            percent,
            half_width_90,
            source: Source::Kinesthetic,
            left_out: lacks(reading),
            phase: course.reached(),
        })
    }
}

/// Whether the newest samples of a column, more than [`MOST_UNKNOWN`] of them, are none of them known.
fn falls_silent(column: &[f64]) -> bool {
    let newest = column.iter().rev().take(MOST_UNKNOWN + 1);
    column.len() > MOST_UNKNOWN && newest.copied().all(|angle| !angle.is_finite())
}

/// Whether a column jumps from sample to sample by a good part of what it may go through, degrees.
fn jumps(column: &[f64], span: f64) -> bool {
    let steps = || {
        column
            .windows(2)
            .map(|two| (two[1] - two[0]).abs())
            .filter(|step| step.is_finite())
    };
    let wide = steps().filter(|step| *step > JUMPS * span).count();
    steps().count() >= STEPS && 2 * wide > steps().count()
}
