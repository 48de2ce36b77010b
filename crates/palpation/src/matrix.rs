//! Numbers in columns, and the two operations that everything else is made of.

use std::ops::{Index, IndexMut};

/// A matrix of `nrows` times `ncols` numbers, column after column: `D x N` touches, or their `C x N` places on a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl Matrix {
    /// Of its values, column after column.
    ///
    /// # Panics
    ///
    /// If there are not `rows` times `columns` values.
    pub fn new(rows: usize, columns: usize, values: Vec<f64>) -> Self {
        assert_eq!(values.len(), rows * columns, "{rows} x {columns} values");
        Self {
            rows,
            columns,
            values,
        }
    }

    /// Of what a function says of each row and column.
    pub fn from_fn(rows: usize, columns: usize, mut value: impl FnMut(usize, usize) -> f64) -> Self {
        let mut values = Vec::with_capacity(rows * columns);
        for column in 0..columns {
            values.extend((0..rows).map(|row| value(row, column)));
        }
        Self::new(rows, columns, values)
    }

    pub(crate) fn zeros(rows: usize, columns: usize) -> Self {
        Self::new(rows, columns, vec![0.0; rows * columns])
    }

    /// The numbers in a column.
    pub fn nrows(&self) -> usize {
        self.rows
    }

    /// The number of columns.
    pub fn ncols(&self) -> usize {
        self.columns
    }

    /// All values, column after column.
    pub fn as_slice(&self) -> &[f64] {
        &self.values
    }

    /// One column.
    ///
    /// # Panics
    ///
    /// If there is no such column.
    pub fn column(&self, column: usize) -> &[f64] {
        &self.values[column * self.rows..][..self.rows]
    }

    /// The columns, one after another.
    pub fn column_iter(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.rows.max(1))
    }

    pub(crate) fn column_mut(&mut self, column: usize) -> &mut [f64] {
        &mut self.values[column * self.rows..][..self.rows]
    }

    pub(crate) fn column_iter_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        self.values.chunks_exact_mut(self.rows.max(1))
    }

    /// Two columns, `first` before `second`.
    pub(crate) fn two_columns_mut(&mut self, first: usize, second: usize) -> (&mut [f64], &mut [f64]) {
        let (before, after) = self.values.split_at_mut(second * self.rows);
        (
            &mut before[first * self.rows..][..self.rows],
            &mut after[..self.rows],
        )
    }

    /// The columns behind the first `count`, as one run of values.
    pub(crate) fn split_columns_mut(&mut self, count: usize) -> (&mut [f64], &mut [f64]) {
        self.values.split_at_mut(count * self.rows)
    }

    /// A matrix of these columns, in this order.
    ///
    /// # Panics
    ///
    /// If there is no such column.
    pub fn select_columns(&self, columns: &[usize]) -> Self {
        let values = columns.iter().flat_map(|column| self.column(*column));
        Self::new(self.rows, columns.len(), values.copied().collect())
    }

    pub(crate) fn transpose(&self) -> Self {
        Self::from_fn(self.columns, self.rows, |row, column| self[(column, row)])
    }

    /// The mean of the columns.
    pub(crate) fn column_mean(&self) -> Vec<f64> {
        self.column_mean_above(&vec![0.0; self.rows])
    }

    /// The mean of what the columns differ from one.
    pub(crate) fn column_mean_above(&self, base: &[f64]) -> Vec<f64> {
        let mut mean = vec![0.0; self.rows];
        let mut fours = self.values.chunks_exact(4 * self.rows.max(1));
        for four in &mut fours {
            let (ab, cd) = four.split_at(2 * self.rows);
            let ((a, b), (c, d)) = (ab.split_at(self.rows), cd.split_at(self.rows));
            let columns = a.iter().zip(b).zip(c).zip(d);
            for ((sum, base), (((a, b), c), d)) in mean.iter_mut().zip(base).zip(columns) {
                *sum += ((a - base) + (b - base)) + ((c - base) + (d - base));
            }
        }
        for column in fours.remainder().chunks_exact(self.rows.max(1)) {
            for ((sum, base), x) in mean.iter_mut().zip(base).zip(column) {
                *sum += x - base;
            }
        }
        mean.iter_mut().for_each(|x| *x /= self.columns as f64);
        mean
    }

    /// Where the first number is that is not finite, as row and column.
    pub(crate) fn not_finite(&self) -> Option<(usize, usize)> {
        // Whole columns without a branch first: nearly always all is well.
        let whole = |column: &[f64]| column.iter().fold(true, |whole, x| whole & x.is_finite());
        let column = self.column_iter().position(|column| !whole(column))?;
        let row = self.column(column).iter().position(|x| !x.is_finite())?;
        Some((row, column))
    }
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;

    fn index(&self, (row, column): (usize, usize)) -> &f64 {
        &self.values[column * self.rows..][..self.rows][row]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    fn index_mut(&mut self, (row, column): (usize, usize)) -> &mut f64 {
        &mut self.values[column * self.rows..][..self.rows][row]
    }
}

