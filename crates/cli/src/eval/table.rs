//! Reports for people.

use super::cell::{CELL, percent, time, within};
use crate::wrap::wrap;
use std::fmt::Write;
use taxel_eval::{EvalReport, MethodReport, ScalingReport};

/// No line is longer.
const COLUMNS: usize = 100;
/// Longer names stand on a line of their own.
pub(super) const NAME: usize = 28;

/// What it comes to in a sentence, what was measured, and a line of figures for each method.
pub(super) fn main_figures(report: &EvalReport) -> String {
    let unit = report.methods.first().map_or("px", |m| &m.errors.cop_unit);
    let mut text = wrapped(&verdict(report));
    text += "\n";
    text += &wrapped(&format!(
        "{}, {} with contact (median {:.0} taxels); K_D = {}, K_A = {}; the same frames for every method{}.",
        what(report),
        report.contact_frames,
        report.contacts_median,
        report.levels,
        report.actuators,
        report
            .conditioning
            .as_ref()
            .map_or(String::new(), |name| format!(", conditioning `{name}`")),
    ));
    text.push('\n');
    let head = [
        "shown", "in 7 %", "total", unit, "optimal", "places", "jumps", "us p50", "p99",
    ];
    text += &line("method", NAME, &head.map(String::from), CELL);
    let percent = |share: f64| percent(share, CELL);
    for m in &report.methods {
        let e = &m.errors;
        text += &line(
            &m.name,
            NAME,
            &[
                within(e.displayed_nrmse, 3, CELL),
                percent(e.displayed_weber_share),
                percent(e.displayed_total_error_mean),
                within(e.cop_error_mean, 2, CELL),
                percent(e.force_optimal_fraction),
                chosen(m, e.position_sse_ratio_mean).map_or("-".into(), |ratio| within(ratio, 3, CELL)),
                percent(e.jump_fraction),
                time(m.tick_us_p50),
                time(m.tick_us_p99),
            ],
            CELL,
        );
    }
    text.push('\n');
    text += &wrapped(&format!(
        "shown: error of the force at each taxel in contact (NRMSE), both stages; in 7 %: taxels shown within a just \
         noticeable difference; total: error of their sum; {unit}: of the centre of pressure; optimal: frames whose levels \
         have the least error; places: squared error over the best of {}{}; us: a tick{}. Every switch and figure: --all.",
        report.restarts,
        if report.methods.iter().any(|m| m.places_fixed) {
            ", - where they cannot move"
        } else {
            ""
        },
        if report.conditioning_timed {
            ", conditioning included"
        } else {
            ""
        },
    ));
    let (jump, unit) = (report.jump_distance, &report.place_unit);
    if unit == "mm" {
        text += &wrapped(&format!(
            "Places are those on the hand, as actuators have them, and jumps are moves of more than {jump:.1} mm."
        ));
    } else if jump != 2.0 {
        text += &wrapped(&format!(
            "Jumps: moves of more than {jump:.1} pixels, an eighth of the side of a square of {} taxels.",
            report.taxels
        ));
    }
    text += &contact_truth(report);
    text.push('\n');
    text
}

/// A name and figures in columns of those widths, with a blank before each figure. A longer name stands on a line of its
/// own.
pub(super) fn line(name: &str, name_width: usize, cells: &[String], width: usize) -> String {
    let mut text = match name.len() > name_width {
        true => format!("{name}\n{:name_width$}", ""),
        false => format!("{name:name_width$}"),
    };
    for cell in cells {
        let _ = write!(text, " {cell:>width$}");
    }
    text + "\n"
}

/// A ratio of places, where the method chose them and a frame had more contacts than actuators.
pub(super) fn chosen(method: &MethodReport, ratio: Option<f64>) -> Option<f64> {
    ratio.filter(|_| !method.places_fixed)
}

/// What was taken for a contact, where a scene knows.
pub(super) fn contact_truth(report: &EvalReport) -> String {
    report.contact_truth.as_ref().map_or(String::new(), |t| {
        wrapped(&format!(
            "Contacts against the scene: precision {:.3}, recall {:.3}; {:.3} of taxels touched above the threshold.",
            t.precision, t.recall, t.recall_above_threshold
        ))
    })
}

/// How `optimal`, or else the method that shows forces best, compares with `paper`, or else the one that does worst.
fn verdict(report: &EvalReport) -> String {
    let named = |name: &str| report.methods.iter().find(|m| m.name == name);
    let by_error =
        |a: &&MethodReport, b: &&MethodReport| a.errors.displayed_nrmse.total_cmp(&b.errors.displayed_nrmse);
    let best = named("optimal").or_else(|| report.methods.iter().min_by(by_error));
    let other = named("paper").or_else(|| report.methods.iter().max_by(by_error));
    let (Some(best), Some(other)) = (best, other) else {
        return String::new();
    };
    let e = &best.errors;
    // As it is written.
    let is_none = |error: f64| error < 0.0005;
    let compared = match (e.displayed_nrmse, other.errors.displayed_nrmse) {
        _ if best.name == other.name => String::new(),
        (error, others) if is_none(error) && is_none(others) => format!(", as `{}`", other.name),
        (_, others) if is_none(others) => format!(", where `{}` has none", other.name),
        (error, others) => format!(", {:.2} times that of `{}`", error / others, other.name),
    };
    let optimal = match best.levels_fitted {
        true => format!(
            " levels are optimal in {:.1} % of frames,",
            100.0 * e.force_optimal_fraction
        ),
        false => String::new(),
    };
    format!(
        "`{}` shows forces with an error of {:.3}{compared};{optimal} {:.1} % of actuators jump, and a tick takes {:.1} us.",
        best.name,
        e.displayed_nrmse,
        100.0 * e.jump_fraction,
        best.tick_us_p50,
    )
}

