//! The publication's repetitions (section 5 of the article): each trains the networks anew on another draw of squeezes.

use crate::error::NetworksError;
use crate::examples::Examples;
use crate::network::{Kind, Reading};
use crate::training::{Losses, Training};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use taxel_cluster::Random;
use taxel_forearm::{Judged, Session, Split};

/// Share of the training squeezes that is kept for validation.
const VALIDATION: f64 = 0.2;
/// Between two checkpoints, where an epoch does not take longer.
const CHECKPOINTS: Duration = Duration::from_secs(60);

/// What is to be trained.
#[derive(Debug, Clone)]
pub struct Plan {
    /// What the kinesthetic network takes for time.
    pub reading: Reading,
    /// Fewer epochs than the article's, for a try, of the two networks that are fed squeezes. Fusion, which takes half a
    /// minute, has all of its own: after few it says what its first weights say.
    pub epochs: Option<usize>,
    /// Where checkpoints are kept, if they are; what is found there is gone on with.
    pub folder: Option<PathBuf>,
    /// First weights and orders are drawn from it, anew in each repetition.
    pub seed: u64,
}

impl Plan {
    pub(crate) fn epochs_of(&self, kind: Kind) -> usize {
        let fewer = self.epochs.filter(|_| kind != Kind::Fusion);
        fewer.unwrap_or(kind.epochs())
    }
}

/// Which training of how many.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stage {
    /// Which repetition, from 0.
    pub repetition: usize,
    /// Which network.
    pub kind: Kind,
}

/// How far a training is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Which training.
    pub stage: Stage,
    /// Epochs made.
    pub epoch: usize,
    /// Epochs to be made.
    pub epochs: usize,
    /// Losses of the last one.
    pub losses: Losses,
    /// How long this training will take from now on, s, if epochs take as long as they did.
    pub left_s: f64,
}

/// What a network says after its training.
#[derive(Debug, Clone, PartialEq)]
pub struct Trained {
    /// Which training.
    pub stage: Stage,
    /// Epochs made, fewer than planned where it was stopped.
    pub epochs: usize,
    /// Time spent on training, s.
    pub train_s: f64,
    /// Time for one estimate, microseconds.
    pub estimate_us: f64,
    /// Estimates of the squeezes it is judged on, without interval, which networks do not give.
    pub judged: Vec<Judged>,
}

