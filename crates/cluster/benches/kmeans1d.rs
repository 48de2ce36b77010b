//! Exact one-dimensional k-means: `cargo bench -p taxel-cluster`.

use divan::Bencher;
use taxel_cluster::Kmeans1d;

fn main() {
    divan::main();
}

fn forces(n: usize, seed: u64) -> Vec<f64> {
    let mut state = seed;
    let mut values: Vec<f64> = (0..n)
        .map(|_| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            let u = (state >> 11) as f64 / (1u64 << 53) as f64;
            50.0 + 500.0 * (1.0 / (1.0 - 0.99 * u) - 1.0)
        })
        .collect();
    values.sort_unstable_by(f64::total_cmp);
    values
}

const SIZES: &[(usize, usize)] = &[
    (16, 4),
    (100, 8),
    (240, 4),
    (240, 8),
    (240, 16),
    (4096, 8),
    (4096, 64),
    (65536, 8),
    (65536, 64),
];

#[divan::bench(args = SIZES)]
fn cold(bencher: Bencher, (n, k): (usize, usize)) {
    let values = forces(n, 1);
    let mut solver = Kmeans1d::new(n, k);
    bencher.bench_local(|| {
        solver.forget();
        solver.solve(divan::black_box(&values), k).expect("sorted").cost
    });
}

#[divan::bench(args = SIZES)]
fn warm(bencher: Bencher, (n, k): (usize, usize)) {
    let values = forces(n, 1);
    let mut solver = Kmeans1d::new(n, k);
    bencher.bench_local(|| solver.solve(divan::black_box(&values), k).expect("sorted").cost);
}
