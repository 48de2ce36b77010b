//! The publication's Figures 5, 7 and 8, and error against how much of the squeeze has been.

use super::disturbed::by_share;
use super::judge::{Judgement, judge_all, train};
use super::report;
use super::with_touch::WithTouch;
use anyhow::Context;
use serde_json::json;
use std::path::PathBuf;
use taxel_forearm::{Errors, Kinesthetic, PlaceErrors, Session, Squeeze, TACTILE_COLUMNS, splits};
use taxel_playback::output_file::OutputFile;
use taxel_plot::{Axis, Chart, Picture, Sheet};

/// Draw the publication's figures 5, 7 and 8 and error against elapsed squeeze, numbers as CSV beside them.
///
/// Where the session has touch, figures 7 and 8 have estimates from angles, from touch and from both; error against elapsed
/// squeeze is that from the angles alone. Titles say of what is simulated that it is.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A session: an .npz or a folder of .mat files
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// Where figures go
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Random repetitions
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..=1000))]
    repetitions: u16,
    /// Random numbers: the same seed, the same repetitions
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// One JSON object for each file that is written, a line each: {"file"}
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<String> {
    let session = super::session(&args.data)?;
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let splits = splits(&session, args.repetitions.into(), args.seed);
    let models = train(&session, &splits, Kinesthetic::train)?.estimators;
    let errors = judge_all(&session, &splits, &models, None)?.errors;
    let touched = match session.has_touch() {
        true => Some(WithTouch::of(&session, &splits, &models, false)?),
        false => None,
    };
    let mut sources = vec![("kinesthetic", &errors)];
    for (name, (judgement, _)) in touched.iter().flat_map(WithTouch::parts) {
        sources.extend(judgement.as_ref().ok().map(|outcome| (name, &outcome.errors)));
    }
    let early = by_share(&session, &splits, &models);
    let published = report::beside("kinesthetic", &session);
    let of = match session.simulated {
        true => " (simulated forearm)",
        false => "",
    };
    let alone = match session.has_touch() {
        true => format!(", from the angles alone{of}"),
        false => of.into(),
    };
    let sheets = [
        ("forearm-05", squeezes(&session, of)),
        ("forearm-07", estimates(&sources, of)),
        ("forearm-08", errors_by_place(&sources, of, published)),
        (
            "forearm-early",
            elapsed(
                (early.iter())
                    .filter_map(|(share, judgement)| Some((*share, &judgement.as_ref().ok()?.errors))),
                &errors,
                &alone,
                &not_estimated(&early),
                published,
            ),
        ),
    ];
    let mut text = String::new();
    for (name, sheet) in sheets {
        for (end, content) in [("svg", sheet.svg()?), ("csv", sheet.csv())] {
            let path = args.out.join(format!("{name}.{end}"));
            OutputFile::write(&path, content)?;
            let file = path.display().to_string();
            text += &match args.json {
                true => format!("{}\n", json!({ "file": file })),
                false => format!("{file}\n"),
            };
        }
    }
    Ok(text)
}

/// Tactile images of a squeeze in figure 5, as many as the publication has.
const MOMENTS: usize = 5;
/// PWM up to this share of its highest is rest.
const REST: f64 = 0.02;

/// Rows of a squeeze from where PWM rises by its peak to its end, evenly up and down.
fn moments(squeeze: &Squeeze) -> Option<[usize; MOMENTS]> {
    let pwm = &squeeze.pwm;
    let peak = (0..squeeze.len()).max_by(|a, b| pwm[*a].total_cmp(&pwm[*b]))?;
    let is_squeezed = |row: &usize| pwm[*row] > REST * pwm[peak];
    let first = (0..squeeze.len()).find(is_squeezed)?;
    let last = (0..squeeze.len()).rfind(is_squeezed)?;
    Some([first, (first + peak) / 2, peak, (peak + last) / 2, last])
}

/// Figure 5: angles over a squeeze at the wrist, in the middle and at the elbow; where there are tactile images, those of five
/// moments, one below the other, in the colours of the strongest.
fn squeezes(session: &Session, of: &str) -> Sheet {
    let places = session.locations();
    let shown = [0, places.len() / 2, places.len() - 1].map(|n| places[n]);
    let mut sheet = Sheet::new(format!("Squeeze and release: angles of the fingers{of}"))
        .columns(3)
        .panel_size(380, 300);
    let trials = || {
        shown
            .iter()
            .filter_map(|place| session.trials.iter().find(|t| t.location_percent == *place))
    };
    for trial in trials() {
        let squeeze = &trial.squeeze;
        let column = |column: &[f64]| {
            squeeze
                .time_ms
                .iter()
                .map(|t| t / 1000.0)
                .zip(column.iter().copied())
                .collect::<Vec<_>>()
        };
        let mut chart = Chart::new(
            format!("{:.1} %", trial.location_percent),
            Axis::new("time, s"),
            Axis::new("angle, degrees").range(0.0, 90.0),
        );
        for finger in 0..2 {
            chart = chart
                .line(
                    format!("motor of finger {finger}"),
                    column(&squeeze.theta_a_deg[finger]),
                )
                .line(
                    format!("joint of finger {finger}"),
                    column(&squeeze.theta_p_deg[finger]),
                );
        }
        let tenth: Vec<f64> = squeeze.pwm.iter().map(|pwm| pwm / 10.0).collect();
        sheet = sheet.chart(chart.line("PWM / 10", column(&tenth)));
    }
    for moment in 0..MOMENTS {
        for trial in trials() {
            let squeeze = &trial.squeeze;
            let Some(row) = moments(squeeze).map(|rows| rows[moment]) else {
                continue;
            };
            let Some(image) = squeeze.tactile_image(row) else {
                continue;
            };
            let strongest = squeeze.tactile.iter().flatten().max().copied().unwrap_or(0);
            let title = format!(
                "{:.1} %, {:.1} s",
                trial.location_percent,
                squeeze.time_ms[row] / 1000.0
            );
            let counts = image.iter().map(|count| f64::from(*count));
            let picture = Picture::heat(title, TACTILE_COLUMNS, counts);
            sheet = sheet.picture(picture.span(0.0, f64::from(strongest.max(1))));
        }
    }
    sheet
}

