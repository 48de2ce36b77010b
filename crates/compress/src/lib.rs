//! Sequential clustering: a force frame and a display profile become a tactile image.

mod image;
mod profile;

pub use image::{Actuator, TactileImage};
pub use profile::{ActuatorForce, Grey, Method, Profile, ProfileError};
