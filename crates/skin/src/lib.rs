//! The robot hand's skin: its layout, the boards' protocols, sweep assembly and conditioning.
//!
//! Nothing here does I/O or holds a clock: frames and times come in as arguments, so that a recording replays to
//! the bit.

mod frame;
mod layout;

pub use frame::{Fault, Faults, ForceFrame, Freshness, TactileFrame, TaxelReading};
pub use layout::{Layout, Module, Protocol, Taxel};
