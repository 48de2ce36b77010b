//! What is told of the categories of one set of touches: for people, and as one object.

use super::touches::Set;
use serde::Serialize;
use std::fmt::Write as _;
use taxel_palpation::{Agreement, Categories, Matrix, Silhouette, stability};
use taxel_sequence::Aligned;

/// What `--json` prints.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    touches: usize,
    features: usize,
    aligned_by: String,
    first: f64,
    step: f64,
    steps: usize,
    frames_left_out: usize,
    explained_variance: Vec<f64>,
    labels: Vec<usize>,
    proved: bool,
    attempts: u32,
    silhouette: Readings,
    stability: f64,
    classes: Vec<String>,
    /// The class that each category stands for; null for one that stands for none.
    pub(super) class_of_label: Vec<Option<String>>,
    confusion: Vec<Vec<usize>>,
    accuracy: Option<f64>,
    ari: Option<f64>,
    map: Vec<Vec<f64>>,
}

/// The silhouette of the categories in three readings, and of the true classes.
#[derive(Debug, Serialize)]
struct Readings {
    cluster: f64,
    #[serde(rename = "macro")]
    macro_average: f64,
    standard: f64,
    /// The standard one of the true classes in place of the categories; null where they are not known.
    classes: Option<f64>,
}

/// Draws of the bootstrap.
const DRAWS: u32 = 100;

/// What became of the touches of a set.
pub(super) fn report(
    set: &Set,
    aligned: &Aligned,
    map: &Matrix,
    explained_variance: Vec<f64>,
    categories: Categories,
    seed: u64,
) -> anyhow::Result<Report> {
    let silhouette = Silhouette::of(map, &categories.labels)?;
    let known = set.classes();
    let agreement = known
        .as_ref()
        .map(|(_, classes)| Agreement::of(&categories.labels, classes))
        .transpose()?;
    let of_classes = known
        .as_ref()
        .filter(|(names, _)| names.len() > 1)
        .map(|(_, classes)| Silhouette::of(map, classes))
        .transpose()?
        .map(|silhouette| silhouette.standard);
    let classes = known.map(|(names, _)| names).unwrap_or_default();
    Ok(Report {
        touches: map.ncols(),
        features: aligned.features(),
        aligned_by: aligned.along.to_string(),
        first: aligned.first,
        step: aligned.step,
        steps: aligned.steps,
        frames_left_out: aligned.left_out + set.beyond,
        explained_variance,
        proved: categories.proved,
        attempts: categories.attempts,
        silhouette: Readings {
            cluster: silhouette.cluster,
            macro_average: silhouette.macro_average,
            standard: silhouette.standard,
            classes: of_classes,
        },
        stability: stability(map, &categories.labels, DRAWS, seed)?,
        class_of_label: (agreement.as_ref()).map_or_else(Vec::new, |a| stands_for(a, &classes)),
        confusion: (agreement.as_ref()).map_or_else(Vec::new, |a| a.confusion.clone()),
        accuracy: agreement.as_ref().map(|a| a.accuracy),
        ari: agreement.as_ref().map(|a| a.ari),
        labels: categories.labels,
        classes,
        map: map.column_iter().map(<[f64]>::to_vec).collect(),
    })
}

/// The name of the class that each category stands for. One that was matched only since nothing else was left, and has no
/// touch of its class, stands for none.
fn stands_for(agreement: &Agreement, classes: &[String]) -> Vec<Option<String>> {
    let matched = agreement.class_of.iter().zip(&agreement.confusion);
    let named = matched.map(|(class, touches)| {
        let has_any = touches.get(*class).is_some_and(|touches| *touches > 0);
        classes.get(*class).filter(|_| has_any).cloned()
    });
    named.collect()
}

/// The same for people.
pub(super) fn human(set: &Set, report: &Report) -> String {
    let mut text = format!(
        "{}: {} touches of {} features, {} steps by {} from {} on, {} each\n",
        set.name, report.touches, report.features, report.steps, report.aligned_by, report.first, report.step
    );
    if let Some(left_out) = set.frames_left_out(report.frames_left_out) {
        let _ = writeln!(text, "  {left_out}");
    }
    let kept: f64 = report.explained_variance.iter().sum();
    let _ = writeln!(text, "  variance on the map    {kept:.4} of all");
    let how = match (report.proved, report.attempts) {
        (true, _) => "proved to be the optimum".to_owned(),
        (false, 0) => "the best of many starts".to_owned(),
        (false, attempts) => format!("three starts agreed at attempt {attempts}"),
    };
    let _ = writeln!(
        text,
        "  categories             {}, {how}",
        report.labels.iter().max().map_or(0, |most| most + 1)
    );
    let s = &report.silhouette;
    let _ = writeln!(
        text,
        "  silhouette             {:.3} per category as printed, {:.3} macro, {:.3} standard",
        s.cluster, s.macro_average, s.standard
    );
    if let Some(classes) = s.classes {
        let _ = writeln!(
            text,
            "  ... of the classes     {classes:.3} standard, whatever the categories"
        );
    }
    let _ = writeln!(
        text,
        "  found again            {:.3} (mean ARI of {DRAWS} draws)",
        report.stability
    );
    if let (Some(accuracy), Some(ari)) = (report.accuracy, report.ari) {
        let _ = writeln!(
            text,
            "  agrees with classes    {accuracy:.3} of the touches, ARI {ari:.3}"
        );
    }
    let without = set.labels.iter().filter(|label| label.is_empty()).count();
    if (1..set.labels.len()).contains(&without) {
        let all = set.labels.len();
        let _ = writeln!(
            text,
            "  agrees with classes    not known: {without} of {all} touches have no class"
        );
    }
    for (label, _) in report
        .labels
        .iter()
        .enumerate()
        .filter(|(n, label)| !report.labels[..*n].contains(label))
    {
        let label = report.labels[label];
        let members = report.labels.iter().enumerate().filter(|(_, l)| **l == label);
        let names: Vec<&str> = members.map(|(n, _)| set.touches[n].name.as_str()).collect();
        let class = report.class_of_label.get(label).cloned().flatten();
        let class = class.map_or_else(String::new, |class| format!(" ({class})"));
        let _ = writeln!(text, "  category {label}{class}: {}", names.join(", "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_category_is_not_called_after_a_class_of_which_it_has_no_touch() {
        let agreement = Agreement::of(&[0, 0, 1, 2, 2, 2], &[0, 0, 0, 1, 1, 2]).unwrap();
        let names = ["a", "b", "c"].map(str::to_owned);
        let named = stands_for(&agreement, &names);
        let wanted = [Some("a"), None, Some("b")].map(|name| name.map(str::to_owned));
        assert_eq!(named, wanted);
    }
}
