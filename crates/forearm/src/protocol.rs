//! The publication's protocol: which squeezes are trained on, which are judged, and how errors are summed up.

use crate::session::Session;
use taxel_cluster::Random;

/// Share of the squeezes at a place that is trained on.
const TRAINED: f64 = 0.9;

/// One of the publication's random repetitions, as numbers of a session's trials.
///
/// Its set SE is every second place from the wrist on, SO the others. Single estimators are trained on nine tenths of
/// SE and judged on the rest of SE and all of SO. Fusion is trained on nine tenths of SO and judged on the rest of SO
/// and all of SE, of which its single estimators were trained on nine tenths.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// What single estimators are trained on.
    pub train: Vec<usize>,
    /// What they are judged on.
    pub test: Vec<usize>,
    /// What fusion is trained on.
    pub fusion_train: Vec<usize>,
    /// What fusion is judged on.
    pub fusion_test: Vec<usize>,
}

/// The publication's random repetitions; the same seed gives the same.
pub fn splits(session: &Session, repetitions: usize, seed: u64) -> Vec<Split> {
    splits_of_few(session, repetitions, seed, usize::MAX)
}

/// The same repetitions, but at most `squeezes` at each place are trained on, drawn from those that would be. The others are
/// neither trained on nor judged.
pub fn splits_of_few(session: &Session, repetitions: usize, seed: u64, squeezes: usize) -> Vec<Split> {
    let mut random = Random::new(seed);
    let locations = session.locations();
    let of_place = |place: &f64| {
        let here = |n: &usize| session.trials[*n].location_percent == *place;
        (0..session.trials.len()).filter(here).collect::<Vec<_>>()
    };
    let places: Vec<Vec<usize>> = locations.iter().map(of_place).collect();
    let mut draw = || {
        let mut parts = [const { Vec::new() }; 4];
        for (number, trials) in places.iter().enumerate() {
            let mut trials = trials.clone();
            random.shuffle(&mut trials);
            let (train, test) = trials.split_at(trained(trials.len()));
            let [own, own_test, other_all] = if number % 2 == 0 { [0, 1, 3] } else { [2, 3, 1] };
            parts[own].extend(train.iter().take(squeezes));
            parts[own_test].extend_from_slice(test);
            parts[other_all].extend_from_slice(&trials);
        }
        parts.iter_mut().for_each(|part| part.sort_unstable());
        let [train, test, fusion_train, fusion_test] = parts;
        Split {
            train,
            test,
            fusion_train,
            fusion_test,
        }
    };
    (0..repetitions).map(|_| draw()).collect()
}

/// How many of so many squeezes at a place are trained on: nine tenths. One at least is left to be judged, where training
/// has the two that it needs.
fn trained(squeezes: usize) -> usize {
    let share = (TRAINED * squeezes as f64).round() as usize;
    share.min(squeezes.saturating_sub(1).max(2)).min(squeezes)
}

/// An estimate beside the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judged {
    /// Which repetition of the protocol, from 0.
    pub repetition: usize,
    /// Where the squeeze was made, 0 to 100.
    pub percent: f64,
    /// Where it was estimated to be.
    pub estimate: f64,
    /// Half-width of the interval.
    pub half_width_90: f64,
    /// Whether squeezes at the place were trained on.
    pub seen: bool,
}

impl Judged {
    fn error(&self) -> f64 {
        self.estimate - self.percent
    }

    fn covered(&self) -> bool {
        self.error().abs() <= self.half_width_90
    }
}

/// Errors at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceErrors {
    /// Where it is, 0 to 100.
    pub percent: f64,
    /// Root of the mean square error, mean over repetitions.
    pub rmse: f64,
    /// Mean absolute error, mean over repetitions.
    pub mae: f64,
    /// Every estimate of all repetitions.
    pub estimates: Vec<f64>,
    /// Least, first quartile, median, third quartile and largest of them.
    pub spread: [f64; 5],
    /// Share of squeezes whose place is within the interval.
    pub covered: f64,
}

impl PlaceErrors {
    /// From the least to the largest estimate.
    pub fn range(&self) -> f64 {
        self.spread[4] - self.spread[0]
    }
}

