//! The squeezes that a kinesthetic estimator is trained on: what is asked of them, and their angles at phases.

use super::angles::{LEAST_MOVED, MOTORS, READINGS, STUCK_DEG, angle, columns_of, covers, range, without};
use crate::error::ForearmError;
use crate::left_out::ANGLES;
use crate::phase::PHASES;
use crate::profile::{Profile, places, within};
use crate::regression::Rows;
use crate::session::Trial;
use crate::squeeze::Squeeze;

/// An angle this far beyond those of the other training squeezes is none of the gripper's, degrees. Where these are few, a
/// sound one of the public squeezes is beyond by up to 19.6; a potentiometer in radians is by more.
const BEYOND_OTHERS_DEG: f64 = 20.0;
/// In some squeeze of a training a motor closes by at least this, degrees: in radians it would be half a turn. A
/// potentiometer, which may hardly move, comes at least so far from 0.
const LEAST_CLOSED_DEG: f64 = 3.0;

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
pub(super) struct Training {
    pub(super) profile: Profile,
    /// None of an angle that is in no squeeze, or moves in none.
    pub(super) range_deg: [Option<[f64; 2]>; 4],
    /// Four angles at phases for each squeeze, 0 where there is none.
    angles: Vec<f64>,
    /// The phase that all came to.
    pub(super) reached: f64,
    places: Vec<usize>,
    percents: Vec<f64>,
}

impl Training {
    pub(super) fn of(trials: &[&Trial]) -> Result<Self, ForearmError> {
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
                let (low, high) = (low - BEYOND_OTHERS_DEG, high + BEYOND_OTHERS_DEG);
                if let Some(value) = [*least, *most].into_iter().find(|v| !(low..=high).contains(v)) {
                    return Err(within(trial)(ForearmError::Angle {
                        name,
                        value,
                        low,
                        high,
                    }));
                }
            }
            // Where one is far off, sound motors hardly move beside it: it is named before them.
            for (trial, [least, most]) in trials.iter().zip(&ranges).filter(|_| MOTORS.contains(&n)) {
                let [low, high] = others.of_all_but([*least, *most]);
                let (span, moved) = (high - low, most - least);
                if moved < LEAST_MOVED * span {
                    return Err(within(trial)(ForearmError::Still { name, moved, span }));
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
    pub(super) fn reading(&self) -> Result<[bool; 4], ForearmError> {
        let there = self.range_deg.map(|range| range.is_some());
        let all = READINGS.into_iter().find(|reading| covers(there, *reading));
        all.ok_or_else(|| {
            let missing: Vec<_> = without(there).names().collect();
            ForearmError::Untrained {
                what: format!("no squeeze has {}, or they never move", missing.join(", ")),
            }
        })
    }

    pub(super) fn rows(&self, reading: [bool; 4]) -> Rows {
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
}
