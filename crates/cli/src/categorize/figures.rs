//! The publication's figures 6 to 17, of any sweep.

use super::trial::{CLASSES, RANKS, READINGS, Row, Trial, abstractions, phantoms};
use anyhow::Context;
use std::path::Path;
use taxel_palpation::{Matrix, Pca, Silhouette, Solver, optimal};
use taxel_playback::progress::Progress;
use taxel_plot::{Axis, Chart, Picture, Sheet};

/// Subsets of a size that are drawn where there are more.
const SUBSETS: usize = 60;

/// Draws all of them that the trials allow.
pub(super) fn draw(trials: &[Trial], folder: &Path, seed: u64) -> anyhow::Result<()> {
    let figures = Figures { trials, seed };
    // The publication shows its second phantom but for figures 13 and 14.
    let Some(&phantom) = phantoms(trials).last() else {
        return Ok(());
    };
    let vertical = figures.of(phantom, 0.0);
    let radius = trials.iter().map(|t| t.motion.radius_mm).fold(0.0, f64::max);
    let rotary = if radius > 0.0 {
        figures.of(phantom, radius)
    } else {
        Vec::new()
    };
    let progress = Progress::new(12, "figures");
    let save = |number: u32, sheet: Sheet| {
        progress.advance(1);
        figures.save(number, &sheet, folder)
    };
    if let (Some(&first), Some(&last)) = (vertical.first(), vertical.last()) {
        let ends = distinct([first, last]);
        save(6, figures.raw(&ends))?;
        let poor = rotary.first().copied().unwrap_or(last);
        save(7, figures.components(&distinct([first, poor]))?)?;
        if let Some(two) = two_classes(first) {
            let title = format!("{phantom}: two classes on the map");
            save(10, figures.maps(&title, &ends, &two, false))?;
        }
        let title = format!("{phantom}: vertical");
        save(14, figures.maps(&title, &ends, &classes(first), true))?;
    }
    let motions = [("vertical", &vertical), ("rotary", &rotary)];
    let subsets = figures.subsets(&motions)?;
    for (number, part, by_class) in [(8, 0, false), (9, 0, true), (11, 1, false), (12, 1, true)] {
        save(number, figures.basis(number, phantom, &subsets, part, by_class))?;
    }
    save(13, figures.abstractions())?;
    if let (Some(&first), Some(&last)) = (rotary.first(), rotary.last()) {
        let least = trials
            .iter()
            .map(|t| t.motion.radius_mm)
            .filter(|r| *r > 0.0)
            .fold(radius, f64::min);
        let narrow = figures.of(phantom, least);
        let ends = distinct(narrow.first().copied().into_iter().chain([first, last]));
        let title = format!("{phantom}: rotary");
        save(15, figures.maps(&title, &ends, &classes(first), true))?;
    }
    save(16, figures.distances(phantom, &vertical))?;
    save(17, figures.ranked(phantom, &vertical))?;
    Ok(())
}

struct Figures<'a> {
    trials: &'a [Trial],
    seed: u64,
}

/// For one motion and one kind of basis: low, middle and high of what its maps keep, and of their silhouettes.
struct Judged {
    panel: &'static str,
    depth_mm: f64,
    basis: String,
    by_class: bool,
    values: [[f64; 3]; 2],
}

