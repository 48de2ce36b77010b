//! Principal components: beside scikit-learn's, and on spectra that are known.

use serde_json::Value;
use taxel_palpation::{Agreement, Matrix, PalpationError, Pca, Silhouette, Solver, optimal};

/// The same touches as `fixtures/scikit_learn.py`, `D x N`.
fn touches(features: usize, count: usize, offset: u64) -> Matrix {
    Matrix::from_fn(features, count, |d, n| {
        let class = n % 5;
        let signal = class * ((d * 31 + class * 17) % 101);
        let noise = (d * d * 7919 + n * 104_729 + d * n * 613) % 1009;
        offset as f64 + signal as f64 + noise as f64 / 16.0
    })
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

fn assert_near(what: &str, found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    for (n, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= tolerance * scale, "{what} {n}: {a}, not {b}");
    }
}

#[test]
fn what_scikit_learn_says_is_said_here() {
    let all: Value = serde_json::from_str(include_str!("fixtures/scikit_learn.json")).unwrap();
    for case in all["cases"].as_array().unwrap() {
        let size = |key: &str| case[key].as_u64().unwrap() as usize;
        let touches = touches(
            size("features"),
            size("touches"),
            case["offset"].as_u64().unwrap(),
        );
        let expected = numbers(&case["singular_values"]);
        let name = format!("{} x {}", touches.nrows(), touches.ncols());
        let pca = Pca::fit(&touches, expected.len(), Solver::Exact).unwrap();
        assert_near(&name, pca.singular_values(), &expected, 1e-9);
        assert_near(
            &name,
            &pca.explained_variance(),
            &numbers(&case["explained_variance"]),
            1e-9,
        );
        let map = Pca::fit(&touches, 2, Solver::Exact)
            .unwrap()
            .project(&touches)
            .unwrap();
        let kept = numbers(&case["abs_scores"]).len() / touches.ncols();
        let map = Matrix::from_fn(kept, touches.ncols(), |row, column| map[(row, column)]);
        let scores: Vec<f64> = map.as_slice().iter().map(|x| x.abs()).collect();
        assert_near(&name, &scores, &numbers(&case["abs_scores"]), 1e-9);

        let categories = optimal(&map, size("clusters"), 1).unwrap();
        let cost = case["cost"].as_f64().unwrap();
        assert!(
            categories.cost <= cost * (1.0 + 1e-9),
            "{name}: {} > {cost}",
            categories.cost
        );
        // Of the labels that scikit-learn found, whatever were found here.
        let labels: Vec<usize> = numbers(&case["labels"])
            .iter()
            .map(|label| *label as usize)
            .collect();
        if let Some(silhouette) = case["silhouette"].as_f64() {
            let found = Silhouette::of(&map, &labels).unwrap().standard;
            assert!(
                (found - silhouette).abs() < 1e-12,
                "{name}: {found}, not {silhouette}"
            );
        }
        let classes: Vec<usize> = (0..touches.ncols()).map(|n| n % 5).collect();
        let ari = Agreement::of(&labels, &classes).unwrap().ari;
        assert!(
            (ari - case["ari"].as_f64().unwrap()).abs() < 1e-12,
            "{name}: {ari}"
        );
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// As many orthonormal vectors of this length, of which the first stands along `first` where it is given: Gram and Schmidt's,
/// twice, so that they are orthogonal to the last places.
fn orthonormal(length: usize, count: usize, salt: usize, first: Option<f64>) -> Vec<Vec<f64>> {
    let scatter =
        |i: usize, j: usize| ((i * 7919 + j * j * 613 + i * j * 31 + salt) % 1009) as f64 / 504.0 - 1.0;
    let mut vectors: Vec<Vec<f64>> = Vec::new();
    for j in 0..count {
        let start = first.filter(|_| j == 0);
        let mut vector: Vec<f64> = (0..length)
            .map(|i| start.unwrap_or_else(|| scatter(i, j)))
            .collect();
        for _ in 0..2 {
            for other in &vectors {
                let along = dot(&vector, other);
                vector.iter_mut().zip(other).for_each(|(x, o)| *x -= along * o);
            }
            let norm = dot(&vector, &vector).sqrt();
            vector.iter_mut().for_each(|x| *x /= norm);
        }
        vectors.push(vector);
    }
    vectors
}

/// Touches `D x N` whose centred matrix has these singular values, and an offset on every feature.
fn of_spectrum(features: usize, count: usize, spectrum: &[f64], offset: f64) -> Matrix {
    let left = orthonormal(features, spectrum.len(), 1, None);
    // Vectors of the touches' side must not change the mean: a column of ones before them takes it out.
    let right = &orthonormal(count, spectrum.len() + 1, 2, Some(1.0))[1..];
    let components = || spectrum.iter().zip(&left).zip(right);
    Matrix::from_fn(features, count, |d, n| {
        offset
            + components()
                .map(|((value, left), right)| value * left[d] * right[n])
                .sum::<f64>()
    })
}

#[test]
fn spectra_of_any_condition_come_back() {
    let falling = |n: usize, condition: f64| -> Vec<f64> {
        (0..n)
            .map(|i| condition.powf(-(i as f64) / (n - 1) as f64))
            .collect()
    };
    for (features, count, spectrum) in [
        (427, 16, falling(15, 1e3)),
        (427, 16, falling(15, 1e12)),
        (20_000, 16, falling(15, 1e12)),
        (20, 200, falling(20, 1e8)),
        (50, 2, vec![3.0]),
        (50, 6, vec![2.0, 2.0, 2.0, 1.0, 1.0]),
    ] {
        let touches = of_spectrum(features, count, &spectrum, 0.0);
        let pca = Pca::fit(&touches, spectrum.len(), Solver::Exact).unwrap();
        for (found, expected) in pca.singular_values().iter().zip(&spectrum) {
            // What rounding of the matrix itself leaves: 100 units in the last place of its greatest value.
            let error = (found - expected).abs();
            assert!(
                error < 100.0 * f64::EPSILON * spectrum[0],
                "{features} x {count}: {found}, not {expected}"
            );
        }
        assert_eq!(pca.components().ncols(), spectrum.len(), "{features} x {count}");
        for (i, a) in pca.components().column_iter().enumerate() {
            for (j, b) in pca.components().column_iter().enumerate() {
                let expected = f64::from(u8::from(i == j));
                assert!(
                    (dot(a, b) - expected).abs() < 1e-12,
                    "{features} x {count}: {i} {j}"
                );
            }
        }
    }
}

#[test]
fn the_first_components_are_the_same_whether_or_not_the_others_are_asked_for() {
    // The first stand out, hardly do, or are equal; the others are short, long together, or nothing.
    for (name, spectrum) in [
        ("falls", (0..15).map(|i| 0.1f64.powi(i)).collect::<Vec<_>>()),
        ("two stand out of noise", [vec![9.0, 4.0], vec![0.9; 13]].concat()),
        ("hardly falls", (0..15).map(|i| 1.0 - i as f64 / 100.0).collect()),
        ("two are equal", [vec![7.0, 7.0], vec![1.0; 13]].concat()),
        ("two are all", vec![3.0, 2.0]),
    ] {
        let touches = of_spectrum(427, 16, &spectrum, 0.0);
        let all = Pca::fit(&touches, 15, Solver::Exact).unwrap();
        let two = Pca::fit(&touches, 2, Solver::Exact).unwrap();
        assert_near(name, two.singular_values(), &spectrum[..2], 1e-14);
        assert_near(name, two.singular_values(), &all.singular_values()[..2], 1e-14);
        if spectrum[0] > spectrum[1] {
            let loadings = &all.components().as_slice()[..2 * 427];
            assert_near(name, two.components().as_slice(), loadings, 1e-12);
        }
    }
}

#[test]
fn an_offset_of_a_million_costs_the_signal_its_rounding_alone() {
    let spectrum = [1.0, 0.5, 0.25, 0.125];
    let pca = Pca::fit(&of_spectrum(91, 16, &spectrum, 1e6), 4, Solver::Exact).unwrap();
    // Features near 1e6 are rounded to 1.2e-10 before anybody sees them.
    assert_near("singular values", pca.singular_values(), &spectrum, 1e-8);
}

#[test]
fn components_beyond_the_rank_are_zero() {
    // Two touches have one component; constant taxels have none.
    let two = Matrix::new(6, 2, [[0.0; 6], [0.0, 3.0, 0.0, -4.0, 0.0, 0.0]].concat());
    for solver in [Solver::Auto, Solver::Exact, Solver::Truncated] {
        let pca = Pca::fit(&two, 2, solver).unwrap();
        assert_eq!(pca.rank(), 1, "{solver:?}");
        assert_near("share", &pca.explained_variance(), &[1.0, 0.0], 1e-15);
        assert_near(
            "loadings",
            pca.components().as_slice()[..6].as_ref(),
            &[0.0, -0.6, 0.0, 0.8, 0.0, 0.0],
            1e-15,
        );
        assert_near(
            "map",
            pca.project(&two).unwrap().as_slice(),
            &[2.5, 0.0, -2.5, 0.0],
            1e-15,
        );
    }
}

#[test]
fn the_truncated_solver_keeps_its_bound() {
    for (name, spectrum) in [
        ("falling", (0..120).map(|i| 0.8f64.powi(i)).collect::<Vec<_>>()),
        (
            "a plane in noise",
            [9.0, 5.0]
                .into_iter()
                .chain((0..118).map(|i| 1.0 - i as f64 / 500.0))
                .collect(),
        ),
        (
            "hardly falling",
            (0..120).map(|i| 1.0 - i as f64 / 400.0).collect(),
        ),
    ] {
        let touches = of_spectrum(400, 300, &spectrum, 5.0);
        let pca = Pca::fit(&touches, 3, Solver::Truncated).unwrap();
        for (n, (found, residual)) in pca.singular_values().iter().zip(pca.residuals()).enumerate() {
            let nearest = spectrum
                .iter()
                .map(|s| (s - found).abs())
                .fold(f64::INFINITY, f64::min);
            assert!(
                nearest <= residual + 1e-12,
                "{name}, {n}: {found} is {nearest} from the nearest, bound {residual}"
            );
            assert!(
                *found <= spectrum[n] * (1.0 + 1e-12),
                "{name}, {n}: {found} is above {}",
                spectrum[n]
            );
        }
        // What stands out of the rest is exact.
        let clear = match name {
            "falling" => 3,
            "a plane in noise" => 2,
            _ => 0,
        };
        assert_near(name, &pca.singular_values()[..clear], &spectrum[..clear], 1e-9);
    }
}

#[test]
fn many_touches_are_gone_over_in_parts_that_make_a_whole() {
    // More than a million values, and rows, columns and components that no block divides.
    let spectrum = [9.0, 5.0, 1.0];
    let pca = Pca::fit(&of_spectrum(1101, 1003, &spectrum, 5.0), 3, Solver::Truncated).unwrap();
    assert_near("singular values", pca.singular_values(), &spectrum, 1e-12);
    assert!(
        pca.residuals().iter().all(|residual| *residual < 1e-9),
        "{:?}",
        pca.residuals()
    );
}

#[test]
fn a_map_of_few_touches_is_judged_on_all() {
    let all = touches(91, 16, 0);
    let kept = |basis: &[usize]| -> f64 {
        let pca = Pca::fit(&all.select_columns(basis), 2, Solver::Exact).unwrap();
        pca.kept_variance(&all).unwrap().iter().sum()
    };
    let everything: Vec<usize> = (0..16).collect();
    let best = Pca::fit(&all, 2, Solver::Exact)
        .unwrap()
        .explained_variance()
        .iter()
        .sum::<f64>();
    assert!((kept(&everything) - best).abs() < 1e-12);
    assert!(kept(&[0, 1]) < best && kept(&[0, 1]) > 0.0);
}

#[test]
fn touches_that_have_no_map_are_refused_by_name() {
    let good = touches(7, 4, 0);
    let with = |value: f64| {
        let mut touches = good.clone();
        touches[(3, 2)] = value;
        touches
    };
    for (touches, components, words) in [
        (good.select_columns(&[0]), 2, "at least 2 touches; there is 1"),
        (Matrix::new(0, 4, vec![]), 2, "no features"),
        (good.clone(), 0, "0 components"),
        (with(f64::NAN), 2, "touch 2, feature 3 is NaN"),
        (with(f64::INFINITY), 2, "touch 2, feature 3 is inf"),
        (
            with(1e200),
            2,
            "the squares of 4 touches of 7 features are beyond",
        ),
        (Matrix::new(7, 4, vec![0.1; 28]), 2, "all 4 touches are the same"),
        (Matrix::new(7, 4, vec![0.0; 28]), 2, "all 4 touches are the same"),
    ] {
        let error = Pca::fit(&touches, components, Solver::Auto)
            .unwrap_err()
            .to_string();
        assert!(error.contains(words), "{error}");
    }
    let map = Pca::fit(&good, 2, Solver::Auto).unwrap();
    let other = PalpationError::OtherProbe {
        expected: 7,
        found: 8,
    };
    assert_eq!(map.project(&touches(8, 4, 0)), Err(other));
}
