//! `taxel forearm`: where on the forearm a gripper holds.

mod angles;
mod disturbed;
mod eval;
mod eval_json;
mod figures;
mod fingers;
mod judge;
mod live;
mod more;
mod network_args;
#[cfg(feature = "networks")]
mod networks;
pub(crate) mod play;
mod record;
mod report;
mod sessions;
pub(crate) mod simulate;
mod touch;
mod with_touch;

use crate::errors::wrong_use;
use anyhow::Context;
use clap::Subcommand;
use serde::Serialize;
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use taxel_forearm::{Estimate, Estimator, Model, Session, Squeeze, Trial};
use taxel_playback::output_file::{OutputFile, refuse_overlap};
use taxeld::stdout;

/// Say where on a forearm a gripper holds, from one squeeze.
///
/// DATA is a session: an .npz (`data`, places x repetitions x samples x 10, and `location_percent`), or a folder of the
/// publication's files, PLACE/distancePLACE_REPETITION.mat with places 0 (wrist) to 12 (elbow).
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel forearm simulate --out session.npz         where there is none: a simulated forearm
  taxel forearm train session.npz --out arm.model
  taxel forearm estimate arm.model session.npz     or .mat files of single squeezes
  taxel forearm estimate --live arm.model --publish /tmp/forearm.sock
  taxel forearm eval session.npz
  taxel forearm figures session.npz --out figures
  taxel forearm fingers session.npz > fingers.csv")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Record(record::Args),
    Simulate(simulate::Args),
    Train(TrainArgs),
    Estimate(EstimateArgs),
    Eval(eval::Args),
    Figures(figures::Args),
    Fingers(fingers::Args),
}

/// Train an estimator on every squeeze of a session, and keep it in a file.
#[derive(Debug, clap::Args)]
struct TrainArgs {
    /// A session: an .npz or a folder of .mat files
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// Where to keep the model: three lines of JSON
    #[arg(long, value_name = "MODEL")]
    out: PathBuf,
    /// One JSON object: what it was trained on, and how far it is off
    #[arg(long)]
    json: bool,
}

/// Say where squeezes were made.
#[derive(Debug, clap::Args)]
struct EstimateArgs {
    /// What `taxel forearm train` made
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Squeezes: .mat files, or sessions as `train` takes them
    #[arg(
        value_name = "FILE",
        required_unless_present = "live",
        conflicts_with = "live"
    )]
    files: Vec<PathBuf>,
    /// Print one JSON object a squeeze
    #[arg(long, conflicts_with = "live")]
    json: bool,
    /// Estimate at every sample of the squeezes that a running daemon's gripper makes, one JSON object a line, as `taxel
    /// forearm record` and whoever else makes its marks squeeze
    #[arg(long)]
    live: bool,
    /// With --live: also publish estimates on a socket of this name, as ESTIMATE messages
    #[arg(long, value_name = "PATH", requires = "live")]
    publish: Option<PathBuf>,
    /// With --live: the daemon's image socket [default: where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH", requires = "live")]
    socket: Option<PathBuf>,
    /// With --live: wait for the daemon, at the start and whenever it is gone, instead of ending
    #[arg(long, requires = "live")]
    reconnect: bool,
    /// With --live: joints of the two servos [default: the first two servos]
    #[arg(long, value_name = "NAME,NAME", value_delimiter = ',', requires = "live")]
    fingers: Vec<String>,
    /// With --live: joints of the two potentiometers, in the order of the fingers [default: the first two joints that are no servos]
    #[arg(long, value_name = "NAME,NAME", value_delimiter = ',', requires = "live")]
    potentiometers: Vec<String>,
}

/// A squeeze that ends before this phase was broken off: a random profile of PWM need not come back to 2.
const WHOLE: f64 = 1.9;
/// What ends before this phase, at less than a fifth of a squeeze's time, says too little to be told for a squeeze of a file.
const LEAST: f64 = 0.15;

/// A line of `estimate --json`.
#[derive(Debug, Serialize)]
struct Line {
    file: String,
    /// Where the session says that it was made; null for a single file.
    true_percent: Option<f64>,
    /// Which squeeze at its place, from 1 as files are numbered; null for a single file.
    repetition: Option<usize>,
    /// The estimate, as in an ESTIMATE message.
    location_percent: f64,
    half_width_90: f64,
    source: String,
    /// What it was made without: angles that are lost, stuck or jump, touch that is unlike that of the training, and the less
    /// sure of both where they contradict each other.
    left_out: Vec<&'static str>,
    /// How far the squeeze came: 1 is its peak, 2 its end.
    phase: f64,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let text = match &args.command {
        Command::Record(args) => return record::run(args),
        Command::Simulate(args) => simulate::run(args)?,
        Command::Train(args) => train(args)?,
        Command::Estimate(args) => return estimate(args),
        Command::Eval(args) => eval::run(args)?,
        Command::Figures(args) => figures::run(args)?,
        Command::Fingers(args) => fingers::run(args)?,
    };
    stdout::print(&text)
}

