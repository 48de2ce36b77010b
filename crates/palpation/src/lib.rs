//! Categories of what a probe touches (Scimeca, Maiolino and Iida, "Motor-Induced Structuring of Tactile Sensory
//! Information for Category Formation in Robotics Palpation").
//!
//! Each touch is a tactile image sequence: the signed counts above baseline of every taxel at every step of a motion,
//! one after another. [`Pca`] makes a cognitive map of touches, [`paper`] or [`optimal`] find [`Categories`] on it,
//! [`Silhouette`] and [`stability`] say how clear they are, [`Agreement`] relates them to classes that are known, and
//! [`Ranking`] orders classes by their distance from one of them.
//!
//! Everywhere `D x N`: a column is a touch. Random numbers come from seeds, so that the same touches give the same
//! categories. `docs/palpation.md` has the whole way with examples.
//!
//! ```
//! use taxel_palpation::{Matrix, Pca, Silhouette, Solver, optimal};
//!
//! let touches = Matrix::new(3, 4, vec![1.0, 2.0, 0.0, 1.1, 2.0, 0.1, 8.0, 9.0, 5.0, 8.1, 9.0, 5.0]);
//! let map = Pca::fit(&touches, 2, Solver::Auto)?.project(&touches)?;
//! let categories = optimal(&map, 2, 1)?;
//! assert_eq!(categories.labels, [0, 0, 1, 1]);
//! assert!(Silhouette::of(&map, &categories.labels)?.standard > 0.9);
//! # Ok::<(), taxel_palpation::PalpationError>(())
//! ```

mod agreement;
mod branch_and_bound;
mod categories;
mod classifier;
mod decomposition;
mod error;
mod householder;
mod jacobi;
mod labels;
mod matrix;
mod pca;
mod ranking;
mod silhouette;
mod stability;
mod truncated;

pub use agreement::Agreement;
pub use categories::{Categories, PAPER_ATTEMPTS, clusters_by_silhouette, optimal, paper};
pub use classifier::{Classified, Classifier};
pub use error::PalpationError;
pub use matrix::Matrix;
pub use pca::{Pca, Solver};
pub use ranking::Ranking;
pub use silhouette::Silhouette;
pub use stability::stability;
