//! Estimators trained and judged by the publication's protocol.

use anyhow::Context;
use serde::Serialize;
use std::fmt;
use std::time::{Duration, Instant};
use taxel_forearm::{
    Choice, Errors, Estimator, ForearmError, Judged, Kinesthetic, Session, Split, Squeeze, Trial,
};
use taxel_playback::progress::Progress;

/// Estimators of each repetition, and how long their training took.
pub(super) struct Trained<E> {
    pub(super) estimators: Vec<E>,
    pub(super) took: Duration,
}

/// Estimates of a protocol, summed up, or why there is none.
pub(super) type Judgement = Result<Outcome, NoEstimate>;

/// Nothing could be said of any squeeze.
#[derive(Debug)]
pub(super) struct NoEstimate {
    /// How many there were.
    pub(super) squeezes: usize,
    /// Why, in the words of the first.
    pub(super) why: String,
}

impl std::error::Error for NoEstimate {}

impl fmt::Display for NoEstimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.why)
    }
}

/// Estimates of a protocol, summed up.
pub(super) struct Outcome {
    pub(super) errors: Errors,
    /// Mean time of an estimate.
    pub(super) estimate_us: f64,
    /// Share of estimates that were made without an angle.
    pub(super) without_an_angle: f64,
    /// Squeezes of which nothing could be said, and why in the words of the first.
    pub(super) refused: Option<(usize, String)>,
}

pub(super) fn trials<'a>(session: &'a Session, numbers: &[usize]) -> Vec<&'a Trial> {
    numbers.iter().map(|n| &session.trials[*n]).collect()
}

/// Trains once for each repetition.
pub(super) fn train<E>(
    session: &Session,
    splits: &[Split],
    train: impl Fn(&[&Trial]) -> Result<E, ForearmError>,
) -> anyhow::Result<Trained<E>> {
    let began = Instant::now();
    let estimators = splits.iter().map(|split| train(&trials(session, &split.train)));
    let estimators = estimators
        .collect::<Result<_, _>>()
        .with_context(|| session.name.clone())?;
    let took = began.elapsed();
    Ok(Trained { estimators, took })
}

/// An estimator, what it was trained on, and what it is judged on, as numbers of trials.
struct Part<'a, E> {
    repetition: usize,
    estimator: &'a E,
    train: Vec<usize>,
    test: &'a [usize],
}

/// What happens to a squeeze before it is judged; it is given a number of the squeeze's own in each repetition.
pub(super) type Change<'a> = Option<&'a dyn Fn(&Squeeze, u64) -> Squeeze>;

