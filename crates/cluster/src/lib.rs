//! k-means kernels in one, two and any number of dimensions.
//!
//! Slices in, slices out: nothing here allocates, reads a clock or depends on the machine. Every
//! operation is a plain IEEE 754 double operation in a documented order, so that a result is the
//! same on every platform, to the bit. The recipe that `docs/algorithm.md` gives for other
//! languages is the one these functions follow.

mod kmeans1d;
mod kmeans2d;
mod lloyd1d;
mod lloyd2d;
mod local_search;
mod matching;
mod random;
mod seed;

pub use kmeans1d::{Kmeans1d, Kmeans1dError, Partition};
pub use kmeans2d::{Clusters, Kmeans2d, Kmeans2dSettings};
pub use lloyd1d::{assign1d, lloyd1d, nearest1d};
pub use lloyd2d::{Plane, lloyd2d, medoids};
pub use local_search::LocalSearch;
pub use matching::Matching;
pub use random::Random;
pub use seed::{maximin, uniform};
