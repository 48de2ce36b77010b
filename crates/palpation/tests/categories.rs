//! Categories against exhaustion, silhouettes against their definitions, matching against the publication's example.

use proptest::prelude::*;
use taxel_palpation::{
    Agreement, Classifier, Matrix, PalpationError, Pca, Ranking, Silhouette, Solver, clusters_by_silhouette,
    optimal, paper, stability,
};

fn cost(map: &Matrix, labels: &[usize], clusters: usize) -> f64 {
    let of = |k: usize| -> Vec<usize> { (0..labels.len()).filter(|n| labels[*n] == k).collect() };
    let within = |touches: Vec<usize>| -> f64 {
        let members = map.select_columns(&touches);
        let mean = |d: usize| members.column_iter().map(|touch| touch[d]).sum::<f64>() / touches.len() as f64;
        let means: Vec<f64> = (0..map.nrows()).map(mean).collect();
        let differences = members.column_iter().flat_map(|touch| touch.iter().zip(&means));
        differences.map(|(x, mean)| (x - mean).powi(2)).sum()
    };
    (0..clusters)
        .map(of)
        .filter(|touches| !touches.is_empty())
        .map(within)
        .sum()
}

/// The least cost, by trying every labelling.
fn exhausted(map: &Matrix, clusters: usize) -> f64 {
    let n = map.ncols();
    let labelling = |mut number: usize| -> Vec<usize> {
        (0..n)
            .map(|_| {
                let label = number % clusters;
                number /= clusters;
                label
            })
            .collect()
    };
    let all = (0..clusters.pow(n as u32)).map(labelling);
    all.map(|labels| cost(map, &labels, clusters))
        .fold(f64::INFINITY, f64::min)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn no_categories_are_better(
        (dimensions, values) in (1usize..4).prop_flat_map(|d| (Just(d), prop::collection::vec(-20i32..20, d * 7))),
        clusters in 2usize..4,
    ) {
        let map = Matrix::new(dimensions, 7, values.iter().map(|x| f64::from(*x)).collect());
        match optimal(&map, clusters, 3) {
            Err(PalpationError::Clusters { different, .. }) => prop_assert!(different < clusters),
            Err(error) => prop_assert!(false, "{error}"),
            Ok(found) => {
                prop_assert!(found.proved);
                let least = exhausted(&map, clusters);
                prop_assert!((found.cost - least).abs() <= 1e-9 * (1.0 + least), "{} and {least}", found.cost);
                prop_assert!((cost(&map, &found.labels, clusters) - found.cost).abs() <= 1e-9 * (1.0 + least));
            }
        }
    }

    #[test]
    fn matching_is_the_most_that_any_permutation_gives(
        labels in prop::collection::vec(0usize..4, 12),
        classes in prop::collection::vec(0usize..4, 12),
    ) {
        let agreement = Agreement::of(&labels, &classes).unwrap();
        let mut permutations = vec![vec![]];
        for _ in 0..4 {
            permutations = permutations.into_iter().flat_map(|p: Vec<usize>| {
                (0..4).filter(|k| !p.contains(k)).map(|k| [p.clone(), vec![k]].concat()).collect::<Vec<_>>()
            }).collect();
        }
        let hits = |p: &Vec<usize>| labels.iter().zip(&classes).filter(|(label, class)| p[**label] == **class).count();
        let most = permutations.iter().map(hits).max().unwrap();
        prop_assert_eq!((agreement.accuracy * 12.0).round() as usize, most);
        let used = agreement.class_of.len();
        // Permutations are in the order of numbers.
        let first = permutations.iter().find(|p| hits(p) == most).unwrap();
        prop_assert_eq!(&agreement.class_of[..], &first[..used]);
    }
}

#[test]
fn the_optimum_of_sixteen_touches_without_structure_is_proved() {
    let map = Matrix::from_fn(2, 16, |d, n| ((n * n * 37 + d * 53 * n + 11 * n) % 101) as f64);
    for clusters in 2..=6 {
        assert!(optimal(&map, clusters, 1).unwrap().proved, "{clusters} clusters");
    }
}

#[test]
fn the_publications_rule_takes_what_three_starts_agree_on() {
    let clear = Matrix::new(1, 6, vec![0.0, 1.0, 50.0, 51.0, 52.0, 0.5]);
    let found = paper(&clear, 2, 7).unwrap();
    assert_eq!(found.labels, [0, 0, 1, 1, 1, 0]);
    assert!(found.attempts >= 1 && !found.proved);
    // Twelve points on a circle have twelve equal cuts into two, which three starts hardly ever share.
    let circle = Matrix::from_fn(2, 64, |d, n| {
        let angle = n as f64 / 64.0 * std::f64::consts::TAU;
        if d == 0 { angle.cos() } else { angle.sin() }
    });
    let refused = PalpationError::NoAgreement {
        clusters: 5,
        attempts: taxel_palpation::PAPER_ATTEMPTS,
    };
    assert_eq!(paper(&circle, 5, 1), Err(refused));
}

#[test]
fn the_number_of_categories_is_refused_by_what_differs() {
    let map = Matrix::new(1, 4, vec![1.0, 1.0, 2.0, -0.0]);
    for clusters in [0, 1, 4, 9] {
        for found in [paper(&map, clusters, 1), optimal(&map, clusters, 1)] {
            assert_eq!(
                found,
                Err(PalpationError::Clusters {
                    clusters,
                    different: 3
                })
            );
        }
    }
}

