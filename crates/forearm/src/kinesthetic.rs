//! Where a gripper holds, from the angles of its fingers.

use crate::domain::Domain;
use crate::error::ForearmError;
use crate::estimate::{ANGLES, Estimate, Estimator, LeftOut, Source};
use crate::glitch::without_glitches;
use crate::phase::{Course, PHASES};
use crate::profile::{Profile, WHOLE, places, within};
use crate::regression::{Regression, Rows, Tried, try_all};
use crate::session::Trial;
use crate::squeeze::Squeeze;
use crate::stillness::Stillness;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

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
/// So far beyond those of the other training squeezes. Where these are few, a sound one of the public squeezes is beyond by
/// up to 19.6; a potentiometer in radians is by more.
const BEYOND_OTHERS_DEG: f64 = 20.0;
/// An angle that moves by no more than this until the peak is stuck, degrees: less than a step of either sensor.
const STUCK_DEG: f64 = 0.05;
/// Of what a motor's angle goes through in all squeezes, it moves by this much in each. The least is 0.23 in the public
/// data and 0.15 in the simulation; in radians it is 0.02 at most.
const LEAST_MOVED: f64 = 0.05;
/// Half of the steps from sample to sample are this share of what an angle goes through in all squeezes, or less: more
/// is a wire that hangs free. Sound potentiometers make steps of 0 to 0.01.
const JUMPS: f64 = 0.1;
/// Steps that it takes to see that.
const STEPS: usize = 8;
/// In some squeeze of a training a motor closes by at least this, degrees: in radians it would be half a turn. A
/// potentiometer, which may hardly move, comes at least so far from 0.
const LEAST_CLOSED_DEG: f64 = 3.0;
/// So many samples in a row an angle may be missing: a machine that was busy with something else. With one more it is lost,
/// in a squeeze that goes on, and `taxel forearm record` ends the squeeze.
pub const MOST_UNKNOWN: usize = 8;
/// An angle that was one of the gripper's, and then stands still within this where none is, degrees, has lost its wire: its
/// converter is at an end, to a count.
const OFF_DEG: f64 = 0.5;
/// The motors' angles among the four.
const MOTORS: std::ops::Range<usize> = 2..4;
/// Where angles are lost there is a line for every so many steps only.
const STAGE_OF_FEWER: usize = 6;
/// Whole squeezes that are so many times as far from those of the training as the furthest of these is are another
/// gripper's. Public ones, whatever happens to them in `taxel forearm eval`, are 5 times as far at most, and 11 times where four
/// squeezes a place are trained on; those under a model of the simulated forearm 13 times at least.
const UNLIKE: f64 = 12.0;
/// Whole is what comes to the end of the training's squeezes, to this phase.
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
            .map(|chosen| set.model(chosen, reading, stillness))
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
            .filter(|_| course.reached() >= self.reached - ABOUT);
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

/// Whether these angles are all that a reading needs.
fn covers(has: [bool; 4], reading: [bool; 4]) -> bool {
    reading.iter().zip(has).all(|(needs, has)| has || !needs)
}

/// What is left out where only these angles are used.
fn without(used: [bool; 4]) -> LeftOut {
    LeftOut {
        angles: used.map(|used| !used),
        touch: false,
    }
}

/// An angle by its number in `ANGLES`.
fn as_read(squeeze: &Squeeze, angle: usize) -> &[f64] {
    let ([p0, p1], [a0, a1]) = (&squeeze.theta_p_deg, &squeeze.theta_a_deg);
    [p0, p1, a0, a1][angle]
}

/// The same without glitches, which potentiometers have; a motor's angle comes in a packet with a checksum.
fn angle(squeeze: &Squeeze, angle: usize) -> Cow<'_, [f64]> {
    match as_read(squeeze, angle) {
        column if MOTORS.contains(&angle) => Cow::Borrowed(column),
        column => Cow::Owned(without_glitches(column)),
    }
}

/// The angles of a reading that are added up, as numbers of `ANGLES`: the motors', then the potentiometers'.
fn columns_of(reading: [bool; 4]) -> impl Iterator<Item = Vec<usize>> {
    let of = move |pair: [usize; 2]| pair.into_iter().filter(|n| reading[*n]).collect::<Vec<_>>();
    [[2, 3], [0, 1]]
        .into_iter()
        .map(of)
        .filter(|pair| !pair.is_empty())
}

/// Smallest and largest number of a column.
fn range(column: &[f64]) -> [f64; 2] {
    let known = || column.iter().copied().filter(|v| v.is_finite());
    [
        known().fold(f64::INFINITY, f64::min),
        known().fold(f64::NEG_INFINITY, f64::max),
    ]
}

/// The two smallest and the two largest values of an angle, each of another squeeze.
struct Others {
    least: [f64; 2],
    most: [f64; 2],
}

impl Others {
    fn of(ranges: &[[f64; 2]]) -> Self {
        let mut others = Self {
            least: [f64::INFINITY; 2],
            most: [f64::NEG_INFINITY; 2],
        };
        for [least, most] in ranges {
            let [first, second] = &mut others.least;
            *second = least.max(*first).min(*second);
            *first = least.min(*first);
            let [first, second] = &mut others.most;
            *second = most.min(*first).max(*second);
            *first = most.max(*first);
        }
        others
    }

    /// What the angle goes through in all squeezes but the one of this range.
    fn of_all_but(&self, [least, most]: [f64; 2]) -> [f64; 2] {
        [
            self.least[usize::from(least == self.least[0])],
            self.most[usize::from(most == self.most[0])],
        ]
    }
}

