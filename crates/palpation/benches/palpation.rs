//! Times of what a set of touches takes; `tests/peers/palpation` compares them with scikit-learn's.

use nalgebra::DMatrix;
use taxel_palpation::{Pca, Silhouette, Solver, optimal};

fn main() {
    divan::main();
}

/// Touches in five classes, `D x N`: made of an integer sequence, so that other programs can make the same.
fn touches(features: usize, count: usize) -> DMatrix<f64> {
    DMatrix::from_fn(features, count, |d, n| {
        let class = (n % 5) as f64;
        let noise = ((d * 7919 + n * 104_729) % 1009) as f64 / 1009.0;
        100.0 * class * ((d as f64 * (1.0 + class) / features as f64).sin()) + 20.0 * noise
    })
}

/// The publication's size: map, five categories, silhouette.
#[divan::bench]
fn small(bencher: divan::Bencher<'_, '_>) {
    let touches = touches(427, 16);
    bencher.bench(|| {
        let map = Pca::fit(&touches, 2, Solver::Exact)?.project(&touches)?;
        let categories = optimal(&map, 5, 1)?;
        Silhouette::of(&map, &categories.labels)
    });
}

/// The map alone.
#[divan::bench]
fn small_map(bencher: divan::Bencher<'_, '_>) {
    let touches = touches(427, 16);
    bencher.bench(|| Pca::fit(&touches, 2, Solver::Exact)?.project(&touches));
}
