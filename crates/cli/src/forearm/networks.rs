//! `taxel forearm eval --method paper`: the publication's networks, trained as it says.

use super::judge::Outcome;
use super::network_args::{self, NetworkArgs};
use super::report::{beside, column, simulated};
use crate::seconds::duration_text;
use anyhow::Context;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};
use taxel_forearm::{Errors, Session, Split};
use taxel_networks::{Kind, Plan, Progress, Reading, Trained};
use taxel_playback::interrupt::Interrupt;

/// Between two lines that say how far a training is.
const LINES: Duration = Duration::from_secs(10);

/// What came of one network.
pub(super) struct Judgement {
    /// "kinesthetic", "tactile" or "fused".
    pub(super) source: &'static str,
    pub(super) outcome: Outcome,
    /// Time spent on training in all repetitions, s.
    pub(super) train_s: f64,
    /// Fewest and most epochs of a repetition, those of the article, and how many repetitions there are.
    pub(super) epochs: [usize; 3],
    pub(super) repetitions: usize,
}

/// Trains the networks of one repetition after another, and judges what there is when all are trained or Ctrl-C comes.
pub(super) fn judge(
    session: &Session,
    splits: &[Split],
    asked: &NetworkArgs,
    seed: u64,
) -> anyhow::Result<Vec<Judgement>> {
    if let Some(folder) = &asked.checkpoints {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    let reading = match asked.reading() {
        network_args::Reading::Time => Reading::Time,
        network_args::Reading::Transposed => Reading::Transposed,
    };
    let plan = Plan {
        reading,
        epochs: asked.epochs.map(usize::from),
        folder: asked.checkpoints.clone(),
        seed,
    };
    let interrupt = Interrupt::install()?;
    let mut trained = Vec::new();
    let mut said: Option<Instant> = None;
    for (repetition, split) in splits.iter().enumerate() {
        let mut report = |progress: &Progress| {
            let is_last = progress.epoch == progress.epochs;
            if is_last || said.is_none_or(|said| said.elapsed() >= LINES) {
                say!("{}", line(progress, splits.len()));
                said = Some(Instant::now());
            }
            if interrupt.is_set() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        trained.extend(taxel_networks::run(
            session,
            split,
            repetition,
            &plan,
            &mut report,
        )?);
        if interrupt.is_set() {
            break;
        }
    }
    let sources = [
        ("kinesthetic", Kind::Kinesthetic(reading)),
        ("tactile", Kind::Tactile),
        ("fused", Kind::Fusion),
    ];
    let judged = sources
        .into_iter()
        .filter_map(|(source, kind)| sum_up(source, kind, &trained));
    Ok(judged.collect())
}

fn line(progress: &Progress, repetitions: usize) -> String {
    let stage = progress.stage;
    let validation = progress
        .losses
        .validation
        .map_or(String::new(), |loss| format!(", validation {loss:.6}"));
    format!(
        "{} {} of {repetitions}: epoch {} of {}, loss {:.6}{validation}, {} left",
        stage.kind,
        stage.repetition + 1,
        progress.epoch,
        progress.epochs,
        progress.losses.training,
        duration_text(progress.left_s),
    )
}

fn sum_up(source: &'static str, kind: Kind, trained: &[Trained]) -> Option<Judgement> {
    let trained: Vec<&Trained> = trained
        .iter()
        .filter(|trained| trained.stage.kind == kind)
        .collect();
    let judged: Vec<_> = trained
        .iter()
        .flat_map(|trained| trained.judged.clone())
        .collect();
    let epochs = || trained.iter().map(|trained| trained.epochs);
    let estimate_us = trained.iter().map(|trained| trained.estimate_us).sum::<f64>() / trained.len() as f64;
    let errors = Errors::of(&judged)?;
    Some(Judgement {
        source,
        outcome: Outcome {
            errors,
            estimate_us,
            without_an_angle: 0.0,
            refused: None,
        },
        train_s: trained.iter().map(|trained| trained.train_s).sum(),
        epochs: [epochs().min()?, epochs().max()?, kind.epochs()],
        repetitions: trained.len(),
    })
}

/// The judgements for people.
pub(super) fn report(
    session: &Session,
    planned: usize,
    reading: network_args::Reading,
    judgements: &[Judgement],
) -> String {
    let reading = match reading {
        network_args::Reading::Time => "samples",
        network_args::Reading::Transposed => "angles",
    };
    let mut text = format!(
        "{}: the publication's networks, as printed; {reading} are their time\n{}",
        session.name,
        simulated(session),
    );
    for judgement in judgements {
        let e = &judgement.outcome.errors;
        let (heading, [rmse, mae, range]) = column(beside(judgement.source, session));
        let [least, most, printed] = judgement.epochs;
        let epochs = if least == most {
            most.to_string()
        } else {
            format!("{least} to {most}")
        };
        let _ = write!(
            text,
            "\n{}: {} of {planned} repetitions, {epochs} of the publication's {printed} epochs; training took {}, an estimate {:.1} ms\n\
             % of the forearm              here{heading}\n\
             \x20 RMSE, mean over places   {:8.2}{rmse}\n\
             \x20 MAE, mean over places    {:8.2}{mae}\n\
             \x20 RMSE over squeezes       {:8.2}\n\
             \x20 MAE over squeezes        {:8.2}\n\
             \x20 range of estimates, mean {:8.2}{range}\n",
            judgement.source,
            judgement.repetitions,
            duration_text(judgement.train_s),
            judgement.outcome.estimate_us / 1000.0,
            e.macro_rmse,
            e.macro_mae,
            e.pooled_rmse,
            e.pooled_mae,
            e.mean_range(),
        );
        text += "\n   place    RMSE     MAE     min      q1  median      q3     max   range\n";
        for place in &e.places {
            let [low, first, median, third, high] = place.spread;
            let _ = writeln!(
                text,
                "{:6.1} %{:8.2}{:8.2}{low:8.1}{first:8.1}{median:8.1}{third:8.1}{high:8.1}{:8.1}",
                place.percent,
                place.rmse,
                place.mae,
                place.range(),
            );
        }
    }
    if judgements.is_empty() {
        text += "Nothing was trained.\n";
    }
    text
}
