//! Lloyd's iterations in the plane: the publication's actuator quantisation.

/// Points in a plane, as two columns of equal length.
#[derive(Debug, Clone, Copy)]
pub struct Plane<'a> {
    /// First coordinate of each point.
    pub x: &'a [f64],
    /// Second coordinate of each point.
    pub y: &'a [f64],
}

impl Plane<'_> {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Squared distance of a point from a place, eq. (9): `dx * dx + dy * dy`.
    pub(crate) fn squared_distance(&self, n: usize, x: f64, y: f64) -> f64 {
        let (dx, dy) = (self.x[n] - x, self.y[n] - y);
        dx * dx + dy * dy
    }
}

/// Lloyd's iterations in the plane, eqs (9) to (11) of the publication; returns how many were done.
///
/// `centroids_x` and `centroids_y` hold the initial centroids and receive the final ones;
/// `labels[n]` receives the index of the centroid that point `n` belonged to in the last iteration.
/// `weights`, where given, must be positive and finite, one per point; they move centroids but not
/// borders. `sums` is scratch, one entry per centroid.
///
/// - distance: `(x_n - mx_k)^2 + (y_n - my_k)^2`, each square rounded, then their sum. ties: the
///   lowest index.
/// - update: the sum of the members in the order of the points, divided by their number, or by the
///   sum of their weights (each term `weight * x`).
/// - empty cluster: keeps the centroid it has.
/// - iterations: as in [`crate::lloyd1d`], with the same early stop.
///
/// # Panics
///
/// If the lengths do not match, if there are points but no centroids, or more than 65,536 centroids.
pub fn lloyd2d(
    points: Plane<'_>,
    weights: Option<&[f64]>,
    iterations: u16,
    centroids_x: &mut [f64],
    centroids_y: &mut [f64],
    labels: &mut [u16],
    sums: &mut [[f64; 3]],
) -> u16 {
    assert_eq!(points.x.len(), points.y.len(), "as many x as y");
    assert_eq!(points.len(), labels.len(), "one label per point");
    assert_eq!(centroids_x.len(), centroids_y.len(), "as many x as y");
    assert_eq!(centroids_x.len(), sums.len(), "one sum per centroid");
    assert!(
        weights.is_none_or(|w| w.len() == points.len()),
        "one weight per point"
    );
    assert!(centroids_x.len() <= 1 << 16, "labels are 16 bits");
    let mut done = 0;
    while done < iterations {
        let changed = assign(points, centroids_x, centroids_y, labels);
        if done > 0 && !changed {
            break;
        }
        sums.fill([0.0; 3]);
        for (n, label) in labels.iter().enumerate() {
            let [x, y, total] = &mut sums[usize::from(*label)];
            let weight = weights.map_or(1.0, |w| w[n]);
            *x += weight * points.x[n];
            *y += weight * points.y[n];
            *total += weight;
        }
        for (k, [x, y, total]) in sums.iter().enumerate() {
            if *total > 0.0 {
                centroids_x[k] = x / total;
                centroids_y[k] = y / total;
            }
        }
        done += 1;
    }
    done
}

/// Assigns each point to its nearest centroid, eq. (10); says whether any label changed.
fn assign(points: Plane<'_>, centroids_x: &[f64], centroids_y: &[f64], labels: &mut [u16]) -> bool {
    let mut changed = false;
    for (n, label) in labels.iter_mut().enumerate() {
        let mut nearest = 0;
        let mut least = points.squared_distance(n, centroids_x[0], centroids_y[0]);
        for k in 1..centroids_x.len() {
            let distance = points.squared_distance(n, centroids_x[k], centroids_y[k]);
            if distance < least {
                least = distance;
                nearest = k as u16;
            }
        }
        changed |= nearest != *label;
        *label = nearest;
    }
    changed
}

