//! Sequential clustering: a force frame and a display profile become a tactile image.
//!
//! [`Compressor`] does it, frame by frame, without allocating; [`learn_codebook`] makes the constant codebook of a session.
//! `docs/algorithm.md` gives the recipe to the bit.

mod actuators;
mod codebook;
mod compressor;
mod contacts;
mod fixed;
mod hand;
mod image;
mod levels;
mod profile;
mod profile_error;
mod session;
mod steps;

pub use codebook::learn_codebook;
pub use compressor::{Compressor, Stages};
pub use contacts::FORCE_MAX;
pub use image::{Actuator, TactileImage};
pub use profile::{
    ActuatorForce, CodebookLearning, Coordinates, ForceFit, Grey, LevelSteps, Method, Placement, Profile,
};
pub use profile_error::ProfileError;
