//! What is wrong with a hand, its buses and its joints, in words that a user can act on: each thing
//! once, with one severity. Status, log, notices and doctor all say what is found here.
//!
//! Nothing here does I/O or has a clock. What is known comes in as data, a [`HandView`];
//! [`Problems`] tells what is wrong in it, and what of that is new. The daemon asks ten times a
//! second, the doctor while it listens.

mod array;
mod boards;
mod bus;
mod contacts;
mod hidden;
mod joints;
mod joints_view;
mod kind;
mod malformed;
mod names;
mod news;
mod problem;
mod problems;
mod rate_limiter;
mod readers;
mod reload;
mod sharing;
mod taxels;
mod traffic;
mod view;

pub use joints::{
    JointsReporter, absent_potentiometers, missing_servos, motor_error, potentiometer_state, servo_name,
    servo_state, silent_fingers, silent_potentiometers, silent_servo, slow_adapter, two_servos,
    unknown_model, unread_lines,
};
pub use joints_view::{JointsView, SourceView};
pub use kind::{Kind, Severity};
pub use names::board_name;
pub use news::News;
pub use problem::{Place, Problem};
pub use problems::{CurrentProblem, Problems};
pub use readers::Crowd;
pub use reload::NotReloaded;
pub use taxels::{feels_little, is_broken};
pub use traffic::speaks_on;
pub use view::{BusView, DaemonView, HandSetup, HandView, Starting};

/// Of a contact threshold of 0, as the publication's rule makes it of two frames that are the same.
pub const ANY_CHANGE_IS_CONTACT: &str =
    "nothing changed while it was measured, so that any change is a contact";

#[cfg(test)]
mod tests;
