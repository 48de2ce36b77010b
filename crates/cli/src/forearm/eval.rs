//! `taxel forearm eval`: the publication's protocol.

use super::eval_json::{self, Figures, Report};
use super::judge::{Judgement, chosen, judge_all, train};
use super::more::More;
use super::network_args::NetworkArgs;
use super::report;
use super::with_touch::WithTouch;
use crate::errors::wrong_use;
#[cfg(feature = "networks")]
use anyhow::Context;
use clap::ValueEnum;
use std::path::PathBuf;
use taxel_forearm::{Kinesthetic, Session, splits_of_few};

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
    /// Train on at most so many squeezes at each place, drawn from those that it would train on
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(2..=1000))]
    squeezes: Option<u16>,
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
        simulated: session.simulated,
        kinesthetic: figures("kinesthetic")
            .context("Ctrl-C came before the first epoch; nothing is judged")?,
        tactile: figures("tactile"),
        fused: figures("fused"),
        fused_unseen: None,
        chosen: Vec::new(),
        more: None,
    };
    Ok(serde_json::to_string(&report)? + "\n")
}

pub(super) fn run(args: &Args) -> anyhow::Result<String> {
    if let Some(option) = args.networks.given().filter(|_| args.method != Method::Paper) {
        return Err(wrong_use(format!(
            "{option} is of the publication's networks; give it --method paper too, or leave it out"
        )));
    }
    let session = super::session(&args.data)?;
    let most = args.squeezes.map_or(usize::MAX, usize::from);
    let splits = splits_of_few(&session, args.repetitions.into(), args.seed, most);
    if args.method == Method::Paper {
        return paper(&args.networks, args, &session, &splits);
    }
    let trained = train(&session, &splits, Kinesthetic::train)?;
    let outcome = judge_all(&session, &splits, &trained.estimators, None)?;
    let train_s = trained.took.as_secs_f64();
    let touch = match session.has_touch() {
        true => Some(WithTouch::of(
            &session,
            &splits,
            &trained.estimators,
            !args.brief,
        )?),
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
            simulated: session.simulated,
            kinesthetic: Figures::of(&outcome, train_s),
            tactile: touch.as_ref().and_then(|touch| figures(&touch.tactile)),
            fused: touch.as_ref().and_then(|touch| figures(&touch.fused)),
            fused_unseen: touch.as_ref().and_then(|touch| figures(&touch.fused_unseen)),
            chosen: chosen(&trained.estimators),
            more: more
                .as_ref()
                .map(|more| eval_json::More::of(&session, more, touch.as_ref())),
        };
        return Ok(serde_json::to_string(&report)? + "\n");
    }
    let mut text = report::procedure(&session, &splits, &trained.estimators);
    text += &report::errors("kinesthetic", &session, &outcome, train_s);
    text += &report::places(&outcome);
    if let Some(touch) = &touch {
        text += &report::with_touch(&session, touch);
    }
    if let Some(more) = &more {
        text += &report::more(&session, more, touch.as_ref());
    }
    Ok(text)
}
