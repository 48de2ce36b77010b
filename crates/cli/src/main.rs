//! The `taxel` command: look at a tactile hand, play recordings and scenes to it, compress offline,
//! find what is wrong.

#![cfg_attr(not(test), deny(clippy::print_stdout, clippy::print_stderr))]

#[macro_use(remark, say)]
extern crate taxel_playback;

mod allocations;
mod categorize;
mod client;
mod compress;
mod config;
mod convert;
mod demo;
mod doctor;
mod errors;
mod eval;
mod everyday;
mod extension;
mod figures;
mod forearm;
mod foxglove;
mod layouts;
mod manual;
mod metrics;
mod notices;
mod offered;
mod piped_file;
mod record;
mod recordings;
mod replay;
mod seconds;
mod servo;
mod setup;
mod sim;
mod terminal;
mod view;
mod watch;
mod wrap;

use anyhow::Context;
use clap::{CommandFactory, Parser, Subcommand};
use signal_hook::consts::SIGXFSZ;
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;
use taxeld::stdout;

/// Tactile images from robot skin: watch a running daemon, replay recordings, simulate a hand,
/// compress offline.
#[derive(Debug, Parser)]
#[command(name = "taxel", version = env!("TAXEL_VERSION"), after_help = EXAMPLES, max_term_width = 110)]
#[command(arg_required_else_help = true)]
struct Cli {
    /// List every command there is, those of other programs with their files
    #[arg(long, exclusive = true)]
    list: bool,
    #[command(subcommand)]
    command: Option<Command>,
}

const EXAMPLES: &str = "\
Examples:
  taxel demo                                     a simulated hand grasps a ball, here, now
  taxel view                                     the hand of the daemon on this machine, drawn
  taxel watch                                    one line per image of the daemon on this machine
  taxel sim tap --to can:vcan0 --to can:vcan1    a simulated hand on two virtual buses
  taxel foxglove                                 that hand live in Foxglove and Lichtblick
  taxel record grasp.mcap                        everything the daemon on this machine has, until Ctrl-C
  taxel replay grasp.log --to can:vcan0          a recording back onto a bus
  taxel convert grasp.mcap grasp.npz             a recording in another format
  taxel compress grasp.npz --out images.npz      the daemon's compression, offline
  taxel eval grasp.npz                           what it loses and what it costs, every method
  taxel figures sim:ball-grasp --out figures     its figures, raw beside compressed, as SVG
  taxel categorize sim:phantom-1 --classes 5     categories of what a probe touches
  taxel forearm eval session.npz                 where on a forearm a gripper holds, and how well one can tell
  taxel setup                                    boards on a bus, to a configuration
  taxel doctor                                   what is wrong with this machine and this hand
  taxel config init > taxeld.toml                a configuration to start from
  taxel status                                   the running daemon on one screen

`taxel COMMAND --help` explains each; a program `taxel-NAME` beside this one or in PATH is `taxel NAME`. CAN sources are can:INTERFACE, udp:GROUP:PORT, log:FILE and sim:SCENE.";

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Args),
    View(Box<view::Args>),
    Watch(watch::Args),
    Layouts(layouts::Args),
    Record(record::Args),
    Replay(replay::Args),
    Convert(convert::Args),
    Compress(compress::Args),
    Eval(Box<eval::Args>),
    Figures(Box<figures::Args>),
    Categorize(Box<categorize::Args>),
    Forearm(Box<forearm::Args>),
    Sim(sim::Args),
    Doctor(Box<doctor::Args>),
    Status(everyday::StatusArgs),
    Rezero(everyday::RezeroArgs),
    Pause(everyday::PauseArgs),
    Resume(everyday::ResumeArgs),
    Profile(everyday::ProfileArgs),
    Mark(everyday::MarkArgs),
    Metrics(metrics::Args),
    Foxglove(foxglove::Args),
    Servo(servo::Args),
    Setup(Box<setup::Args>),
    Completions(manual::CompletionsArgs),
    #[command(hide = true)]
    Man(manual::ManArgs),
    Config(config::Args),
    /// A program `taxel-NAME` with its arguments.
    #[command(external_subcommand)]
    Extension(Vec<OsString>),
}

fn main() -> ExitCode {
    let outcome = stdout::ended(run());
    piped_file::remove();
    let code = outcome.unwrap_or_else(|error| match error.downcast_ref::<clap::Error>() {
        Some(wrong) => stdout::tell(wrong).unwrap_or(ExitCode::FAILURE),
        None => {
            notices::say_last(&format!("taxel: {}", errors::describe(&error)));
            ExitCode::FAILURE
        }
    });
    notices::end();
    code
}

