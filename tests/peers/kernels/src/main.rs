//! Times `Kmeans1d` and the crate `ckmeans` on the same values: `peer-kernels FRAMES.npz K` on the
//! contacts of exported frames, `peer-kernels --made-up K` on made-up values. Prints one JSON
//! object. Times include sorting on both sides.

use ndarray::Array2;
use ndarray_npy::NpzReader;
use serde_json::{Value, json};
use std::error::Error;
use std::fs::File;
use std::hint::black_box;
use std::time::Instant;
use taxel_cluster::Kmeans1d;

const PASSES: usize = 9;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, clusters] = &arguments[..] else {
        return Err("usage: peer-kernels FRAMES.npz|--made-up K".into());
    };
    let clusters: u8 = clusters.parse()?;
    let output = match input.as_str() {
        "--made-up" => made_up(clusters),
        path => recorded(path, clusters)?,
    };
    println!("{output}");
    Ok(())
}

/// The forces of the contacts of every frame that has more of them than clusters; `ckmeans` refuses fewer.
fn recorded(path: &str, clusters: u8) -> Result<Value, Box<dyn Error>> {
    let mut npz = NpzReader::new(File::open(path)?)?;
    let force: Array2<f64> = npz.by_name("force")?;
    let contact: Array2<u8> = npz.by_name("contact")?;
    let frames: Vec<Vec<f64>> = (force.rows().into_iter().zip(contact.rows()))
        .map(|(force, contact)| {
            force
                .iter()
                .zip(contact)
                .filter(|(_, c)| **c > 0)
                .map(|(f, _)| *f)
                .collect()
        })
        .filter(|frame: &Vec<f64>| frame.len() > clusters.into())
        .collect();
    Ok(compare(&frames, clusters))
}

/// Heavy-tailed values, as contact forces are, that wander from one frame to the next.
fn made_up(clusters: u8) -> Value {
    let mut state = 1u64;
    let mut unit = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let sizes = [16, 64, 256, 1024, 4096, 16384, 65536];
    let of_size = |n: usize| {
        let mut values: Vec<f64> = (0..n)
            .map(|_| 50.0 + 500.0 * (1.0 / (1.0 - 0.99 * unit()) - 1.0))
            .collect();
        let frames: Vec<Vec<f64>> = (0..20)
            .map(|_| {
                values.iter_mut().for_each(|v| *v += unit() * 2.0);
                values.clone()
            })
            .collect();
        json!({"values": n, "kernels": compare(&frames, clusters)})
    };
    sizes.map(of_size).into()
}

/// The microseconds of each kernel for every frame, the least of some passes, and its error over
/// that of `Kmeans1d`.
fn compare(frames: &[Vec<f64>], clusters: u8) -> Value {
    let most = frames.iter().map(Vec::len).max().unwrap_or(1);
    let mut kernel = Kernel::new(most, clusters);
    let mut cold = |values: &[f64]| {
        kernel.solver.forget();
        kernel.cost(values, clusters)
    };
    let least: Vec<f64> = frames.iter().map(|frame| cold(frame)).collect();
    let mut laps = vec![vec![[0.0; 5]; PASSES]; frames.len()];
    for pass in 0..PASSES {
        for (frame, laps) in frames.iter().zip(&mut laps) {
            laps[pass][0] = microseconds(|| kernel.cost(frame, clusters));
        }
        for (frame, laps) in frames.iter().zip(&mut laps) {
            kernel.solver.forget();
            laps[pass][1] = microseconds(|| kernel.cost(frame, clusters));
        }
        for (frame, laps) in frames.iter().zip(&mut laps) {
            laps[pass][2] = microseconds(|| kernel.sort(frame));
        }
        for (frame, laps) in frames.iter().zip(&mut laps) {
            laps[pass][3] = microseconds(|| ckmeans::ckmeans(frame, clusters));
        }
        for (frame, laps) in frames.iter().zip(&mut laps) {
            laps[pass][4] = microseconds(|| ckmeans::ckmeans_indices(frame, clusters));
        }
    }
    let mut ratios = Vec::new();
    for (frame, least) in frames.iter().zip(&least) {
        if *least > 0.0 {
            ratios.push(ckmeans_error(frame, clusters) / least);
        }
    }
    let names = [
        "Kmeans1d, after the last frame",
        "Kmeans1d, cold",
        "of which sorting",
        "ckmeans",
        "ckmeans_indices",
    ];
    let mut result = json!({"frames": frames.len(), "ckmeans_error_ratio_min": fold(&ratios, f64::min), "ckmeans_error_ratio_max": fold(&ratios, f64::max)});
    for (n, name) in names.into_iter().enumerate() {
        let of_frame = |laps: &Vec<[f64; 5]>| laps.iter().map(|lap| lap[n]).fold(f64::INFINITY, f64::min);
        result[name] = laps.iter().map(of_frame).collect();
    }
    result
}

/// `Kmeans1d` as the force stage calls it: values sorted, equal ones merged.
struct Kernel {
    solver: Kmeans1d,
    sorted: Vec<f64>,
    values: Vec<f64>,
    counts: Vec<u32>,
}

impl Kernel {
    fn new(most: usize, clusters: u8) -> Self {
        Self {
            solver: Kmeans1d::new(most, clusters.into()),
            sorted: Vec::with_capacity(most),
            values: Vec::with_capacity(most),
            counts: Vec::with_capacity(most),
        }
    }

    fn sort(&mut self, values: &[f64]) {
        self.sorted.clear();
        self.sorted.extend_from_slice(values);
        // As bits, since forces are positive.
        self.sorted.sort_unstable_by_key(|value| value.to_bits());
    }

    fn cost(&mut self, values: &[f64], clusters: u8) -> f64 {
        self.sort(values);
        let all_differ = self.sorted.windows(2).all(|pair| pair[0] != pair[1]);
        let solved = if all_differ {
            self.solver.solve(&self.sorted, clusters.into())
        } else {
            self.values.clear();
            self.counts.clear();
            for equal in self.sorted.chunk_by(|a, b| a == b) {
                self.values.push(equal[0]);
                self.counts.push(equal.len() as u32);
            }
            self.solver
                .solve_weighted(&self.values, &self.counts, clusters.into())
        };
        solved.expect("finite values").cost
    }
}

fn microseconds<T>(what: impl FnOnce() -> T) -> f64 {
    let begin = Instant::now();
    black_box(what());
    begin.elapsed().as_nanos() as f64 / 1e3
}

fn fold(values: &[f64], of: fn(f64, f64) -> f64) -> Option<f64> {
    values.iter().copied().reduce(of)
}

fn ckmeans_error(values: &[f64], clusters: u8) -> f64 {
    let found = ckmeans::ckmeans(values, clusters).expect("more values than clusters");
    let of_cluster = |cluster: &Vec<f64>| {
        let first = cluster[0];
        let mean = first + cluster.iter().map(|v| v - first).sum::<f64>() / cluster.len() as f64;
        cluster.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>()
    };
    found.iter().map(of_cluster).sum()
}
