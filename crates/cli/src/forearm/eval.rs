//! `taxel forearm eval`: the publication's protocol.

use super::disturbed;
use super::judge::{Outcome, judge_all, judge_fused, leave_places_out, train, trials};
use super::network_args::NetworkArgs;
use super::report;
#[cfg(feature = "networks")]
use anyhow::Context;
use clap::ValueEnum;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use taxel_forearm::{Fused, Fusion, Kinesthetic, Session, Split, Tactile, Tried, splits};

/// Judge estimators by the publication's protocol.
///
/// In each of --repetitions random repetitions an estimator is trained on nine tenths of the squeezes at every second
/// place and judged on the other tenth and on all squeezes at the places between. Everything is chosen on the training
/// squeezes alone. Errors are percent of the forearm: macro is the mean over places of the error at each, pooled is over
/// squeezes.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A session: an .npz or a folder of .mat files
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Whose estimators
    #[arg(long, value_enum, default_value_t = Method::Best)]
    method: Method,
    /// Random repetitions
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..=1000))]
    repetitions: u16,
    /// Random numbers: the same seed, the same repetitions
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Only the protocol: no disturbances, early estimates, places left out and other procedures
    #[arg(long)]
    brief: bool,
    #[command(flatten)]
    networks: NetworkArgs,
}

/// Whose estimators.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Partial least squares on angles at phases of the squeeze
    Best,
    /// The publication's neural networks, as printed; days of training
    Paper,
}

const PROTOCOL: &str = "Pastor et al. 2022: trained on nine tenths of every second place, judged on all else";

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Report {
    protocol: &'static str,
    repetitions: usize,
    kinesthetic: Figures,
    tactile: Option<Figures>,
    fused: Option<Figures>,
}

#[derive(Debug, Serialize)]
struct Figures {
    macro_rmse: f64,
    macro_mae: f64,
    pooled_rmse: f64,
    pooled_mae: f64,
    coverage_90: f64,
    train_s: f64,
    estimate_us: f64,
    /// Of a network: the fewest epochs that any repetition had. A training may have been cut short.
    #[serde(skip_serializing_if = "Option::is_none")]
    epochs: Option<usize>,
}

impl Figures {
    fn of(outcome: &Outcome, train_s: f64) -> Self {
        let errors = &outcome.errors;
        Self {
            macro_rmse: errors.macro_rmse,
            macro_mae: errors.macro_mae,
            pooled_rmse: errors.pooled_rmse,
            pooled_mae: errors.pooled_mae,
            coverage_90: errors.coverage_90,
            train_s,
            estimate_us: outcome.estimate_us,
            epochs: None,
        }
    }
}

/// What the choice of least value is taken by.
type Score = fn(&Tried) -> f64;

/// Other ways to choose, to see what the choice is worth.
const OTHER_PROCEDURES: [(&str, Score); 5] = [
    ("chosen with repetitions left out alone", |t| t.repetitions_out),
    ("chosen with a place left out alone", |t| t.place_out),
    ("10 phases, first sample to last, 3 components", |t| fixed(t, 3)),
    ("10 phases, first sample to last, 4 components", |t| fixed(t, 4)),
    ("10 phases, first sample to last, 5 components", |t| fixed(t, 5)),
];

fn fixed(tried: &Tried, components: usize) -> f64 {
    let choice = tried.choice;
    f64::from(u8::from(
        (choice.points, choice.from, choice.to, choice.components) != (10, 0, 47, components),
    ))
}

#[cfg(not(feature = "networks"))]
fn paper(_: &NetworkArgs, _: &Args, _: &Session, _: &[taxel_forearm::Split]) -> anyhow::Result<String> {
    anyhow::bail!(
        "this taxel is built without the publication's networks; build one that has them with \
         `cargo build --release -p taxel-cli --features networks`"
    )
}