/// The member nearest to each centroid, where an actuator can stand; `None` for a cluster without members.
///
/// ties: the first point. `least` is scratch; both it and `members` have one entry per centroid.
///
/// # Panics
///
/// If the lengths do not match.
pub fn medoids(
    points: Plane<'_>,
    labels: &[u16],
    centroids_x: &[f64],
    centroids_y: &[f64],
    least: &mut [f64],
    members: &mut [Option<u32>],
) {
    members.fill(None);
    least.fill(f64::INFINITY);
    for (n, label) in labels.iter().enumerate() {
        let k = usize::from(*label);
        let distance = points.squared_distance(n, centroids_x[k], centroids_y[k]);
        if members[k].is_none() || distance < least[k] {
            least[k] = distance;
            members[k] = Some(n as u32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Places = Vec<(f64, f64)>;

    fn run(
        points: &[(f64, f64)],
        weights: Option<&[f64]>,
        start: &[(f64, f64)],
        iterations: u16,
    ) -> (Places, Vec<u16>) {
        let (x, y): (Vec<_>, Vec<_>) = points.iter().copied().unzip();
        let (mut cx, mut cy): (Vec<_>, Vec<_>) = start.iter().copied().unzip();
        let mut labels = vec![u16::MAX; x.len()];
        let mut sums = vec![[0.0; 3]; cx.len()];
        lloyd2d(
            Plane { x: &x, y: &y },
            weights,
            iterations,
            &mut cx,
            &mut cy,
            &mut labels,
            &mut sums,
        );
        (cx.into_iter().zip(cy).collect(), labels)
    }

    #[test]
    fn follows_equations_9_to_11() {
        let square = [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (2.0, 2.0)];
        for (name, points, weights, start, centroids, labels) in [
            (
                "left and right",
                &square[..],
                None,
                vec![(0.0, 1.0), (2.0, 1.0)],
                vec![(0.0, 1.0), (2.0, 1.0)],
                vec![0, 1, 0, 1],
            ),
            (
                "points half way go to the lowest k",
                &square[..],
                None,
                vec![(1.0, 1.0), (1.0, 1.0)],
                vec![(1.0, 1.0), (1.0, 1.0)],
                vec![0, 0, 0, 0],
            ),
            (
                "an empty cluster keeps its centroid",
                &square[..2],
                None,
                vec![(1.0, 0.0), (50.0, 50.0)],
                vec![(1.0, 0.0), (50.0, 50.0)],
                vec![0, 0],
            ),
            (
                "weights pull the centroid",
                &square[..2],
                Some(&[1.0, 3.0][..]),
                vec![(0.0, 0.0)],
                vec![(1.5, 0.0)],
                vec![0, 0],
            ),
        ] {
            let (c, l) = run(points, weights, &start, 10);
            assert_eq!(c, centroids, "{name}");
            assert_eq!(l, labels, "{name}");
        }
    }

    #[test]
    fn the_medoid_is_the_member_nearest_the_centroid_and_the_first_among_equals() {
        let (x, y) = ([0.0, 1.0, 2.0, 3.0, 9.0], [0.0; 5]);
        let (mut least, mut members) = ([0.0; 3], [None; 3]);
        medoids(
            Plane { x: &x, y: &y },
            &[0, 0, 0, 0, 2],
            &[1.5, 5.0, 8.0],
            &[0.0; 3],
            &mut least,
            &mut members,
        );
        assert_eq!(members, [Some(1), None, Some(4)]);
    }

    proptest! {
        #[test]
        fn the_order_of_points_on_pixels_does_not_matter(
            cells in prop::collection::btree_set((0u8..16, 0u8..16), 5..100),
            seed in any::<u64>(),
        ) {
            let points: Vec<(f64, f64)> = cells.iter().map(|(x, y)| (f64::from(*x), f64::from(*y))).collect();
            let start = &points[..4];
            let mut shuffled: Vec<usize> = (0..points.len()).collect();
            let mut state = seed | 1;
            for i in (1..shuffled.len()).rev() {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                shuffled.swap(i, (state >> 33) as usize % (i + 1));
            }
            let moved: Vec<_> = shuffled.iter().map(|i| points[*i]).collect();
            let (centroids, labels) = run(&points, None, start, 10);
            let (centroids_moved, labels_moved) = run(&moved, None, start, 10);
            prop_assert_eq!(centroids, centroids_moved);
            for (place, from) in shuffled.iter().enumerate() {
                prop_assert_eq!(labels[*from], labels_moved[place]);
            }
        }
    }
}
