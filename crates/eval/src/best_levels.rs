//! The least error that `K` force levels can have: the reference of the force stage.

/// The least sum of squared distances of `values` from `clusters` levels, each value from the nearest.
///
/// Dynamic programming over the sorted distinct values in its plainest form (Wang and Song 2011),
/// `O(K n^2)`. The cost of a cluster is added up value by value (Welford's update, West's weights),
/// which subtracts nothing and so loses nothing on large offsets; the result is good to a few units
/// in the 14th place. Zero where there are no more distinct values than levels.
///
/// # Panics
///
/// If there are values but no clusters.
pub(crate) fn least_level_error(values: &[f64], clusters: usize) -> f64 {
    let points = distinct(values);
    if points.len() <= clusters {
        return 0.0;
    }
    assert!(clusters > 0, "values without levels");
    // best[k][i]: the least error of the first i values in k + 1 clusters.
    let mut best = vec![vec![f64::INFINITY; points.len() + 1]; clusters];
    for row in &mut best {
        row[0] = 0.0;
    }
    for end in 1..=points.len() {
        let (mut weight, mut mean, mut error) = (0.0, 0.0, 0.0);
        // The last cluster is start..end; it only gets worse as it grows.
        for start in (0..end).rev() {
            let (value, count) = points[start];
            weight += count;
            let off = value - mean;
            mean += off * count / weight;
            error += count * off * (value - mean);
            if start == 0 {
                best[0][end] = error;
            }
            let mut useful = clusters == 1;
            for k in 1..clusters {
                let total = best[k - 1][start] + error;
                if total < best[k][end] {
                    best[k][end] = total;
                }
                useful |= error <= best[k][end];
            }
            // Only the first row needs the long clusters.
            if !useful {
                best[0][end] = whole(&points[..end]);
                break;
            }
        }
    }
    best[clusters - 1][points.len()]
}

/// The error of one cluster of all points.
fn whole(points: &[(f64, f64)]) -> f64 {
    let (mut weight, mut mean, mut error) = (0.0, 0.0, 0.0);
    for &(value, count) in points {
        weight += count;
        let off = value - mean;
        mean += off * count / weight;
        error += count * off * (value - mean);
    }
    error
}

/// Distinct values, ascending, and how often each occurs.
fn distinct(values: &[f64]) -> Vec<(f64, f64)> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let mut points: Vec<(f64, f64)> = Vec::new();
    for value in sorted {
        match points.last_mut() {
            Some((last, count)) if *last == value => *count += 1.0,
            _ => points.push((value, 1.0)),
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn small_cases_are_as_computed_by_hand() {
        for (name, values, clusters, want) in [
            ("nothing", &[][..], 3, 0.0),
            ("one value", &[7.0], 1, 0.0),
            ("all equal", &[5.0; 9], 2, 0.0),
            ("one level", &[1.0, 2.0, 6.0], 1, 14.0),
            ("two pairs", &[1.0, 3.0, 11.0, 13.0], 2, 4.0),
            ("an outlier takes a level", &[0.0, 1.0, 2.0, 100.0], 2, 2.0),
            ("weights by repetition", &[0.0, 0.0, 0.0, 4.0, 100.0], 2, 12.0),
            (
                "a count apart on an offset",
                &[65534.0, 65535.0, 65535.0, 65533.0],
                3,
                0.0,
            ),
        ] {
            assert_eq!(least_level_error(values, clusters), want, "{name}");
        }
    }

    #[test]
    fn large_offsets_do_not_cancel() {
        let offset = 1e10;
        let values: Vec<f64> = (0..40).map(|n| offset + f64::from(n % 20) * 0.5).collect();
        let plain: Vec<f64> = (0..40).map(|n| f64::from(n % 20) * 0.5).collect();
        for clusters in [1, 2, 5, 9] {
            let (far, near) = (
                least_level_error(&values, clusters),
                least_level_error(&plain, clusters),
            );
            assert!((far - near).abs() <= 1e-6 * near, "{clusters}: {far} and {near}");
        }
    }

    /// Every way to cut sorted values into at most `clusters` intervals.
    fn exhaustive(sorted: &[f64], clusters: usize) -> f64 {
        if sorted.is_empty() {
            return 0.0;
        }
        if clusters == 0 {
            return f64::INFINITY;
        }
        (1..=sorted.len())
            .map(|end| {
                let mean = sorted[..end].iter().sum::<f64>() / end as f64;
                let error: f64 = sorted[..end].iter().map(|v| (v - mean) * (v - mean)).sum();
                error + exhaustive(&sorted[end..], clusters - 1)
            })
            .fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn no_cut_is_better(values in prop::collection::vec(0i32..60, 0..9), clusters in 1usize..5) {
            let mut values: Vec<f64> = values.into_iter().map(f64::from).collect();
            values.sort_unstable_by(f64::total_cmp);
            let (got, want) = (least_level_error(&values, clusters), exhaustive(&values, clusters));
            prop_assert!((got - want).abs() <= 1e-9 * (1.0 + want), "{} and {}", got, want);
        }
    }
}