impl Figures<'_> {
    /// Trials of a phantom and radius, by depth.
    fn of(&self, phantom: &str, radius_mm: f64) -> Vec<&Trial> {
        let those = |t: &&Trial| t.set.phantom == phantom && t.motion.radius_mm == radius_mm;
        let mut trials: Vec<&Trial> = self.trials.iter().filter(those).collect();
        trials.sort_by(|a, b| a.motion.depth_mm.total_cmp(&b.motion.depth_mm));
        trials
    }

    /// A sheet and its numbers. One without panels, which the sweep has no motions for, is left out.
    fn save(&self, number: u32, sheet: &Sheet, folder: &Path) -> anyhow::Result<()> {
        let (svg, csv) = match sheet.svg() {
            Ok(svg) => (svg, sheet.csv()),
            Err(taxel_plot::PlotError::Empty { .. }) => return Ok(()),
            Err(error) => return Err(error.into()),
        };
        for (ending, text) in [("svg", svg), ("csv", csv)] {
            let path = folder.join(format!("figure-{number:02}.{ending}"));
            std::fs::write(&path, text).with_context(|| path.display().to_string())?;
        }
        Ok(())
    }

    /// Figure 6: the touch of an area without an inclusion and of one with a big deep one, at two depths.
    fn raw(&self, trials: &[&Trial]) -> Sheet {
        let last = trials[trials.len() - 1];
        let title = format!(
            "{}: counts of each taxel (row) at each step (column)",
            last.set.phantom
        );
        let mut sheet = Sheet::new(title).columns(2).panel_size(420, 190);
        let most = (last.touches.as_slice().iter()).fold(0.0f64, |most, x| most.max(x.abs()));
        for trial in trials {
            for class in ["NA", "BD"] {
                let Some(touch) = trial.set.labels.iter().position(|label| label == class) else {
                    continue;
                };
                let (taxels, steps) = (trial.taxels, trial.touches.nrows() / trial.taxels);
                let values = (0..taxels).flat_map(|taxel| (0..steps).map(move |step| (taxel, step)));
                let values = values.map(|(taxel, step)| trial.touches[(step * taxels + taxel, touch)]);
                let title = format!("{class}, {}", trial.motion);
                sheet = sheet.picture(Picture::heat(title, steps, values).span(0.0, most));
            }
        }
        sheet
    }

    /// Figure 7: share of each component, for a good and a poor basis.
    fn components(&self, trials: &[&Trial]) -> anyhow::Result<Sheet> {
        let title = format!("{}: variance of each component", trials[0].set.phantom);
        let mut sheet = Sheet::new(title).columns(2).panel_size(420, 280);
        for trial in trials {
            let all = trial.explained_variance.clone();
            let four: Vec<usize> = (0..trial.touches.ncols()).step_by(4).collect();
            let few = Pca::fit(&trial.touches.select_columns(&four), 8, Solver::Auto)?.explained_variance();
            let names = (1..=8).map(|n| format!("p{n}"));
            let chart = Chart::new(
                trial.motion.to_string(),
                Axis::of_names("component", names),
                Axis::new("share of the variance of its basis").range(0.0, 1.0),
            );
            let areas = |count: usize| format!("{count} areas");
            let chart = chart.bars(areas(trial.touches.ncols()), all);
            sheet = sheet.chart(chart.bars(areas(four.len()), few));
        }
        Ok(sheet)
    }

    /// Touches that a map is made of, by name: of a size, or of classes.
    fn bases(&self, trial: &Trial) -> Vec<(String, bool, Vec<Vec<usize>>)> {
        let count = trial.touches.ncols();
        let mut bases = Vec::new();
        for size in [2, 4, 8, 16].into_iter().filter(|size| *size <= count) {
            let draws = if size == count { 1 } else { SUBSETS };
            let subsets =
                (0..draws).map(|draw| subset(count, size, self.seed ^ (draw as u64) << 8 ^ size as u64));
            bases.push((format!("{size} areas"), false, subsets.collect()));
        }
        let first = |classes: &[&str]| -> Option<Vec<usize>> {
            let mut chosen = Vec::new();
            for class in classes {
                let next = (0..count).find(|t| trial.set.labels[*t] == *class && !chosen.contains(t))?;
                chosen.push(next);
            }
            Some(chosen)
        };
        for (name, classes) in [
            ("NA, SS, BS, BD", ["NA", "SS", "BS", "BD"]),
            ("NA, NA, SS, SD", ["NA", "NA", "SS", "SD"]),
            ("NA, NA, NA, NA", ["NA"; 4]),
        ] {
            bases.extend(first(&classes).map(|chosen| (name.to_owned(), true, vec![chosen])));
        }
        bases
    }

    /// What maps of few touches are worth, judged on all.
    fn subsets(&self, motions: &[(&'static str, &Vec<&Trial>)]) -> anyhow::Result<Vec<Judged>> {
        let total: usize = motions.iter().map(|(_, trials)| trials.len()).sum();
        let progress = Progress::new(total as u64, "motions with few areas");
        let mut all = Vec::new();
        for (panel, trials) in motions {
            for trial in *trials {
                let clusters = abstractions(&trial.set).last().copied().unwrap_or(2);
                for (basis, by_class, subsets) in self.bases(trial) {
                    let values = subsets
                        .iter()
                        .map(|chosen| judged(&trial.touches, chosen, clusters, self.seed));
                    let values = values.collect::<anyhow::Result<Vec<_>>>()?;
                    let quartiles = |part: usize| {
                        let mut sorted: Vec<f64> = values.iter().map(|v| v[part]).collect();
                        sorted.sort_by(f64::total_cmp);
                        [1, 2, 3].map(|q| sorted[(sorted.len() - 1) * q / 4])
                    };
                    all.push(Judged {
                        panel,
                        depth_mm: trial.motion.depth_mm,
                        basis,
                        by_class,
                        values: [quartiles(0), quartiles(1)],
                    });
                }
                progress.advance(1);
            }
        }
        Ok(all)
    }

    /// Figures 8, 9, 11 and 12: what maps of few areas keep, and how clear categories are on them.
    fn basis(&self, number: u32, phantom: &str, judged: &[Judged], part: usize, by_class: bool) -> Sheet {
        let what = [
            "share of the variance of all areas",
            "silhouette per category, K = 5",
        ][part];
        let mut sheet = Sheet::new(format!(
            "{phantom}: figure {number}, maps of few areas judged on all"
        ))
        .columns(2)
        .panel_size(420, 300);
        for panel in ["vertical", "rotary"] {
            let those = || {
                judged
                    .iter()
                    .filter(|j| j.panel == panel && j.by_class == by_class)
            };
            if those().next().is_none() {
                continue;
            }
            let mut names: Vec<&str> = Vec::new();
            those().for_each(|j| {
                if !names.contains(&j.basis.as_str()) {
                    names.push(&j.basis);
                }
            });
            let mut chart = Chart::new(panel, Axis::new("depth, mm"), Axis::new(what));
            for name in names {
                let of = || those().filter(|j| j.basis == name);
                if !by_class {
                    chart = chart.band(
                        name,
                        of().map(|j| (j.depth_mm, j.values[part][0], j.values[part][2])),
                    );
                }
                chart = chart.line(name, of().map(|j| (j.depth_mm, j.values[part][1])));
            }
            sheet = sheet.chart(chart);
        }
        sheet
    }

    /// Figures 10, 14 and 15: classes on the map, with their two-sigma ellipses.
    fn maps(&self, title: &str, trials: &[&Trial], classes: &[String], ellipses: bool) -> Sheet {
        let mut sheet = Sheet::new(title).columns(trials.len()).panel_size(400, 340);
        for trial in trials {
            sheet = sheet.chart(map(trial.motion.to_string(), trial, classes, ellipses));
        }
        sheet
    }

    /// Figure 13: silhouettes over depth for each number of categories, in all readings.
    fn abstractions(&self) -> Sheet {
        let mut sheet = Sheet::new("Silhouette and accuracy over depth, vertical")
            .columns(READINGS.len())
            .panel_size(320, 280);
        for phantom in phantoms(self.trials) {
            for (name, value) in READINGS {
                let trials = self.of(phantom, 0.0);
                let clusters = trials
                    .first()
                    .map(|trial| abstractions(&trial.set))
                    .unwrap_or_default();
                if clusters.is_empty() {
                    continue;
                }
                let mut chart = Chart::new(
                    format!("{phantom}, {name}"),
                    Axis::new("depth, mm"),
                    Axis::new(name),
                );
                for (place, k) in clusters.iter().enumerate() {
                    let of = |trial: &&Trial| (trial.motion.depth_mm, value(&trial.rows[place] as &Row));
                    chart = chart.line(format!("K = {k}"), trials.iter().map(of));
                }
                sheet = sheet.chart(chart);
            }
        }
        sheet
    }

    /// Figure 16: distance of each class from the first over depth.
    fn distances(&self, phantom: &str, trials: &[&Trial]) -> Sheet {
        let sheet = Sheet::new(format!("{phantom}: distance of matched categories from NA"))
            .columns(2)
            .panel_size(460, 320);
        let ranked = || {
            trials
                .iter()
                .filter_map(|t| Some((t.motion.depth_mm, t.ranking.as_ref()?)))
        };
        if ranked().next().is_none() {
            return sheet;
        }
        let mut distances = Chart::new(
            "",
            Axis::new("depth, mm"),
            Axis::new("distance on the map, counts").from_zero(),
        );
        for (n, class) in CLASSES.iter().enumerate().skip(1) {
            distances = distances.line(
                *class,
                ranked().map(|(depth, (distances, _))| (depth, distances[n])),
            );
        }
        let mut sure = Chart::new(
            "",
            Axis::new("depth, mm"),
            Axis::new("share of draws with this order").range(0.0, 1.0),
        );
        for (n, (name, _)) in RANKS.iter().enumerate() {
            sure = sure.line(
                *name,
                ranked().map(|(depth, (_, probabilities))| (depth, probabilities[n])),
            );
        }
        sheet.chart(distances).chart(sure)
    }

    /// Figure 17: the maps of the motions that are most sure of each ranking.
    fn ranked(&self, phantom: &str, trials: &[&Trial]) -> Sheet {
        let mut sheet = Sheet::new(format!("{phantom}: ranked by depth and by size"))
            .columns(2)
            .panel_size(400, 340);
        for (n, (name, _)) in RANKS.iter().enumerate() {
            let sure = |trial: &Trial| trial.ranking.as_ref().map_or(-1.0, |(_, p)| p[n]);
            let best = trials.iter().max_by(|a, b| sure(a).total_cmp(&sure(b)));
            if let Some(trial) = best.filter(|trial| sure(trial) > 0.0) {
                let title = format!("{name} in {:.2} of draws, {}", sure(trial), trial.motion);
                sheet = sheet.chart(map(title, trial, &classes(trial), false));
            }
        }
        sheet
    }
}

/// The classes that a trial has: the publication's in its order, others in that of their first touches.
fn classes(trial: &Trial) -> Vec<String> {
    let (mut names, _) = trial.set.classes().unwrap_or_default();
    names.sort_by_key(|name| CLASSES.iter().position(|class| class == name));
    names
}

/// The two classes of figure 10: the publication's, or those that there are. Figure 14 has any number of them.
fn two_classes(trial: &Trial) -> Option<Vec<String>> {
    let all = classes(trial);
    let publications = ["NA", "BS"].map(str::to_owned);
    match publications.iter().all(|class| all.contains(class)) {
        true => Some(publications.to_vec()),
        false => Some(all).filter(|all| all.len() == 2),
    }
}

/// Trials without those that are there already.
fn distinct<'a>(trials: impl IntoIterator<Item = &'a Trial>) -> Vec<&'a Trial> {
    let mut all: Vec<&Trial> = Vec::new();
    for trial in trials {
        if !all.iter().any(|known| std::ptr::eq(*known, trial)) {
            all.push(trial);
        }
    }
    all
}