fn judge<E: Estimator>(session: &Session, parts: &[Part<'_, E>], change: Change<'_>) -> Judgement {
    let (mut judged, mut refused, mut without) = (Vec::new(), None, 0.0);
    let mut took = Duration::ZERO;
    for part in parts {
        let known: Vec<f64> = part
            .train
            .iter()
            .map(|n| session.trials[*n].location_percent)
            .collect();
        for number in part.test {
            let trial = &session.trials[*number];
            let seed = ((part.repetition as u64) << 32) | *number as u64;
            let changed = change.map(|change| change(&trial.squeeze, seed));
            let began = Instant::now();
            let estimate = part
                .estimator
                .estimate(changed.as_ref().unwrap_or(&trial.squeeze));
            match estimate {
                Ok(estimate) => {
                    took += began.elapsed();
                    without += f64::from(u8::from(estimate.left_out.names().next().is_some()));
                    judged.push(Judged {
                        repetition: part.repetition,
                        percent: trial.location_percent,
                        estimate: estimate.percent,
                        half_width_90: estimate.half_width_90,
                        seen: known.contains(&trial.location_percent),
                    });
                }
                Err(error) => refused.get_or_insert((0, error.to_string())).0 += 1,
            }
        }
    }
    match Errors::of(&judged) {
        Some(errors) => Ok(Outcome {
            estimate_us: took.as_secs_f64() * 1e6 / judged.len() as f64,
            errors,
            without_an_angle: without / judged.len() as f64,
            refused,
        }),
        None => {
            let (squeezes, why) = refused.unwrap_or((0, "there is nothing to judge".into()));
            Err(NoEstimate { squeezes, why })
        }
    }
}

/// Judges the single estimators of all repetitions on what the protocol says.
pub(super) fn judge_all<E: Estimator>(
    session: &Session,
    splits: &[Split],
    estimators: &[E],
    change: Change<'_>,
) -> Judgement {
    judge_parts(session, splits, estimators, change, |split| {
        (split.train.clone(), &split.test)
    })
}

/// Judges fused estimators, which learn and are judged at the other places: what their two estimators were trained on is
/// among what is judged.
pub(super) fn judge_fused<E: Estimator>(
    session: &Session,
    splits: &[Split],
    estimators: &[E],
    change: Change<'_>,
) -> Judgement {
    judge_parts(session, splits, estimators, change, |split| {
        (
            [&split.train[..], &split.fusion_train].concat(),
            &split.fusion_test,
        )
    })
}

fn judge_parts<E: Estimator>(
    session: &Session,
    splits: &[Split],
    estimators: &[E],
    change: Change<'_>,
    of: fn(&Split) -> (Vec<usize>, &Vec<usize>),
) -> Judgement {
    let mut parts = Vec::new();
    for (repetition, (split, estimator)) in splits.iter().zip(estimators).enumerate() {
        let (train, test) = of(split);
        parts.push(Part {
            repetition,
            estimator,
            train,
            test,
        });
    }
    judge(session, &parts, change)
}

/// Trains without each place in turn and judges there.
pub(super) fn leave_places_out<E: Estimator>(
    session: &Session,
    train: impl Fn(&[&Trial]) -> Result<E, ForearmError>,
) -> anyhow::Result<Judgement> {
    let places = session.locations();
    let progress = Progress::new(places.len() as u64, "places left out");
    let mut parts = Vec::new();
    for place in places {
        let is_elsewhere = |n: &usize| session.trials[*n].location_percent != place;
        let (rest, here): (Vec<usize>, Vec<usize>) = (0..session.trials.len()).partition(is_elsewhere);
        parts.push((train(&trials(session, &rest))?, rest, here));
        progress.advance(1);
    }
    // Each place is judged once: one repetition.
    let mut all = Vec::new();
    for (estimator, train, test) in &parts {
        all.push(Part {
            repetition: 0,
            estimator,
            train: train.clone(),
            test,
        });
    }
    Ok(judge(session, &all, None))
}

/// A choice, and in how many repetitions it was taken.
#[derive(Debug, Serialize)]
pub(super) struct Chosen {
    pub(super) times: usize,
    #[serde(flatten)]
    pub(super) choice: Choice,
}

pub(super) fn chosen(models: &[Kinesthetic]) -> Vec<Chosen> {
    let mut chosen: Vec<Chosen> = Vec::new();
    for model in models {
        let choice = model.chosen().choice;
        match chosen.iter_mut().find(|known| known.choice == choice) {
            Some(known) => known.times += 1,
            None => chosen.push(Chosen { times: 1, choice }),
        }
    }
    chosen.sort_by_key(|chosen| std::cmp::Reverse(chosen.times));
    chosen
}

/// Mean over the squeezes of a place of how far both fingers close at the highest PWM, degrees.
pub(super) fn closed_at_peak(session: &Session, place: f64) -> f64 {
    let here = session
        .trials
        .iter()
        .filter(|trial| trial.location_percent == place);
    let closed = here.filter_map(|trial| {
        let squeeze = &trial.squeeze;
        let peak = (0..squeeze.len()).max_by(|a, b| squeeze.pwm[*a].total_cmp(&squeeze.pwm[*b]))?;
        let [first, second] = squeeze.sample(peak).theta_a_deg;
        Some(first + second).filter(|sum| sum.is_finite())
    });
    let (sum, count) = closed.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}