fn train(args: &TrainArgs) -> anyhow::Result<String> {
    refuse_overlap(&[&args.out], &[&args.data])?;
    let session = sessions::open(&args.data)?;
    let model = Model::train(&session).with_context(|| session.name.clone())?;
    OutputFile::write(&args.out, model.to_bytes())?;
    let chosen = model.kinesthetic.chosen();
    let squeezes = session.trials.len();
    let locations = session.locations();
    let [from, to] = [locations.first(), locations.last()].map(|at| at.copied().unwrap_or_default());
    if args.json {
        let object = json!({
            "out": args.out.display().to_string(),
            "squeezes": squeezes,
            "places": locations.len(),
            "from_percent": from,
            "to_percent": to,
            "simulated": model.trained_on.simulated,
            "touch": model.touch.is_some(),
            "without": model.kinesthetic.never_there().collect::<Vec<_>>(),
            "looks_at": chosen.choice.to_string(),
            "rmse_repetitions_out": chosen.repetitions_out,
            "rmse_place_out": chosen.place_out,
            "half_width_90": model.kinesthetic.half_width_90(),
        });
        return Ok(format!("{object}\n"));
    }
    let untouched = session.trials.iter().filter(|t| t.squeeze.tactile.is_none());
    let senses = match (model.touch.is_some(), untouched.count()) {
        (true, _) => ", from angles and touch".into(),
        (false, n) if n == squeezes => String::new(),
        (false, n) => format!(", from angles alone: {n} of them have no touch"),
    };
    let of = match model.trained_on.simulated {
        true => " of a simulated forearm",
        false => "",
    };
    let mut text = format!(
        "{}: trained on {squeezes} squeezes at {} places{of}{senses}\n",
        args.out.display(),
        locations.len(),
    );
    // Who has numbered places of their own has them at twelfths all the same.
    let elbow = match to < 100.0 && args.data.is_dir() {
        true => "; the elbow, 100 %, is place 12",
        false => "",
    };
    writeln!(
        text,
        "places are from {from:.1} to {to:.1} % of the forearm{elbow}"
    )?;
    let never: Vec<_> = model.kinesthetic.never_there().collect();
    if !never.is_empty() {
        writeln!(
            text,
            "without {}: no squeeze has it, or it never moves",
            never.join(" and ")
        )?;
    }
    writeln!(
        text,
        "looks at {}, chosen on these squeezes\n\
         off by {:.1} % of the forearm where repetitions are left out, by {:.1} % where a place is (RMSE, mean over places)\n\
         90 % interval: +-{:.1} %, of this arm and gripper",
        chosen.choice,
        chosen.repetitions_out,
        chosen.place_out,
        model.kinesthetic.half_width_90(),
    )?;
    Ok(text)
}

fn estimate(args: &EstimateArgs) -> anyhow::Result<()> {
    // What clap does not ask for where an option conflicts with the one that is missing.
    for (option, is_given) in [
        ("--publish", args.publish.is_some()),
        ("--socket", args.socket.is_some()),
        ("--reconnect", args.reconnect),
        ("--fingers", !args.fingers.is_empty()),
        ("--potentiometers", !args.potentiometers.is_empty()),
    ] {
        if is_given && !args.live {
            return Err(wrong_use(format!(
                "{option} is of --live, and files are estimated; leave one of them out"
            )));
        }
    }
    let model = Model::open(&args.model)?;
    if model.trained_on.simulated {
        remark!(
            "taxel: {}: it was trained on a simulated forearm: what it says is no evidence about people",
            args.model.display()
        );
    }
    if args.live {
        let sockets = live::Sockets {
            images: args.socket.as_deref(),
            reconnect: args.reconnect,
            publish: args.publish.as_deref(),
        };
        live::run(&model, &sockets, &args.fingers, &args.potentiometers)?;
    }
    let mut failed = Vec::new();
    for path in &args.files {
        // What cannot be estimated hides none of the others.
        let mut text = String::new();
        let estimated = estimate_file(&mut text, &model, path, args.json, &mut failed);
        stdout::print(&text)?;
        failed.extend(estimated.err());
    }
    let Some(last) = failed.pop() else {
        return Ok(());
    };
    for error in failed {
        say!("taxel: {}", crate::errors::describe(&error));
    }
    Err(last)
}

