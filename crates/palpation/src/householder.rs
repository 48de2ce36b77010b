//! QR by Householder's reflections (Golub and Van Loan, "Matrix Computations", 5.2).

use crate::matrix::{Matrix, dots, norm};

/// Columns that are made a triangle together.
const PANEL: usize = 4;

/// A matrix of at least as many rows as columns, as an orthogonal one times a triangle.
pub(crate) struct Qr {
    /// The triangle above the diagonal; below and on it, the vector of each reflection, of squared length 2.
    packed: Matrix,
    diagonal: Vec<f64>,
}

impl Qr {
    pub(crate) fn new(mut a: Matrix) -> Self {
        let (rows, columns) = (a.nrows(), a.ncols());
        debug_assert!(rows >= columns, "{rows} x {columns}");
        let mut diagonal = Vec::with_capacity(columns);
        // A few columns at a time, which stay near while what is done already goes over them.
        for first in (0..columns).step_by(PANEL) {
            let (done, panel) = a.split_columns_mut(first);
            let panel = &mut panel[..PANEL.min(columns - first) * rows];
            for (n, vector) in done.chunks_exact(rows).enumerate() {
                reflect(&vector[n..], panel, rows, n);
            }
            for n in first..first + panel.len() / rows {
                let (done, left) = panel.split_at_mut((n + 1 - first) * rows);
                let vector = &mut done[(n - first) * rows + n..];
                let length = norm(vector);
                let x0 = vector[0];
                diagonal.push(-length.copysign(x0));
                // v = x + sign(x0) |x| e0, made so long that a reflection is x - v (v x); of nothing, it is nothing.
                vector[0] += length.copysign(x0);
                let scale = (length * vector[0].abs()).sqrt();
                if scale > 0.0 {
                    let scale = scale.recip();
                    vector.iter_mut().for_each(|x| *x *= scale);
                    reflect(vector, left, rows, n);
                } else {
                    vector.fill(0.0);
                }
            }
        }
        Self { packed: a, diagonal }
    }

    /// The triangle, square.
    pub(crate) fn r(&self) -> Matrix {
        let size = self.diagonal.len();
        Matrix::from_fn(size, size, |row, column| match row.cmp(&column) {
            std::cmp::Ordering::Less => self.packed[(row, column)],
            std::cmp::Ordering::Equal => self.diagonal[row],
            std::cmp::Ordering::Greater => 0.0,
        })
    }

    /// The orthogonal matrix times the first columns of a matrix of as many rows as the triangle has.
    pub(crate) fn q_times(&self, a: &Matrix, columns: usize) -> Matrix {
        let rows = self.packed.nrows();
        let mut product = Matrix::zeros(rows, columns);
        for (long, short) in product.column_iter_mut().zip(a.column_iter()) {
            long[..short.len()].copy_from_slice(short);
        }
        for n in (0..self.diagonal.len()).rev() {
            let vector = &self.packed.column(n)[n..];
            reflect(vector, product.split_columns_mut(0).1, rows, n);
        }
        product
    }

    /// The columns of the orthogonal matrix that the triangle combines.
    pub(crate) fn q(&self) -> Matrix {
        let size = self.diagonal.len();
        let identity = Matrix::from_fn(size, size, |row, column| f64::from(u8::from(row == column)));
        self.q_times(&identity, size)
    }
}

/// Reflects columns of `rows` numbers, from row `from` on: `x - v (v x)`.
fn reflect(vector: &[f64], columns: &mut [f64], rows: usize, from: usize) {
    let mut fours = columns.chunks_exact_mut(4 * rows);
    for four in &mut fours {
        let (ab, cd) = four.split_at_mut(2 * rows);
        let ((a, b), (c, d)) = (ab.split_at_mut(rows), cd.split_at_mut(rows));
        reflect_each(
            vector,
            [&mut a[from..], &mut b[from..], &mut c[from..], &mut d[from..]],
        );
    }
    let mut twos = fours.into_remainder().chunks_exact_mut(2 * rows);
    for two in &mut twos {
        let (a, b) = two.split_at_mut(rows);
        reflect_each(vector, [&mut a[from..], &mut b[from..]]);
    }
    for one in twos.into_remainder().chunks_exact_mut(rows) {
        reflect_each(vector, [&mut one[from..]]);
    }
}

fn reflect_each<const M: usize>(vector: &[f64], mut columns: [&mut [f64]; M]) {
    let along = dots(vector, columns.each_ref().map(|column| &**column));
    for (column, along) in columns.iter_mut().zip(along) {
        for (x, v) in column.iter_mut().zip(vector) {
            *x -= v * along;
        }
    }
}
