//! The command line of `taxeld`; here so that its manual page can be made without it.

use clap::Parser;
use std::path::PathBuf;

/// Reads a robot hand's skin from CAN and gives tactile images to display drivers.
///
/// The configuration is one TOML file; docs/guide.md says what is in it. Display drivers connect to
/// the images socket (docs/wire.md); `taxel watch` shows what they are given. RUST_LOG=debug says
/// more.
#[derive(Debug, Parser)]
#[command(
    name = "taxeld",
    version = env!("TAXEL_VERSION"),
    after_help = "Example:\n  taxeld --config /etc/taxeld/taxeld.toml"
)]
pub struct Arguments {
    /// The configuration file.
    #[arg(long, value_name = "FILE")]
    pub config: PathBuf,
    /// Only check the configuration file, the groups, recordings and scenes that it names, and say what it would run.
    #[arg(long)]
    pub check: bool,
}