/// Numbers that are added side by side, so that a processor can add several at once; the same on every machine.
const LANES: usize = 8;

/// Scalar products of one vector with several, all of its length.
pub(crate) fn dots<const M: usize>(v: &[f64], others: [&[f64]; M]) -> [f64; M] {
    others.map(|other| product(v, other))
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    let (wide, rest) = a.as_chunks::<LANES>();
    let (others, others_rest) = b[..a.len()].as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in wide.iter().zip(others) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = rest.iter().zip(others_rest).map(|(a, b)| a * b).sum();
    total(sums) + rest
}

/// Scalar product of what one vector differs from another with a third, all of their length.
pub(crate) fn product_above(a: &[f64], base: &[f64], b: &[f64]) -> f64 {
    let (wide, rest) = a.as_chunks::<LANES>();
    let (bases, bases_rest) = base[..a.len()].as_chunks::<LANES>();
    let (others, others_rest) = b[..a.len()].as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for ((a, base), b) in wide.iter().zip(bases).zip(others) {
        for lane in 0..LANES {
            sums[lane] += (a[lane] - base[lane]) * b[lane];
        }
    }
    let rest = rest.iter().zip(bases_rest).zip(others_rest);
    total(sums) + rest.map(|((a, base), b)| (a - base) * b).sum::<f64>()
}

/// Halves on halves: the order that needs no number moved to another lane.
fn total(s: [f64; LANES]) -> f64 {
    let fours: [f64; 4] = std::array::from_fn(|n| s[n] + s[n + 4]);
    let twos: [f64; 2] = std::array::from_fn(|n| fours[n] + fours[n + 2]);
    twos[0] + twos[1]
}

/// The greatest magnitude.
pub(crate) fn greatest(v: &[f64]) -> f64 {
    let (wide, rest) = v.as_chunks::<LANES>();
    let mut most = [0.0; LANES];
    for v in wide {
        for lane in 0..LANES {
            let x = v[lane].abs();
            most[lane] = if x > most[lane] { x } else { most[lane] };
        }
    }
    let rest = rest.iter().map(|x| x.abs());
    most.into_iter().chain(rest).fold(0.0, f64::max)
}

/// Adds several vectors, each times a factor, to one of their length.
pub(crate) fn add_scaled<const M: usize>(sum: &mut [f64], vectors: [&[f64]; M], factors: [f64; M]) {
    let vectors = vectors.map(|vector| &vector[..sum.len()]);
    for (n, sum) in sum.iter_mut().enumerate() {
        let mut added = vectors[0][n] * factors[0];
        for m in 1..M {
            added += vectors[m][n] * factors[m];
        }
        *sum += added;
    }
}

pub(crate) fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

pub(crate) fn norm(v: &[f64]) -> f64 {
    dots(v, [v])[0].sqrt()
}
