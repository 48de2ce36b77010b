//! Every figure of every method, in two tables.

use super::cell::{WIDE_CELL, percent, ratio, within};
use super::table::{self, chosen, contact_truth, what, wrapped};
use std::fmt::Write;
use taxel_eval::{EvalReport, MethodReport};

/// Longer names stand on a line of their own.
const WIDEST_NAME: usize = 44;

/// No line of the tables of every figure is longer: a name, and 17 figures behind two blanks each.
#[cfg(test)]
pub(super) const WIDE_COLUMNS: usize = WIDEST_NAME + 17 * (2 + WIDE_CELL);

/// Two tables, errors and cost, below a line of what was measured.
pub(super) fn every_figure(report: &EvalReport) -> String {
    let mut text = format!(
        "{}, {} with contact (median {:.0}); K_D = {}, K_A = {}\n\n",
        what(report),
        report.contact_frames,
        report.contacts_median,
        report.levels,
        report.actuators
    );
    let (errors, costs) = (error_columns(report), cost_columns(report));
    text += &table("errors", &errors, &report.methods);
    text.push('\n');
    text += &table("cost, us", &costs, &report.methods);
    text.push('\n');
    text += &explained(
        "errors, where p50 and p95 are of the frames, else means.",
        &errors,
    );
    let cost = format!(
        "cost, us: per frame with contacts, the median of {} passes.",
        report.passes
    );
    text += &explained(&cost, &costs);
    if report.jump_bound_fraction > 0.0 {
        let _ = writeln!(
            text,
            "Contacts come and go so far apart that at least {} of the actuators jump whatever the method, if place is to stay \
             within 1.08 in every frame.",
            share(report.jump_bound_fraction)
        );
    }
    text += &contact_truth(report);
    text.push('\n');
    text
}

/// A figure of every method.
struct Column {
    heading: String,
    /// What it is; empty where it is said with another.
    explanation: String,
    figure: fn(&MethodReport) -> String,
}

fn column(
    heading: impl Into<String>,
    explanation: impl Into<String>,
    figure: fn(&MethodReport) -> String,
) -> Column {
    Column {
        heading: heading.into(),
        explanation: explanation.into(),
        figure,
    }
}

fn number(value: f64, decimals: usize) -> String {
    within(value, decimals, WIDE_CELL)
}

fn place_ratio(method: &MethodReport, value: Option<f64>) -> String {
    chosen(method, value).map_or("-".into(), ratio)
}

fn share(value: f64) -> String {
    percent(value, WIDE_CELL)
}

fn error_columns(report: &EvalReport) -> Vec<Column> {
    let unit = report.methods.first().map_or("px", |m| &m.errors.cop_unit);
    let centre = format!("cop {unit}");
    let place = format!(
        "place: squared distance of contacts from the middle of those that share their actuator, over the best of {} \
         k-means++",
        report.restarts
    );
    let bits = format!(
        "kbit/s: of actuators and levels, where the raw counts are {:.1}",
        report.raw_bits_per_s / 1e3
    );
    let jumps = format!(
        "jumps: actuators that move more than {:.1} {} between two images",
        report.jump_distance, report.place_unit
    );
    let centre_is = format!("{centre}: how far off the centre of pressure is");
    vec![
        column(
            "force",
            "force: squared error of the levels over the least there is",
            |m| ratio(m.errors.force_sse_ratio_mean),
        ),
        column("p50", "", |m| ratio(m.errors.force_sse_ratio_p50)),
        column("p95", "", |m| ratio(m.errors.force_sse_ratio_p95)),
        column("optimal", "optimal: frames that have the least", |m| {
            share(m.errors.force_optimal_fraction)
        }),
        column("place", place, |m| {
            place_ratio(m, m.errors.position_sse_ratio_mean)
        }),
        column("p95", "", |m| place_ratio(m, m.errors.position_sse_ratio_p95)),
        column("snapped", "snapped: the same from the actuator's pixel", |m| {
            place_ratio(m, m.errors.snapped_sse_ratio_mean)
        }),
        column("jumps", jumps, |m| share(m.errors.jump_fraction)),
        column("moved px", "moved px: how far they move", |m| {
            number(m.errors.moved_px_mean, 2)
        }),
        column(
            "level chg",
            "level chg: taxels in contact whose level changes",
            |m| share(m.errors.level_change_fraction),
        ),
        column(
            "nrmse",
            "nrmse: error of the levels at each taxel in contact",
            |m| number(m.errors.force_nrmse, 3),
        ),
        column(
            "levels 7%",
            "levels 7%: taxels within a just noticeable difference",
            |m| share(m.errors.weber_share),
        ),
        column(
            "shown",
            "shown, shown 7%: the same of the force with which their actuators press",
            |m| number(m.errors.displayed_nrmse, 3),
        ),
        column("shown 7%", "", |m| share(m.errors.displayed_weber_share)),
        column("total", "total: error of the sum of these", |m| {
            share(m.errors.displayed_total_error_mean)
        }),
        column(centre, centre_is, |m| number(m.errors.cop_error_mean, 2)),
        column("kbit/s", bits, |m| number(m.errors.bits_per_s / 1e3, 1)),
    ]
}

fn cost_columns(report: &EvalReport) -> Vec<Column> {
    let tick = match report.conditioning_timed {
        true => "tick: conditioning and compression",
        false => "tick: compression, since magnitudes need no conditioning",
    };
    vec![
        column("tick p50", tick, |m| number(m.tick_us_p50, 2)),
        column("p99", "", |m| number(m.tick_us_p99, 2)),
        column("p99.9", "", |m| number(m.tick_us_p999, 2)),
        column("condition", "condition and compress: each alone, p50", |m| {
            number(m.cost.condition_us.p50, 2)
        }),
        column("compress", "", |m| number(m.cost.compress_us.p50, 2)),
        column("p99", "", |m| number(m.cost.compress_us.p99, 2)),
        column("all p50", "all: every tick of every pass", |m| {
            number(m.cost.every_tick_us.p50, 2)
        }),
        column("all p99", "", |m| number(m.cost.every_tick_us.p99, 2)),
        column("all p99.9", "", |m| number(m.cost.every_tick_us.p999, 2)),
        column("all max", "", |m| number(m.cost.every_tick_us.max, 2)),
        column("allocs", "allocs: allocations per tick", |m| {
            m.allocations_per_tick.map_or("-".into(), |n| format!("{n:.3}"))
        }),
    ]
}

/// A line for each method, below one of headings.
fn table(title: &str, columns: &[Column], methods: &[MethodReport]) -> String {
    let widths = methods.iter().map(|m| m.name.len());
    let fitting = widths.filter(|width| *width <= WIDEST_NAME).max();
    let width = fitting.unwrap_or(0).max(8);
    // Another blank before each figure.
    let line = |name: &str, cell: &dyn Fn(&Column) -> String| {
        let cells: Vec<String> = columns.iter().map(cell).collect();
        table::line(name, width, &cells, 1 + WIDE_CELL)
    };
    let mut text = line(title, &|column| column.heading.clone());
    for m in methods {
        text += &line(&m.name, &|column| (column.figure)(m));
    }
    text
}

/// What the figures of a table are.
fn explained(all: &str, columns: &[Column]) -> String {
    let explanations = columns.iter().map(|column| column.explanation.as_str());
    let said: Vec<&str> = explanations.filter(|said| !said.is_empty()).collect();
    wrapped(&format!("{all} {}.", said.join("; ")))
}
