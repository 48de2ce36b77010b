//! The Allegro hand: sixteen joint angles from the position frames that it puts on its CAN bus.
//!
//! The hand is controlled by another program; this one listens, unless the hand has a bus to itself
//! (`own_bus`), on which it is started. Joints are numbered `4 * finger + j`: index, middle, ring,
//! thumb, from base to tip.

mod config;
mod decoder;
mod ids;
mod motor_errors;
mod source;
mod starter;

pub use config::{ALLEGRO_FINGERS, ALLEGRO_JOINTS, AllegroConfig};
pub use decoder::{AllegroCounters, AllegroDecoder, AllegroFrame};
pub use ids::overlapping_ids;
pub use motor_errors::{MOTOR_ERROR_NS, MotorError, MotorErrors};
pub use source::AllegroSource;
pub use starter::AllegroStarter;
