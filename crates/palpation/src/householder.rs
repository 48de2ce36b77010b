//! QR by Householder's reflections (Golub and Van Loan, "Matrix Computations", 5.2).

use crate::matrix::{Matrix, add_scaled, dots, norm};

/// Columns that are made a triangle together, and reflections that go over a column together.
const PANEL: usize = 4;

/// A matrix of at least as many rows as columns, as an orthogonal one times a triangle.
pub(crate) struct Qr {
    /// The triangle above the diagonal; below and on it, the vector of each reflection, of squared length 2.
    packed: Matrix,
    diagonal: Vec<f64>,
    /// Of each whole panel, the scalar products of its vectors.
    products: Vec<[[f64; PANEL]; PANEL]>,
}

impl Qr {
    pub(crate) fn new(mut a: Matrix) -> Self {
        let (rows, columns) = (a.nrows(), a.ncols());
        debug_assert!(rows >= columns, "{rows} x {columns}");
        let mut diagonal = Vec::with_capacity(columns);
        let mut products = Vec::with_capacity(columns / PANEL);
        // A few columns at a time, which stay near while what is done already goes over them.
        for first in (0..columns).step_by(PANEL) {
            let (done, panel) = a.split_columns_mut(first);
            let panel = &mut panel[..PANEL.min(columns - first) * rows];
            for (n, products) in products.iter().enumerate() {
                let block = Block::new(done, rows, n, products);
                panel
                    .chunks_exact_mut(rows)
                    .for_each(|column| block.reflect(column, false));
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
            if panel.len() == PANEL * rows {
                let vector = |n: usize, from: usize| &panel[n * rows + first + from..(n + 1) * rows];
                let mut of_panel = [[0.0; PANEL]; PANEL];
                for (n, m) in (1..PANEL).flat_map(|n| (0..n).map(move |m| (n, m))) {
                    let product = dots(vector(n, n), [vector(m, n)])[0];
                    (of_panel[n][m], of_panel[m][n]) = (product, product);
                }
                products.push(of_panel);
            }
        }
        Self {
            packed: a,
            diagonal,
            products,
        }
    }

    /// The triangle turned over, square: a lower one.
    pub(crate) fn lower(&self) -> Matrix {
        let size = self.diagonal.len();
        let mut lower = Matrix::zeros(size, size);
        for (n, column) in lower.column_iter_mut().enumerate() {
            column[n] = self.diagonal[n];
            for (to, row) in column[n + 1..].iter_mut().zip(n + 1..) {
                *to = self.packed[(n, row)];
            }
        }
        lower
    }

    /// The orthogonal matrix times the first columns of a matrix of as many rows as the triangle has.
    pub(crate) fn q_times(&self, a: &Matrix, columns: usize) -> Matrix {
        let rows = self.packed.nrows();
        let mut product = Matrix::zeros(rows, columns);
        for (long, short) in product.column_iter_mut().zip(a.column_iter()) {
            long[..short.len()].copy_from_slice(short);
        }
        for n in (self.products.len() * PANEL..self.diagonal.len()).rev() {
            let vector = &self.packed.column(n)[n..];
            reflect(vector, product.split_columns_mut(0).1, rows, n);
        }
        for (n, products) in self.products.iter().enumerate().rev() {
            let block = Block::new(self.packed.as_slice(), rows, n, products);
            product
                .column_iter_mut()
                .for_each(|column| block.reflect(column, true));
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

/// The reflections of one panel (Schreiber and Van Loan 1989): a column is read and written once for all of them.
struct Block<'a> {
    first: usize,
    /// Of each vector, what is within the panel's first rows, and what is below them.
    heads: [[f64; PANEL]; PANEL],
    tails: [&'a [f64]; PANEL],
    products: &'a [[f64; PANEL]; PANEL],
}

impl<'a> Block<'a> {
    fn new(packed: &'a [f64], rows: usize, panel: usize, products: &'a [[f64; PANEL]; PANEL]) -> Self {
        let first = panel * PANEL;
        let vector = |n: usize| &packed[(first + n) * rows + first..][..rows - first];
        let head = |n: usize, row: usize| if row < n { 0.0 } else { vector(n)[row] };
        Self {
            first,
            heads: std::array::from_fn(|n| std::array::from_fn(|row| head(n, row))),
            tails: std::array::from_fn(|n| &vector(n)[PANEL..]),
            products,
        }
    }

    /// Reflects a column by each vector, or by each from the last on.
    fn reflect(&self, column: &mut [f64], from_last: bool) {
        let (head, tail) = column[self.first..].split_at_mut(PANEL);
        let mut along = dots(tail, self.tails);
        for (along, vector) in along.iter_mut().zip(&self.heads) {
            *along += vector.iter().zip(&*head).map(|(v, x)| v * x).sum::<f64>();
        }
        // Each finds the column as those before it have left it.
        let at = |n: usize| if from_last { PANEL - 1 - n } else { n };
        for n in 1..PANEL {
            for before in 0..n {
                along[at(n)] -= self.products[at(n)][at(before)] * along[at(before)];
            }
        }
        let less = along.map(|along| -along);
        for (vector, along) in self.heads.iter().zip(less) {
            head.iter_mut().zip(vector).for_each(|(x, v)| *x += v * along);
        }
        add_scaled(tail, self.tails, less);
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
