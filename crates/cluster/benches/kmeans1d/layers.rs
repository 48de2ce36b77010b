//! The two other ways to the exact optimum, layer by layer: `least[k][i] = min over j of
//! least[k-1][j] + cost(j, i)`.
//!
//! Both find the minima of each row of a totally monotone matrix, `K - 1` times: by halving, O(n
//! log n) per layer, or by SMAWK, O(n). They share prefix sums in plain doubles, without the
//! measures that make the solver exact, which favours them a little.

/// Prefix sums and layers, with memory for `n` values and `k` clusters.
pub(crate) struct Layers {
    sum: Vec<f64>,
    square: Vec<f64>,
    reciprocal: Vec<f64>,
    before: Vec<f64>,
    now: Vec<f64>,
    from: Vec<Vec<u32>>,
    rows: Vec<u32>,
    columns: Vec<u32>,
}

impl Layers {
    pub(crate) fn new(n: usize, k: usize) -> Self {
        Self {
            sum: vec![0.0; n + 1],
            square: vec![0.0; n + 1],
            reciprocal: (0..=n).map(|w| 1.0 / (w.max(1)) as f64).collect(),
            before: vec![0.0; n + 1],
            now: vec![0.0; n + 1],
            from: vec![vec![0; n + 1]; k],
            rows: Vec::with_capacity(2 * n + 2),
            columns: Vec::with_capacity(4 * n + 4),
        }
    }

    /// The least cost, layers solved by halving.
    pub(crate) fn by_halving(&mut self, values: &[f64], clusters: usize) -> f64 {
        self.run(values, clusters, Self::halve)
    }

    /// The least cost, layers solved by SMAWK.
    pub(crate) fn by_smawk(&mut self, values: &[f64], clusters: usize) -> f64 {
        self.run(values, clusters, |layers, k, n| {
            layers.rows.clear();
            layers.rows.extend(k as u32..=n as u32);
            layers.columns.clear();
            layers.columns.extend(k as u32 - 1..n as u32);
            layers.smawk(k, 0..n - k + 1, 0..n - k + 1);
        })
    }

    fn run(&mut self, values: &[f64], clusters: usize, layer: impl Fn(&mut Self, usize, usize)) -> f64 {
        let n = values.len();
        let median = values[n / 2];
        for (i, value) in values.iter().enumerate() {
            let v = value - median;
            self.sum[i + 1] = self.sum[i] + v;
            self.square[i + 1] = self.square[i] + v * v;
        }
        for i in 1..=n {
            self.now[i] = self.cost(0, i);
        }
        for k in 2..=clusters {
            std::mem::swap(&mut self.before, &mut self.now);
            if k == clusters {
                let columns = k - 1..n;
                return self.least(columns, n).0;
            }
            layer(self, k, n);
        }
        self.now[n]
    }

    fn cost(&self, j: usize, i: usize) -> f64 {
        let sum = self.sum[i] - self.sum[j];
        self.square[i] - self.square[j] - sum * sum * self.reciprocal[i - j]
    }

    fn at(&self, j: usize, i: usize) -> f64 {
        if j < i {
            self.before[j] + self.cost(j, i)
        } else {
            f64::INFINITY
        }
    }

    fn least(&self, columns: std::ops::Range<usize>, i: usize) -> (f64, usize) {
        let mut best = (f64::INFINITY, columns.start);
        for j in columns {
            let value = self.before[j] + self.cost(j, i);
            if value < best.0 {
                best = (value, j);
            }
        }
        best
    }

    /// Rows `k..=n`; a row's best column lies between those of its neighbours, and not left of the
    /// one it had a layer before.
    fn halve(&mut self, k: usize, n: usize) {
        let rows = n + 1 - k;
        let mut stride = rows.next_power_of_two();
        while stride > 0 {
            for r in (stride - 1..rows).step_by(2 * stride) {
                let i = k + r;
                let left = if r >= stride {
                    self.from[k - 1][i - stride] as usize
                } else {
                    k - 1
                };
                let left = left.max(self.from[k - 2][i] as usize);
                let right = if r + stride < rows {
                    self.from[k - 1][i + stride] as usize
                } else {
                    i - 1
                };
                let (value, j) = self.least(left..right.min(i - 1).max(left) + 1, i);
                self.now[i] = value;
                self.from[k - 1][i] = j as u32;
            }
            stride /= 2;
        }
    }

    /// Minima of the rows and columns listed at these places of `rows` and `columns`.
    fn smawk(&mut self, k: usize, rows: std::ops::Range<usize>, columns: std::ops::Range<usize>) {
        if rows.is_empty() {
            return;
        }
        let kept = self.columns.len();
        for c in columns {
            let j = self.columns[c];
            while self.columns.len() > kept {
                let row = self.rows[rows.start + self.columns.len() - kept - 1] as usize;
                let last = self.columns[self.columns.len() - 1] as usize;
                if self.at(last, row) <= self.at(j as usize, row) {
                    break;
                }
                self.columns.pop();
            }
            if self.columns.len() - kept < rows.len() {
                self.columns.push(j);
            }
        }
        let (odd, width) = (self.rows.len(), self.columns.len());
        for r in rows.clone().skip(1).step_by(2) {
            self.rows.push(self.rows[r]);
        }
        self.smawk(k, odd..self.rows.len(), kept..width);
        self.rows.truncate(odd);
        let mut c = kept;
        for r in rows.clone().step_by(2) {
            let i = self.rows[r] as usize;
            let right = if r + 1 < rows.end {
                self.from[k - 1][self.rows[r + 1] as usize]
            } else {
                self.columns[width - 1]
            };
            let mut best = (f64::INFINITY, self.columns[c]);
            loop {
                let j = self.columns[c];
                let value = self.at(j as usize, i);
                if value < best.0 {
                    best = (value, j);
                }
                if j >= right || c + 1 == width {
                    break;
                }
                c += 1;
            }
            self.now[i] = best.0;
            self.from[k - 1][i] = best.1;
        }
        self.columns.truncate(kept);
    }
}
