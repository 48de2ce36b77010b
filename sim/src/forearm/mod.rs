//! A forearm that a gripper squeezes, and what the gripper feels (Pastor, Gandarias, Garcia-Cerezo and Gomez-de-Gabriel,
//! "Dataset with Tactile and Kinesthetic Information from a Human Forearm and Its Application to Deep Learning", 2022).
//! What is made here is synthetic: it is no evidence about people.
//!
//! A [`Grip`] is the two fingers on one place of the forearm: PWM goes in, angles come out. A
//! [`SimulatedForearm`] makes whole squeezes of it, with touch.

mod grip;
mod pressed;
mod section;
mod squeeze;
mod touch;

pub use grip::{FingerAngles, Grip, NoPlace};
pub use pressed::ForearmTouch;
pub use squeeze::{SimulatedForearm, SimulatedSqueeze};
pub use touch::{TOUCH_COLUMNS, TOUCH_ROWS};
