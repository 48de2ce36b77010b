//! k-means in any number of dimensions, once and for all: no frame before it, no clusters to keep.

/// One run of k-means with the memory that it needs: seeds, Lloyd's iterations, then single points that move to
/// another cluster where that lowers the cost (Hartigan and Wong 1979), until none does.
///
/// Points are rows of `dimensions` numbers, one after another. Draws come from the caller, evenly from 0 to 1
/// without 1: the same points and draws give the same clusters.
///
/// ```
/// let points = [0.0, 0.0, 0.0, 1.0, 9.0, 9.0, 9.0, 8.0];
/// let mut search = taxel_cluster::LocalSearch::new(4, 2, 2);
/// search.seed_far(&points, || 0.5);
/// search.lloyd(&points);
/// assert_eq!(search.improve(&points), 1.0);
/// assert_eq!(search.labels()[0], search.labels()[1]);
/// ```
#[derive(Debug, Clone)]
pub struct LocalSearch {
    dimensions: usize,
    clusters: usize,
    centroids: Vec<f64>,
    counts: Vec<usize>,
    labels: Vec<usize>,
    nearest: Vec<f64>,
}

/// Lloyd's iterations at most; on N points in the plane they end after some tens.
const ITERATIONS: usize = 1000;
/// A move has to save this share of what it takes away, so that rounding does not move points to and fro.
const LEAST_GAIN: f64 = 1e-12;

impl LocalSearch {
    /// Memory for exactly so many points and clusters.
    ///
    /// # Panics
    ///
    /// If there are no dimensions or clusters, or fewer points than clusters.
    pub fn new(points: usize, dimensions: usize, clusters: usize) -> Self {
        assert!(dimensions > 0 && clusters > 0, "clusters of something");
        assert!(points >= clusters, "{clusters} clusters of {points} points");
        Self {
            dimensions,
            clusters,
            centroids: vec![0.0; clusters * dimensions],
            counts: vec![0; clusters],
            labels: vec![0; points],
            nearest: vec![0.0; points],
        }
    }

    /// The cluster of each point.
    pub fn labels(&self) -> &[usize] {
        &self.labels
    }

    /// The mean of each cluster, one after another.
    pub fn centroids(&self) -> &[f64] {
        &self.centroids
    }

    /// Puts the centroids on different points drawn evenly: the publication's random start.
    pub fn seed_anywhere(&mut self, points: &[f64], mut draw: impl FnMut() -> f64) {
        let n = self.labels.len();
        // The first entries of a shuffle (Fisher and Yates); labels are not in use yet.
        for (at, label) in self.labels.iter_mut().enumerate() {
            *label = at;
        }
        for k in 0..self.clusters {
            let other = k + (draw() * (n - k) as f64) as usize;
            self.labels.swap(k, other.min(n - 1));
            self.put(points, k, self.labels[k]);
        }
    }

    /// Puts the first centroid on any point, and each further one on a point drawn with a probability proportional
    /// to its squared distance from the nearest so far (k-means++, Arthur and Vassilvitskii 2007).
    pub fn seed_far(&mut self, points: &[f64], mut draw: impl FnMut() -> f64) {
        let n = self.labels.len();
        self.nearest.fill(f64::INFINITY);
        let mut chosen = (draw() * n as f64) as usize;
        for k in 0..self.clusters {
            self.put(points, k, chosen.min(n - 1));
            let centroid = &self.centroids[k * self.dimensions..][..self.dimensions];
            let mut total = 0.0;
            for (point, nearest) in points.chunks_exact(self.dimensions).zip(&mut self.nearest) {
                *nearest = nearest.min(squared_distance(point, centroid));
                total += *nearest;
            }
            let mut left = draw() * total;
            let drawn = self.nearest.iter().position(|d| {
                left -= d;
                left < 0.0
            });
            chosen = drawn.unwrap_or(n - 1);
        }
    }

    fn put(&mut self, points: &[f64], k: usize, point: usize) {
        let d = self.dimensions;
        self.centroids[k * d..][..d].copy_from_slice(&points[point * d..][..d]);
    }

    /// Lloyd's iterations from the seeds until no point changes its cluster; says whether every cluster has points.
    pub fn lloyd(&mut self, points: &[f64]) -> bool {
        self.labels.fill(usize::MAX);
        for _ in 0..ITERATIONS {
            let mut changed = false;
            for (point, label) in points.chunks_exact(self.dimensions).zip(&mut self.labels) {
                let (mut least, mut at) = (f64::INFINITY, 0);
                for (k, centroid) in self.centroids.chunks_exact(self.dimensions).enumerate() {
                    let distance = squared_distance(point, centroid);
                    if distance < least {
                        (least, at) = (distance, k);
                    }
                }
                changed |= *label != at;
                *label = at;
            }
            if !changed {
                break;
            }
            self.centre(points);
        }
        self.counts.iter().all(|count| *count > 0)
    }

