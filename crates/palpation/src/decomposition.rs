//! Singular value decomposition: what it gives, and the exact one.

use crate::householder::Qr;
use crate::jacobi::singular;
use crate::matrix::Matrix;

/// Singular values, descending, with the vectors on the side of the features as columns, and the residual of each.
pub(crate) struct Decomposition {
    pub(crate) values: Vec<f64>,
    pub(crate) vectors: Matrix,
    pub(crate) residuals: Vec<f64>,
}

/// The first values and vectors: QR of the longer side, then SVD of the triangle.
pub(crate) fn exact(centred: Matrix, wanted: usize) -> Option<Decomposition> {
    let wide = centred.ncols() > centred.nrows();
    let wanted = wanted.min(centred.ncols()).min(centred.nrows());
    let (values, vectors) = if wide {
        singular(Qr::new(centred.transpose()).lower(), wanted)?
    } else {
        let qr = Qr::new(centred);
        // The other triangle of this one has the same vectors on this side, and columns that hardly need turning.
        let (values, vectors) = singular(Qr::new(qr.lower()).lower(), wanted)?;
        (values, qr.q_times(&vectors, wanted))
    };
    Some(Decomposition {
        residuals: vec![0.0; values.len()],
        values,
        vectors,
    })
}
