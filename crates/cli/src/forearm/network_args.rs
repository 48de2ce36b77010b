//! What is asked of the publication's networks.

use clap::ValueEnum;
use std::path::PathBuf;

/// What is asked of the publication's networks.
#[derive(Debug, clap::Args)]
#[cfg_attr(not(feature = "networks"), allow(dead_code))]
pub(super) struct NetworkArgs {
    /// With --method paper: what the kinesthetic network takes for time; the publication does not say
    #[arg(long, value_enum, default_value_t = Reading::Transposed)]
    pub(super) reading: Reading,
    /// With --method paper: fewer epochs than the publication's, for a try
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) epochs: Option<u16>,
    /// With --method paper: keep checkpoints here, and go on from those that are there
    #[arg(long, value_name = "DIR")]
    pub(super) checkpoints: Option<PathBuf>,
}

/// What a network takes for time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Reading {
    /// Samples, one after another
    Time,
    /// Angles, one after another, each with all its samples, as an earlier article's code does
    Transposed,
}