/// A line for each squeeze of a file. Why there is none for a squeeze of a session goes to `failed`.
fn estimate_file(
    text: &mut String,
    model: &Model,
    path: &Path,
    json: bool,
    failed: &mut Vec<anyhow::Error>,
) -> anyhow::Result<()> {
    let file = path.display().to_string();
    if !path.is_dir() && path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mat")) {
        let squeeze = Squeeze::open(path)?;
        let estimate = told(model, &squeeze).with_context(|| file.clone())?;
        return line(text, &file, None, estimate, json);
    }
    let session = sessions::open(path)?;
    if session.simulated && !model.trained_on.simulated {
        remark!(
            "taxel: {file}: its squeezes are of a simulated forearm, and those that the model was trained on are not said to be: \
             it is as one of another gripper"
        );
    }
    for trial in &session.trials {
        let place = || format!("{file}, {}", trial.name());
        match told(model, &trial.squeeze).with_context(place) {
            Ok(estimate) => line(text, &file, Some(trial), estimate, json)?,
            Err(error) => failed.push(error),
        }
    }
    Ok(())
}

/// The estimate of a squeeze that is over: one of which little is there is no squeeze.
fn told(model: &Model, squeeze: &Squeeze) -> anyhow::Result<Estimate> {
    let estimate = model.estimate(squeeze)?;
    says_enough(&estimate, squeeze.len())?;
    Ok(estimate)
}

/// Whether there was enough of a squeeze that is over.
fn says_enough(estimate: &Estimate, samples: usize) -> anyhow::Result<()> {
    anyhow::ensure!(
        estimate.phase > 0.0,
        "PWM never rises above rest in its {samples} samples; give a squeeze from rest to release"
    );
    anyhow::ensure!(
        estimate.phase >= LEAST,
        "the squeeze breaks off at phase {:.3} of 2, and what ends before {LEAST} says too little; squeeze again",
        estimate.phase
    );
    Ok(())
}

/// Why an estimate is made without these.
fn why(left_out: &[&str]) -> &'static str {
    let touch = left_out.contains(&"touch");
    match (touch, left_out.len()) {
        (false, _) => "lost, stuck, jumps, or contradicted",
        (true, 1) => "unlike that of the training, or contradicted",
        (true, _) => "lost, stuck, jumps, unlike that of the training, or contradicted",
    }
}

fn line(
    text: &mut String,
    file: &str,
    trial: Option<&Trial>,
    estimate: Estimate,
    json: bool,
) -> anyhow::Result<()> {
    if json {
        let line = Line {
            file: file.into(),
            true_percent: trial.map(|t| t.location_percent),
            repetition: trial.map(Trial::number),
            location_percent: estimate.percent,
            half_width_90: estimate.half_width_90,
            source: estimate.source.to_string(),
            left_out: estimate.left_out.names().collect(),
            phase: estimate.phase,
        };
        writeln!(text, "{}", serde_json::to_string(&line)?)?;
    } else {
        let made = trial.map(|t| format!(", {}", t.name()));
        let (percent, width) = (estimate.percent, estimate.half_width_90);
        let made = made.unwrap_or_default();
        write!(
            text,
            "{file}{made}: {percent:.1} % +-{width:.1} ({}",
            estimate.source
        )?;
        let left_out: Vec<_> = estimate.left_out.names().collect();
        if !left_out.is_empty() {
            write!(text, "; without {}: {}", left_out.join(" and "), why(&left_out))?;
        }
        match estimate.phase {
            phase if phase < WHOLE => {
                writeln!(text, "; of a squeeze that breaks off at phase {phase:.2} of 2)")?
            }
            _ => writeln!(text, ")")?,
        }
    }
    Ok(())
}

/// A session, where every place has squeezes enough for the publication's protocol.
fn session(path: &Path) -> anyhow::Result<Session> {
    let session = sessions::open(path)?;
    let places = session.locations().len();
    anyhow::ensure!(
        places >= 6,
        "{}: {places} places; the protocol trains on every second one and takes at least 6",
        path.display()
    );
    Ok(session)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touch_is_left_out_for_what_it_is_and_not_as_lost() {
        for (left_out, wanted) in [
            (&["touch"][..], "unlike that of the training, or contradicted"),
            (&["theta_p of finger 0"], "lost, stuck, jumps, or contradicted"),
            (
                &["theta_p of finger 0", "touch"],
                "lost, stuck, jumps, unlike that of the training, or contradicted",
            ),
        ] {
            assert_eq!(why(left_out), wanted);
        }
    }
}
