//! One phantom and motion, judged.

use super::matrix;
use super::touches::Set;
use anyhow::{Context, ensure};
use serde::Serialize;
use taxel_palpation::{Agreement, Matrix, Pca, Ranking, Silhouette, Solver, optimal};
use taxel_sequence::Motion;

/// The classes of the publication: nothing, small and shallow, big and shallow, small and deep, big and deep.
pub(super) const CLASSES: [&str; 5] = ["NA", "SS", "BS", "SD", "BD"];
/// Its rankings, as numbers of [`CLASSES`]: by depth, and by size.
pub(super) const RANKS: [(&str, [&[usize]; 3]); 2] = [
    ("rank-1", [&[0], &[3, 4], &[1, 2]]),
    ("rank-2", [&[0], &[1, 3], &[2, 4]]),
];
/// Draws for the probability of a ranking.
const DRAWS: u32 = 500;

/// One phantom and motion.
#[derive(Debug)]
pub(super) struct Trial {
    pub(super) set: Set,
    pub(super) motion: Motion,
    /// `D x N`.
    pub(super) touches: Matrix,
    pub(super) taxels: usize,
    /// The map of all touches.
    pub(super) map: Matrix,
    pub(super) explained_variance: Vec<f64>,
    pub(super) rows: Vec<Row>,
    /// Distance of each of [`CLASSES`] from the first, and the probability of each of [`RANKS`]; `None` where a touch is
    /// of another class or a class has no touch.
    pub(super) ranking: Option<(Vec<f64>, [f64; 2])>,
}

/// One phantom, motion and number of categories, as printed.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Row {
    phantom: String,
    depth_mm: f64,
    radius_mm: f64,
    touches: usize,
    features: usize,
    pub(super) explained_variance: f64,
    pub(super) clusters: usize,
    pub(super) silhouette_cluster: f64,
    pub(super) silhouette_macro: f64,
    pub(super) silhouette_standard: f64,
    /// The standard one of the true classes: how well the map keeps them apart, whatever categories are found on it.
    pub(super) silhouette_classes: f64,
    /// The publication's a(i) and b(i), averaged over the true classes of this number.
    within: f64,
    between: f64,
    pub(super) accuracy: f64,
    ari: f64,
    pub(super) proved: bool,
    rank_1_probability: Option<f64>,
    rank_2_probability: Option<f64>,
}

/// The class of a touch where so many are told apart: all five; nothing, small, large; nothing, something. Classes that
/// are not the publication's stay as they are.
pub(super) fn merged(label: &str, clusters: usize) -> &str {
    match (clusters, label) {
        (_, "NA") => "NA",
        (2, "SS" | "SD" | "BS" | "BD") => "inclusion",
        (3, "SS" | "SD") => "small",
        (3, "BS" | "BD") => "big",
        (_, other) => other,
    }
}

/// How many categories are looked for: the publication's 2, 3 and 5, or as many as there are classes.
pub(super) fn abstractions(set: &Set) -> Vec<usize> {
    let known = |label: &String| CLASSES.contains(&label.as_str());
    if set.labels.iter().all(known) {
        return vec![2, 3, 5];
    }
    set.classes().map_or(vec![], |(names, _)| vec![names.len()])
}

