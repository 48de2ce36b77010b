//! What every part of taxeld shares: the frames that a hand's skin gives, where its taxels sit, the
//! tactile image that a display is given, and the profile that says what the display can do.
//!
//! Only data: nothing here decodes, computes an image or does I/O. How the boards of a hand are
//! wired is no concern of this crate; that is the layout of `taxel-skin`.

mod did_you_mean;
mod frame;
mod from_map;
mod geometry;
mod image;
mod name;
mod neighbours;
mod plain_words;
mod plural;
mod pose;
mod profile;
mod profile_error;
mod range;
mod whole_list;

pub use did_you_mean::{closest, did_you_mean};
pub use frame::{FORCE_MAX, FORCE_MIN, Fault, Faults, ForceFrame, Freshness, TactileFrame};
pub use from_map::FromMap;
pub use geometry::{Geometry, GeometryError, MAX_MODULES, MAX_PIXELS, MAX_TAXELS, Module, Taxel};
pub use image::{Actuator, TactileImage};
pub use name::why_no_name;
pub use plain_words::plain_words;
pub use plural::plural;
pub use pose::Pose;
pub use profile::{
    ActuatorForce, CodebookLearning, Coordinates, ForceFit, Grey, LevelSteps, Method, Placement, Profile,
};
pub use profile_error::ProfileError;
pub use range::{RangeError, check_range};
pub use whole_list::{Whole, WholeList};

/// The examples of the README compile, and those that can run do.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
