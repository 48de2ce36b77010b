//! Every phantom and motion of a manifest, judged; and which motion tells classes apart best.

use super::figures;
use super::manifest::{Job, read_manifest};
use super::trial::{RANKS, READINGS, Row, Trial, abstractions, judge, phantoms};
use anyhow::Context;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use taxel_hand::plural;
use taxel_playback::progress::Progress;
use taxel_record::ReadOptions;

/// Reads and judges every job of the manifest, draws figures, and returns what is printed.
pub(super) fn run(
    manifest: &Path,
    options: &ReadOptions,
    window: Option<f64>,
    folder: Option<&Path>,
    seed: u64,
    json: bool,
) -> anyhow::Result<String> {
    let jobs = read_manifest(manifest, options)?;
    if let Some(folder) = folder {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    let trials = trials(&jobs, window, seed)?;
    let rows: Vec<&Row> = trials.iter().flat_map(|trial| &trial.rows).collect();
    if let Some(folder) = folder {
        let path = folder.join("sweep.csv");
        let mut writer = csv::Writer::from_path(&path).with_context(|| path.display().to_string())?;
        for row in &rows {
            writer.serialize(row)?;
        }
        writer.flush()?;
        figures::draw(&trials, folder, seed)?;
    }
    if json {
        return Ok(serde_json::to_string(&rows)? + "\n");
    }
    Ok(summary(&trials))
}

/// Every job on every processor.
fn trials(jobs: &[Job], window: Option<f64>, seed: u64) -> anyhow::Result<Vec<Trial>> {
    let progress = Progress::new(jobs.len() as u64, "motions");
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    let work = || {
        while let Some((number, job)) = {
            let number = next.fetch_add(1, Ordering::Relaxed);
            jobs.get(number).map(|job| (number, job))
        } {
            let trial = job.read().and_then(|set| judge(set.last_mm(window)?, seed));
            progress.advance(1);
            let failed = trial.is_err();
            done.lock()
                .unwrap_or_else(PoisonError::into_inner)
                .push((number, trial));
            if failed {
                next.store(jobs.len(), Ordering::Relaxed);
            }
        }
    };
    let workers = std::thread::available_parallelism()
        .map_or(1, usize::from)
        .min(jobs.len());
    std::thread::scope(|scope| (0..workers).for_each(|_| drop(scope.spawn(work))));
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, trial)| trial).collect()
}

fn summary(trials: &[Trial]) -> String {
    let rows = || trials.iter().flat_map(|trial| &trial.rows);
    let mut text = format!(
        "{}; {} of {} divisions into categories are proved to be the best\n",
        plural(trials.len(), "motion"),
        rows().filter(|row| row.proved).count(),
        rows().count(),
    );
    for phantom in phantoms(trials) {
        let _ = writeln!(text, "\n{phantom:<26}{:>26}{:>26}", "vertical", "any motion");
        let of = |vertical: bool| -> Vec<&Trial> {
            let those = trials.iter().filter(|t| t.set.phantom == phantom);
            those.filter(|t| !vertical || !t.motion.is_rotary()).collect()
        };
        let clusters = of(false)
            .first()
            .map(|trial| abstractions(&trial.set))
            .unwrap_or_default();
        for (place, k) in clusters.iter().enumerate() {
            for (name, value) in READINGS {
                let best = |vertical: bool| {
                    let best = of(vertical)
                        .into_iter()
                        .max_by(|a, b| value(&a.rows[place]).total_cmp(&value(&b.rows[place])));
                    best.map_or_else(String::new, |t| {
                        format!(
                            "{:.3} at {} / {} mm",
                            value(&t.rows[place]),
                            t.motion.depth_mm,
                            t.motion.radius_mm
                        )
                    })
                };
                let _ = writeln!(text, "  K = {k} {name:<18}{:>26}{:>26}", best(true), best(false));
            }
        }
        // Other classes than the publication's have no ranks.
        let is_ranked = of(false).iter().any(|trial| trial.ranking.is_some());
        for (n, (name, _)) in RANKS.iter().enumerate().filter(|_| is_ranked) {
            let sure = |vertical: bool| {
                let with = of(vertical)
                    .into_iter()
                    .filter_map(|t| Some((t.ranking.as_ref()?.1[n], t)));
                // Where no draw of any motion has the order, none is the best.
                with.filter(|(p, _)| *p > 0.0)
                    .max_by(|a, b| a.0.total_cmp(&b.0))
                    .map_or_else(
                        || "none".to_owned(),
                        |(p, t)| format!("{p:.3} at {} / {} mm", t.motion.depth_mm, t.motion.radius_mm),
                    )
            };
            let _ = writeln!(text, "  {name:<24}{:>26}{:>26}", sure(true), sure(false));
        }
    }
    text += "\nsilhouettes and accuracy at depth / radius";
    if trials.iter().any(|trial| trial.ranking.is_some()) {
        text += "; a rank with the share of draws in which it holds";
    }
    text + "\n"
}
