//! `taxel status`, `rezero`, `pause`, `resume`, `profile` and `mark`: one request to the running daemon.

use crate::client::{control, status_text};
use anyhow::{Context, anyhow};
use serde_json::{Value, json};
use std::path::PathBuf;
use taxel_hand::shell_word;
use taxel_wire::status::Status;
use taxeld::stdout;

/// Where the daemon is asked.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct Ask {
    /// The daemon's control or status socket [default: where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
}

/// Print what the running daemon knows of itself and of the hand, on one screen.
///
/// Images, buses, boards, joints, who reads, and what is wrong with what to do about it. Counts are those since the
/// daemon's start; `taxel doctor` looks for causes.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel status
  watch -n 1 taxel status                    again and again
  taxel status --json | jq .buses[0].used    every count there is
  taxel status --check                       1 where an error is among the problems, for scripts and Nagios")]
pub(crate) struct StatusArgs {
    #[command(flatten)]
    ask: Ask,
    /// One JSON object with everything
    #[arg(long)]
    json: bool,
    /// End with 1 where what is wrong is an error and no warning
    #[arg(long)]
    check: bool,
}

/// Measure the baseline anew, as after a warm-up; the hand must not be touched for two seconds.
#[derive(Debug, clap::Args)]
pub(crate) struct RezeroArgs {
    /// One JSON object: how many taxels were in contact just before
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    ask: Ask,
}

/// Show no contact until `taxel resume`, so that every display lets go; frames are read on.
#[derive(Debug, clap::Args)]
pub(crate) struct PauseArgs {
    /// One JSON object: {"paused": true}
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    ask: Ask,
}

/// Show contacts again after `taxel pause`.
#[derive(Debug, clap::Args)]
pub(crate) struct ResumeArgs {
    /// One JSON object: {"paused": false}
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    ask: Ask,
}

/// Print or change the display profile of subscribers that state none.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel profile                                       as JSON
  taxel profile '{\"levels\": 4, \"actuators\": 12}'      what is not named has its default
  taxel profile - < glove.json                        the same from a file")]
pub(crate) struct ProfileArgs {
    /// The new profile, a JSON object; its keys are those of `[profile]` in the configuration; - reads it from stdin
    #[arg(value_name = "JSON")]
    profile: Option<String>,
    /// Print the profile that is in force behind a change as well
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    ask: Ask,
}

/// Tell every subscriber and recorder that something happened now.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  taxel mark 'cup 3, second grasp'")]
pub(crate) struct MarkArgs {
    /// What happened
    text: String,
    /// One JSON object: behind which image it is, and its time
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    ask: Ask,
}

pub(crate) fn status(args: &StatusArgs) -> anyhow::Result<()> {
    let reply = args.ask.send(&json!({ "cmd": "status" }))?;
    let status = Status::try_from(reply["status"].clone())?;
    stdout::print(&match args.json {
        true => reply["status"].to_string() + "\n",
        false => status_text::of(&status),
    })?;
    let errors = status.problems.iter().filter(|problem| problem.severe).count();
    anyhow::ensure!(
        !args.check || errors == 0,
        "{errors} of the problems {}; `taxel doctor` looks for causes",
        if errors == 1 { "is an error" } else { "are errors" }
    );
    Ok(())
}

pub(crate) fn rezero(args: &RezeroArgs) -> anyhow::Result<()> {
    let reply = args.ask.send(&json!({ "cmd": "rezero" }))?;
    let contacts = reply["contacts"].as_u64();
    if let Some(contacts @ 1..) = contacts {
        let taxels = if contacts == 1 { "taxel was" } else { "taxels were" };
        say!(
            "taxel: {contacts} {taxels} in contact just before; if something touches the hand, that is no touch from now \
             on: let go of it, and `taxel rezero` again"
        );
    }
    stdout::print(&match args.json {
        true => format!("{}\n", json!({ "contacts": contacts })),
        false => "the baseline is measured anew; do not touch the hand for two seconds\n".to_owned(),
    })
}

pub(crate) fn pause(args: &PauseArgs) -> anyhow::Result<()> {
    args.ask.pause("pause", true, args.json)
}

pub(crate) fn resume(args: &ResumeArgs) -> anyhow::Result<()> {
    args.ask.pause("resume", false, args.json)
}

pub(crate) fn profile(args: &ProfileArgs) -> anyhow::Result<()> {
    if let Some(text) = &args.profile {
        let profile = read_profile(text)?;
        args.ask.send(&json!({ "cmd": "profile", "profile": profile }))?;
        if !args.json {
            return Ok(());
        }
    }
    let reply = args.ask.send(&json!({ "cmd": "profile" }))?;
    stdout::print(&format!("{}\n", reply["profile"]))
}

/// A profile as it was given, or as it comes through stdin.
fn read_profile(given: &str) -> anyhow::Result<Value> {
    let text = match given {
        "-" => std::io::read_to_string(std::io::stdin()).context("stdin")?,
        text => text.to_owned(),
    };
    serde_json::from_str(&text).map_err(|error| {
        let file = std::fs::read_to_string(given).ok().filter(|_| given != "-");
        let name = if given == "-" { "stdin" } else { given };
        let is_table = |text: &str| text.lines().any(|line| line.trim() == "[profile]");
        if is_table(file.as_ref().unwrap_or(&text)) {
            anyhow!(
                "{name}: it has a table [profile], which is a part of the daemon's configuration: put it there, and \
                 `systemctl reload taxeld`"
            )
        } else if file.is_some() {
            anyhow!("{name} is a file, which is read by `taxel profile - < {}`", shell_word(name))
        } else {
            anyhow!("{}: {error}; a profile is a JSON object such as {{\"levels\": 4}}", text.trim())
        }
    })
}

pub(crate) fn mark(args: &MarkArgs) -> anyhow::Result<()> {
    let reply = args.ask.send(&json!({ "cmd": "mark", "text": args.text }))?;
    stdout::print(&match args.json {
        true => format!("{}\n", reply["mark"]),
        false => format!("behind image {}\n", reply["mark"]["seq"]),
    })
}

impl Ask {
    /// Has the daemon pause or go on.
    fn pause(&self, cmd: &str, paused: bool, json: bool) -> anyhow::Result<()> {
        self.send(&json!({ "cmd": cmd }))?;
        match json {
            true => stdout::print(&format!("{}\n", json!({ "paused": paused }))),
            false => Ok(()),
        }
    }

    /// Sends a request and returns the reply; an error is the daemon's own words why not.
    pub(crate) fn send(&self, request: &Value) -> anyhow::Result<Value> {
        // What only tells is open to more users.
        let tells = request["cmd"] == "status" || request == &json!({ "cmd": "profile" });
        let name = if tells { "status.sock" } else { "control.sock" };
        let default = || taxeld::config::running_socket(name);
        control::request(&self.socket.clone().unwrap_or_else(default), request)
    }
}
