//! How long training and estimates take: `cargo run --release -p taxel-forearm --example estimate_times -- SESSION`.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;
use taxel_forearm::{Estimator, Kinesthetic, Session, Trial, splits};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let data = std::env::args()
        .nth(1)
        .ok_or("name a session: an .npz or a folder of .mat files")?;
    let session = Session::open(Path::new(&data))?;
    let splits = splits(&session, 20, 1);
    let mut best_s = f64::INFINITY;
    let mut models = Vec::new();
    for _ in 0..5 {
        models.clear();
        let began = Instant::now();
        for split in &splits {
            let trials: Vec<&Trial> = split.train.iter().map(|n| &session.trials[*n]).collect();
            models.push(Kinesthetic::train(&trials)?);
        }
        best_s = began.elapsed().as_secs_f64().min(best_s);
    }
    let mut took_us = Vec::new();
    for (model, split) in models.iter().zip(&splits) {
        for n in &split.test {
            let began = Instant::now();
            black_box(model.estimate(black_box(&session.trials[*n].squeeze))?);
            took_us.push(began.elapsed().as_secs_f64() * 1e6);
        }
    }
    took_us.sort_by(f64::total_cmp);
    let at = |share: f64| took_us[(share * (took_us.len() - 1) as f64) as usize];
    println!(
        "training of {} estimators: {best_s:.2} s, best of 5",
        splits.len()
    );
    println!(
        "an estimate from a whole squeeze: {:.1} us (median), {:.1} us (p99)",
        at(0.5),
        at(0.99)
    );
    Ok(())
}
