use super::*;
use proptest::prelude::*;

/// Least common multiple of 1..=36: every cost of clusters with total weight up to 36 times this is
/// an integer.
const DENOMINATOR: i128 = 144_403_552_893_600;

/// The cost of an interval, exactly, times [`DENOMINATOR`].
fn exact_cost(values: &[i64], weights: &[u32]) -> i128 {
    let (mut w, mut s, mut q) = (0i128, 0i128, 0i128);
    for (v, weight) in values.iter().zip(weights) {
        let (v, weight) = (i128::from(*v - values[0]), i128::from(*weight));
        w += weight;
        s += weight * v;
        q += weight * v * v;
    }
    assert_eq!(DENOMINATOR % w, 0);
    (w * q - s * s) * (DENOMINATOR / w)
}

/// The least cost of `clusters` clusters, exactly, times [`DENOMINATOR`], by trying every start of
/// the last cluster.
fn exhaustive(values: &[i64], weights: &[u32], clusters: usize) -> i128 {
    let n = values.len();
    let mut least = vec![i128::MAX; n + 1];
    least[0] = 0;
    for _ in 0..clusters {
        let mut next = vec![i128::MAX; n + 1];
        for i in 1..=n {
            for j in 0..i {
                if least[j] < i128::MAX {
                    next[i] = next[i].min(least[j] + exact_cost(&values[j..i], &weights[j..i]));
                }
            }
        }
        next[0] = 0;
        least = next;
    }
    least[n]
}

fn partition_cost(starts: &[u32], values: &[i64], weights: &[u32]) -> i128 {
    let ends = starts.iter().skip(1).copied().chain([values.len() as u32]);
    starts
        .iter()
        .zip(ends)
        .map(|(a, b)| {
            exact_cost(
                &values[*a as usize..b as usize],
                &weights[*a as usize..b as usize],
            )
        })
        .sum()
}

/// Solves and compares with the exhaustive optimum: equal, or above it by at most the share allowed.
fn assert_optimal(values: &[i64], weights: Option<&[u32]>, clusters: usize, allowed: f64) {
    let ones = vec![1; values.len()];
    let floats: Vec<f64> = values.iter().map(|v| *v as f64).collect();
    let mut solver = Kmeans1d::new(values.len(), clusters);
    let found = match weights {
        Some(weights) => solver.solve_weighted(&floats, weights, clusters),
        None => solver.solve(&floats, clusters),
    };
    let found = found.expect("sorted");
    let weights = weights.unwrap_or(&ones);
    let optimum = exhaustive(values, weights, clusters);
    let cost = partition_cost(found.starts, values, weights);
    let excess = (cost - optimum) as f64;
    assert!(
        excess <= optimum as f64 * allowed,
        "{values:?} x {weights:?} into {clusters}: {:?} costs {cost}, the optimum {optimum}",
        found.starts
    );
    let reported = found.cost * DENOMINATOR as f64;
    assert!(
        (reported - cost as f64).abs() <= cost as f64 * 1e-9,
        "reports {reported}, not {cost}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn small_counts_reach_the_exhaustive_optimum_exactly(
        mut values in prop::collection::vec(0i64..100, 1..13),
        clusters in 1usize..8,
    ) {
        values.sort_unstable();
        assert_optimal(&values, None, clusters, 0.0);
    }

    #[test]
    fn weighted_counts_reach_the_exhaustive_optimum_exactly(
        mut values in prop::collection::vec(0i64..100, 12),
        weights in prop::collection::vec(1u32..4, 12),
        clusters in 1usize..8,
    ) {
        values.sort_unstable();
        assert_optimal(&values, Some(&weights), clusters, 0.0);
    }

    #[test]
    fn adversarial_values_reach_the_exhaustive_optimum(
        mut values in prop::collection::vec(
            prop_oneof![0i64..4, 65_530i64..65_536, 12_884_508_670i64..12_884_508_676, 0i64..12_884_508_676],
            1..13,
        ),
        clusters in 1usize..9,
    ) {
        values.sort_unstable();
        assert_optimal(&values, None, clusters, 2f64.powi(-32));
    }
}

#[test]
fn hard_cases_reach_the_exhaustive_optimum() {
    let offset = |values: &[i64], by: i64| values.iter().map(|v| v + by).collect::<Vec<_>>();
    let squares: Vec<i64> = (65_527..65_536).map(|v| 3 * v * v).collect();
    let even: Vec<i64> = (0..16).collect();
    for (name, values) in [
        ("all equal", vec![7; 9]),
        ("one value", vec![7]),
        ("two clusters a count apart", vec![0, 0, 0, 1, 1, 1]),
        (
            "two clusters a count apart on an offset",
            vec![65_534, 65_534, 65_534, 65_535, 65_535, 65_535],
        ),
        (
            "the same with a far value",
            vec![0, 65_534, 65_534, 65_534, 65_535, 65_535, 65_535],
        ),
        (
            "a count apart on the greatest square",
            offset(&[0, 0, 1, 1, 2, 2, 3], 12_884_508_672),
        ),
        ("consecutive squares", squares),
        ("evenly spaced, with ties everywhere", even.clone()),
        ("evenly spaced on an offset", offset(&even, 12_884_508_000)),
        ("symmetric", vec![-9, -5, -4, -1, 1, 4, 5, 9]),
        ("geometric", (0..16).map(|e| 1 << (2 * e)).collect()),
        ("duplicates", vec![1, 1, 1, 1, 2, 9, 9, 9, 9, 9, 9, 30]),
        ("negative", vec![-65_535, -65_534, -3, -2, -1]),
    ] {
        for clusters in 1..=values.len() {
            println!("{name}, {clusters}");
            assert_optimal(&values, None, clusters, 0.0);
            let weights: Vec<u32> = (0..values.len()).map(|n| 1 + n as u32 % 3).collect();
            if weights.iter().sum::<u32>() <= 36 {
                assert_optimal(&values, Some(&weights), clusters, 0.0);
            }
        }
    }
}