#[test]
fn readings_of_the_silhouette_are_as_computed_by_hand() {
    // {0, 2} and {10}: as printed a = 2, b = 9 and a = 0, b = 9; Rousseeuw 8/10, 6/8 and, alone, 0.
    let map = Matrix::new(1, 3, vec![0.0, 2.0, 10.0]);
    let found = Silhouette::of(&map, &[4, 4, 1]).unwrap();
    assert_eq!(found.clusters, [7.0 / 9.0, 1.0]);
    assert_eq!((found.within, found.between), (vec![2.0, 0.0], vec![9.0, 9.0]));
    assert!((found.cluster - 8.0 / 9.0).abs() < 1e-15);
    assert!((found.macro_average - (0.8 + 0.75) / 4.0).abs() < 1e-15);
    assert!((found.standard - (0.8 + 0.75) / 3.0).abs() < 1e-15);
    assert_eq!(
        Silhouette::of(&map, &[0, 0, 0]),
        Err(PalpationError::OneCluster { clusters: 1 })
    );
    assert_eq!(
        Silhouette::of(&map, &[0, 1]),
        Err(PalpationError::Labels {
            labels: 2,
            touches: 3
        })
    );
    let same = Matrix::new(1, 4, vec![3.0; 4]);
    assert_eq!(Silhouette::of(&same, &[0, 0, 1, 1]).unwrap().cluster, 0.0);
}

#[test]
fn the_publications_example_is_matched_as_it_says() {
    let (v, t) = ([2, 2, 1, 0, 0], [1, 1, 0, 2, 2]);
    let agreement = Agreement::of(&v, &t).unwrap();
    assert_eq!(agreement.relabelled(&v), t);
    assert_eq!((agreement.accuracy, agreement.ari), (1.0, 1.0));
}

#[test]
fn categories_without_a_class_have_numbers_of_their_own() {
    let agreement = Agreement::of(&[0, 1, 2, 2], &[0, 0, 1, 1]).unwrap();
    assert_eq!(agreement.class_of, [0, 2, 1]);
    assert_eq!(agreement.accuracy, 0.75);
    assert_eq!(
        Agreement::of(&[0], &[]),
        Err(PalpationError::Labels {
            labels: 1,
            touches: 0
        })
    );
}

#[test]
fn clear_categories_are_found_again_and_vague_ones_are_not() {
    let clear = Matrix::from_fn(1, 12, |_, n| (n % 3) as f64 * 100.0 + n as f64);
    let found = clusters_by_silhouette(&clear, 2..=6, 1).unwrap();
    assert_eq!(found.len(), 3);
    assert_eq!(stability(&clear, &found.labels, 50, 1).unwrap(), 1.0);
    let vague = Matrix::from_fn(1, 12, |_, n| n as f64);
    let labels = optimal(&vague, 4, 1).unwrap().labels;
    assert!(stability(&vague, &labels, 50, 1).unwrap() < 0.9);
}

#[test]
fn classes_are_ranked_by_their_distance_from_the_reference() {
    let map = Matrix::new(1, 8, vec![0.0, 1.0, 3.0, 4.0, 5.0, 6.0, 9.0, 10.0]);
    let classes = [0, 0, 2, 2, 1, 1, 3, 3];
    let ranking = Ranking::of(&map, &classes, 0).unwrap();
    assert_eq!(ranking.distances(), [0.0, 5.0, 3.0, 9.0]);
    assert_eq!(ranking.order(), [0, 2, 1, 3]);
    assert!(ranking.has_order(&[&[0], &[1, 2], &[3]]));
    assert!(!ranking.has_order(&[&[0], &[1], &[2], &[3]]));
    let sure = Ranking::probability(&map, &classes, 0, &[&[0], &[1, 2], &[3]], 100, 1).unwrap();
    assert_eq!(sure, 1.0);
    let missing = PalpationError::NoSuchClass { class: 1 };
    assert_eq!(Ranking::of(&map, &[0, 0, 2, 2, 2, 2, 3, 3], 0), Err(missing));
}

#[test]
fn later_touches_are_put_where_they_belong_or_nowhere() {
    // Two classes along the first feature, noise along the second; the third is always 0.
    let touches = Matrix::new(
        3,
        6,
        vec![
            0.0, 0.0, 0.0, 1.0, 0.2, 0.0, 0.5, 0.4, 0.0, 100.0, 0.0, 0.0, 101.0, 0.3, 0.0, 99.0, 0.1, 0.0,
        ],
    );
    let pca = Pca::fit(&touches, 1, Solver::Exact).unwrap();
    let found = optimal(&pca.project(&touches).unwrap(), 2, 1).unwrap();
    let classifier = Classifier::new(&pca, &touches, &found).unwrap();
    assert!(classifier.is_whole(3) && !classifier.is_whole(4));
    for (touch, category, unknown) in [
        ([2.0, 0.1, 0.0], 0, false),
        ([90.0, 0.2, 0.1], 1, false),
        ([400.0, 0.2, 0.0], 1, true),
        ([100.0, 0.2, 60.0], 1, true),
    ] {
        let put = classifier.classify(&touch).unwrap();
        assert_eq!(
            (put.category, put.unknown),
            (category, unknown),
            "{touch:?}: {put:?}"
        );
    }
    assert!(classifier.classify(&[50.0, 0.2, 0.0]).unwrap().confidence < 0.05);
    assert!(classifier.classify(&[0.5, 0.2, 0.0]).unwrap().confidence > 0.95);
    let other = PalpationError::OtherProbe {
        expected: 3,
        found: 2,
    };
    assert_eq!(classifier.classify(&[1.0, 2.0]), Err(other));
    assert!(classifier.classify(&[1.0, f64::NAN, 0.0]).is_err());
}
