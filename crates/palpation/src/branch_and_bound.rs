//! The optimum, proved: a repeated branch and bound (Brusco, "A repetitive branch-and-bound procedure for minimum
//! within-cluster sums of squares partitioning", Psychometrika 71, 2006).
//!
//! Touches are put in an order and given to categories one after another. What is left of them costs at least what it
//! costs by itself (as few touches as categories: nothing), so once the last `m` are solved, they bound every branch that
//! still has `m` to place.

use crate::matrix::{Matrix, squared_distance};

/// Costs that agree to this share are equal: rounding.
const EQUAL: f64 = 1e-12;

/// Looks for categories that cost less than `cost`, that of `labels`: such labels if there are, and whether those, or
/// else `labels`, are known to be the optimum. It gives up after some number of `branches`.
pub(crate) fn least(
    map: &Matrix,
    clusters: usize,
    labels: &[usize],
    cost: f64,
    branches: u64,
) -> (Option<Vec<usize>>, bool) {
    let order = order(map, labels, clusters);
    let n = order.len();
    let mut search = Search {
        touches: map.select_columns(&order),
        bound: vec![0.0; n + 1],
        sums: Matrix::zeros(map.nrows(), clusters),
        before: Matrix::zeros(map.nrows(), n),
        counts: vec![0.0; clusters],
        labels: vec![0; n],
        best: Vec::new(),
        least: 0.0,
        left: branches,
    };
    // The last m touches of the order: as good as any guess, what they cost in the categories that were found.
    let mut guess = Search {
        sums: Matrix::zeros(map.nrows(), clusters),
        ..search.clone()
    };
    let mut guessed = 0.0;
    for m in 1..=n {
        let (at, label) = (n - m, labels[order[n - m]]);
        guessed += guess.adds(at, label);
        guess.put(at, label);
        if m <= clusters {
            continue;
        }
        search.best.clear();
        // A hair more, so that the same partition is found to be the least.
        search.least = if m == n {
            cost
        } else {
            guessed * (1.0 + 4.0 * EQUAL)
        };
        search.place(at, 0.0, 0);
        if search.left == 0 {
            return (None, false);
        }
        search.bound[m] = search.least * (1.0 - 8.0 * EQUAL);
    }
    let found = (!search.best.is_empty()).then(|| {
        let mut labels = vec![0; n];
        for (touch, label) in order.iter().zip(&search.best) {
            labels[*touch] = *label;
        }
        labels
    });
    (found, true)
}

#[derive(Clone)]
struct Search {
    /// In their order.
    touches: Matrix,
    /// What the last m touches cost at least.
    bound: Vec<f64>,
    /// Of the touches in each category, and of those in a touch's category before it.
    sums: Matrix,
    before: Matrix,
    counts: Vec<f64>,
    labels: Vec<usize>,
    best: Vec<usize>,
    least: f64,
    /// Branches until it gives up.
    left: u64,
}

impl Search {
    /// Gives the touch at this place of the order, and those after it, to categories; `used` have touches.
    fn place(&mut self, at: usize, cost: f64, used: usize) {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 {
            return;
        }
        if at == self.labels.len() {
            self.least = cost;
            self.best.clone_from(&self.labels);
            return;
        }
        let left = self.labels.len() - at - 1;
        for k in 0..self.counts.len().min(used + 1) {
            let next = cost + self.adds(at, k);
            if next + self.bound[left] >= self.least * (1.0 - EQUAL) {
                continue;
            }
            self.put(at, k);
            self.place(at + 1, next, used.max(k + 1));
            self.counts[k] -= 1.0;
            self.sums.column_mut(k).copy_from_slice(self.before.column(at));
        }
    }

    /// What a touch adds to the cost of a category.
    fn adds(&self, at: usize, k: usize) -> f64 {
        let count = self.counts[k];
        if count == 0.0 {
            return 0.0;
        }
        let places = self.touches.column(at).iter().zip(self.sums.column(k));
        let squares = places.map(|(x, sum)| (x * count - sum) * (x * count - sum));
        squares.sum::<f64>() / (count * (count + 1.0))
    }

    fn put(&mut self, at: usize, k: usize) {
        let sum = self.sums.column_mut(k);
        self.before.column_mut(at).copy_from_slice(sum);
        let touch = self.touches.column(at);
        sum.iter_mut().zip(touch).for_each(|(sum, x)| *sum += x);
        self.counts[k] += 1.0;
        self.labels[at] = k;
    }
}

/// Touches in an order that takes one of each category in turn, the outermost of each last: then few branches are open
/// when the bound begins to bite.
fn order(map: &Matrix, labels: &[usize], clusters: usize) -> Vec<usize> {
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); clusters];
    for (touch, label) in labels.iter().enumerate() {
        members[*label].push(touch);
    }
    for members in &mut members {
        let mean = map.select_columns(members).column_mean();
        members.sort_by(|a, b| {
            let distance = |m: usize| squared_distance(map.column(m), &mean);
            distance(*b).total_cmp(&distance(*a))
        });
    }
    let most = members.iter().map(Vec::len).max().unwrap_or(0);
    let mut order: Vec<usize> = (0..most)
        .flat_map(|turn| members.iter().filter_map(move |m| m.get(turn).copied()))
        .collect();
    order.reverse();
    order
}