#[test]
fn the_ends_of_the_range_of_doubles_are_solved_like_any_other() {
    let shape = [0.0, 1.0, 2.0, 10.0, 11.0, 12.0, 30.0, 31.0];
    for unit in [1.0, 5e-324, f64::MIN_POSITIVE, 1e-100, 1e100, 3e298] {
        let values = shape.map(|v| v * unit);
        let mut solver = Kmeans1d::new(values.len(), 3);
        let found = solver.solve(&values, 3).expect("sorted");
        assert_eq!(found.starts, [0, 3, 6], "unit {unit:e}");
        assert_eq!(found.centroids[0], unit);
        assert!(found.centroids.iter().all(|c| c.is_finite()));
    }
}

#[test]
fn fewer_different_values_than_clusters_give_one_cluster_each() {
    let mut solver = Kmeans1d::new(6, 5);
    let found = solver.solve(&[0.1, 0.1, 0.1, 0.3, 0.7, 0.7], 5).expect("sorted");
    assert_eq!(found.starts, [0, 3, 4]);
    assert_eq!(found.centroids, [0.1, 0.3, 0.7]);
    assert_eq!(found.cost, 0.0);
    assert_eq!(
        solver.solve(&[], 5).expect("nothing to do").starts,
        [] as [u32; 0]
    );
}

#[test]
fn what_cannot_be_clustered_is_refused_with_its_place() {
    let mut solver = Kmeans1d::new(4, 2);
    for (values, clusters, want) in [
        (&[1.0, f64::NAN][..], 2, Kmeans1dError::NotFinite { index: 1 }),
        (&[1.0, f64::INFINITY], 2, Kmeans1dError::NotFinite { index: 1 }),
        (&[-1.1e300, 0.0], 2, Kmeans1dError::NotFinite { index: 0 }),
        (&[2.0, 1.0], 2, Kmeans1dError::NotAscending { index: 1 }),
        (&[0.0; 5], 2, Kmeans1dError::OutOfRange { asked: 5, most: 4 }),
        (&[0.0], 3, Kmeans1dError::OutOfRange { asked: 3, most: 2 }),
        (&[0.0], 0, Kmeans1dError::OutOfRange { asked: 0, most: 2 }),
    ] {
        assert_eq!(solver.solve(values, clusters).unwrap_err(), want, "{values:?}");
    }
    assert_eq!(
        solver.solve_weighted(&[1.0], &[0], 1).unwrap_err(),
        Kmeans1dError::ZeroWeight { index: 0 }
    );
    assert_eq!(
        solver.solve_weighted(&[1.0], &[], 1).unwrap_err(),
        Kmeans1dError::WeightsMissing {
            values: 1,
            weights: 0
        }
    );
}

