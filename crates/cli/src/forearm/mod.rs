//! `taxel forearm`: where on the forearm a gripper holds.

mod record;

use clap::Subcommand;

/// Where on the forearm a gripper holds, from the squeeze.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Record(record::Args),
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    match &args.command {
        Command::Record(args) => record::run(args),
    }
}