/// Classes on a map.
fn map(title: String, trial: &Trial, classes: &[String], ellipses: bool) -> Chart {
    let mut chart = Chart::new(title, Axis::new("first component"), Axis::new("second component"));
    for class in classes {
        let labels = trial
            .set
            .labels
            .iter()
            .enumerate()
            .filter(|(_, label)| *label == class);
        let points: Vec<(f64, f64)> = labels
            .map(|(n, _)| (trial.map[(0, n)], trial.map[(1, n)]))
            .collect();
        if ellipses {
            chart = chart.ellipse(class, points.iter().copied());
        }
        chart = chart.points(class, points);
    }
    chart
}

/// What a map of some touches keeps of all, and the silhouette of categories on it, as printed.
fn judged(touches: &Matrix, basis: &[usize], clusters: usize, seed: u64) -> anyhow::Result<[f64; 2]> {
    let pca = Pca::fit(&touches.select_columns(basis), 2, Solver::Auto)?;
    let map = pca.project(touches)?;
    let found = optimal(&map, clusters, seed)?;
    let kept = pca.kept_variance(touches)?.iter().sum();
    Ok([kept, Silhouette::of(&map, &found.labels)?.cluster])
}

/// Some of `count` touches: the first of a shuffle.
fn subset(count: usize, size: usize, seed: u64) -> Vec<usize> {
    let mut state = seed ^ 0x9E37_79B9_7F4A_7C15;
    let mut all: Vec<usize> = (0..count).collect();
    for n in 0..size {
        // Knuth's MMIX generator; its high bits.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        all.swap(n, n + (state >> 33) as usize % (count - n));
    }
    all.truncate(size);
    all
}