#[cfg(feature = "networks")]
fn paper(
    asked: &NetworkArgs,
    args: &Args,
    session: &Session,
    splits: &[taxel_forearm::Split],
) -> anyhow::Result<String> {
    let judgements = super::networks::judge(session, splits, asked, args.seed)?;
    if !args.json {
        return Ok(super::networks::report(
            session,
            splits.len(),
            asked.reading,
            &judgements,
        ));
    }
    let figures = |source: &str| {
        let judgement = judgements.iter().find(|judgement| judgement.source == source)?;
        let mut figures = Figures::of(&judgement.outcome, judgement.train_s);
        figures.coverage_90 = f64::NAN;
        figures.epochs = Some(judgement.epochs[0]);
        Some(figures)
    };
    let report = Report {
        protocol: PROTOCOL,
        repetitions: judgements.first().map_or(0, |judgement| judgement.repetitions),
        kinesthetic: figures("kinesthetic")
            .context("Ctrl-C came before the first epoch; nothing is judged")?,
        tactile: figures("tactile"),
        fused: figures("fused"),
    };
    Ok(serde_json::to_string(&report)? + "\n")
}

pub(super) fn run(args: &Args) -> anyhow::Result<String> {
    let session = super::session(&args.data)?;
    let splits = splits(&session, args.repetitions.into(), args.seed);
    if args.method == Method::Paper {
        return paper(&args.networks, args, &session, &splits);
    }
    let trained = train(&session, &splits, Kinesthetic::train)?;
    let outcome = judge_all(&session, &splits, &trained.estimators, None)?;
    let train_s = trained.took.as_secs_f64();
    let touch = match session.has_touch() {
        true => Some(with_touch(&session, &splits, &trained.estimators)?),
        false => None,
    };
    if args.json {
        let report = Report {
            protocol: PROTOCOL,
            repetitions: splits.len(),
            kinesthetic: Figures::of(&outcome, train_s),
            tactile: touch
                .as_ref()
                .map(|touch| Figures::of(&touch.tactile.0, touch.tactile.1)),
            fused: touch
                .as_ref()
                .map(|touch| Figures::of(&touch.fused.0, touch.fused.1)),
        };
        return Ok(serde_json::to_string(&report)? + "\n");
    }
    let mut text = report::procedure(&session, &splits, &trained.estimators);
    text += &report::errors("kinesthetic", &session, &outcome, train_s);
    text += &report::places(&outcome);
    for (name, (outcome, train_s)) in touch.iter().flat_map(Touch::parts) {
        text += &report::errors(name, &session, outcome, *train_s);
        text += &report::places(outcome);
    }
    if args.brief {
        return Ok(text);
    }
    text += &disturbed::disturbances(&session, &splits, &trained.estimators)?;
    text += &disturbed::early(&session, &splits, &trained.estimators)?;
    text += &report::places_left_out(&session, &leave_places_out(&session, Kinesthetic::train)?);
    text += &other_procedures(&session, &splits)?;
    Ok(text)
}

/// Outcomes of the estimators that need touch, and how long their training took, s.
struct Touch {
    tactile: (Outcome, f64),
    fused: (Outcome, f64),
}

impl Touch {
    fn parts(&self) -> [(&'static str, &(Outcome, f64)); 2] {
        [("tactile", &self.tactile), ("fused", &self.fused)]
    }
}

fn with_touch(session: &Session, splits: &[Split], angles: &[Kinesthetic]) -> anyhow::Result<Touch> {
    let tactile = train(session, splits, Tactile::train)?;
    let outcome = judge_all(session, splits, &tactile.estimators, None)?;
    let began = Instant::now();
    let mut fused = Vec::new();
    for ((kinesthetic, tactile), split) in angles.iter().zip(tactile.estimators).zip(splits) {
        let fusion = Fusion::train(kinesthetic, &tactile, &trials(session, &split.fusion_train))?;
        let kinesthetic = kinesthetic.clone();
        fused.push(Fused {
            kinesthetic,
            tactile,
            fusion,
        });
    }
    let took = began.elapsed();
    Ok(Touch {
        tactile: (outcome, tactile.took.as_secs_f64()),
        fused: (judge_fused(session, splits, &fused)?, took.as_secs_f64()),
    })
}

fn other_procedures(session: &Session, splits: &[Split]) -> anyhow::Result<String> {
    let mut rows = Vec::new();
    for (name, score) in OTHER_PROCEDURES {
        let trained = train(session, splits, |trials| Kinesthetic::train_by(trials, score))?;
        rows.push((
            name.to_owned(),
            judge_all(session, splits, &trained.estimators, None)?,
        ));
    }
    Ok(report::table("other procedures", &rows))
}