fn names(errors: &Errors) -> Vec<String> {
    errors
        .places
        .iter()
        .map(|place| format!("{:.1}", place.percent))
        .collect()
}

/// Figure 7: estimates at each place, a panel for each way to estimate.
fn estimates(sources: &[(&str, &Errors)], of: &str) -> Sheet {
    let mut sheet = Sheet::new(format!("Estimates at each place, all repetitions{of}")).panel_size(760, 420);
    for (name, errors) in sources {
        // One alone is named by nothing that it is to be told from.
        let title = if sources.len() > 1 { *name } else { "" };
        let places = Axis::of_names("place, % from wrist to elbow", names(errors));
        let chart = Chart::new(title, places, Axis::new("estimate, %").range(0.0, 100.0));
        let samples = errors.places.iter().map(|place| place.estimates.clone());
        sheet = sheet.chart(chart.boxes(*name, samples));
    }
    sheet
}

/// Figure 8: errors at each place, beside the publication's RMSE and MAE where they are of this data.
fn errors_by_place(sources: &[(&str, &Errors)], of: &str, published: Option<[f64; 3]>) -> Sheet {
    let mut sheet = Sheet::new(format!("Errors at each place{of}"))
        .columns(2)
        .panel_size(560, 340);
    type Value = fn(&PlaceErrors) -> f64;
    let parts: [(&str, Value); 2] = [("RMSE", |place| place.rmse), ("MAE", |place| place.mae)];
    let all = names(sources[0].1);
    for (column, (part, value)) in parts.into_iter().enumerate() {
        let places = Axis::of_names("place, % from wrist to elbow", all.clone());
        let axis = Axis::new(format!("{part}, % of the forearm")).from_zero();
        let mut chart = Chart::new(part, places, axis);
        for (source, errors) in sources {
            // A place at which all was refused has no bar.
            let here = |name: &String| names(errors).iter().position(|other| other == name);
            let height = |name| here(name).map_or(f64::NAN, |n| value(&errors.places[n]));
            chart = chart.bars(*source, all.iter().map(height));
        }
        if let Some(published) = published {
            chart = chart.at_y("publication, mean", published[column]);
        }
        sheet = sheet.chart(chart);
    }
    sheet
}

/// Of 100 squeezes those without an estimate after each share of their time.
fn not_estimated(early: &[(f64, Judgement)]) -> Vec<(f64, f64)> {
    let percent = |judgement: &Judgement| {
        let Ok(outcome) = judgement else {
            return 100.0;
        };
        let refused = outcome.refused.as_ref().map_or(0, |(count, _)| *count) as f64;
        let judged: usize = outcome
            .errors
            .places
            .iter()
            .map(|place| place.estimates.len())
            .sum();
        100.0 * refused / (refused + judged as f64)
    };
    early
        .iter()
        .map(|(share, judgement)| (100.0 * share, percent(judgement)))
        .collect()
}

/// How early can one know?
fn elapsed<'a>(
    early: impl Iterator<Item = (f64, &'a Errors)>,
    whole: &'a Errors,
    of: &str,
    not_estimated: &[(f64, f64)],
    published: Option<[f64; 3]>,
) -> Sheet {
    let all: Vec<(f64, &Errors)> = early.chain([(1.0, whole)]).collect();
    let line = |value: fn(&Errors) -> f64| {
        all.iter()
            .map(move |(share, e)| (100.0 * share, value(e)))
            .collect::<Vec<_>>()
    };
    let mut chart = Chart::new(
        "",
        Axis::new("time since the squeeze began, % of the whole"),
        Axis::new("% of the forearm, or of squeezes").from_zero(),
    );
    chart = chart
        .line("RMSE, mean over places", line(|e| e.macro_rmse))
        .line("RMSE over squeezes", line(|e| e.pooled_rmse))
        .line("half-width of the 90 % interval", line(|e| e.half_width_90))
        .line("squeezes without an estimate", not_estimated.iter().copied());
    if let Some([rmse, ..]) = published {
        chart = chart.at_y("publication, kinesthetic", rmse);
    }
    Sheet::new(format!("How early one can know{of}"))
        .panel_size(700, 400)
        .chart(chart)
}