/// What motions are compared by.
type Reading = (&'static str, fn(&Row) -> f64);
pub(super) const READINGS: [Reading; 5] = [
    ("as printed", |row| row.silhouette_cluster),
    ("macro", |row| row.silhouette_macro),
    ("standard", |row| row.silhouette_standard),
    ("of the classes", |row| row.silhouette_classes),
    ("accuracy", |row| row.accuracy),
];

/// Judges the touches of one phantom and motion.
pub(super) fn judge(set: Set, seed: u64) -> anyhow::Result<Trial> {
    let Some(motion) = set.motion else {
        anyhow::bail!(
            "{}: a sweep is over motions; give each touch a depth and a radius. Touches without a depth are aligned by time and \
             judged without --sweep, those of one phantom at once: keep the lines of one phantom in a manifest of its own",
            set.name
        );
    };
    let name = set.name.clone();
    let aligned = set.align(None)?;
    let touches = matrix(&aligned);
    let inner = || -> anyhow::Result<_> {
        let pca = Pca::fit(&touches, 8, Solver::Auto)?;
        let explained_variance = pca.explained_variance();
        let map = Pca::fit(&touches, 2, Solver::Auto)?.project(&touches)?;
        let ranking = ranking(&set, &map, seed)?;
        ensure!(
            !abstractions(&set).is_empty(),
            "a touch has no label, so nothing can be compared"
        );
        let kept = explained_variance.iter().take(2).sum();
        let rows = abstractions(&set).into_iter().map(|clusters| {
            let found = optimal(&map, clusters, seed)?;
            let silhouette = Silhouette::of(&map, &found.labels)?;
            let classes = numbers(&set.labels, clusters);
            let truth = Silhouette::of(&map, &classes)?;
            let agreement = Agreement::of(&found.labels, &classes)?;
            let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
            Ok(Row {
                phantom: set.phantom.clone(),
                depth_mm: motion.depth_mm,
                radius_mm: motion.radius_mm,
                touches: touches.ncols(),
                features: touches.nrows(),
                explained_variance: kept,
                clusters,
                silhouette_cluster: silhouette.cluster,
                silhouette_macro: silhouette.macro_average,
                silhouette_standard: silhouette.standard,
                silhouette_classes: truth.standard,
                within: mean(&truth.within),
                between: mean(&truth.between),
                accuracy: agreement.accuracy,
                ari: agreement.ari,
                proved: found.proved,
                rank_1_probability: ranking.as_ref().map(|(_, p)| p[0]),
                rank_2_probability: ranking.as_ref().map(|(_, p)| p[1]),
            })
        });
        Ok((
            explained_variance,
            rows.collect::<anyhow::Result<_>>()?,
            map,
            ranking,
        ))
    };
    let (explained_variance, rows, map, ranking) = inner().with_context(|| name)?;
    Ok(Trial {
        taxels: aligned.taxels,
        explained_variance,
        rows,
        map,
        ranking,
        set,
        motion,
        touches,
    })
}

/// The class of each touch where so many are told apart, numbered in the order of their first touches.
pub(super) fn numbers(labels: &[String], clusters: usize) -> Vec<usize> {
    let mut names: Vec<&str> = Vec::new();
    let mut numbers = Vec::new();
    for label in labels {
        let name = merged(label, clusters);
        numbers.push(names.iter().position(|n| *n == name).unwrap_or(names.len()));
        if numbers.last() == Some(&names.len()) {
            names.push(name);
        }
    }
    numbers
}

/// Distances of the classes as they are matched with five categories, as in the publication's section 4.4.
fn ranking(set: &Set, map: &Matrix, seed: u64) -> anyhow::Result<Option<(Vec<f64>, [f64; 2])>> {
    let number = |label: &String| CLASSES.iter().position(|class| class == label);
    let Some(classes) = set.labels.iter().map(number).collect::<Option<Vec<_>>>() else {
        return Ok(None);
    };
    if (0..CLASSES.len()).any(|class| !classes.contains(&class)) {
        return Ok(None);
    }
    let found = optimal(map, CLASSES.len(), seed)?;
    let matched = Agreement::of(&found.labels, &classes)?.relabelled(&found.labels);
    let ranking = Ranking::of(map, &matched, 0)?;
    let mut probabilities = [0.0; 2];
    for ((_, groups), probability) in RANKS.iter().zip(&mut probabilities) {
        *probability = Ranking::probability(map, &matched, 0, groups, DRAWS, seed)?;
    }
    Ok(Some((ranking.distances().to_vec(), probabilities)))
}

/// The names of the phantoms in the order of the manifest.
pub(super) fn phantoms(trials: &[Trial]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for trial in trials {
        if !names.contains(&trial.set.phantom.as_str()) {
            names.push(&trial.set.phantom);
        }
    }
    names
}
