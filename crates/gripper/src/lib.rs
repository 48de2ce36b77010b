//! The gripper that squeezes forearms (Pastor, Gandarias, Garcia-Cerezo and Gomez-de-Gabriel, "Dataset with Tactile and
//! Kinesthetic Information from a Human Forearm and Its Application to Deep Learning", 2022, section 2.1): two fingers of
//! two phalanges each, which one motor closes through a five-bar linkage, against a third finger that does not move.
//!
//! A motor's angle and the angle between the phalanges, which a potentiometer reads, give where a finger is
//! ([`FiveBar::proximal_rad`]); what the motor presses with goes through the same bars ([`FiveBar::contact_forces_n`]).
//! [`Ramp`] is how hard the motors are driven during a squeeze.
//!
//! ```
//! use taxel_gripper::FiveBar;
//!
//! let (theta_a, theta_p) = (60_f64.to_radians(), 42_f64.to_radians());
//! let theta_u = FiveBar::FINGER.proximal_rad(theta_a, theta_p)?;
//! assert_eq!(theta_u.to_degrees().round(), 98.0);
//! let back = FiveBar::FINGER.actuated_rad(theta_u, theta_p)?;
//! assert!((back - theta_a).abs() < 1e-9);
//! # Ok::<(), taxel_gripper::FiveBarError>(())
//! ```

mod error;
mod five_bar;
mod ramp;
mod statics;

pub use error::FiveBarError;
pub use five_bar::FiveBar;
pub use ramp::{FULL_PWM, Ramp};
pub use statics::Spring;
