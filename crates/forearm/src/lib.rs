//! Where on the forearm a gripper holds, from one squeeze (Pastor, Gandarias, Garcia-Cerezo and Gomez-de-Gabriel,
//! "Dataset with Tactile and Kinesthetic Information from a Human Forearm and Its Application to Deep Learning", 2022).
//!
//! A [`Squeeze`] is what the gripper felt while it closed and opened: angles of its two fingers, the commanded PWM, and
//! the tactile images of a third finger where there is one. A [`Session`] is squeezes with the places they were made
//! at, read from the publication's folders of `.mat` files or from an `.npz`. An [`Estimator`] says where a squeeze was
//! made, from 0 % (wrist) to 100 % (elbow), and how far that may be off; it takes as much of a squeeze as there is.

mod disturbance;
mod error;
mod estimate;
mod folder;
mod fusion;
mod kinesthetic;
mod least_squares;
mod left_out;
mod mat;
mod model;
mod phase;
mod places;
mod plausibility;
mod profile;
mod protocol;
mod regression;
mod session;
mod shape;
mod squeeze;
mod tactile;

pub use disturbance::Disturbance;
pub use error::ForearmError;
pub use estimate::{Estimate, Estimator, Seen, Source};
pub use fusion::{Fused, Fusion};
pub use kinesthetic::{Kinesthetic, MOST_UNKNOWN};
pub use left_out::LeftOut;
pub use mat::{Matrix, TornMat, read_mat, write_mat};
pub use model::{Model, TrainedOn};
pub use places::{PLACES, location_percent};
pub use protocol::{Errors, Judged, PlaceErrors, Split, splits, splits_of_few};
pub use regression::{Choice, Tried};
pub use session::{Session, Trial, touch_file};
pub use squeeze::{COLUMNS, FINGERS, Sample, Squeeze, TACTELS, TACTILE_COLUMNS, TACTILE_ROWS};
pub use tactile::Tactile;
pub use taxel_gripper::{FULL_PWM, Ramp};
