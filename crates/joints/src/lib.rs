//! The joint angles of a robot hand: Dynamixel servos on a serial bus, and the Allegro hand on CAN.
//!
//! [`protocol2`] is Dynamixel Protocol 2.0 as bytes, [`bus`] decides what is asked when; neither does I/O or holds a
//! clock. [`JointReader`] runs a bus on a real serial port in a thread of its own. [`JointHistory`] gives the angles at
//! the instant of a tactile frame. [`AllegroDecoder`] listens to an Allegro hand.

mod allegro;
pub mod bus;
mod config;
pub mod protocol2;
pub mod registers;
mod serial;
mod synchrony;

pub use allegro::{
    ALLEGRO_JOINTS, AllegroConfig, AllegroCounters, AllegroDecoder, AllegroFrame, overlapping_ids,
    start_commands, stop_commands,
};
pub use config::{
    FastSyncRead, JointSource, JointSourceError, JointsConfig, JointsConfigError, MAX_JOINTS, ServoConfig,
};
pub use serial::{
    BusSurvey, FoundServo, JointReader, JointSnapshot, PortError, PortLatency, PortState, PortStatus,
    SerialBus, StartError, SurveyedServo, scan, survey,
};
pub use synchrony::{AngleAt, EXTRAPOLATE_NS, JointHistory, interpolation_bound_rad};