/// Errors of a protocol, percent of the forearm.
#[derive(Debug, Clone, PartialEq)]
pub struct Errors {
    /// By place, from the wrist on.
    pub places: Vec<PlaceErrors>,
    /// Mean over places of the RMSE at a place, in each repetition.
    pub macro_rmses: Vec<f64>,
    /// Mean of these.
    pub macro_rmse: f64,
    /// Mean over places of the mean absolute error at a place.
    pub macro_mae: f64,
    /// RMSE over squeezes: places with more of them count more.
    pub pooled_rmse: f64,
    /// Mean absolute error over squeezes.
    pub pooled_mae: f64,
    /// Mean over places of the share of squeezes whose place is within the interval.
    pub coverage_90: f64,
    /// Share of squeezes within it at places that were trained on, and at others; not a number where there are none.
    pub coverage_seen_and_new: [f64; 2],
    /// Mean half-width of the interval.
    pub half_width_90: f64,
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

fn rmse<'a>(judged: impl Iterator<Item = &'a Judged>) -> f64 {
    mean(judged.map(|j| j.error() * j.error())).sqrt()
}

impl Errors {
    /// Sums up estimates; none where there is none.
    pub fn of(judged: &[Judged]) -> Option<Self> {
        let last = judged.iter().map(|j| j.repetition).max()?;
        let mut percents: Vec<f64> = judged.iter().map(|j| j.percent).collect();
        percents.sort_by(f64::total_cmp);
        percents.dedup();
        // Errors of each repetition at each place, where it has any there.
        let cells: Vec<Vec<Vec<&Judged>>> = (0..=last)
            .map(|repetition| {
                let mut row = vec![Vec::new(); percents.len()];
                for j in judged.iter().filter(|j| j.repetition == repetition) {
                    row[percents.iter().position(|p| *p == j.percent).unwrap_or(0)].push(j);
                }
                row
            })
            .collect();
        let of_cell = |cell: &[&Judged]| {
            let absolute = mean(cell.iter().map(|j| j.error().abs()));
            [rmse(cell.iter().copied()), absolute]
        };
        let row_mean = |row: &[Vec<&Judged>], part: usize| {
            mean(
                row.iter()
                    .filter(|cell| !cell.is_empty())
                    .map(|cell| of_cell(cell)[part]),
            )
        };
        let place = |(n, percent): (usize, &f64)| {
            let here = || cells.iter().map(|row| &row[n]).filter(|cell| !cell.is_empty());
            let all: Vec<&Judged> = here().flatten().copied().collect();
            let mut estimates: Vec<f64> = all.iter().map(|j| j.estimate).collect();
            estimates.sort_by(f64::total_cmp);
            let quantile = |share: f64| {
                let at = share * (estimates.len() - 1) as f64;
                let (below, above) = (estimates[at.floor() as usize], estimates[at.ceil() as usize]);
                below + at.fract() * (above - below)
            };
            PlaceErrors {
                percent: *percent,
                rmse: mean(here().map(|cell| of_cell(cell)[0])),
                mae: mean(here().map(|cell| of_cell(cell)[1])),
                spread: [0.0, 0.25, 0.5, 0.75, 1.0].map(quantile),
                covered: mean(all.iter().map(|j| f64::from(u8::from(j.covered())))),
                estimates,
            }
        };
        let covered = |of: &dyn Fn(&Judged) -> bool| {
            mean(
                judged
                    .iter()
                    .filter(|j| of(j))
                    .map(|j| f64::from(u8::from(j.covered()))),
            )
        };
        let rows = || cells.iter().filter(|row| row.iter().any(|cell| !cell.is_empty()));
        let repetition = |repetition: usize| judged.iter().filter(move |j| j.repetition == repetition);
        let drawn = || (0..=last).filter(|n| repetition(*n).next().is_some());
        let macro_rmses: Vec<f64> = rows().map(|row| row_mean(row, 0)).collect();
        let places: Vec<PlaceErrors> = percents.iter().enumerate().map(place).collect();
        Some(Self {
            macro_rmse: mean(macro_rmses.iter().copied()),
            macro_rmses,
            macro_mae: mean(rows().map(|row| row_mean(row, 1))),
            pooled_rmse: mean(drawn().map(|n| rmse(repetition(n)))),
            pooled_mae: mean(drawn().map(|n| mean(repetition(n).map(|j| j.error().abs())))),
            coverage_90: mean(places.iter().map(|place| place.covered)),
            coverage_seen_and_new: [covered(&|j| j.seen), covered(&|j| !j.seen)],
            half_width_90: mean(judged.iter().map(|j| j.half_width_90)),
            places,
        })
    }

