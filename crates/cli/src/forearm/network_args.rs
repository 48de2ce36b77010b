//! What is asked of the publication's networks.

use clap::ValueEnum;
use std::path::PathBuf;

/// What is asked of the publication's networks.
#[derive(Debug, clap::Args)]
#[cfg_attr(not(feature = "networks"), allow(dead_code))]
pub(super) struct NetworkArgs {
    /// With --method paper: what the kinesthetic network takes for time; the publication does not say [default:
    /// transposed]
    #[arg(long, value_enum)]
    reading: Option<Reading>,
    /// With --method paper: fewer epochs than the publication's, for a try; fusion, which takes half a minute, has all of its own
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) epochs: Option<u16>,
    /// With --method paper: keep checkpoints here, and go on from those that are there
    #[arg(long, value_name = "DIR")]
    pub(super) checkpoints: Option<PathBuf>,
}

impl NetworkArgs {
    /// What the kinesthetic network takes for time.
    #[cfg_attr(not(feature = "networks"), allow(dead_code))]
    pub(super) fn reading(&self) -> Reading {
        self.reading.unwrap_or(Reading::Transposed)
    }

    /// The first option that was given.
    pub(super) fn given(&self) -> Option<&'static str> {
        [
            ("--reading", self.reading.is_some()),
            ("--epochs", self.epochs.is_some()),
            ("--checkpoints", self.checkpoints.is_some()),
        ]
        .into_iter()
        .find_map(|(option, is_given)| is_given.then_some(option))
    }
}

/// What a network takes for time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Reading {
    /// Samples, one after another
    Time,
    /// Angles, one after another, each with all its samples, as an earlier article's code does
    Transposed,
}
