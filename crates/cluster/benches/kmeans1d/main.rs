//! Exact one-dimensional k-means by three algorithms: `cargo bench -p taxel-cluster`.

mod layers;

use divan::Bencher;
use layers::Layers;
use taxel_cluster::Kmeans1d;

fn main() {
    for (n, k) in [(16, 2), (16, 8), (240, 8), (1000, 33)] {
        let values = forces(n, 5);
        let solved = Kmeans1d::new(n, k).solve(&values, k).expect("sorted").cost;
        let mut layers = Layers::new(n, k);
        for cost in [layers.by_halving(&values, k), layers.by_smawk(&values, k)] {
            assert!(
                (cost - solved).abs() <= 1e-9 * solved,
                "n = {n}, k = {k}: {cost} and {solved}"
            );
        }
    }
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
    (16, 2),
    (16, 8),
    (100, 8),
    (240, 2),
    (240, 8),
    (240, 16),
    (240, 64),
    (1024, 8),
    (4096, 8),
    (4096, 64),
    (65536, 2),
    (65536, 8),
    (65536, 64),
];

#[divan::bench(args = SIZES, sample_count = 20)]
fn halving(bencher: Bencher, (n, k): (usize, usize)) {
    let values = forces(n, 1);
    let mut layers = Layers::new(n, k);
    bencher.bench_local(|| layers.by_halving(divan::black_box(&values), k));
}

#[divan::bench(args = SIZES, sample_count = 20)]
fn smawk(bencher: Bencher, (n, k): (usize, usize)) {
    let values = forces(n, 1);
    let mut layers = Layers::new(n, k);
    bencher.bench_local(|| layers.by_smawk(divan::black_box(&values), k));
}

#[divan::bench(args = SIZES, sample_count = 20)]
fn penalty_cold(bencher: Bencher, (n, k): (usize, usize)) {
    let values = forces(n, 1);
    let mut solver = Kmeans1d::new(n, k);
    bencher.bench_local(|| {
        solver.forget();
        solver.solve(divan::black_box(&values), k).expect("sorted").cost
    });
}

#[divan::bench(args = SIZES, sample_count = 20)]
fn penalty_warm(bencher: Bencher, (n, k): (usize, usize)) {
    let values = forces(n, 1);
    let mut solver = Kmeans1d::new(n, k);
    bencher.bench_local(|| solver.solve(divan::black_box(&values), k).expect("sorted").cost);
}