    /// Mean over places of the range from the least to the largest estimate.
    pub fn mean_range(&self) -> f64 {
        mean(self.places.iter().map(PlaceErrors::range))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::places::location_percent;
    use crate::session::Trial;
    use crate::squeeze::Squeeze;

    fn session() -> Session {
        let trial = |n: usize| Trial {
            location_percent: location_percent(n / 10),
            repetition: n % 10,
            squeeze: Squeeze::default(),
        };
        Session {
            name: "test".into(),
            simulated: false,
            passed_over: Vec::new(),
            trials: (0..130).map(trial).collect(),
        }
    }

    #[test]
    fn a_repetition_trains_on_nine_tenths_of_every_second_place_and_judges_all_else() {
        let drawn = splits(&session(), 3, 1);
        for split in &drawn {
            let counts = [&split.train, &split.test, &split.fusion_train, &split.fusion_test].map(Vec::len);
            assert_eq!(counts, [63, 7 + 60, 54, 6 + 70]);
            assert!(split.train.iter().all(|n| n / 10 % 2 == 0));
            assert!(split.fusion_train.iter().all(|n| n / 10 % 2 == 1));
            for (train, test) in [
                (&split.train, &split.test),
                (&split.fusion_train, &split.fusion_test),
            ] {
                assert!(train.iter().all(|n| !test.contains(n)));
            }
        }
        assert_ne!(drawn[0], drawn[1]);
        assert_eq!(drawn, splits(&session(), 3, 1));
        for (split, whole) in splits_of_few(&session(), 3, 1, 2).iter().zip(&drawn) {
            assert_eq!((split.train.len(), split.fusion_train.len()), (14, 12));
            assert!(split.train.iter().all(|n| whole.train.contains(n)));
            assert_eq!(
                (&split.test, &split.fusion_test),
                (&whole.test, &whole.fusion_test)
            );
        }
    }

    #[test]
    fn a_squeeze_at_each_place_is_left_to_be_judged_where_two_are_trained_on() {
        let all = [1, 2, 3, 4, 5, 10, 60].map(trained);
        assert_eq!(all, [1, 2, 2, 3, 4, 9, 54]);
    }

    #[test]
    fn errors_are_summed_up_by_place_and_over_squeezes() {
        let judged = |repetition, percent, estimate, seen| Judged {
            repetition,
            percent,
            estimate,
            half_width_90: 3.5,
            seen,
        };
        // At 0 %: one squeeze, off by 2. At 50 %: three, off by 4, 4 and -4. Once more without error.
        let all = [
            judged(0, 0.0, 2.0, true),
            judged(0, 50.0, 54.0, false),
            judged(0, 50.0, 54.0, false),
            judged(0, 50.0, 46.0, false),
            judged(1, 0.0, 0.0, true),
            judged(1, 50.0, 50.0, false),
        ];
        let errors = Errors::of(&all).unwrap();
        assert_eq!(errors.macro_rmses, [3.0, 0.0]);
        assert_eq!((errors.macro_rmse, errors.macro_mae), (1.5, 1.5));
        assert_eq!(errors.pooled_rmse, (52.0f64 / 4.0).sqrt() / 2.0);
        assert_eq!(errors.pooled_mae, 3.5 / 2.0);
        assert_eq!(errors.coverage_seen_and_new, [1.0, 0.25]);
        assert_eq!(errors.places[1].spread, [46.0, 49.0, 52.0, 54.0, 54.0]);
        assert_eq!((errors.places[1].range(), errors.mean_range()), (8.0, 5.0));
        assert_eq!(Errors::of(&[]), None);
    }
}
