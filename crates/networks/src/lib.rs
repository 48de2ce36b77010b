//! The neural networks with which the forearm publication estimates where a gripper holds (Pastor, Gandarias,
//! Garcia-Cerezo and Gomez-de-Gabriel, "Dataset with Tactile and Kinesthetic Information from a Human Forearm and Its
//! Application to Deep Learning", 2022, section 4), as printed, and their training.
//!
//! They are here to be compared with, not to be used: `taxel-forearm` is trained in milliseconds instead of hours. What
//! the article leaves open is settled in the documents of [`Reading`], [`Examples`] and [`BATCH`]. All of it needs the
//! feature `candle`.

#![cfg(feature = "candle")]

mod adam;
mod checkpoint;
mod error;
mod examples;
mod initial;
mod network;
mod protocol;
mod recurrence;
#[cfg(test)]
mod tests;
mod training;
mod window;

pub use error::NetworksError;
pub use examples::Examples;
pub use network::{Kind, Reading};
pub use protocol::{Plan, Progress, Stage, Trained, run, train};
pub use training::{BATCH, Losses, Training};
