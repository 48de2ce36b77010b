//! From columns at phases to a place: one line for every phase a squeeze may have come to.

use crate::least_squares::{Line, Moments};
use crate::phase::{PHASES, phase_of};
use serde::{Deserialize, Serialize};

/// Numbers of phases that are tried.
const POINTS: [usize; 5] = [5, 8, 10, 14, 20];
/// Steps from which phases are tried: the first sample, and where PWM begins to rise.
const FROM: [usize; 2] = [0, 5];
/// Steps to which phases are tried: where PWM is back at rest, and the last sample.
const TO: [usize; 2] = [45, 47];
/// Components that are tried.
const COMPONENTS: std::ops::RangeInclusive<usize> = 1..=6;
/// Parts of the cross-validation by repetition.
const FOLDS: usize = 5;
/// The publication tests at seven places of the training and six others.
const SEEN_AND_OTHERS: [f64; 2] = [7.0, 6.0];

/// What a regression looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Choice {
    /// Phases, evenly spaced.
    pub points: usize,
    /// Number of the first phase, from 0 (the first sample).
    pub from: usize,
    /// Number of the last phase, to 47 (the last sample).
    pub to: usize,
    /// Components of partial least squares.
    pub components: usize,
}

impl std::fmt::Display for Choice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (from, to) = (phase_of(self.from), phase_of(self.to));
        write!(
            f,
            "{} components at {} phases from {from:.2} to {to:.2}",
            self.components, self.points
        )
    }
}

/// A choice with its errors on the training squeezes alone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// What was looked at.
    pub choice: Choice,
    /// Mean over places of the RMSE where a fifth of the repetitions is left out, percent of the forearm.
    pub repetitions_out: f64,
    /// Mean over places of the RMSE where the place is left out.
    pub place_out: f64,
}

impl Tried {
    /// Both errors as the publication's test weighs them: seven places that are known, six that are not.
    pub fn score(&self) -> f64 {
        let [seen, others] = SEEN_AND_OTHERS;
        (seen * self.repetitions_out + others * self.place_out) / (seen + others)
    }
}

/// Training squeezes: columns at phases, and where each was made.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    /// Columns; each has a feature for every phase.
    pub(crate) columns: usize,
    /// Features of each squeeze, one after another.
    pub(crate) features: Vec<f64>,
    /// The place of each squeeze, as a number of `percents`.
    pub(crate) places: Vec<usize>,
    /// Where the places are.
    pub(crate) percents: Vec<f64>,
}

impl Rows {
    pub(crate) fn row(&self, n: usize) -> &[f64] {
        let features = self.columns * PHASES;
        &self.features[n * features..][..features]
    }

    /// The part, of so many, that each squeeze is in: its number at its place.
    pub(crate) fn parts(&self, parts: usize) -> Vec<usize> {
        let mut counts = vec![0; self.percents.len()];
        let next = |place: &usize| {
            counts[*place] += 1;
            (counts[*place] - 1) % parts
        };
        self.places.iter().map(next).collect()
    }

    fn sums(&self, of: impl Fn(usize) -> bool) -> Moments {
        let mut sums = Moments::new(self.columns * PHASES);
        for n in (0..self.places.len()).filter(|n| of(*n)) {
            sums.add(self.row(n), self.percents[self.places[n]]);
        }
        sums
    }
}

/// Sums over the training squeezes without what is left out to judge a choice.
struct LeftOut<'a> {
    rows: &'a Rows,
    folds: Vec<usize>,
    without_fold: Vec<Moments>,
    without_place: Vec<Moments>,
}

/// Lines through the same features with 1, 2, .. components, made without a fold or a place.
struct Lines {
    picks: Vec<usize>,
    without_fold: Vec<Vec<Line>>,
    without_place: Vec<Vec<Line>>,
}

impl<'a> LeftOut<'a> {
    fn of(rows: &'a Rows) -> Self {
        let folds = rows.parts(FOLDS);
        let places = 0..rows.percents.len();
        let of_place: Vec<Moments> = places
            .map(|place| rows.sums(|n| rows.places[n] == place))
            .collect();
        let mut all = Moments::new(rows.columns * PHASES);
        of_place.iter().for_each(|part| all.merge(part, 1.0));
        let without = |part: &Moments| {
            let mut rest = all.clone();
            rest.merge(part, -1.0);
            rest
        };
        Self {
            without_fold: (0..FOLDS)
                .map(|fold| without(&rows.sums(|n| folds[n] == fold)))
                .collect(),
            without_place: of_place.iter().map(without).collect(),
            rows,
            folds,
        }
    }

