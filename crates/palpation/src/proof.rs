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
        map,
        order: &order,
        clusters,
        bound: vec![0.0; n + 1],
        sums: Matrix::zeros(map.nrows(), clusters),
        counts: vec![0; clusters],
        labels: vec![0; n],
        best: Vec::new(),
        least: 0.0,
        last: n,
        left: branches,
    };
    // The last m touches of the order: as good as any guess, what they cost in the categories that were found.
    for m in clusters + 1..=n {
        search.last = m;
        search.best.clear();
        let guess = if m == n {
            cost
        } else {
            within(map, &order[n - m..], labels, clusters)
        };
        search.least = guess;
        search.place(n - m, 0.0, 0);
        if search.left == 0 {
            return (None, false);
        }
        search.bound[m] = search.least * (1.0 - 8.0 * EQUAL);
    }
    let found = (!search.best.is_empty()).then_some(search.best);
    (found, true)
}

struct Search<'a> {
    map: &'a Matrix,
    order: &'a [usize],
    clusters: usize,
    /// What the last m touches cost at least.
    bound: Vec<f64>,
    sums: Matrix,
    counts: Vec<usize>,
    labels: Vec<usize>,
    best: Vec<usize>,
    least: f64,
    last: usize,
    /// Branches until it gives up.
    left: u64,
}

impl Search<'_> {
    /// Gives the touch at this place of the order, and those after it, to categories; `used` have touches.
    fn place(&mut self, at: usize, cost: f64, used: usize) {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 {
            return;
        }
        let Some(&touch) = self.order.get(at) else {
            self.least = cost;
            self.best.clone_from(&self.labels);
            return;
        };
        let left = self.order.len() - at - 1;
        let dimensions = self.map.nrows();
        for k in 0..self.clusters.min(used + 1) {
            let count = self.counts[k] as f64;
            let mut added = 0.0;
            for d in 0..dimensions {
                let off = if self.counts[k] > 0 {
                    self.map[(d, touch)] - self.sums[(d, k)] / count
                } else {
                    0.0
                };
                added += off * off;
            }
            let next = cost + added * count / (count + 1.0);
            if next + self.bound[left] >= self.least * (1.0 - EQUAL) {
                continue;
            }
            self.counts[k] += 1;
            for d in 0..dimensions {
                self.sums[(d, k)] += self.map[(d, touch)];
            }
            self.labels[touch] = k;
            self.place(at + 1, next, used.max(k + 1));
            self.counts[k] -= 1;
            for d in 0..dimensions {
                self.sums[(d, k)] -= self.map[(d, touch)];
            }
        }
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

/// What some touches cost in the categories that they are in.
fn within(map: &Matrix, touches: &[usize], labels: &[usize], clusters: usize) -> f64 {
    let cost = |k: usize| {
        let own: Vec<usize> = touches.iter().copied().filter(|t| labels[*t] == k).collect();
        let own = map.select_columns(&own);
        let mean = own.column_mean();
        own.column_iter()
            .map(|touch| squared_distance(touch, &mean))
            .sum::<f64>()
    };
    // A hair more, so that the same partition is found to be the least.
    (0..clusters).map(cost).sum::<f64>() * (1.0 + 4.0 * EQUAL)
}
