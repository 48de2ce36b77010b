//! How long a set of touches takes, and what is found: for `tests/peers/palpation.py`, which gives the same touches to
//! scikit-learn.
//!
//!     cargo run --release -p taxel-palpation --example map_times -- FEATURES TOUCHES CLUSTERS REPEATS

use serde_json::json;
use std::time::Instant;
use taxel_palpation::{Matrix, Pca, Silhouette, Solver, optimal};

/// Touches of five classes with noise, `D x N`: of integers, so that other programs make the same.
fn touches(features: usize, count: usize) -> Matrix {
    Matrix::from_fn(features, count, |d, n| {
        let class = n % 5;
        let signal = class * ((d * 31 + class * 17) % 101);
        let noise = (d * d * 7919 + n * 104_729 + d * n * 613) % 1009;
        signal as f64 + noise as f64 / 16.0
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let sizes: Vec<usize> = std::env::args()
        .skip(1)
        .map(|size| size.parse())
        .collect::<Result<_, _>>()?;
    let [features, count, clusters, repeats] = sizes[..] else {
        return Err("FEATURES TOUCHES CLUSTERS REPEATS".into());
    };
    let touches = touches(features, count);
    let mut best = [f64::INFINITY; 3];
    let mut found = None;
    for _ in 0..repeats {
        let began = Instant::now();
        let pca = Pca::fit(&touches, 2, Solver::Auto)?;
        let map = pca.project(&touches)?;
        let mapped = began.elapsed();
        let categories = optimal(&map, clusters, 1)?;
        let categorised = began.elapsed();
        let silhouette = Silhouette::of(&map, &categories.labels)?.standard;
        let times = [mapped, categorised - mapped, began.elapsed() - categorised].map(|t| t.as_secs_f64());
        best = std::array::from_fn(|n| best[n].min(times[n]));
        found = Some((pca, categories, silhouette));
    }
    let (pca, categories, silhouette) = found.ok_or("REPEATS is 0")?;
    let report = json!({
        "map_s": best[0], "categories_s": best[1], "silhouette_s": best[2],
        "explained_variance": pca.explained_variance(),
        "residuals": pca.residuals(), "singular_values": pca.singular_values(),
        "cost": categories.cost, "proved": categories.proved, "silhouette": silhouette,
    });
    println!("{report}");
    Ok(())
}
