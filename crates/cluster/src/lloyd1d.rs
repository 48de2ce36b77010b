//! Lloyd's iterations in one dimension: the publication's force quantisation.

/// The centroid nearest to a value, eqs (4) and (5).
///
/// distance: `(value - mu_k)^2`, rounded as a double. ties: the lowest index.
///
/// # Panics
///
/// If there are no centroids.
pub fn nearest1d(value: f64, centroids: &[f64]) -> usize {
    let mut nearest = 0;
    let mut least = squared(value - centroids[0]);
    for (k, centroid) in centroids.iter().enumerate().skip(1) {
        let distance = squared(value - centroid);
        if distance < least {
            least = distance;
            nearest = k;
        }
    }
    nearest
}

/// Assigns each value to its nearest centroid, [`nearest1d`], and says whether any label changed.
///
/// # Panics
///
/// If there are values but no centroids, or `labels` is not as long as `values`.
pub fn assign1d(values: &[f64], centroids: &[f64], labels: &mut [u16]) -> bool {
    assert_eq!(values.len(), labels.len(), "one label per value");
    let mut changed = false;
    for (value, label) in values.iter().zip(labels) {
        let nearest = nearest1d(*value, centroids) as u16;
        changed |= nearest != *label;
        *label = nearest;
    }
    changed
}

/// Lloyd's iterations in one dimension, eqs (4) to (6) of the publication; returns how many were done.
///
/// `centroids` holds the initial centroids and receives the final ones, in the same order;
/// `labels[n]` receives the index of the centroid that value `n` belonged to in the last iteration.
/// `sums` is scratch, one entry per centroid.
///
/// - distance and ties: see [`nearest1d`].
/// - update: the sum of the members in the order of `values`, divided by their number.
/// - empty cluster: keeps the centroid it has.
/// - iterations: `iterations` times assignment then update; the labels are those of the last
///   assignment, the centroids those of the update after it. It stops early once no label changes:
///   the update would repeat the very sums that gave the present centroids, and so would every
///   later iteration.
///
/// Values and centroids must be finite and small enough that their squared differences do not
/// overflow; otherwise the result is still defined, but no longer nearest.
///
/// # Panics
///
/// If the lengths do not match, if there are values but no centroids, or more than 65,536 centroids.
pub fn lloyd1d(
    values: &[f64],
    iterations: u16,
    centroids: &mut [f64],
    labels: &mut [u16],
    sums: &mut [(f64, u32)],
) -> u16 {
    assert_eq!(centroids.len(), sums.len(), "one sum per centroid");
    assert!(centroids.len() <= 1 << 16, "labels are 16 bits");
    let mut done = 0;
    while done < iterations {
        let changed = assign1d(values, centroids, labels);
        if done > 0 && !changed {
            break;
        }
        update(values, labels, centroids, sums);
        done += 1;
    }
    done
}

/// Moves each centroid to the mean of its members, eq. (6).
fn update(values: &[f64], labels: &[u16], centroids: &mut [f64], sums: &mut [(f64, u32)]) {
    sums.fill((0.0, 0));
    for (value, label) in values.iter().zip(labels) {
        let (sum, count) = &mut sums[usize::from(*label)];
        *sum += value;
        *count += 1;
    }
    for (centroid, (sum, count)) in centroids.iter_mut().zip(sums) {
        if *count > 0 {
            *centroid = *sum / f64::from(*count);
        }
    }
}

