//! Simulated Dynamixel servos (Protocol 2.0, XM430-W210) on a pseudo terminal, that misbehave on request.
//!
//! A [`ServoBus`] is the servos and their wire, with time as an argument: request bytes go in,
//! answers come out with the times at which they are on the wire. A [`ServoPty`] runs one in real
//! time behind a pseudo terminal, which any client can open as its serial port, ROBOTIS's own SDK
//! included. The behaviour is that of docs/protocols.md, "Simulated servos".

mod bus;
mod device;
mod fault;
mod line_pty;
mod link;
mod load;
mod motion;
mod pty;
mod scene_servos;
mod table;
mod terminal;

pub use bus::{AfterSilence, ServoBus, ServoTraffic};
pub use device::{ServoBuild, SimServo};
pub use fault::ServoFault;
pub use line_pty::LinePty;
pub use link::StableLink;
pub use load::{ForearmFinger, Load, SpringWall};
pub use motion::{Motion, Track};
pub use pty::{ServoPty, servo_clock_ns};
pub use scene_servos::{NamedServo, SERVO_BAUD, servos_of_scene};