    fn lines(&self, steps: &[usize]) -> Lines {
        let picks = picks(self.rows.columns, steps);
        let fit = |sums: &Moments| sums.fit(&picks, *COMPONENTS.end());
        Lines {
            without_fold: self.without_fold.iter().map(fit).collect(),
            without_place: self.without_place.iter().map(fit).collect(),
            picks,
        }
    }

    fn tried(&self, lines: &Lines, choice: Choice) -> Tried {
        let rows = self.rows;
        let at = |line: &Line, n: usize| line.at(rows.row(n), &lines.picks);
        let line = choice.components - 1;
        Tried {
            choice,
            repetitions_out: mean_rmse(rows, |n| at(&lines.without_fold[self.folds[n]][line], n)),
            place_out: mean_rmse(rows, |n| at(&lines.without_place[rows.places[n]][line], n)),
        }
    }
}

/// Sums over the training squeezes, whole and without what is left out to tell how far a new squeeze at a new place is off.
struct Elsewhere<'a> {
    rows: &'a Rows,
    halves: Vec<usize>,
    all: Moments,
    /// By the place that is not in it, and the half of the repetitions.
    without: Vec<[Moments; 2]>,
}

impl<'a> Elsewhere<'a> {
    fn of(rows: &'a Rows) -> Self {
        let halves = rows.parts(2);
        let part = |place, half| rows.sums(|n| rows.places[n] == place && halves[n] == half);
        let parts: Vec<[Moments; 2]> = (0..rows.percents.len())
            .map(|place| [0, 1].map(|half| part(place, half)))
            .collect();
        let whole = [0, 1].map(|half| {
            let mut whole = Moments::new(rows.columns * PHASES);
            parts.iter().for_each(|part| whole.merge(&part[half], 1.0));
            whole
        });
        let mut all = whole[0].clone();
        all.merge(&whole[1], 1.0);
        let without = |part: &[Moments; 2]| {
            [1, 0].map(|other: usize| {
                let mut rest = whole[other].clone();
                rest.merge(&part[other], -1.0);
                rest
            })
        };
        Self {
            without: parts.iter().map(without).collect(),
            halves,
            all,
            rows,
        }
    }

    /// Half-width of the interval that holds nine of ten squeezes to come, at places to come: Student's t times the RMSE of
    /// lines that were made without the place, and without that half of the repetitions which the squeeze is of. A line
    /// through places has two degrees less than there are places.
    fn half_width(&self, picks: &[usize], components: usize) -> f64 {
        let lines: Vec<[Option<Line>; 2]> = (self.without.iter())
            .map(|halves| [0, 1].map(|half| halves[half].fit(picks, components).pop()))
            .collect();
        let rows = self.rows;
        let squares = place_means(rows, |n| {
            let place = rows.places[n];
            let line = lines[place][self.halves[n]].as_ref();
            let estimate = line.map_or(f64::NAN, |line| line.at(rows.row(n), picks));
            (estimate.clamp(0.0, 100.0) - rows.percents[place]).powi(2)
        });
        let places = squares.len() as f64;
        student((places - 2.0).max(1.0)) * (squares.iter().sum::<f64>() / places).sqrt()
    }
}

/// The 0.95 quantile of Student's t (Cornish and Fisher's expansion, right to 0.5 % from five degrees on).
fn student(degrees: f64) -> f64 {
    1.6449 + 1.5239 / degrees + 1.4203 / (degrees * degrees)
}

/// Steps, evenly spaced.
fn steps(points: usize, from: usize, to: usize) -> Vec<usize> {
    let points = points.min(to - from + 1).max(1);
    let place = |n: usize| from + ((to - from) * n + (points - 1) / 2) / (points - 1).max(1);
    if points == 1 {
        vec![to]
    } else {
        (0..points).map(place).collect()
    }
}

/// The features of every column at some steps.
fn picks(columns: usize, steps: &[usize]) -> Vec<usize> {
    let of_column = |column: usize| steps.iter().map(move |step| column * PHASES + step);
    (0..columns).flat_map(of_column).collect()
}

/// The features at so many phases, evenly from the first to the last.
pub(crate) fn picks_evenly(columns: usize, points: usize) -> Vec<usize> {
    picks(columns, &steps(points, 0, PHASES - 1))
}

/// The features that are looked at of a squeeze that has come to step `last`.
fn picks_until(columns: usize, choice: Choice, last: usize) -> Vec<usize> {
    let to = last.min(choice.to);
    picks(columns, &steps(choice.points, choice.from.min(to), to))
}

