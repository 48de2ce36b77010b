//! Singular values of small matrices, by one-sided Jacobi rotations (Hestenes 1958; Demmel and Veselic 1992).

use crate::matrix::{Matrix, dots, norm};
use std::ops::Range;

/// Sweeps over pairs of columns at most. Some ten do for any matrix, and after that each doubles the digits.
const SWEEPS: usize = 60;
/// Those that turn only pairs with a wanted column: each adds digits where the other columns are short or nearly at
/// right angles, as the first make them. Where these do not do, sweeps over all pairs come sooner to an end.
const SHORT_SWEEPS: Range<usize> = 2..12;

/// The first `wanted` singular values, descending, and their vectors on the side of the rows, as columns; zero where the
/// value is.
///
/// Pairs of columns are turned until all are at right angles: then their lengths are the singular values. `None` if they
/// never are. Soonest done with a lower triangle whose columns become shorter.
///
/// Where `wanted` columns are longer than all others together, only they have to be at right angles to each column: no
/// singular value of the others is greater than their length together.
pub(crate) fn singular(mut a: Matrix, wanted: usize) -> Option<(Vec<f64>, Matrix)> {
    let mut squares = Vec::with_capacity(a.ncols());
    let mut turns = vec![true; a.ncols()];
    let mut sweeps = 0;
    loop {
        squares.clear();
        squares.extend(a.column_iter().map(|column| dots(column, [column])[0]));
        if SHORT_SWEEPS.contains(&sweeps) {
            longest(&squares, wanted, &mut turns);
        } else {
            turns.fill(true);
        }
        if !sweep(&mut a, &mut squares, &turns) {
            break;
        }
        sweeps += 1;
        if sweeps == SWEEPS {
            return None;
        }
    }

    let lengths: Vec<f64> = a.column_iter().map(norm).collect();
    let mut order: Vec<usize> = (0..a.ncols()).collect();
    order.sort_by(|a, b| lengths[*b].total_cmp(&lengths[*a]));
    order.truncate(wanted);
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

/// Marks the `wanted` longest columns if each is longer than all others together, else all.
fn longest(squares: &[f64], wanted: usize, marked: &mut [bool]) {
    marked.fill(false);
    let mut least = f64::INFINITY;
    for _ in 0..wanted.min(squares.len()) {
        let unmarked = (0..squares.len()).filter(|n| !marked[*n]);
        if let Some(next) = unmarked.max_by(|a, b| squares[*a].total_cmp(&squares[*b])) {
            marked[next] = true;
            least = squares[next];
        }
    }
    let others = squares.iter().zip(&*marked).filter(|(_, marked)| !**marked);
    if others.map(|(square, _)| square).sum::<f64>() >= least {
        marked.fill(true);
    }
}

/// Pairs that are taken together.
const PAIRS: usize = 4;

/// Every pair with a column that `turns`, once; says whether one was turned. `squares` are of the columns' lengths.
///
/// Pairs are in the order of a tournament: those of one round share no column, so their angles are found side by side.
fn sweep(a: &mut Matrix, squares: &mut [f64], turns: &[bool]) -> bool {
    let size = a.ncols();
    // What is left of a column that depends on others is rounding, and has no direction.
    let nothing = squares.iter().copied().fold(0.0, f64::max) * f64::EPSILON * f64::EPSILON;
    let places = size + size % 2;
    let mut turned = false;
    for round in 0..places.saturating_sub(1) {
        let (mut pairs, mut count) = ([(0, 0); PAIRS], 0);
        for n in 0..places / 2 {
            let (p, q) = pair(round, n, places);
            if q < size && (turns[p] | turns[q]) {
                pairs[count] = (p, q);
                count += 1;
            }
            if count == PAIRS || (n + 1 == places / 2 && count > 0) {
                turned |= turn(a, squares, &pairs[..count], nothing);
                count = 0;
            }
        }
    }
    turned
}

/// Turns pairs that share no column, each to a right angle; says whether one was not at it.
fn turn(a: &mut Matrix, squares: &mut [f64], pairs: &[(usize, usize)], nothing: f64) -> bool {
    let equal = (f64::EPSILON * a.nrows() as f64).powi(2);
    let [mut along, mut xx, mut yy] = [[0.0; PAIRS]; 3];
    for (n, &(p, q)) in pairs.iter().enumerate() {
        along[n] = dots(a.column(p), [a.column(q)])[0];
        (xx[n], yy[n]) = (squares[p], squares[q]);
    }
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
    let mut turned = false;
    for (n, &(p, q)) in pairs.iter().enumerate() {
        let (tangent, cosine) = (tangents[n], cosines[n]);
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
    turned
}

/// A pair of a round of a tournament of an even number: the first stays where it is, the others go round.
fn pair(round: usize, pair: usize, places: usize) -> (usize, usize) {
    let place = |at: usize| match at + round {
        _ if at == 0 => 0,
        further if further >= places => further + 1 - places,
        further => further,
    };
    let (one, other) = (place(pair), place(places - 1 - pair));
    (one.min(other), one.max(other))
}
