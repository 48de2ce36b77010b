//! Partial least squares from sums, so that leaving squeezes out costs no second look at them.

/// Sums over squeezes of features and of the place: all that partial least squares needs.
#[derive(Debug, Clone)]
pub(crate) struct Moments {
    features: usize,
    count: f64,
    x: Vec<f64>,
    y: f64,
    /// Row by row, the lower half and the diagonal.
    xx: Vec<f64>,
    xy: Vec<f64>,
}

/// A straight line: the place is `offset` and the sum of `weights` times the picked features.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Line {
    pub(crate) weights: Vec<f64>,
    pub(crate) offset: f64,
}

impl Line {
    pub(crate) fn at(&self, features: &[f64], picks: &[usize]) -> f64 {
        let terms = self
            .weights
            .iter()
            .zip(picks)
            .map(|(weight, pick)| weight * features[*pick]);
        self.offset + terms.sum::<f64>()
    }
}

impl Moments {
    pub(crate) fn new(features: usize) -> Self {
        Self {
            features,
            count: 0.0,
            x: vec![0.0; features],
            y: 0.0,
            xx: vec![0.0; features * features],
            xy: vec![0.0; features],
        }
    }

    /// Adds a squeeze. Features and places should be about their mean, or digits are lost.
    pub(crate) fn add(&mut self, x: &[f64], y: f64) {
        self.count += 1.0;
        self.y += y;
        for (row, a) in x.iter().enumerate() {
            self.x[row] += a;
            self.xy[row] += a * y;
            let sums = &mut self.xx[row * self.features..][..=row];
            sums.iter_mut().zip(x).for_each(|(sum, b)| *sum += a * b);
        }
    }

    /// Adds (`sign` 1) or takes away (-1) the squeezes of another.
    pub(crate) fn merge(&mut self, other: &Self, sign: f64) {
        self.count += sign * other.count;
        self.y += sign * other.y;
        let pairs = [
            (&mut self.x, &other.x),
            (&mut self.xy, &other.xy),
            (&mut self.xx, &other.xx),
        ];
        for (sums, others) in pairs {
            sums.iter_mut()
                .zip(others)
                .for_each(|(sum, other)| *sum += sign * other);
        }
    }

    /// Partial least squares of the picked features, standardised, with 1, 2, .. `components` components.
    ///
    /// The estimate with k components lies in the Krylov space of the correlations (Helland 1988), and so is what k steps of
    /// conjugate gradients from 0 give. Where the features have fewer components, the last are as the one before.
    pub(crate) fn fit(&self, picks: &[usize], components: usize) -> Vec<Line> {
        let (n, count) = (picks.len(), self.count);
        let mean: Vec<f64> = picks.iter().map(|p| self.x[*p] / count).collect();
        let mean_y = self.y / count;
        let product = |a: usize, b: usize| self.xx[a.max(b) * self.features + a.min(b)] / count;
        let spread: Vec<f64> = (0..n)
            .map(|a| (product(picks[a], picks[a]) - mean[a] * mean[a]).max(0.0).sqrt())
            // A feature that is always the same says nothing.
            .map(|s| if s > 1e-9 { s } else { f64::INFINITY })
            .collect();
        let mut s = vec![0.0; n * n];
        for a in 0..n {
            for b in 0..=a {
                let r = (product(picks[a], picks[b]) - mean[a] * mean[b]) / (spread[a] * spread[b]);
                (s[a * n + b], s[b * n + a]) = (r, r);
            }
        }
        let mut residual: Vec<f64> = (0..n)
            .map(|a| (self.xy[picks[a]] / count - mean[a] * mean_y) / spread[a])
            .collect();
        let mut direction = residual.clone();
        let mut weights = vec![0.0; n];
        let mut squared = dot(&residual, &residual);
        let first = squared;
        let mut lines = Vec::with_capacity(components);
        for _ in 0..components {
            if squared > first * 1e-20 {
                let ahead: Vec<f64> = s.chunks_exact(n).map(|row| dot(row, &direction)).collect();
                let step = squared / dot(&direction, &ahead).max(f64::MIN_POSITIVE);
                for a in 0..n {
                    weights[a] += step * direction[a];
                    residual[a] -= step * ahead[a];
                }
                let next = dot(&residual, &residual);
                for a in 0..n {
                    direction[a] = residual[a] + next / squared * direction[a];
                }
                squared = next;
            }
            let scaled: Vec<f64> = weights.iter().zip(&spread).map(|(w, s)| w / s).collect();
            lines.push(Line {
                offset: mean_y - dot(&scaled, &mean),
                weights: scaled,
            });
        }
        lines
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
