//! The cheapest partition into any number of clusters, when each cluster costs a penalty.

use super::cost::Cost;

/// One pass and its memory.
#[derive(Debug)]
pub(super) struct Pass {
    /// Total cost of the first `i` points, penalties included, less [`Cost::offset`].
    g: Vec<f64>,
    /// The same with the offset: it never falls with `i`, up to rounding.
    f: Vec<f64>,
    /// First point of the last cluster of the first `i` points.
    from: Vec<u32>,
}

impl Pass {
    pub(super) fn new(points: usize) -> Self {
        Self {
            g: vec![0.0; points + 1],
            f: vec![0.0; points + 1],
            from: vec![0; points + 1],
        }
    }

    /// Finds the cheapest partition and writes the starts of its clusters.
    ///
    /// Row `i` takes its minimum over columns `j < i`, where the last cluster begins. Three facts
    /// keep this near linear: the best column never moves left as `i` grows; a column whose own
    /// total exceeds a total already found for `i` cannot be best; and within a block of rows the
    /// columns before the block can be searched by halving, since their totals are final.
    pub(super) fn run<C: Cost>(&mut self, cost: &C, penalty: f64, block: usize, starts: &mut Vec<u32>) {
        let n = cost.points();
        let slack = cost.slack();
        self.g[0] = 0.0;
        self.f[0] = 0.0;
        let (mut first, mut last) = (0, 0);
        let mut begin = 0;
        while begin < n {
            let end = (begin + block).min(n);
            let bound = cost.at(&self.g, first, end) + cost.offset(end) + slack;
            while last < begin && self.f[last + 1] < bound {
                last += 1;
            }
            if end - begin == 1 {
                let (value, from) = cost.least(&self.g, first, last, end);
                self.settle(cost, end, value + penalty, from);
            } else {
                self.columns_before(cost, begin, end, first, last);
                self.columns_within(cost, begin, end, penalty);
            }
            first = self.from[end] as usize;
            last = last.max(first);
            begin = end;
        }
        self.walk_back(n, starts);
    }

    /// The best of the columns `first..=last`, which lie before the block, for each row of `begin +
    /// 1..=end`; written to `g` and `from`.
    fn columns_before<C: Cost>(&mut self, cost: &C, begin: usize, end: usize, first: usize, last: usize) {
        let (done, open) = self.g.split_at_mut(begin + 1);
        let from = &mut self.from[begin + 1..=end];
        let rows = end - begin;
        let mut row = |r: usize, left: usize, right: usize, from: &mut [u32]| {
            let (value, j) = cost.least(done, left, right, begin + 1 + r);
            open[r] = value;
            from[r] = j as u32;
        };
        row(rows - 1, first, last, from);
        let mut stride = rows.next_power_of_two() / 2;
        while stride > 0 {
            for r in (stride - 1..rows - 1).step_by(2 * stride) {
                let left = if r >= stride {
                    from[r - stride] as usize
                } else {
                    first
                };
                let right = from[(r + stride).min(rows - 1)] as usize;
                row(r, left, right.max(left), from);
            }
            stride /= 2;
        }
    }

    /// Adds the columns within the block, row by row.
    fn columns_within<C: Cost>(&mut self, cost: &C, begin: usize, end: usize, penalty: f64) {
        let slack = cost.slack();
        let mut first = begin + 1;
        let mut last = begin;
        for i in begin + 1..=end {
            let (mut value, mut from) = (self.g[i], self.from[i] as usize);
            let bound = value + cost.offset(i) + slack;
            while last + 1 < i && self.f[last + 1] < bound {
                last += 1;
            }
            if last >= first {
                let (inside, j) = cost.least(&self.g, first, last, i);
                if inside < value {
                    (value, from) = (inside, j);
                    first = j;
                }
            }
            self.settle(cost, i, value + penalty, from);
        }
    }

    fn settle<C: Cost>(&mut self, cost: &C, i: usize, g: f64, from: usize) {
        self.g[i] = g;
        self.f[i] = g + cost.offset(i);
        self.from[i] = from as u32;
    }

    /// Writes the starts of the clusters of the first `n` points, ascending.
    fn walk_back(&self, n: usize, starts: &mut Vec<u32>) {
        starts.clear();
        let mut i = n;
        while i > 0 {
            i = self.from[i] as usize;
            starts.push(i as u32);
        }
        starts.reverse();
    }
}