/// A paragraph in lines that fit.
pub(super) fn wrapped(text: &str) -> String {
    wrap(text, COLUMNS).join("\n") + "\n"
}

/// What was measured: one frame has no rate.
pub(super) fn what(report: &EvalReport) -> String {
    let EvalReport {
        input,
        frames,
        taxels,
        rate_hz,
        ..
    } = report;
    match frames {
        1 => format!("{input}: 1 frame of {taxels} taxels"),
        _ => format!("{input}: {frames} frames of {taxels} taxels at {rate_hz:.1} Hz"),
    }
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

#[cfg(test)]
mod tests {
    use super::super::every_figure::{WIDE_COLUMNS, every_figure};
    use super::*;
    use taxel_eval::{Cost, Errors, Method, Quantiles};
    use taxel_hand::Profile;

    /// Of two methods with these errors and ticks of that many microseconds.
    fn report(paper: Errors, optimal: Errors, us: f64) -> EvalReport {
        let every = Quantiles {
            p50: us,
            p99: us,
            p999: us,
            max: us,
        };
        let cost = Cost {
            tick_us: every,
            condition_us: every,
            compress_us: every,
            every_tick_us: every,
            ..Cost::default()
        };
        let methods = [("paper", paper), ("optimal", optimal)];
        EvalReport {
            input: "forces.npy".into(),
            frames: 2,
            taxels: 4,
            contact_frames: 2,
            contacts_median: 4.0,
            rate_hz: 30.0,
            levels: 8,
            actuators: 16,
            raw_bits_per_s: 1920.0,
            restarts: 64,
            jump_bound_fraction: 0.0,
            place_unit: "px".into(),
            jump_distance: 2.0,
            passes: 5,
            conditioning: None,
            conditioning_timed: false,
            contact_truth: None,
            methods: methods
                .map(|(name, errors)| {
                    let method = Method::parse(name, &Profile::default()).unwrap();
                    MethodReport::new(&method, errors, cost.clone())
                })
                .into(),
        }
    }

    #[test]
    fn columns_stay_apart_however_large_their_figures() {
        let huge = Errors {
            displayed_nrmse: 1e12,
            displayed_total_error_mean: 1_575.888,
            cop_error_mean: 1e9,
            force_sse_ratio_mean: 1e30,
            moved_px_mean: 1e20,
            position_sse_ratio_mean: Some(123_456.7),
            position_frames: 1,
            ..Errors::default()
        };
        let report = report(huge.clone(), huge, 1_158_864.0);
        for (table, columns, cells) in [
            (main_figures(&report), COLUMNS, 9),
            (every_figure(&report), WIDE_COLUMNS, 17),
        ] {
            assert!(
                table.lines().all(|line| line.chars().count() <= columns),
                "{table}"
            );
            let line = table.lines().find(|line| line.starts_with("paper ")).unwrap();
            let figures = line.replace(" %", "%").replace(" ms", "ms");
            assert_eq!(figures.split_whitespace().count(), 1 + cells, "{line}");
        }
    }

    #[test]
    fn what_a_display_does_not_choose_is_not_held_against_it() {
        let errors = || Errors {
            position_sse_ratio_mean: Some(7.5),
            position_frames: 2,
            ..Errors::default()
        };
        let mut report = report(errors(), errors(), 1.0);
        let unjudged = every_figure(&self::report(Errors::default(), Errors::default(), 1.0));
        let line = unjudged.lines().find(|line| line.starts_with("paper ")).unwrap();
        assert_eq!(
            line.split_whitespace().filter(|cell| *cell == "-").count(),
            3,
            "{unjudged}"
        );
        let text = main_figures(&report).replace('\n', " ");
        assert!(text.contains("levels are optimal in 0.0 % of frames, 0.0 % of actuators jump"));
        assert!(
            text.contains(" 7.500 ") && !text.contains("cannot move"),
            "{text}"
        );
        for method in &mut report.methods {
            (method.levels_fitted, method.places_fixed) = (false, true);
        }
        let text = main_figures(&report).replace('\n', " ");
        assert!(text.contains("as `paper`; 0.0 % of actuators jump"), "{text}");
        assert!(
            !text.contains("7.500") && text.contains("- where they cannot move"),
            "{text}"
        );
    }

    #[test]
    fn the_verdict_does_not_set_no_error_against_none() {
        let of = |displayed_nrmse| Errors {
            displayed_nrmse,
            ..Errors::default()
        };
        for (paper, optimal, wanted) in [
            (0.0, 0.0, "an error of 0.000, as `paper`;"),
            (0.0, 1e-9, "an error of 0.000, as `paper`;"),
            (0.0, 0.25, "an error of 0.250, where `paper` has none;"),
            (0.5, 0.25, "an error of 0.250, 0.50 times that of `paper`;"),
        ] {
            let text = verdict(&report(of(paper), of(optimal), 1.0));
            assert!(text.contains(wanted), "{text}");
        }
    }
}
