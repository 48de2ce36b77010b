//! The joint angles of a robot hand: Dynamixel servos on a serial bus, the Allegro hand on CAN, and potentiometers beside
//! either.
//!
//! Each kind of source is a folder behind one seam ([`SourceConfig`], [`CanJoints`]);
//! [`JointSource`] is their list. [`JointFeed`] puts their angles into tactile frames, each at the
//! frame's own instant ([`JointHistory`]): without I/O and without a clock. [`JointReader`] is the
//! thread that a source on a serial port is read by.

mod allegro;
mod analogue;
mod buses;
mod config;
mod dynamixel;
mod error;
mod feed;
mod joint_name;
mod reader;
mod serial;
mod source;
mod synchrony;

pub use allegro::{
    ALLEGRO_FINGERS, ALLEGRO_JOINTS, AllegroConfig, AllegroCounters, AllegroDecoder, AllegroFrame,
    AllegroSource, AllegroStarter, MOTOR_ERROR_NS, MotorError, MotorErrors, overlapping_ids,
};
pub use analogue::{
    AnalogueConfig, AnalogueCounters, AnalogueJointConfig, AnalogueLines, AnalogueReader, AnalogueSnapshot,
    Channel, HeardChannel, NoAngle,
};
pub use buses::{JointsBus, JointsError};
pub use config::{JointSource, JointsConfig};
pub use dynamixel::{
    BusSurvey, DynamixelConfig, FastSyncRead, FoundServo, SerialBus, ServoConfig, ServoReader, ServoSnapshot,
    SurveyedServo, bus, protocol2, registers, scan, survey,
};
pub use error::{JointSourceError, JointsConfigError, MAX_JOINTS};
pub use feed::{JointCommand, JointFeed, JointsSnapshot};
pub use reader::JointReader;
pub use serial::{PortError, PortLatency, PortState, PortStatus, ReadingThreadError, StartError};
pub use source::{CanJoints, JointCount, JointReadings, SourceConfig};
pub use synchrony::{AngleAt, EXTRAPOLATE_NS, JointHistory, JointMotion};