    /// The means of the clusters as they are labelled; one without points stays where it is.
    fn centre(&mut self, points: &[f64]) {
        let d = self.dimensions;
        self.counts.fill(0);
        for label in &self.labels {
            self.counts[*label] += 1;
        }
        for (centroid, count) in self.centroids.chunks_exact_mut(d).zip(&self.counts) {
            if *count > 0 {
                centroid.fill(0.0);
            }
        }
        for (point, label) in points.chunks_exact(d).zip(&self.labels) {
            for (sum, x) in self.centroids[label * d..][..d].iter_mut().zip(point) {
                *sum += x;
            }
        }
        for (centroid, count) in self.centroids.chunks_exact_mut(d).zip(&self.counts) {
            if *count > 0 {
                centroid.iter_mut().for_each(|x| *x /= *count as f64);
            }
        }
    }

    /// Moves single points to another cluster while that lowers the cost; returns the cost, the sum of squared
    /// distances from the means.
    pub fn improve(&mut self, points: &[f64]) -> f64 {
        let d = self.dimensions;
        let (mut unmoved, mut n) = (0, 0);
        while unmoved < self.labels.len() {
            let (point, from) = (&points[n * d..][..d], self.labels[n]);
            let count = self.counts[from] as f64;
            unmoved += 1;
            if count > 1.0 {
                let loses = count / (count - 1.0) * squared_distance(point, &self.centroids[from * d..][..d]);
                let costs = |to: usize| {
                    let count = self.counts[to] as f64;
                    count / (count + 1.0) * squared_distance(point, &self.centroids[to * d..][..d])
                };
                let others = (0..self.clusters).filter(|to| *to != from);
                let best = others
                    .map(|to| (costs(to), to))
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((costs, to)) = best
                    && costs < loses * (1.0 - LEAST_GAIN)
                {
                    self.labels[n] = to;
                    self.centre_of(points, from);
                    self.centre_of(points, to);
                    unmoved = 0;
                }
            }
            n = (n + 1) % self.labels.len();
        }
        let own =
            |(point, label): (&[f64], &usize)| squared_distance(point, &self.centroids[label * d..][..d]);
        points.chunks_exact(d).zip(&self.labels).map(own).sum()
    }

    /// The mean of one cluster, added up anew, so that errors do not pile up over many moves.
    fn centre_of(&mut self, points: &[f64], k: usize) {
        let d = self.dimensions;
        let centroid = &mut self.centroids[k * d..][..d];
        centroid.fill(0.0);
        let mut count = 0;
        for (point, _) in points
            .chunks_exact(d)
            .zip(&self.labels)
            .filter(|(_, label)| **label == k)
        {
            count += 1;
            centroid.iter_mut().zip(point).for_each(|(sum, x)| *sum += x);
        }
        centroid.iter_mut().for_each(|x| *x /= f64::from(count));
        self.counts[k] = count as usize;
    }
}

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_point_moves_where_lloyd_is_content() {
        // 5 is 2.5 from the mean of {0, 5} and 3 from 8; to leave saves 2 * 2.5^2, to join costs 3^2 / 2.
        let points = [0.0, 5.0, 8.0];
        let mut search = LocalSearch::new(3, 1, 2);
        search.centroids.copy_from_slice(&[2.5, 8.0]);
        assert!(search.lloyd(&points));
        assert_eq!(search.labels(), [0, 0, 1]);
        assert_eq!(search.improve(&points), 4.5);
        assert_eq!(search.labels(), [0, 1, 1]);
    }

    #[test]
    fn random_starts_are_different_points() {
        let points: Vec<f64> = (0..9).map(f64::from).collect();
        let mut search = LocalSearch::new(9, 1, 9);
        let mut draws = [0.99, 0.0, 0.5, 0.3, 0.99, 0.0, 0.7, 0.99, 0.5].into_iter();
        search.seed_anywhere(&points, || draws.next().unwrap_or(0.0));
        let mut seeds = search.centroids().to_vec();
        seeds.sort_by(f64::total_cmp);
        assert_eq!(seeds, points);
    }

    proptest! {
        #[test]
        fn no_single_move_lowers_the_cost(
            (points, clusters) in (2usize..12).prop_flat_map(|n| (prop::collection::vec(-50i32..50, n * 2), 1..=n)),
            draw in 0.0..1.0f64,
        ) {
            let points: Vec<f64> = points.into_iter().map(f64::from).collect();
            let mut search = LocalSearch::new(points.len() / 2, 2, clusters);
            search.seed_far(&points, || draw);
            search.lloyd(&points);
            let cost = search.improve(&points);
            for n in 0..points.len() / 2 {
                for to in 0..clusters {
                    let mut moved = search.clone();
                    if moved.counts[moved.labels[n]] < 2 || moved.counts[to] == 0 {
                        continue;
                    }
                    moved.labels[n] = to;
                    moved.centre(&points);
                    let own = |(p, k): (&[f64], &usize)| squared_distance(p, &moved.centroids[k * 2..][..2]);
                    let other: f64 = points.chunks_exact(2).zip(&moved.labels).map(own).sum();
                    prop_assert!(other >= cost * (1.0 - 1e-9) - 1e-9, "{other} < {cost}");
                }
            }
        }
    }
}
