//! The best of 64 k-means++ starts, each followed by Lloyd's iterations to the end.

/// Squared error of the best of 64 runs; the same for the same points and seed.
pub(crate) fn best_of_restarts(pixels: &[[u16; 2]], clusters: usize, seed: u64) -> f64 {
    let points: Vec<[f64; 2]> = pixels
        .iter()
        .map(|[x, y]| [f64::from(*x), f64::from(*y)])
        .collect();
    let mut random = Random(seed + 1);
    (0..64)
        .map(|_| lloyd(&points, plus_plus(&points, clusters, &mut random)))
        .fold(f64::INFINITY, f64::min)
}

/// A linear congruence.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = (self.0)
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn squared(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1])
}

/// Each centroid is a point drawn in proportion to its squared distance from those drawn before.
fn plus_plus(points: &[[f64; 2]], clusters: usize, random: &mut Random) -> Vec<[f64; 2]> {
    let mut distance = vec![1.0; points.len()];
    let mut centroids: Vec<[f64; 2]> = Vec::with_capacity(clusters);
    for k in 0..clusters {
        let mut left = random.uniform() * distance.iter().sum::<f64>();
        let drawn = distance.iter().position(|d| {
            left -= d;
            left < 0.0
        });
        let centroid = points[drawn.unwrap_or(points.len() - 1)];
        centroids.push(centroid);
        for (d, point) in distance.iter_mut().zip(points) {
            let new = squared(*point, centroid);
            *d = if k == 0 { new } else { d.min(new) };
        }
    }
    centroids
}

/// Lloyd's iterations until no label changes; the squared error.
fn lloyd(points: &[[f64; 2]], mut centroids: Vec<[f64; 2]>) -> f64 {
    let mut labels = vec![usize::MAX; points.len()];
    for _ in 0..300 {
        let mut changed = false;
        for (label, point) in labels.iter_mut().zip(points) {
            let mut nearest = (f64::INFINITY, 0);
            for (k, centroid) in centroids.iter().enumerate() {
                let d = squared(*point, *centroid);
                if d < nearest.0 {
                    nearest = (d, k);
                }
            }
            changed |= nearest.1 != *label;
            *label = nearest.1;
        }
        if !changed {
            break;
        }
        let mut sums = vec![[0.0; 3]; centroids.len()];
        for (label, point) in labels.iter().zip(points) {
            let sum = &mut sums[*label];
            *sum = [sum[0] + point[0], sum[1] + point[1], sum[2] + 1.0];
        }
        for (centroid, [x, y, n]) in centroids.iter_mut().zip(sums) {
            if n > 0.0 {
                *centroid = [x / n, y / n];
            }
        }
    }
    labels
        .iter()
        .zip(points)
        .map(|(label, point)| squared(*point, centroids[*label]))
        .sum()
}