/// The least cost by the plain quadratic recurrence over doubles, with each interval's cost updated
/// by Welford's formula.
fn quadratic(values: &[f64], clusters: usize) -> f64 {
    let n = values.len();
    let mut least = vec![f64::INFINITY; n + 1];
    least[0] = 0.0;
    for _ in 0..clusters {
        let mut next = vec![f64::INFINITY; n + 1];
        next[0] = 0.0;
        for (i, next) in next.iter_mut().enumerate().skip(1) {
            let (mut mean, mut cost) = (0.0, 0.0);
            for j in (0..i).rev() {
                let from_mean = values[j] - mean;
                mean += from_mean / (i - j) as f64;
                cost += from_mean * (values[j] - mean);
                *next = next.min(least[j] + cost);
            }
        }
        least = next;
    }
    least[n]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn frames_of_forces_reach_the_optimum_of_the_plain_recurrence(
        mut values in prop::collection::vec(prop_oneof![0.5..100.0f64, 0.5..65_535.0f64, (0u32..40).prop_map(f64::from)], 1..160),
        clusters in 1usize..20,
    ) {
        values.sort_unstable_by(f64::total_cmp);
        let mut solver = Kmeans1d::new(values.len(), clusters);
        let optimum = quadratic(&values, clusters);
        for _ in 0..2 {
            let cost = solver.solve(&values, clusters).expect("sorted").cost;
            prop_assert!(cost <= optimum * (1.0 + 1e-9) + 1e-9, "{cost} over {optimum}");
        }
    }

    #[test]
    fn blocks_of_rows_change_nothing(n in 100usize..400, step in 1u32..4, clusters in 1usize..4) {
        let values: Vec<f64> = (0..n).map(|i| f64::from((i as u32 * step * 7919) % 4001)).collect();
        let mut values = values;
        values.sort_unstable_by(f64::total_cmp);
        let mut solver = Kmeans1d::new(n, clusters);
        let cost = solver.solve(&values, clusters).expect("sorted").cost;
        let optimum = quadratic(&values, clusters);
        prop_assert!(cost <= optimum * (1.0 + 1e-9) + 1e-9, "{cost} over {optimum}");
    }

    #[test]
    fn a_weight_counts_like_repetition(mut values in prop::collection::vec(0u32..5000, 2..40), clusters in 1usize..9) {
        values.sort_unstable();
        let repeated: Vec<f64> = values.iter().flat_map(|v| vec![f64::from(*v); 1 + *v as usize % 4]).collect();
        let once: Vec<f64> = values.iter().map(|v| f64::from(*v)).collect();
        let weights: Vec<u32> = values.iter().map(|v| 1 + v % 4).collect();
        let (mut a, mut b) = (Kmeans1d::new(repeated.len(), clusters), Kmeans1d::new(once.len(), clusters));
        let (a, b) = (a.solve(&repeated, clusters).expect("sorted"), b.solve_weighted(&once, &weights, clusters).expect("sorted"));
        prop_assert!((a.cost - b.cost).abs() <= 1e-9 * a.cost + 1e-9, "{} and {}", a.cost, b.cost);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn few_values_cost_the_same_by_the_recurrence_and_by_the_search(
        mut values in prop::collection::vec(prop_oneof![0.5..100.0f64, 60_000.0..65_535.0f64, (0u32..40).prop_map(f64::from)], 3..=64),
        weights in prop::collection::vec(prop_oneof![1u32..4, 1u32..900], 64),
        is_weighted in any::<bool>(),
        clusters in 2usize..=40,
    ) {
        values.sort_unstable_by(f64::total_cmp);
        values.dedup();
        prop_assume!(values.len() > clusters);
        let weights = is_weighted.then_some(&weights[..values.len()]);
        let mut solver = Kmeans1d::new(64, 40);
        let starts = solver.band.solve(&values, weights, clusters).map(<[u32]>::to_vec);
        solver.grid.place(&values, weights);
        solver.partition(&values, clusters);
        let searched = solver.describe(&values, weights);
        let Some(starts) = starts else { return Ok(()) };
        prop_assert_eq!(starts.len(), clusters);
        solver.search.take(starts.into_iter(), values.len());
        let direct = solver.describe(&values, weights);
        let allowed = 2f64.powi(-32) * searched;
        prop_assert!((direct - searched).abs() <= allowed, "{direct} by the recurrence, {searched} by the search");
    }
}

#[test]
fn what_the_recurrence_would_get_wrong_or_do_slowly_is_left_to_the_search() {
    let even: Vec<f64> = (0..64).map(f64::from).collect();
    let by = |unit: f64| even.iter().map(|v| v * unit).collect::<Vec<_>>();
    let heavy = [1, 1, 1 << 16, 1, 1];
    for (name, values, weights, clusters, direct) in [
        ("few values", &even[..20], None, 8, true),
        ("many clusters of hardly more values", &even[..44], None, 40, true),
        ("many values", &even[..], None, 8, false),
        ("one cluster", &even[..20], None, 1, false),
        ("weights", &even[..5], Some(&[1; 5]), 3, true),
        ("very different weights", &even[..5], Some(&heavy), 3, false),
        ("squares that underflow", &by(1e-150)[..5], None, 3, false),
        ("squares that overflow", &by(1e200)[..5], None, 3, false),
    ] {
        let mut band = Band::new(64);
        let solved = band.solve(values, weights.map(|w| &w[..]), clusters);
        assert_eq!(solved.is_some(), direct, "{name}");
    }
}

/// Ten million random small instances; run it with `cargo test --release -p taxel-cluster -- --ignored`.
#[test]
#[ignore = "minutes; part of the nightly profile"]
fn ten_million_small_instances_reach_the_exhaustive_optimum() {
    let count: u64 = std::env::var("INSTANCES").map_or(10_000_000, |n| n.parse().expect("a number"));
    let mut state = 1u64;
    let mut random = |below: u64| {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((u128::from(state) * u128::from(below)) >> 64) as i64
    };
    for _ in 0..count {
        let n = 1 + random(10) as usize;
        let range = [3, 10, 100, 65_536, 12_884_508_676][random(5) as usize];
        let mut values: Vec<i64> = (0..n).map(|_| random(range)).collect();
        values.sort_unstable();
        let clusters = 1 + random(6) as usize;
        let allowed = if range <= 100 { 0.0 } else { 2f64.powi(-32) };
        assert_optimal(&values, None, clusters, allowed);
    }
}
