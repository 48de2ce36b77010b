//! What every part of taxeld shares: the frames that a hand's skin gives, where its taxels sit, the
//! tactile image that a display is given, and the profile that says what the display can do.
//!
//! Only data, and how the settings that people write are read and refused: nothing here decodes, computes an image or does
//! I/O. How the boards of a hand are wired is no concern of this crate; that is the layout of `taxel-skin`.

mod frame;
mod geometry;
mod image;
mod neighbours;
mod plural;
mod pose;
mod profile;
mod profile_error;
mod settings;
mod shell_word;

pub use frame::{FORCE_MAX, FORCE_MIN, Fault, Faults, ForceFrame, Freshness, TactileFrame};
pub use geometry::{Geometry, GeometryError, MAX_MODULES, MAX_PIXELS, MAX_TAXELS, Module, Taxel};
pub use image::{Actuator, TactileImage};
pub use plural::plural;
pub use pose::Pose;
pub use profile::{
    ActuatorForce, CodebookLearning, Coordinates, ForceFit, Grey, LevelSteps, Method, Placement, Profile,
};
pub use profile_error::ProfileError;
pub use settings::{
    FromMap, RangeError, Whole, WholeList, check_range, closest, did_you_mean, plain_words, why_no_name,
};
pub use shell_word::shell_word;

/// The examples of the README compile, and those that can run do.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
