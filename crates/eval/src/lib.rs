//! How good and how fast a compression of tactile frames is: the measurements of `taxel eval`.
//!
//! A [`Sequence`] holds the frames, [`References`] the best there is for each of them, [`Method`] a
//! profile to be judged. [`judge`] runs the frames through it once and measures errors; [`time`]
//! runs them again and again and measures cost. Both results together are a [`MethodReport`]. The
//! references are computed here, from scratch, and share no code with what they judge.
//!
//! A [`Task`] asks another question: whether what was touched can still be told from one image.

mod best_levels;
mod best_places;
mod classify;
mod contact_truth;
mod cost;
mod judge;
mod jump_bound;
mod method;
mod plane;
mod pressure;
mod quantile;
mod report;
mod sequence;
mod synthetic;
mod tally;
mod task;

pub use best_places::RESTARTS;
pub use contact_truth::{ContactTruth, contact_truth};
pub use cost::{Allocations, Cost, Lap, Timings, time};
pub use judge::{Errors, judge};
pub use method::{Method, MethodError, Offered, main_methods, standard_methods};
pub use plane::Plane;
pub use quantile::{Quantiles, quantile};
pub use report::{CostDetail, EvalReport, MethodReport, ScalingReport};
pub use sequence::{Reference, References, Sequence};
pub use synthetic::synthetic;
pub use task::{BLUR_PX, EXAMPLES, Shown, Task, TaskError, TaskPoint, TaskRow, grid_places};