/// Smallest and largest value of an angle in all squeezes; None where it is in none, or stands still.
fn range_of(trials: &[&Trial], angle: usize) -> Option<[f64; 2]> {
    let ranges = trials
        .iter()
        .map(|trial| range(&self::angle(&trial.squeeze, angle)));
    let [low, high] = ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])?;
    (high - low > STUCK_DEG).then_some([low, high])
}

/// Squeezes with their angles at phases.
struct Training {
    profile: Profile,
    /// None of an angle that is in no squeeze, or moves in none.
    range_deg: [Option<[f64; 2]>; 4],
    /// Four angles at phases for each squeeze, 0 where there is none.
    angles: Vec<f64>,
    /// The phase that all came to.
    reached: f64,
    places: Vec<usize>,
    percents: Vec<f64>,
}

impl Training {
    fn of(trials: &[&Trial]) -> Result<Self, ForearmError> {
        let (places, percents) = places(trials)?;
        let mut set = Self {
            profile: Profile::of(trials)?,
            range_deg: std::array::from_fn(|n| range_of(trials, n)),
            reached: f64::INFINITY,
            angles: Vec::with_capacity(trials.len() * 4 * PHASES),
            places,
            percents,
        };
        for trial in trials {
            set.add(&trial.squeeze).map_err(within(trial))?;
        }
        set.of_one_gripper(trials)?;
        set.in_degrees(trials)?;
        Ok(set)
    }

    /// Whether each squeeze's angles are where those of all others are, and its motors move as theirs do.
    fn of_one_gripper(&self, trials: &[&Trial]) -> Result<(), ForearmError> {
        for (n, name) in ANGLES
            .into_iter()
            .enumerate()
            .filter(|(n, _)| self.range_deg[*n].is_some())
        {
            let ranges: Vec<[f64; 2]> = trials
                .iter()
                .map(|trial| range(&angle(&trial.squeeze, n)))
                .collect();
            let others = Others::of(&ranges);
            for (trial, [least, most]) in trials.iter().zip(&ranges) {
                let [low, high] = others.of_all_but([*least, *most]);
                let (span, moved) = (high - low, most - least);
                let refused = |error| Err(within(trial)(error));
                if MOTORS.contains(&n) && moved < LEAST_MOVED * span {
                    return refused(ForearmError::Still { name, moved, span });
                }
                let (low, high) = (low - BEYOND_OTHERS_DEG, high + BEYOND_OTHERS_DEG);
                if let Some(value) = [*least, *most].into_iter().find(|v| !(low..=high).contains(v)) {
                    return refused(ForearmError::Angle {
                        name,
                        value,
                        low,
                        high,
                    });
                }
            }
        }
        Ok(())
    }

    /// Whether each angle is as large in some squeeze as one in radians is in none.
    fn in_degrees(&self, trials: &[&Trial]) -> Result<(), ForearmError> {
        for n in MOTORS
            .chain(0..MOTORS.start)
            .filter(|n| self.range_deg[*n].is_some())
        {
            let ranges = trials.iter().map(|trial| range(&angle(&trial.squeeze, n)));
            let (goes, most) = match MOTORS.contains(&n) {
                true => (
                    "moves by",
                    ranges.map(|[least, most]| most - least).fold(0.0, f64::max),
                ),
                false => ("comes to", ranges.flatten().map(f64::abs).fold(0.0, f64::max)),
            };
            if most < LEAST_CLOSED_DEG {
                let name = ANGLES[n];
                return Err(ForearmError::Untrained {
                    what: format!(
                        "{name} {goes} {most:.2} degrees in a squeeze at most; is it in degrees? If it is, it tells nothing: \
                         write NaN in its place throughout, and it is done without"
                    ),
                });
            }
        }
        Ok(())
    }

    fn add(&mut self, squeeze: &Squeeze) -> Result<(), ForearmError> {
        let course = self.profile.whole(squeeze)?;
        self.reached = self.reached.min(course.reached());
        for (n, name) in ANGLES.into_iter().enumerate() {
            let column = angle(squeeze, n);
            if self.range_deg[n].is_none() {
                self.angles.extend([0.0; PHASES]);
            } else if !course.at_phases(|row| column[row], &mut self.angles) {
                return Err(ForearmError::LostOnce { name });
            }
        }
        Ok(())
    }

    /// The most angles that every squeeze has.
    fn reading(&self) -> Result<[bool; 4], ForearmError> {
        let there = self.range_deg.map(|range| range.is_some());
        let all = READINGS.into_iter().find(|reading| covers(there, *reading));
        all.ok_or_else(|| {
            let missing: Vec<_> = without(there).names().collect();
            ForearmError::Untrained {
                what: format!("no squeeze has {}, or they never move", missing.join(", ")),
            }
        })
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

    fn model(&self, chosen: Tried, best: [bool; 4], stillness: [Stillness; 2]) -> Kinesthetic {
        let there = self.range_deg.map(|range| range.is_some());
        let reading = |reading: [bool; 4]| {
            let every = if reading == best { 1 } else { STAGE_OF_FEWER };
            covers(there, reading).then(|| {
                let rows = self.rows(reading);
                Reading {
                    regression: Regression::train(&rows, chosen.choice, every),
                    domain: Domain::of(&rows, chosen.choice),
                }
            })
        };
        Kinesthetic {
            profile: self.profile,
            range_deg: self.range_deg,
            reached: self.reached,
            chosen,
            readings: READINGS.map(reading).into(),
            stillness,
        }
    }
}
