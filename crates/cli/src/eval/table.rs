//! Reports for people and for spreadsheets.

use serde_json::Value;
use std::fmt::Write;
use taxel_eval::{EvalReport, ScalingReport};

/// Longer names stand on a line of their own.
const WIDEST_NAME: usize = 44;

/// Two tables, errors and cost, below a line of what was measured.
pub(super) fn human(report: &EvalReport) -> String {
    let EvalReport {
        input,
        frames,
        contact_frames,
        contacts_median,
        taxels,
        rate_hz,
        levels,
        actuators,
        restarts,
        passes,
        ..
    } = report;
    let mut text = format!(
        "{input}: {frames} frames of {taxels} taxels at {rate_hz:.1} Hz, {contact_frames} with contact (median \
         {contacts_median:.0}); K_D = {levels}, K_A = {actuators}\n\n"
    );
    let width = report
        .methods
        .iter()
        .map(|m| m.name.len())
        .filter(|width| *width <= WIDEST_NAME)
        .max()
        .unwrap_or(0)
        .max(8);
    let mut line = |cells: &[String]| {
        for (n, cell) in cells.iter().enumerate() {
            let _ = if n == 0 && cell.len() > width {
                write!(text, "{cell}\n{:width$}", "")
            } else if n == 0 {
                write!(text, "{cell:width$}")
            } else {
                write!(text, "  {cell:>9}")
            };
        }
        text.push('\n');
    };
    let head = |names: &[&str]| names.iter().map(|n| n.to_string()).collect::<Vec<_>>();
    let unit = report.methods.first().map_or("px", |m| &m.errors.cop_unit);
    let centre = format!("cop {unit}");
    line(&head(&[
        "errors",
        "force",
        "p50",
        "p95",
        "optimal",
        "place",
        "p95",
        "snapped",
        "jumps",
        "moved px",
        "level chg",
        "nrmse",
        "in 7 %",
        "shown",
        "in 7 %",
        &centre,
        "kbit/s",
    ]));
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    for m in &report.methods {
        let e = &m.errors;
        line(&[
            m.name.clone(),
            ratio(e.force_sse_ratio_mean),
            ratio(e.force_sse_ratio_p50),
            ratio(e.force_sse_ratio_p95),
            percent(e.force_optimal_fraction),
            ratio(e.position_sse_ratio_mean),
            ratio(e.position_sse_ratio_p95),
            ratio(e.snapped_sse_ratio_mean),
            percent(e.jump_fraction),
            format!("{:.2}", e.moved_px_mean),
            percent(e.level_change_fraction),
            format!("{:.3}", e.force_nrmse),
            percent(e.weber_share),
            format!("{:.3}", e.displayed_nrmse),
            percent(e.displayed_weber_share),
            format!("{:.2}", e.cop_error_mean),
            format!("{:.1}", e.bits_per_s / 1e3),
        ]);
    }
    line(&[]);
    line(&head(&[
        "cost, us",
        "tick p50",
        "p99",
        "p99.9",
        "condition",
        "compress",
        "p99",
        "all p50",
        "all p99",
        "all p99.9",
        "all max",
        "allocs",
    ]));
    for m in &report.methods {
        let (condition, compress, every) = (&m.cost.condition_us, &m.cost.compress_us, &m.cost.every_tick_us);
        let mut cells = vec![m.name.clone()];
        let times = [
            m.tick_us_p50,
            m.tick_us_p99,
            m.tick_us_p999,
            condition.p50,
            compress.p50,
            compress.p99,
            every.p50,
            every.p99,
            every.p999,
            every.max,
        ];
        cells.extend(times.map(|us| format!("{us:.2}")));
        cells.push(m.allocations_per_tick.map_or("-".into(), |n| format!("{n:.3}")));
        line(&cells);
    }
    let _ = write!(
        text,
        "\nforce, place: squared error over the least (exact; best of {restarts} k-means++); snapped: the same from the \
         actuators' pixels.\nTimes: per frame, median of {passes} passes; all: every tick.{}\nRaw: {:.1} kbit/s.\n",
        if report.conditioning_timed {
            " A tick is conditioning and compression."
        } else {
            " Magnitudes need no conditioning: a tick is compression."
        },
        report.raw_bits_per_s / 1e3,
    );
    if report.jump_bound_fraction > 0.0 {
        let _ = writeln!(
            text,
            "Contacts come and go so far apart that at least {} of the actuators jump whatever the method, if place is to stay \
             within 1.08 in every frame.",
            percent(report.jump_bound_fraction)
        );
    }
    if let Some(t) = &report.contact_truth {
        let _ = writeln!(
            text,
            "Contacts against the scene: precision {:.3}, recall {:.3}; {:.3} of taxels touched above the threshold.",
            t.precision, t.recall, t.recall_above_threshold
        );
    }
    text.push('\n');
    text
}

/// How the time of both stages grows; nothing of nothing.
pub(super) fn scaling(reports: &[ScalingReport]) -> String {
    let mut text = String::new();
    for report in reports {
        for (name, us) in &report.methods {
            let per_taxel = 1e3 * us.p50 / report.taxels as f64;
            let _ = writeln!(
                text,
                "{:>6} taxels in contact  {name:24}  p50 {:>10.2} us  p99 {:>10.2} us  {per_taxel:>7.1} ns per taxel",
                report.taxels, us.p50, us.p99
            );
        }
    }
    text
}

/// A ratio near 1 with the digits that matter.
fn ratio(value: f64) -> String {
    if value < 100.0 {
        format!("{value:.4}")
    } else {
        format!("{value:.0}")
    }
}

/// A header, then one line per report and method.
pub(super) fn csv<'a>(reports: impl Iterator<Item = &'a EvalReport>) -> anyhow::Result<String> {
    let mut text = String::new();
    for report in reports {
        let mut of_report = Vec::new();
        for (key, value) in serde_json::to_value(report)?.as_object().into_iter().flatten() {
            // Not every report has a truth, and a table needs the same columns throughout.
            if key != "methods" && key != "contact_truth" {
                flatten(key, value, &mut of_report);
            }
        }
        for method in &report.methods {
            let mut cells = of_report.clone();
            flatten("", &serde_json::to_value(method)?, &mut cells);
            if text.is_empty() {
                let keys: Vec<&str> = cells.iter().map(|(key, _)| key.as_str()).collect();
                text += &(keys.join(",") + "\n");
            }
            let values: Vec<String> = cells.into_iter().map(|(_, value)| value).collect();
            text += &(values.join(",") + "\n");
        }
    }
    Ok(text)
}

/// Appends the leaves of a value with their paths.
fn flatten(key: &str, value: &Value, cells: &mut Vec<(String, String)>) {
    match value {
        Value::Object(fields) => {
            for (inner, value) in fields {
                let path = if key.is_empty() {
                    inner.clone()
                } else {
                    format!("{key}_{inner}")
                };
                flatten(&path, value, cells);
            }
        }
        Value::String(text) => cells.push((key.into(), format!("\"{}\"", text.replace('"', "\"\"")))),
        Value::Null => cells.push((key.into(), String::new())),
        other => cells.push((key.into(), other.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_are_named_by_their_paths_and_text_is_quoted() {
        let value = serde_json::json!({"name": "a \"b\", c", "times": {"p50": 1.5}, "none": null});
        let mut cells = Vec::new();
        flatten("", &value, &mut cells);
        cells.sort();
        let want = [("name", "\"a \"\"b\"\", c\""), ("none", ""), ("times_p50", "1.5")];
        assert_eq!(cells, want.map(|(k, v)| (k.to_string(), v.to_string())));
    }
}