fn run() -> anyhow::Result<ExitCode> {
    stdout::refuse_closed().context("stdout")?;
    let command = match Cli::try_parse() {
        Ok(cli) => cli.command,
        Err(said) => return stdout::tell(&said),
    };
    let Some(command) = command else {
        return extension::list(&Cli::command()).map(|()| ExitCode::SUCCESS);
    };
    // A limit on the size of files is a full disk, which is told; without this the signal ends the program.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::View(args) => view::run(&args),
        Command::Layouts(args) => layouts::run(&args),
        Command::Watch(args) => watch::run(&args),
        Command::Record(args) => record::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Compress(args) => compress::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Figures(args) => figures::run(&args),
        Command::Categorize(args) => categorize::run(&args),
        Command::Forearm(args) => forearm::run(&args),
        Command::Sim(args) => sim::run(&args),
        Command::Status(args) => everyday::status(&args),
        Command::Rezero(args) => everyday::rezero(&args),
        Command::Pause(args) => everyday::pause(&args),
        Command::Resume(args) => everyday::resume(&args),
        Command::Profile(args) => everyday::profile(&args),
        Command::Mark(args) => everyday::mark(&args),
        Command::Metrics(args) => metrics::run(&args),
        Command::Foxglove(args) => foxglove::run(&args),
        Command::Servo(args) => servo::run(&args),
        Command::Setup(args) => setup::run(&args),
        Command::Completions(args) => manual::completions(&args, Cli::command()),
        Command::Man(args) => manual::man(&args, Cli::command()),
        Command::Config(args) => config::run(&args),
        Command::Extension(words) => return Ok(extension::run(&words, &Cli::command())),
        // What is wrong was said already.
        Command::Doctor(args) if !doctor::run(&args)? => return Ok(ExitCode::FAILURE),
        Command::Doctor(_) => Ok(()),
    }?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    /// Every command that does something, as it is typed behind `taxel`.
    fn leaves(command: &clap::Command, path: &str) -> Vec<(String, clap::Command)> {
        let below: Vec<_> = command.get_subcommands().filter(|c| !c.is_hide_set()).collect();
        if below.is_empty() {
            return vec![(path.trim().to_owned(), command.clone())];
        }
        let below = below.into_iter().filter(|c| c.get_name() != "help");
        below
            .flat_map(|c| leaves(c, &format!("{path} {}", c.get_name())))
            .collect()
    }

    /// Commands without `--json`, and why.
    const WITHOUT_JSON: [(&str, &str); 4] = [
        ("completions", "prints a script"),
        ("config init", "prints a file"),
        ("forearm record", "prints an object for each squeeze in any case"),
        ("forearm fingers", "prints a table as CSV"),
    ];

    #[test]
    fn every_command_has_an_answer_for_scripts_or_a_reason_why_not_and_the_guide_lists_them() {
        let guide = include_str!("../../../docs/guide.md");
        for (name, command) in leaves(&Cli::command(), "") {
            let has_json = command.get_arguments().any(|arg| arg.get_long() == Some("json"));
            let is_excused = WITHOUT_JSON.iter().any(|(without, _)| *without == name);
            assert!(
                has_json != is_excused,
                "taxel {name}: give it --json, or WITHOUT_JSON the reason why it has none"
            );
            let row = guide
                .lines()
                .find(|line| line.starts_with(&format!("| `taxel {name}` |")));
            assert_eq!(
                row.is_some(),
                has_json,
                "the table of docs/guide.md on `taxel {name} --json`"
            );
        }
    }

    /// Files that cannot come over stdin, and why.
    const NOT_STDIN: [(&str, &str); 1] = [("forearm estimate", "reads stdin where no file is named")];

    #[test]
    fn every_recording_or_configuration_that_is_named_may_be_on_stdin() {
        for (name, command) in leaves(&Cli::command(), "") {
            if NOT_STDIN.iter().any(|(without, _)| *without == name) {
                continue;
            }
            for arg in command.get_positionals() {
                let value = arg.get_value_names().and_then(<[_]>::first).map(|v| v.as_str());
                if !matches!(value, Some("INPUT" | "FILE" | "OUT")) || arg.get_id() == "more" {
                    continue;
                }
                let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(help.contains("- for"), "taxel {name} {value:?}: {help}");
            }
        }
    }

    /// Where `--layout` names a hand in a file that is written, or is a grid alone.
    const LAYOUT_BY_NAME: [&str; 3] = ["config init", "setup", "categorize"];

    #[test]
    fn every_option_that_names_a_configuration_or_a_layout_takes_one_on_stdin() {
        for (name, command) in leaves(&Cli::command(), "") {
            let is_read =
                |long| long == "config" || long == "layout" && !LAYOUT_BY_NAME.contains(&name.as_str());
            for arg in command
                .get_arguments()
                .filter(|arg| arg.get_long().is_some_and(is_read))
            {
                let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(help.contains("- for"), "taxel {name} --{}: {help}", arg.get_id());
            }
        }
    }

    /// Commands that refuse an option of another one by themselves, which is tested with them.
    const REFUSES_ITSELF: [&str; 1] = ["forearm estimate"];

    /// What is required beside the positional arguments.
    const REQUIRED: [(&str, &[&str]); 1] = [("categorize", &["--classes", "2"])];

    /// Values, of which each option takes one.
    const VALUES: [&str; 18] = [
        "s",
        "x.csv",
        "x.svg",
        "10MB",
        "xyz-blocks",
        "robust",
        "1",
        "2-6",
        "a=b",
        "4x4",
        "40x40",
        "grid:4x4",
        "tap",
        "can:can0",
        "can0=can:can0",
        "dynamixel:/dev/null",
        "x.npz",
        "127.0.0.1:1",
    ];

    /// An option as it is typed, with a value that it takes.
    fn typed(command: &clap::Command, arg: &clap::Arg) -> Vec<String> {
        use clap::error::ErrorKind::{InvalidValue, ValueValidation};
        let name = arg.get_long().map(|long| format!("--{long}"));
        let possible = arg.get_possible_values();
        let values = possible
            .iter()
            .map(clap::builder::PossibleValue::get_name)
            .chain(VALUES);
        let with = |value: &str| {
            name.clone()
                .into_iter()
                .chain([value.to_owned()])
                .collect::<Vec<_>>()
        };
        if !arg.get_action().takes_values() {
            return name.into_iter().collect();
        }
        let is_taken = |words: &Vec<String>| {
            let line = ["taxel".to_owned()].into_iter().chain(words.clone());
            let error = command.clone().try_get_matches_from(line).err();
            !error.is_some_and(|error| matches!(error.kind(), InvalidValue | ValueValidation))
        };
        let taken = values.map(with).find(is_taken);
        taken.unwrap_or_else(|| panic!("VALUES has none for {}", arg.get_id()))
    }

    /// clap passes over `requires` where the option that is missing excludes one that is there.
    #[test]
    fn an_option_of_another_one_is_refused_without_it_whatever_else_is_said() {
        let (mut looked_at, mut taken) = (0, Vec::new());
        for (name, command) in leaves(&Cli::command(), "") {
            if REFUSES_ITSELF.contains(&name.as_str()) {
                continue;
            }
            let mut all: Vec<String> = Vec::new();
            for positional in command.get_positionals() {
                all.extend(typed(&command, positional));
            }
            let required = REQUIRED.iter().filter(|(of, _)| *of == name);
            all.extend(required.flat_map(|(_, words)| words.iter().map(|word| word.to_string())));
            for option in command.get_opts() {
                let help = option.get_help().map(ToString::to_string).unwrap_or_default();
                let needed = help
                    .strip_prefix("With --")
                    .and_then(|rest| rest.split_once([':', ',']));
                let Some((needed, _)) = needed.filter(|(needed, _)| !needed.contains(' ')) else {
                    continue;
                };
                let others = command
                    .get_opts()
                    .filter(|other| other.get_long() != Some(needed));
                for (other, base) in others.flat_map(|other| [(other, &all[..]), (other, &[])]) {
                    let mut line = vec!["taxel".to_owned()];
                    line.extend_from_slice(base);
                    line.extend(typed(&command, option));
                    if other.get_id() != option.get_id() {
                        line.extend(typed(&command, other));
                    }
                    let parsed = command.clone().try_get_matches_from(&line);
                    looked_at += 1;
                    if parsed.is_ok() {
                        taken.push(format!("{name}: {line:?} without --{needed}"));
                    }
                }
            }
        }
        assert_eq!(taken, Vec::<String>::new());
        assert!(looked_at > 200, "{looked_at}");
    }
}
