//! What a solver gives.

use nalgebra::DMatrix;

/// Singular values, descending, with the vectors on the side of the features as columns, and the residual of each.
pub(crate) struct Decomposition {
    pub(crate) values: Vec<f64>,
    pub(crate) vectors: DMatrix<f64>,
    pub(crate) residuals: Vec<f64>,
}
