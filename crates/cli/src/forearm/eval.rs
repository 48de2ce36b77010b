//! `taxel forearm eval`: the publication's protocol.

use super::eval_json::{self, Figures, Report};
use super::judge::{Judgement, chosen, judge_all, judge_fused, train, trials};
use super::more::More;
use super::network_args::NetworkArgs;
use super::report;
#[cfg(feature = "networks")]
use anyhow::Context;
use clap::ValueEnum;
use std::path::PathBuf;
use std::time::Instant;
use taxel_forearm::{Fused, Fusion, Kinesthetic, Session, Split, Tactile, splits};

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
            asked.reading(),
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
        chosen: Vec::new(),
        more: None,
    };
    Ok(serde_json::to_string(&report)? + "\n")
}

pub(super) fn run(args: &Args) -> anyhow::Result<String> {
    if let Some(option) = args.networks.given().filter(|_| args.method != Method::Paper) {
        anyhow::bail!(
            "{option} is of the publication's networks; give it --method paper too, or leave it out"
        );
    }
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
    let more = match args.brief {
        true => None,
        false => Some(More::of(&session, &splits, &trained.estimators)?),
    };
    if args.json {
        let figures =
            |(judgement, train_s): &(Judgement, f64)| Some(Figures::of(judgement.as_ref().ok()?, *train_s));
        let report = Report {
            protocol: PROTOCOL,
            repetitions: splits.len(),
            kinesthetic: Figures::of(&outcome, train_s),
            tactile: touch.as_ref().and_then(|touch| figures(&touch.tactile)),
            fused: touch.as_ref().and_then(|touch| figures(&touch.fused)),
            chosen: chosen(&trained.estimators),
            more: more.as_ref().map(|more| eval_json::More::of(&session, more)),
        };
        return Ok(serde_json::to_string(&report)? + "\n");
    }
    let mut text = report::procedure(&session, &splits, &trained.estimators);
    text += &report::errors("kinesthetic", &session, &outcome, train_s);
    text += &report::places(&outcome);
    for (name, (judgement, train_s)) in touch.iter().flat_map(Touch::parts) {
        match judgement {
            Ok(outcome) => {
                text += &report::errors(name, &session, outcome, *train_s);
                text += &report::places(outcome);
            }
            Err(none) => text += &format!("\n{name}: refused: all, because {none}\n"),
        }
    }
    if let Some(more) = &more {
        text += &report::table(
            "disturbed, from angles: each squeeze drawn anew in each repetition, without being told",
            more.disturbed.iter().map(|(name, outcome)| (name, outcome)),
        );
        let name = |share: f64| format!("after {:.0} % of its time", 100.0 * share);
        text += &report::table(
            "before the squeeze is over, from angles",
            more.early.iter().map(|(share, outcome)| (name(*share), outcome)),
        );
        text += &report::places_left_out(&session, &more.places_left_out);
        text += &report::table(
            "other procedures",
            more.procedures.iter().map(|(name, outcome)| (name, outcome)),
        );
    }
    Ok(text)
}

/// What became of the estimators that need touch, and how long their training took, s.
struct Touch {
    tactile: (Judgement, f64),
    fused: (Judgement, f64),
}

impl Touch {
    fn parts(&self) -> [(&'static str, &(Judgement, f64)); 2] {
        [("tactile", &self.tactile), ("fused", &self.fused)]
    }
}

fn with_touch(session: &Session, splits: &[Split], angles: &[Kinesthetic]) -> anyhow::Result<Touch> {
    let tactile = train(session, splits, Tactile::train)?;
    let judgement = judge_all(session, splits, &tactile.estimators, None);
    let began = Instant::now();
    let mut fused = Vec::new();
    for ((kinesthetic, tactile), split) in angles.iter().zip(tactile.estimators).zip(splits) {
        // Where no touch can be judged, both are as far off as they say.
        let fusion = Fusion::train(kinesthetic, &tactile, &trials(session, &split.fusion_train))
            .unwrap_or_else(|_| Fusion::by_intervals());
        let kinesthetic = kinesthetic.clone();
        fused.push(Fused {
            kinesthetic,
            tactile,
            fusion,
        });
    }
    let took = began.elapsed();
    Ok(Touch {
        tactile: (judgement, tactile.took.as_secs_f64()),
        fused: (judge_fused(session, splits, &fused), took.as_secs_f64()),
    })
}