/// Trains a network until it has made `epochs`, or `report`, asked after each epoch, breaks off. A checkpoint is kept in
/// `path` about every minute and at the end. One of fusion that is of other estimates is of no use, since the networks that made
/// them have been trained on: it begins anew.
///
/// # Errors
/// A checkpoint that cannot be written or is of another run; memory that is exhausted.
pub fn train(
    stage: Stage,
    examples: &Examples,
    seed: u64,
    epochs: usize,
    path: Option<&Path>,
    report: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Training, NetworksError> {
    let mut order: Vec<usize> = (0..examples.len()).collect();
    Random::for_purpose(seed, u64::MAX).shuffle(&mut order);
    let (own, rest) = order.split_at(((1.0 - VALIDATION) * order.len() as f64) as usize);
    let (own, rest) = (examples.select(own)?, examples.select(rest)?);
    let mut training = Training::new(stage.kind, &own, seed)?;
    if let Some(path) = path {
        match training.restore(path, &own) {
            Err(NetworksError::OtherExamples { .. }) if stage.kind == Kind::Fusion => {}
            restored => restored?,
        }
    }
    let mut saved = Instant::now();
    while training.epochs() < epochs {
        let losses = training.epoch(&own, &rest)?;
        let epoch = training.epochs();
        let left_s = training.seconds() / epoch as f64 * (epochs - epoch) as f64;
        let goes_on = report(&Progress {
            stage,
            epoch,
            epochs,
            losses,
            left_s,
        });
        let is_last = goes_on.is_break() || epoch == epochs;
        if let Some(path) = path.filter(|_| is_last || saved.elapsed() >= CHECKPOINTS) {
            training.save(path, &own)?;
            saved = Instant::now();
        }
        if is_last {
            break;
        }
    }
    Ok(training)
}

/// Trains and judges the networks of one repetition: the kinesthetic one and, where every squeeze has touch, the tactile one
/// and fusion. Ends early, with what there is, where `report` breaks off.
///
/// # Errors
/// As [`train`], and squeezes that networks cannot be fed.
pub fn run(
    session: &Session,
    split: &Split,
    repetition: usize,
    plan: &Plan,
    report: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Vec<Trained>, NetworksError> {
    let mut stopped = false;
    let mut trained = Vec::new();
    let mut single = Vec::new();
    let kinds = [
        Some(Kind::Kinesthetic(plan.reading)),
        session.has_touch().then_some(Kind::Tactile),
    ];
    for kind in kinds.into_iter().flatten() {
        let examples = Examples::of_session(session, kind)?;
        let training = one(
            &examples,
            &split.train,
            Stage { repetition, kind },
            plan,
            &mut stopped,
            report,
        )?;
        trained.push(judge(&training, session, &examples, split, repetition, kind)?);
        single.push(training.estimate(&examples)?);
        if stopped {
            return Ok(trained);
        }
    }
    if let [kinesthetic, tactile] = &single[..] {
        let kind = Kind::Fusion;
        let estimates: Vec<[f32; 2]> = kinesthetic.iter().zip(tactile).map(|(k, t)| [*t, *k]).collect();
        let places = session
            .trials
            .iter()
            .map(|trial| trial.location_percent as f32 / 100.0)
            .collect();
        let examples = Examples::of_estimates(&estimates, places)?;
        let training = one(
            &examples,
            &split.fusion_train,
            Stage { repetition, kind },
            plan,
            &mut stopped,
            report,
        )?;
        trained.push(judge(&training, session, &examples, split, repetition, kind)?);
    }
    Ok(trained)
}

fn one(
    examples: &Examples,
    own: &[usize],
    stage: Stage,
    plan: &Plan,
    stopped: &mut bool,
    report: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Training, NetworksError> {
    let name = format!("{}-{:02}.json", stage.kind, stage.repetition + 1);
    let path = plan.folder.as_ref().map(|folder| folder.join(name));
    let epochs = plan.epochs_of(stage.kind);
    let seed = plan.seed.wrapping_add(stage.repetition as u64);
    train(
        stage,
        &examples.select(own)?,
        seed,
        epochs,
        path.as_deref(),
        &mut |progress| {
            let goes_on = report(progress);
            *stopped |= goes_on.is_break();
            goes_on
        },
    )
}

fn judge(
    training: &Training,
    session: &Session,
    examples: &Examples,
    split: &Split,
    repetition: usize,
    kind: Kind,
) -> Result<Trained, NetworksError> {
    let (own, test) = match kind {
        Kind::Fusion => (&split.fusion_train, &split.fusion_test),
        _ => (&split.train, &split.test),
    };
    let percent = |n: &usize| session.trials[*n].location_percent;
    let estimates = training.estimate(&examples.select(test)?)?;
    let judged = test.iter().zip(estimates).map(|(n, place)| Judged {
        repetition,
        percent: percent(n),
        estimate: 100.0 * f64::from(place),
        half_width_90: f64::NAN,
        seen: own.iter().any(|own| percent(own) == percent(n)),
    });
    let judged = judged.collect();
    let one = examples.select(&test[..test.len().min(1)])?;
    let begun = Instant::now();
    training.estimate(&one)?;
    Ok(Trained {
        stage: Stage { repetition, kind },
        epochs: training.epochs(),
        train_s: training.seconds(),
        estimate_us: begun.elapsed().as_secs_f64() * 1e6,
        judged,
    })
}
