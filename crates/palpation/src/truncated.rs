//! The first components of a large matrix.

use crate::decomposition::Decomposition;
use crate::householder::Qr;
use crate::jacobi::singular;
use crate::matrix::{Matrix, add_scaled, dots, norm};
use std::ops::Range;
use std::thread;
use taxel_cluster::Random;

/// Columns iterated beside those wanted, which make the wanted ones converge.
const BESIDE: usize = 10;
/// Residual, as a share of the greatest singular value, at which iteration ends: variances are then good to a part in
/// 10^12.
const ENOUGH: f64 = 1e-6;
/// Iterations at most: spectra that hardly fall do not converge, and `residuals` says so.
const ITERATIONS: usize = 12;
/// Parts of the columns that are gone over side by side: as many on every machine, so that sums are the same.
const PARTS: usize = 4;
/// Values from which on parts are worth a thread each.
const THREADS_FROM: usize = 1 << 20;
/// Rows taken at once: those of a block of columns fit into the nearer caches.
const ROWS: usize = 512;

/// The first `wanted` singular values of a `D x N` matrix and the vectors on the side of its rows, from a block power
/// iteration on a random start. Two passes over the matrix an iteration.
///
/// The values are those of the matrix on a subspace, so none is greater than the true one. With `A v = s u` by
/// construction, the norm of `A' u - s v` bounds the distance of `s` from a singular value of `A`. `None` as of
/// [`singular`].
pub(crate) fn truncated(a: &Matrix, wanted: usize) -> Option<Decomposition> {
    let block = (wanted + BESIDE).min(a.nrows().min(a.ncols()));
    let mut random = Random::new(0x7061_6C70_6174_6521);
    // Columns of the touches' side; the first pass takes it to the features'.
    let start = Matrix::from_fn(a.ncols(), block, |_, _| random.normal());
    let mut side = Qr::new(start).q();
    let mut best = None;
    for _ in 0..ITERATIONS {
        let forward = Qr::new(times(a, &side));
        let triangle = forward.lower();
        let (values, vectors) = singular(Qr::new(triangle.clone()).lower(), wanted)?;
        let basis = forward.q();
        let back = transposed_times(a, &basis);
        // A (side v) = (q u) s, exactly, with s v the lower triangle times u; what is missing is on the way back.
        let residuals: Vec<f64> = (vectors.column_iter())
            .map(|u| {
                let mut missing = combined(&back, u);
                add_scaled(&mut missing, [&combined(&side, &combined(&triangle, u))], [-1.0]);
                norm(&missing)
            })
            .collect();
        let worst = residuals.iter().copied().fold(0.0, f64::max);
        let done = worst <= ENOUGH * values[0];
        best = Some(Decomposition {
            values,
            vectors: forward.q_times(&vectors, wanted),
            residuals,
        });
        if done {
            break;
        }
        side = Qr::new(back).q();
    }
    best
}

/// The sum of columns times factors.
fn combined(columns: &Matrix, factors: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; columns.nrows()];
    for (column, factor) in columns.column_iter().zip(factors) {
        add_scaled(&mut sum, [column], [*factor]);
    }
    sum
}

/// What `work` makes of each part of the columns, in their order.
fn in_parts<T: Send>(a: &Matrix, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    let parts = (0..PARTS).map(|part| part * a.ncols() / PARTS..(part + 1) * a.ncols() / PARTS);
    if a.as_slice().len() < THREADS_FROM {
        return parts.map(work).collect();
    }
    thread::scope(|scope| {
        let threads: Vec<_> = parts.map(|part| scope.spawn(|| work(part))).collect();
        let ended = threads.into_iter().map(|thread| thread.join());
        ended
            .map(|done| done.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    })
}

/// `A B`, a sum over the columns of `A`.
fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let sums = in_parts(a, |part| {
        let mut sum = Matrix::zeros(a.nrows(), b.ncols());
        for first in (0..a.nrows()).step_by(ROWS) {
            let rows = first..(first + ROWS).min(a.nrows());
            let mut columns = part.clone();
            while columns.len() >= 4 {
                let four: [usize; 4] = std::array::from_fn(|n| columns.start + n);
                let vectors = four.map(|column| &a.column(column)[rows.clone()]);
                for n in 0..b.ncols() {
                    add_scaled(
                        &mut sum.column_mut(n)[rows.clone()],
                        vectors,
                        four.map(|column| b[(column, n)]),
                    );
                }
                columns.start += 4;
            }
            for column in columns {
                for n in 0..b.ncols() {
                    add_scaled(
                        &mut sum.column_mut(n)[rows.clone()],
                        [&a.column(column)[rows.clone()]],
                        [b[(column, n)]],
                    );
                }
            }
        }
        sum
    });
    let mut sums = sums.into_iter();
    let first = sums.next().unwrap_or_else(|| unreachable!("there are parts"));
    sums.fold(first, |mut total, sum| {
        for (total, sum) in total.column_iter_mut().zip(sum.column_iter()) {
            add_scaled(total, [sum], [1.0]);
        }
        total
    })
}

/// `A' B`, a row for each column of `A`.
fn transposed_times(a: &Matrix, b: &Matrix) -> Matrix {
    let parts = in_parts(a, |part| {
        let mut rows = Matrix::zeros(b.ncols(), part.len());
        for first in (0..a.nrows()).step_by(ROWS) {
            let within = first..(first + ROWS).min(a.nrows());
            for (row, column) in rows.column_iter_mut().zip(part.clone()) {
                let column = &a.column(column)[within.clone()];
                let (fours, rest) = row.as_chunks_mut::<4>();
                let of = |n: usize| &b.column(n)[within.clone()];
                for (n, four) in fours.iter_mut().enumerate() {
                    let products = dots::<4>(column, std::array::from_fn(|m| of(4 * n + m)));
                    add_scaled(four, [&products], [1.0]);
                }
                for (n, x) in rest.iter_mut().enumerate() {
                    *x += dots(column, [of(4 * fours.len() + n)])[0];
                }
            }
        }
        rows
    });
    let values = parts.iter().flat_map(|part| part.as_slice().iter().copied());
    Matrix::new(b.ncols(), a.ncols(), values.collect()).transpose()
}