/// Tries everything on the training squeezes alone.
pub(crate) fn try_all(rows: &Rows) -> Vec<Tried> {
    let left_out = LeftOut::of(rows);
    let mut tried = Vec::new();
    for points in POINTS {
        for from in FROM {
            for to in TO {
                let lines = left_out.lines(&steps(points, from, to));
                let choice = |components| Choice {
                    points,
                    from,
                    to,
                    components,
                };
                tried.extend(COMPONENTS.map(|components| left_out.tried(&lines, choice(components))));
            }
        }
    }
    tried
}

/// Mean over places of the RMSE of estimates.
fn mean_rmse(rows: &Rows, estimate: impl Fn(usize) -> f64) -> f64 {
    let error = |n: usize| estimate(n).clamp(0.0, 100.0) - rows.percents[rows.places[n]];
    let squares = place_means(rows, |n| error(n).powi(2));
    squares.iter().map(|square| square.sqrt()).sum::<f64>() / squares.len() as f64
}

/// The mean of something over the squeezes of each place.
fn place_means(rows: &Rows, of: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); rows.percents.len()];
    for (n, place) in rows.places.iter().enumerate() {
        sums[*place].0 += of(n);
        sums[*place].1 += 1.0;
    }
    sums.iter().map(|(sum, count)| sum / count).collect()
}

/// A line for each phase that a squeeze may have come to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Regression {
    columns: usize,
    stages: Vec<Stage>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Stage {
    /// The last step that it needs.
    last: usize,
    picks: Vec<usize>,
    weights: Vec<f64>,
    offset: f64,
    half_width_90: f64,
}

impl Regression {
    /// Lines for `every` so many steps, through as many phases and with as many components as were chosen for the whole.
    pub(crate) fn train(rows: &Rows, choice: Choice, every: usize) -> Self {
        let elsewhere = Elsewhere::of(rows);
        let mut stages = Vec::new();
        for last in (every - 1..PHASES).step_by(every) {
            let picks = picks_until(rows.columns, choice, last);
            let line = elsewhere.all.fit(&picks, choice.components).pop();
            stages.extend(line.map(|line| Stage {
                last,
                half_width_90: elsewhere.half_width(&picks, choice.components),
                weights: line.weights,
                offset: line.offset,
                picks: picks.clone(),
            }));
        }
        Self {
            columns: rows.columns,
            stages,
        }
    }

    /// Estimate and half-width from columns at phases of which `steps` have been reached.
    pub(crate) fn estimate(&self, features: &[f64], steps: usize) -> (f64, f64) {
        let reached = |stage: &&Stage| stage.last < steps;
        let Some(stage) = self.stages.iter().rev().find(reached).or(self.stages.first()) else {
            return (50.0, 50.0);
        };
        let terms = stage
            .weights
            .iter()
            .zip(&stage.picks)
            .map(|(w, pick)| w * features[*pick]);
        let percent = stage.offset + terms.sum::<f64>();
        (percent.clamp(0.0, 100.0), stage.half_width_90)
    }

    /// The half-width where the whole squeeze is known.
    pub(crate) fn half_width_90(&self) -> f64 {
        self.stages.last().map_or(f64::NAN, |stage| stage.half_width_90)
    }

    /// Whether its parts fit each other and `columns` columns.
    pub(crate) fn is_whole(&self, columns: usize) -> bool {
        let fits = |stage: &Stage| {
            let numbers = stage.weights.iter().chain([&stage.offset, &stage.half_width_90]);
            stage.picks.len() == stage.weights.len()
                && stage.picks.iter().all(|pick| *pick < columns * PHASES)
                && numbers.copied().all(f64::is_finite)
                && stage.half_width_90 > 0.0
                && stage.last < PHASES
        };
        self.columns == columns
            && !self.stages.is_empty()
            && self.stages.iter().all(fits)
            && self.stages.is_sorted_by(|a, b| a.last < b.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_even_and_have_both_ends() {
        assert_eq!(steps(5, 5, 45), [5, 15, 25, 35, 45]);
        assert_eq!(steps(3, 0, 47), [0, 24, 47]);
        assert_eq!(steps(5, 3, 4), [3, 4]);
        assert_eq!(steps(1, 0, 7), [7]);
    }

    #[test]
    fn the_quantile_of_students_t_is_that_of_the_tables() {
        for (degrees, table) in [(5.0, 2.0150), (7.0, 1.8946), (13.0, 1.7709), (60.0, 1.6706)] {
            assert!((student(degrees) / table - 1.0).abs() < 5e-3, "{degrees}");
        }
    }
}
