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

    /// Adds a squeeze.
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
            let ahead: Vec<f64> = s.chunks_exact(n).map(|row| dot(row, &direction)).collect();
            let curvature = dot(&direction, &ahead);
            // What is left is rounding.
            if squared > first * 1e-20 && curvature > squared * 1e-12 {
                let step = squared / curvature;
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

#[cfg(test)]
mod tests {
    use super::*;

    const X: [[f64; 4]; 12] = [
        [0.346, 58.216, 2.033, -10.909],
        [0.905, 54.464, 1.946, -5.257],
        [0.365, 52.941, 2.003, -5.36],
        [-0.736, 48.371, 1.952, -5.203],
        [0.04, 47.075, 1.922, -7.772],
        [0.008, 47.244, 2.129, -3.98],
        [-2.711, 31.11, 1.983, -8.267],
        [0.214, 52.173, 2.212, -10.336],
        [-0.378, 70.428, 2.065, -5.011],
        [-0.514, 33.519, 2.017, -6.673],
        [-1.227, 43.168, 1.993, -9.834],
        [-0.098, 50.955, 2.004, -8.519],
    ];
    const Y: [f64; 12] = [
        84.09, 77.69, 74.27, 62.95, 72.8, 68.2, 58.87, 77.02, 84.05, 62.15, 62.6, 72.53,
    ];

    /// What `PLSRegression(k, scale=True)` of scikit-learn 1.9.1 says of two places, for k from 1 to 4.
    const SCIKIT_LEARN: [[f64; 2]; 4] = [
        [73.07213330070319, 71.73980742831897],
        [70.83424340559134, 76.13996404221005],
        [70.3565195508211, 77.26940108359902],
        [70.10581924188067, 77.38203416953556],
    ];

    #[test]
    fn each_number_of_components_gives_what_scikit_learn_gives() {
        let mut sums = Moments::new(4);
        X.iter().zip(Y).for_each(|(x, y)| sums.add(x, y));
        let places = [[0.5, 45.0, 2.05, -6.0], [-1.0, 60.0, 1.9, -9.0]];
        for (line, wanted) in sums.fit(&[0, 1, 2, 3], 4).iter().zip(SCIKIT_LEARN) {
            let found = places.map(|place| line.at(&place, &[0, 1, 2, 3]));
            let off = (0..2).map(|n| (found[n] - wanted[n]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-8, "{found:?}, and {wanted:?} was wanted");
        }
    }

    #[test]
    fn what_is_left_out_is_as_if_it_had_never_been_added() {
        let (mut all, mut part, mut rest) = (Moments::new(4), Moments::new(4), Moments::new(4));
        for (n, (x, y)) in X.iter().zip(Y).enumerate() {
            all.add(x, y);
            if n % 3 == 0 {
                part.add(x, y)
            } else {
                rest.add(x, y)
            }
        }
        all.merge(&part, -1.0);
        let (one, other) = (all.fit(&[0, 2, 3], 2), rest.fit(&[0, 2, 3], 2));
        for (one, other) in one.iter().zip(&other) {
            assert!((one.offset - other.offset).abs() < 1e-6, "{one:?} {other:?}");
        }
    }

    #[test]
    fn features_that_say_nothing_have_no_weight_and_repeated_ones_do_no_harm() {
        let mut sums = Moments::new(3);
        (0..9).for_each(|n| sums.add(&[f64::from(n), 7.0, f64::from(n)], 3.0 * f64::from(n)));
        for line in sums.fit(&[0, 1, 2], 6) {
            assert!(
                (line.at(&[4.5, 7.0, 4.5], &[0, 1, 2]) - 13.5).abs() < 1e-9 && line.weights[1] == 0.0,
                "{line:?}"
            );
        }
        for line in sums.fit(&[1], 3) {
            assert!((line.offset, line.weights[0]) == (12.0, 0.0), "{line:?}");
        }
    }
}
