//! Where the iterations start: eqs (3) and (8).

use crate::Plane;

/// Spreads centroids uniformly over a range, eq. (3): the centres of `K` equal bins.
///
/// init: `mu_k = least + ((k - 0.5) * (greatest - least)) / K`, `k = 1..K`, ascending. `K` is
/// `centroids.len()`.
///
/// ```
/// let mut centroids = [0.0; 4];
/// taxel_cluster::uniform(0.0, 8.0, &mut centroids);
/// assert_eq!(centroids, [1.0, 3.0, 5.0, 7.0]);
/// ```
pub fn uniform(least: f64, greatest: f64, centroids: &mut [f64]) {
    let clusters = centroids.len() as f64;
    let range = greatest - least;
    for (k, centroid) in centroids.iter_mut().enumerate() {
        *centroid = least + ((k as f64 + 0.5) * range) / clusters;
    }
}

/// Chooses centroids far from one another, eq. (8).
///
/// init: the first centroid is point 0. Each further one is the point whose squared distance to the
/// nearest centroid chosen so far is greatest; ties go to the first such point. Points that differ
/// give centroids that differ, as long as there are enough of them. `nearest` is scratch, one entry
/// per point.
///
/// # Panics
///
/// If there are centroids but no points, or `nearest` is not as long as `points`.
pub fn maximin(points: Plane<'_>, centroids_x: &mut [f64], centroids_y: &mut [f64], nearest: &mut [f64]) {
    assert_eq!(nearest.len(), points.len(), "one distance per point");
    assert_eq!(centroids_x.len(), centroids_y.len(), "as many x as y");
    nearest.fill(f64::INFINITY);
    let mut chosen = 0;
    for (centroid_x, centroid_y) in centroids_x.iter_mut().zip(centroids_y) {
        *centroid_x = points.x[chosen];
        *centroid_y = points.y[chosen];
        let mut farthest = f64::NEG_INFINITY;
        for (n, distance) in nearest.iter_mut().enumerate() {
            *distance = distance.min(points.squared_distance(n, *centroid_x, *centroid_y));
            if *distance > farthest {
                farthest = *distance;
                chosen = n;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_centroids_are_the_centres_of_equal_bins() {
        for (least, greatest, want) in [
            (3.0, 3.0, vec![3.0]),
            (0.0, 10.0, vec![5.0]),
            (10.0, 20.0, vec![12.5, 17.5]),
            (65535.0, 65536.0, vec![65535.125, 65535.375, 65535.625, 65535.875]),
        ] {
            let mut centroids = vec![0.0; want.len()];
            uniform(least, greatest, &mut centroids);
            assert_eq!(centroids, want, "{least}..{greatest}");
        }
    }

    #[test]
    fn maximin_takes_the_farthest_point_and_the_first_among_equals() {
        let (x, y) = ([0.0, 1.0, 4.0, 0.0, 4.0], [0.0, 0.0, 0.0, 4.0, 4.0]);
        let (mut cx, mut cy, mut nearest) = ([9.0; 5], [9.0; 5], [0.0; 5]);
        maximin(Plane { x: &x, y: &y }, &mut cx, &mut cy, &mut nearest);
        assert_eq!(
            cx.iter().zip(&cy).map(|(x, y)| (*x, *y)).collect::<Vec<_>>(),
            [(0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0), (1.0, 0.0)]
        );
    }
}
