//! Sequential clustering: a force frame and a display profile become a tactile image.
//!
//! [`Compressor`] does it, frame by frame, without allocating; [`learn_codebook`] makes the
//! constant codebook of a session. `docs/algorithm.md` gives the recipe to the bit.

mod actuator_groups;
mod actuators;
mod codebook;
mod compressor;
mod contacts;
mod fixed;
mod heights;
mod levels;
mod session;
mod steps;

pub use codebook::learn_codebook;
pub use compressor::{Compressor, Stages};
