//! Two plain classifiers, which know nothing of touch.

/// The class of the nearest example, by Euclidean distance, the first among equals.
pub(crate) fn nearest(examples: &[(&[f64], usize)], unknown: &[f64]) -> usize {
    let mut nearest = (f64::INFINITY, 0);
    for (example, class) in examples {
        let distance = example.iter().zip(unknown).map(|(a, b)| (a - b) * (a - b)).sum();
        if distance < nearest.0 {
            nearest = (distance, *class);
        }
    }
    nearest.1
}

const STEPS: u32 = 300;
/// Weight of the penalty on the coefficients' squares.
const PENALTY: f64 = 1e-4;

/// Multinomial logistic regression with a small penalty, fitted by Nesterov's accelerated gradient.
///
/// Coefficients are sums of examples, and those sums' weights are what is fitted: there are far
/// fewer examples than pixels. Examples are centred and scaled to a mean length of 1.
pub(crate) struct Logistic {
    classes: usize,
    mean: Vec<f64>,
    scale: f64,
    examples: Vec<Vec<f64>>,
    /// For each example its weight for each class.
    weights: Vec<f64>,
}

impl Logistic {
    pub(crate) fn learn(examples: &[(&[f64], usize)], classes: usize) -> Self {
        let count = examples.len() as f64;
        let length = |v: &[f64]| dot(v, v).sqrt();
        let scale = count
            / examples
                .iter()
                .map(|(e, _)| length(e))
                .sum::<f64>()
                .max(f64::MIN_POSITIVE);
        let mut mean = vec![0.0; examples.first().map_or(0, |(e, _)| e.len())];
        for (example, _) in examples {
            mean.iter_mut().zip(*example).for_each(|(m, v)| *m += v / count);
        }
        let mut model = Self {
            classes,
            mean,
            scale,
            examples: Vec::new(),
            weights: vec![0.0; examples.len() * classes],
        };
        model.examples = examples.iter().map(|(e, _)| model.centred(e)).collect();
        model.fit(&examples.iter().map(|(_, class)| *class).collect::<Vec<_>>());
        model
    }

    fn centred(&self, picture: &[f64]) -> Vec<f64> {
        let centred = picture.iter().zip(&self.mean).map(|(v, m)| (v - m) * self.scale);
        centred.collect()
    }

    fn fit(&mut self, class: &[usize]) {
        let (n, classes) = (class.len(), self.classes);
        let products: Vec<f64> = (0..n * n)
            .map(|at| dot(&self.examples[at / n], &self.examples[at % n]))
            .collect();
        // The curvature is at most half the greatest eigenvalue, which is at most the trace.
        let trace: f64 = (0..n).map(|i| products[i * n + i]).sum();
        let step = 1.0 / (0.5 * greatest_eigenvalue(&products, n).min(trace) / n as f64 + PENALTY);
        let mut ahead = self.weights.clone();
        let mut scores = vec![0.0; classes];
        for t in 0..STEPS {
            let mut next = ahead.clone();
            for (i, row) in products.chunks_exact(n).enumerate() {
                score(row, &ahead, &mut scores);
                let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                scores.iter_mut().for_each(|s| *s = (*s - most).exp());
                let total: f64 = scores.iter().sum();
                for (k, s) in scores.iter().enumerate() {
                    let wanted = f64::from(u8::from(class[i] == k));
                    let at = i * classes + k;
                    next[at] -= step * ((s / total - wanted) / n as f64 + PENALTY * ahead[at]);
                }
            }
            let onward = f64::from(t) / f64::from(t + 3);
            for ((ahead, old), new) in ahead.iter_mut().zip(&mut self.weights).zip(next) {
                *ahead = new + onward * (new - *old);
                *old = new;
            }
        }
    }

    /// The most probable class.
    pub(crate) fn class(&self, unknown: &[f64]) -> usize {
        let unknown = self.centred(unknown);
        let products: Vec<f64> = self.examples.iter().map(|e| dot(e, &unknown)).collect();
        let mut scores = vec![0.0; self.classes];
        score(&products, &self.weights, &mut scores);
        let mut best = 0;
        for (class, score) in scores.iter().enumerate() {
            if *score > scores[best] {
                best = class;
            }
        }
        best
    }
}

/// Of each class, what the examples' weights come to for something with these products with the examples.
fn score(products: &[f64], weights: &[f64], scores: &mut [f64]) {
    scores.fill(0.0);
    for (product, weights) in products.iter().zip(weights.chunks_exact(scores.len())) {
        scores
            .iter_mut()
            .zip(weights)
            .for_each(|(s, w)| *s += product * w);
    }
}

/// Of a symmetric matrix without negative eigenvalues, by powers; a little too large rather than too small.
fn greatest_eigenvalue(matrix: &[f64], n: usize) -> f64 {
    let mut vector: Vec<f64> = (0..n).map(|i| 1.0 + (i % 7) as f64).collect();
    let mut value = 0.0;
    for _ in 0..50 {
        let next: Vec<f64> = matrix.chunks_exact(n).map(|row| dot(row, &vector)).collect();
        value = dot(&next, &next).sqrt();
        if value == 0.0 {
            return 0.0;
        }
        vector = next.iter().map(|v| v / value).collect();
    }
    1.05 * value
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, ra) = a.as_chunks::<4>();
    let (b4, rb) = b.as_chunks::<4>();
    for (a, b) in a4.iter().zip(b4) {
        for lane in 0..4 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f64>() + ra.iter().zip(rb).map(|(a, b)| a * b).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_on_one_side_is_of_that_class() {
        let corners = [[0.0, 0.0, 1.0], [9.0, 0.0, 1.0], [0.0, 9.0, 1.0]];
        let examples: Vec<(&[f64], usize)> = corners.iter().enumerate().map(|(n, c)| (&c[..], n)).collect();
        let logistic = Logistic::learn(&examples, 3);
        for (unknown, want) in [([1.0, 2.0, 1.0], 0), ([8.0, 1.0, 1.0], 1), ([2.0, 7.0, 1.0], 2)] {
            assert_eq!(
                (nearest(&examples, &unknown), logistic.class(&unknown)),
                (want, want)
            );
        }
    }

    #[test]
    fn a_border_is_learned_where_the_nearest_example_is_misled() {
        // Of two numbers only the first tells; there are few examples, and one lies far along the second.
        let left = [[0.0, 0.0], [0.0, 10.0], [0.0, 20.0], [0.0, 30.0]];
        let right = [[2.0, 0.0], [2.0, 10.0], [2.0, 20.0], [2.0, 31.0]];
        let examples: Vec<(&[f64], usize)> = (left.iter().map(|e| (&e[..], 0)))
            .chain(right.iter().map(|e| (&e[..], 1)))
            .collect();
        let unknown = [0.2, 34.0];
        assert_eq!(nearest(&examples, &unknown), 1);
        assert_eq!(Logistic::learn(&examples, 2).class(&unknown), 0);
    }
}
