//! The cheapest matching of rows with columns.

/// A solver of the assignment problem with all the memory it needs: the Hungarian method by
/// shortest augmenting paths (Jonker and Volgenant 1987), `O(rows^2 * columns)`.
///
/// ```
/// let mut matching = taxel_cluster::Matching::new(2, 3);
/// let costs = [[4.0, 1.0, 3.0], [2.0, 0.0, 5.0]];
/// assert_eq!(matching.solve(2, 3, |row, column| costs[row][column]), [1, 0]);
/// ```
#[derive(Debug)]
pub struct Matching {
    /// Prices of rows and columns, the first of each unused.
    row_price: Vec<f64>,
    column_price: Vec<f64>,
    /// Row that each column has, from 1; 0 for none.
    row_of: Vec<usize>,
    /// Column before each column on the cheapest path to it.
    before: Vec<usize>,
    least: Vec<f64>,
    done: Vec<bool>,
    column_of: Vec<usize>,
}

impl Matching {
    /// Memory for up to so many rows and columns.
    pub fn new(rows: usize, columns: usize) -> Self {
        Self {
            row_price: vec![0.0; rows + 1],
            column_price: vec![0.0; columns + 1],
            row_of: vec![0; columns + 1],
            before: vec![0; columns + 1],
            least: vec![0.0; columns + 1],
            done: vec![false; columns + 1],
            column_of: vec![0; rows],
        }
    }

    /// The column of each row, all different, such that the costs add up to the least there is.
    /// `cost` must be finite.
    ///
    /// Ties are broken the same way on every platform; sums are rounded as doubles are.
    ///
    /// # Panics
    ///
    /// If there are more rows than columns, or more of either than there is memory for.
    pub fn solve(&mut self, rows: usize, columns: usize, cost: impl Fn(usize, usize) -> f64) -> &[usize] {
        assert!(rows <= columns, "{rows} rows and only {columns} columns");
        self.row_price[..=rows].fill(0.0);
        self.column_price[..=columns].fill(0.0);
        self.row_of[..=columns].fill(0);
        for row in 1..=rows {
            self.row_of[0] = row;
            let mut column = self.cheapest_path(columns, &cost);
            while column != 0 {
                let before = self.before[column];
                self.row_of[column] = self.row_of[before];
                column = before;
            }
        }
        for column in 1..=columns {
            if self.row_of[column] > 0 {
                self.column_of[self.row_of[column] - 1] = column - 1;
            }
        }
        &self.column_of[..rows]
    }

    /// Finds the cheapest way from the row in column 0 to a column that is free, and adapts the
    /// prices; returns that column.
    fn cheapest_path(&mut self, columns: usize, cost: &impl Fn(usize, usize) -> f64) -> usize {
        self.least[..=columns].fill(f64::INFINITY);
        self.done[..=columns].fill(false);
        let mut column = 0;
        loop {
            self.done[column] = true;
            let row = self.row_of[column];
            let (mut step, mut next) = (f64::INFINITY, 0);
            for to in (1..=columns).filter(|to| !self.done[*to]) {
                let reduced = cost(row - 1, to - 1) - self.row_price[row] - self.column_price[to];
                if reduced < self.least[to] {
                    self.least[to] = reduced;
                    self.before[to] = column;
                }
                if self.least[to] < step {
                    (step, next) = (self.least[to], to);
                }
            }
            for to in 0..=columns {
                if self.done[to] {
                    self.row_price[self.row_of[to]] += step;
                    self.column_price[to] -= step;
                } else {
                    self.least[to] -= step;
                }
            }
            column = next;
            if self.row_of[column] == 0 {
                return column;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The least sum by trying every matching.
    fn least(costs: &[Vec<f64>], row: usize, used: &mut Vec<bool>) -> f64 {
        if row == costs.len() {
            return 0.0;
        }
        let mut best = f64::INFINITY;
        for column in 0..used.len() {
            if !used[column] {
                used[column] = true;
                best = best.min(costs[row][column] + least(costs, row + 1, used));
                used[column] = false;
            }
        }
        best
    }

    proptest! {
        #[test]
        fn no_matching_is_cheaper(
            (costs, columns) in (1usize..6).prop_flat_map(|columns| (
                prop::collection::vec(prop::collection::vec(0u32..30, columns), 0..=columns),
                Just(columns),
            )),
        ) {
            let costs: Vec<Vec<f64>> = costs.iter().map(|row| row.iter().map(|c| f64::from(*c)).collect()).collect();
            let mut matching = Matching::new(5, 5);
            let found = matching.solve(costs.len(), columns, |r, c| costs[r][c]);
            let sum: f64 = found.iter().enumerate().map(|(r, c)| costs[r][*c]).sum();
            let mut different = found.to_vec();
            different.sort_unstable();
            different.dedup();
            prop_assert_eq!(different.len(), costs.len());
            prop_assert_eq!(sum, least(&costs, 0, &mut vec![false; columns]));
        }
    }
}
