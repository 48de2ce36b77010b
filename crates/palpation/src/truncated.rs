//! The first components of a large matrix.

use crate::decomposition::Decomposition;
use crate::random::Random;
use nalgebra::{DMatrix, QR, SVD};

/// Columns iterated beside those wanted, which make the wanted ones converge.
const BESIDE: usize = 10;
/// Residual, as a share of the greatest singular value, at which iteration ends: variances are then good to a part in
/// 10^12.
const ENOUGH: f64 = 1e-6;
/// Iterations at most: spectra that hardly fall do not converge, and `residuals` says so.
const ITERATIONS: usize = 12;

/// The first `wanted` singular values of a `D x N` matrix and the vectors on the side of its rows, from a block power
/// iteration on a random start. Two passes over the matrix an iteration.
///
/// The values are those of the matrix on a subspace, so none is greater than the true one. With `A v = s u` by
/// construction, the norm of `A' u - s v` bounds the distance of `s` from a singular value of `A`.
pub(crate) fn truncated(a: &DMatrix<f64>, wanted: usize) -> Decomposition {
    let (rows, columns) = a.shape();
    let block = (wanted + BESIDE).min(rows.min(columns));
    let mut random = Random(0x7061_6C70_6174_6521);
    // Columns of the touches' side; the first pass takes it to the features'.
    let start = DMatrix::from_fn(columns, block, |_, _| random.normal());
    let mut side = QR::new(start).q();
    let mut best = None;
    for _ in 0..ITERATIONS {
        let forward = QR::new(a * &side);
        let svd = SVD::new(forward.r(), true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
            unreachable!("both were asked for");
        };
        // A (side v) = (q u) s, exactly; what is missing is on the way back.
        let basis = forward.q();
        let back = a.tr_mul(&basis);
        let (u, ahead) = (u.columns(0, wanted), &back * u.columns(0, wanted));
        let partner = &side * v_t.rows(0, wanted).transpose();
        let values: Vec<f64> = svd.singular_values.iter().take(wanted).copied().collect();
        let residual = |i: usize| (ahead.column(i) - partner.column(i) * values[i]).norm();
        let residuals: Vec<f64> = (0..wanted).map(residual).collect();
        let worst = residuals.iter().copied().fold(0.0, f64::max);
        let done = worst <= ENOUGH * values[0];
        best = Some(Decomposition {
            values,
            vectors: &basis * u,
            residuals,
        });
        if done {
            break;
        }
        side = QR::new(back).q();
    }
    best.unwrap_or_else(|| unreachable!("there is a first iteration"))
}
