//! What `taxel forearm eval --json` prints.

use super::judge::{Chosen, Judgement, Outcome, closed_at_peak};
use super::more;
use super::with_touch::WithTouch;
use serde::Serialize;
use taxel_forearm::{Errors, PlaceErrors, Session};

#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub(super) protocol: &'static str,
    pub(super) repetitions: usize,
    /// Whether the session says that it is of a simulated forearm.
    pub(super) simulated: bool,
    pub(super) kinesthetic: Figures,
    pub(super) tactile: Option<Figures>,
    /// On the publication's squeezes: among them are those that its two estimators were trained on.
    pub(super) fused: Option<Figures>,
    /// Weighed by intervals, on the squeezes that the single estimators are judged on.
    pub(super) fused_unseen: Option<Figures>,
    /// What the kinesthetic estimators look at, the most frequent first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) chosen: Vec<Chosen>,
    /// Not with `--brief`.
    #[serde(flatten)]
    pub(super) more: Option<More>,
}

/// Errors of an estimator by the protocol, percent of the forearm.
#[derive(Debug, Serialize)]
pub(super) struct Figures {
    macro_rmse: f64,
    macro_mae: f64,
    pooled_rmse: f64,
    pooled_mae: f64,
    pub(super) coverage_90: f64,
    train_s: f64,
    estimate_us: f64,
    /// Of a network: the fewest epochs that any repetition had. A training may have been cut short.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) epochs: Option<usize>,
    /// The macro RMSE of each repetition.
    macro_rmses: Vec<f64>,
    mean_range: f64,
    half_width_90: f64,
    /// Share of squeezes within the interval at places that were trained on, and at others; null where none was judged.
    coverage_90_trained: f64,
    coverage_90_new: f64,
    /// Squeezes without an estimate, of all repetitions.
    refused: usize,
    places: Vec<Place>,
}

#[derive(Debug, Serialize)]
struct Place {
    location_percent: f64,
    rmse: f64,
    mae: f64,
    min: f64,
    q1: f64,
    median: f64,
    q3: f64,
    max: f64,
    range: f64,
    coverage_90: f64,
}

impl Place {
    fn of(errors: &PlaceErrors) -> Self {
        let [min, q1, median, q3, max] = errors.spread;
        Self {
            location_percent: errors.percent,
            rmse: errors.rmse,
            mae: errors.mae,
            min,
            q1,
            median,
            q3,
            max,
            range: errors.range(),
            coverage_90: errors.covered,
        }
    }
}

impl Figures {
    pub(super) fn of(outcome: &Outcome, train_s: f64) -> Self {
        let errors = &outcome.errors;
        let [coverage_90_trained, coverage_90_new] = errors.coverage_seen_and_new;
        Self {
            macro_rmse: errors.macro_rmse,
            macro_mae: errors.macro_mae,
            pooled_rmse: errors.pooled_rmse,
            pooled_mae: errors.pooled_mae,
            coverage_90: errors.coverage_90,
            train_s,
            estimate_us: outcome.estimate_us,
            epochs: None,
            macro_rmses: errors.macro_rmses.clone(),
            mean_range: errors.mean_range(),
            half_width_90: errors.half_width_90,
            coverage_90_trained,
            coverage_90_new,
            refused: outcome.refused.as_ref().map_or(0, |(count, _)| *count),
            places: errors.places.iter().map(Place::of).collect(),
        }
    }
}

/// What is judged beside the protocol.
#[derive(Debug, Serialize)]
pub(super) struct More {
    disturbed: Vec<Row>,
    /// Both senses together where the array has another gain; only of sessions with touch.
    #[serde(skip_serializing_if = "Option::is_none")]
    gains: Option<Vec<Row>>,
    early: Vec<Row>,
    places_left_out: PlacesLeftOut,
    procedures: Vec<Row>,
}

/// A line of a table; its figures are null where no squeeze has an estimate.
#[derive(Debug, Serialize)]
struct Row {
    #[serde(skip_serializing_if = "Option::is_none")]
    what: Option<String>,
    /// After this share of a squeeze's time.
    #[serde(skip_serializing_if = "Option::is_none")]
    after: Option<f64>,
    macro_rmse: f64,
    macro_mae: f64,
    pooled_rmse: f64,
    pooled_mae: f64,
    coverage_90: f64,
    half_width_90: f64,
    /// Share of estimates that were made without an angle.
    without_an_angle: f64,
    /// Squeezes without an estimate, and why the first has none.
    refused: usize,
    why: Option<String>,
}

impl Row {
    fn of(what: Option<&str>, after: Option<f64>, judgement: &Judgement) -> Self {
        let outcome = judgement.as_ref().ok();
        let figure = |of: fn(&Errors) -> f64| outcome.map_or(f64::NAN, |outcome| of(&outcome.errors));
        let (refused, why) = match judgement {
            Ok(outcome) => outcome.refused.clone().unzip(),
            Err(none) => (Some(none.squeezes), Some(none.why.clone())),
        };
        Self {
            what: what.map(Into::into),
            after,
            macro_rmse: figure(|e| e.macro_rmse),
            macro_mae: figure(|e| e.macro_mae),
            pooled_rmse: figure(|e| e.pooled_rmse),
            pooled_mae: figure(|e| e.pooled_mae),
            coverage_90: figure(|e| e.coverage_90),
            half_width_90: figure(|e| e.half_width_90),
            without_an_angle: outcome.map_or(f64::NAN, |outcome| outcome.without_an_angle),
            refused: refused.unwrap_or(0),
            why,
        }
    }
}

#[derive(Debug, Serialize)]
struct PlacesLeftOut {
    macro_rmse: f64,
    pooled_rmse: f64,
    places: Vec<PlaceLeftOut>,
}

#[derive(Debug, Serialize)]
struct PlaceLeftOut {
    #[serde(flatten)]
    errors: Place,
    /// The sum of both motors' angles at the peak, mean over the squeezes.
    closed_deg: f64,
}

impl More {
    pub(super) fn of(session: &Session, more: &more::More, touch: Option<&WithTouch>) -> Self {
        let rows = |rows: &[(String, Judgement)]| {
            let row = |(what, judgement): &(String, Judgement)| Row::of(Some(what), None, judgement);
            rows.iter().map(row).collect()
        };
        let left_out = more.places_left_out.as_ref().ok().map(|outcome| &outcome.errors);
        let place = |errors: &PlaceErrors| PlaceLeftOut {
            errors: Place::of(errors),
            closed_deg: closed_at_peak(session, errors.percent),
        };
        Self {
            disturbed: rows(&more.disturbed),
            gains: touch.map(|touch| rows(&touch.gains)),
            early: (more.early.iter())
                .map(|(share, judgement)| Row::of(None, Some(*share), judgement))
                .collect(),
            places_left_out: PlacesLeftOut {
                macro_rmse: left_out.map_or(f64::NAN, |errors| errors.macro_rmse),
                pooled_rmse: left_out.map_or(f64::NAN, |errors| errors.pooled_rmse),
                places: left_out
                    .map_or(&[][..], |errors| &errors.places)
                    .iter()
                    .map(place)
                    .collect(),
            },
            procedures: rows(&more.procedures),
        }
    }
}