fn squared(value: f64) -> f64 {
    value * value
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Runs from given centroids; labels start at a value no cluster has.
    fn run(values: &[f64], start: &[f64], iterations: u16) -> (Vec<f64>, Vec<u16>, u16) {
        let mut centroids = start.to_vec();
        let mut labels = vec![u16::MAX; values.len()];
        let mut sums = vec![(0.0, 0); start.len()];
        let done = lloyd1d(values, iterations, &mut centroids, &mut labels, &mut sums);
        (centroids, labels, done)
    }

    #[test]
    fn follows_equations_4_to_6() {
        struct Case {
            name: &'static str,
            values: &'static [f64],
            start: &'static [f64],
            iterations: u16,
            centroids: &'static [f64],
            labels: &'static [u16],
        }
        for case in [
            Case {
                name: "two groups",
                values: &[1.0, 10.0, 2.0, 11.0],
                start: &[3.0, 9.0],
                iterations: 10,
                centroids: &[1.5, 10.5],
                labels: &[0, 1, 0, 1],
            },
            Case {
                name: "a value half way goes to the lowest k",
                values: &[0.0, 1.0, 2.0],
                start: &[0.0, 2.0],
                iterations: 1,
                centroids: &[0.5, 2.0],
                labels: &[0, 0, 1],
            },
            Case {
                name: "the lowest k also when centroids are equal or not in order",
                values: &[5.0, 6.0],
                start: &[7.0, 5.0, 5.0],
                iterations: 1,
                centroids: &[6.0, 5.0, 5.0],
                labels: &[1, 0],
            },
            Case {
                name: "an empty cluster keeps its centroid",
                values: &[0.0, 1.0, 100.0],
                start: &[0.0, 50.5, 100.0],
                iterations: 10,
                centroids: &[0.5, 50.5, 100.0],
                labels: &[0, 0, 2],
            },
            Case {
                name: "labels are those before the last update",
                values: &[0.0, 4.0, 5.0, 6.0],
                start: &[0.0, 10.0],
                iterations: 1,
                centroids: &[3.0, 6.0],
                labels: &[0, 0, 0, 1],
            },
            Case {
                name: "no values",
                values: &[],
                start: &[1.0, 2.0],
                iterations: 3,
                centroids: &[1.0, 2.0],
                labels: &[],
            },
        ] {
            let (centroids, labels, _) = run(case.values, case.start, case.iterations);
            assert_eq!(centroids, case.centroids, "{}", case.name);
            assert_eq!(labels, case.labels, "{}", case.name);
        }
    }

    #[test]
    fn sums_run_in_the_order_of_the_values() {
        let (forward, _, _) = run(&[1e16, 1.0, 1.0], &[0.0], 1);
        let (backward, _, _) = run(&[1.0, 1.0, 1e16], &[0.0], 1);
        assert_eq!(forward[0], 1e16 / 3.0);
        assert_eq!(backward[0], (1e16 + 2.0) / 3.0);
    }

    /// The chart of Table I without the early exit.
    fn every_iteration(values: &[f64], start: &[f64], iterations: u16) -> (Vec<f64>, Vec<u16>) {
        let mut centroids = start.to_vec();
        let mut labels = vec![0; values.len()];
        for _ in 0..iterations {
            assign1d(values, &centroids, &mut labels);
            update(values, &labels, &mut centroids, &mut vec![(0.0, 0); start.len()]);
        }
        (centroids, labels)
    }

    proptest! {
        #[test]
        fn stopping_early_changes_nothing(
            values in prop::collection::vec(0.001..70_000.0, 1..120),
            clusters in 1usize..17,
            iterations in 1u16..40,
        ) {
            let mut start = vec![0.0; clusters];
            crate::uniform(0.0, 70_000.0, &mut start);
            let (centroids, labels, _) = run(&values, &start, iterations);
            prop_assert_eq!((centroids, labels), every_iteration(&values, &start, iterations));
        }

        #[test]
        fn a_greater_value_never_gets_a_lower_centroid(
            values in prop::collection::vec(1u32..50, 1..80),
            clusters in 1usize..12,
            iterations in 1u16..12,
        ) {
            let values: Vec<f64> = values.into_iter().map(f64::from).collect();
            let mut start = vec![0.0; clusters];
            crate::uniform(1.0, 49.0, &mut start);
            let (centroids, labels, _) = run(&values, &start, iterations);
            for (a, la) in values.iter().zip(&labels) {
                for (b, lb) in values.iter().zip(&labels) {
                    if a < b {
                        prop_assert!(centroids[usize::from(*la)] <= centroids[usize::from(*lb)]);
                    }
                }
            }
        }

        #[test]
        fn a_converged_result_is_a_fixed_point(values in prop::collection::vec(0.001..70_000.0, 1..120), clusters in 1usize..9) {
            let mut start = vec![0.0; clusters];
            crate::uniform(0.0, 70_000.0, &mut start);
            let (centroids, labels, done) = run(&values, &start, 1000);
            prop_assert!(done < 1000);
            let (again, same, once) = run(&values, &centroids, 1000);
            prop_assert_eq!((again, same, once), (centroids, labels, 1));
        }
    }
}
