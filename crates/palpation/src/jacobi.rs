//! Singular values of small matrices, by one-sided Jacobi rotations (Hestenes 1958; Demmel and Veselic 1992).

use crate::matrix::{Matrix, dots, norm};

/// Sweeps over all pairs of columns at most. Some ten do for any matrix, and after that each doubles the digits.
const SWEEPS: usize = 60;

/// Singular values, descending, and their vectors on the side of the rows, as columns; zero where the value is.
///
/// Pairs of columns are turned until all are at right angles: then their lengths are the singular values. `None` if they
/// never are. Soonest done with a lower triangle whose
/// columns become shorter.
pub(crate) fn singular(mut a: Matrix) -> Option<(Vec<f64>, Matrix)> {
    let mut sweeps = 0;
    while sweep(&mut a) {
        sweeps += 1;
        if sweeps == SWEEPS {
            return None;
        }
    }

    let lengths: Vec<f64> = a.column_iter().map(norm).collect();
    let mut order: Vec<usize> = (0..a.ncols()).collect();
    order.sort_by(|a, b| lengths[*b].total_cmp(&lengths[*a]));
    let values: Vec<f64> = order.iter().map(|from| lengths[*from]).collect();
    let mut vectors = a.select_columns(&order);
    for (column, length) in vectors
        .column_iter_mut()
        .zip(&values)
        .filter(|(_, length)| **length > 0.0)
    {
        column.iter_mut().for_each(|x| *x /= length);
    }
    Some((values, vectors))
}

/// Pairs of a round that are taken together.
const PAIRS: usize = 8;

/// Every pair of columns once; says whether one was turned.
///
/// Pairs are in the order of a tournament: those of one round share no column, so their angles are found side by side.
fn sweep(a: &mut Matrix) -> bool {
    let size = a.ncols();
    let mut squares: Vec<f64> = a.column_iter().map(|column| dots(column, [column])[0]).collect();
    // What is left of a column that depends on others is rounding, and has no direction.
    let nothing = squares.iter().copied().fold(0.0, f64::max) * f64::EPSILON * f64::EPSILON;
    let equal = f64::EPSILON * f64::EPSILON * a.nrows() as f64;
    let places = size + size % 2;
    let mut turned = false;
    for round in 0..places.saturating_sub(1) {
        for first in (0..places / 2).step_by(PAIRS) {
            let count = PAIRS.min(places / 2 - first);
            let (mut pairs, mut products) = ([(0, 0); PAIRS], [[0.0; PAIRS]; 3]);
            for n in 0..count {
                let (p, q) = pair(round, first + n, places);
                if q < size {
                    pairs[n] = (p, q);
                    products[0][n] = dots(a.column(p), [a.column(q)])[0];
                    products[1][n] = squares[p];
                    products[2][n] = squares[q];
                }
            }
            let [along, xx, yy] = products;
            let (mut tangents, mut cosines) = ([0.0; PAIRS], [0.0; PAIRS]);
            for n in 0..PAIRS {
                let zeta = (yy[n] - xx[n]) / (2.0 * along[n]);
                let tangent = 1.0f64.copysign(zeta) / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let square = along[n] * along[n] <= equal * xx[n] * yy[n];
                tangents[n] = if square | (xx[n].min(yy[n]) <= nothing) {
                    0.0
                } else {
                    tangent
                };
                cosines[n] = 1.0 / (1.0 + tangents[n] * tangents[n]).sqrt();
            }
            for n in 0..count {
                let (tangent, cosine, (p, q)) = (tangents[n], cosines[n], pairs[n]);
                if tangent == 0.0 {
                    continue;
                }
                turned = true;
                let sine = cosine * tangent;
                let (x, y) = a.two_columns_mut(p, q);
                for (x, y) in x.iter_mut().zip(y) {
                    (*x, *y) = (cosine * *x - sine * *y, sine * *x + cosine * *y);
                }
                squares[p] = xx[n] - tangent * along[n];
                squares[q] = yy[n] + tangent * along[n];
            }
        }
    }
    turned
}

/// A pair of a round of a tournament of an even number: the first stays where it is, the others go round.
fn pair(round: usize, pair: usize, places: usize) -> (usize, usize) {
    let place = |at: usize| {
        if at == 0 {
            0
        } else {
            1 + (at - 1 + round) % (places - 1)
        }
    };
    let (one, other) = (place(pair), place(places - 1 - pair));
    (one.min(other), one.max(other))
}
