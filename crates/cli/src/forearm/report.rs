//! What `taxel forearm eval` says to people.

use super::judge::{Judgement, Outcome, chosen, closed_at_peak};
use super::more::More;
use super::with_touch::{FUSED_UNSEEN, WithTouch};
use std::fmt::Write as _;
use taxel_forearm::{Kinesthetic, Session, Split};

/// The publication's Table 3, and the mean range of its estimates.
const PUBLISHED: [(&str, f64, f64, f64); 3] = [
    ("tactile", 13.42, 13.09, 50.87),
    ("kinesthetic", 9.74, 8.81, 41.56),
    ("fused", 7.61, 7.08, 28.24),
];

/// What the protocol's figures of both senses are, and are not.
const FUSED: &str = "\
    As the publication has it, its two estimators were trained on nine tenths of the squeezes at every second place, and are\n\
    judged here on these too. Compare the single estimators with the table below instead.\n";

pub(super) fn procedure(session: &Session, splits: &[Split], models: &[Kinesthetic]) -> String {
    let counts = splits
        .first()
        .map_or((0, 0), |split| (split.train.len(), split.test.len()));
    let mut text = format!(
        "{}: {} squeezes at {} places, {} repetitions: trained on {}, judged on {}\n{}\n\
         Procedure. Partial least squares on the two sums of both fingers' angles, standardised, at\n\
         evenly spaced phases of the commanded PWM. Tried are 5, 8, 10, 14 and 20 phases, from the first sample or where\n\
         PWM rises, to where PWM is back at rest or the last sample, and 1 to 6 components: 120 choices. The one of least\n\
         error on the training squeezes alone is taken: seven parts with repetitions left out in fifths, six parts with a\n\
         place left out, as the test has seven places that were trained on and six others. No squeeze of the test chooses\n\
         anything in this run; whoever settled this family of choices had seen errors on public test data. Taken were:\n",
        session.name,
        session.trials.len(),
        session.locations().len(),
        splits.len(),
        counts.0,
        counts.1,
        simulated(session),
    );
    for chosen in chosen(models) {
        let _ = writeln!(text, "  {:3} times  {}", chosen.times, chosen.choice);
    }
    text
}

/// A line where it is so, and nothing where it is not known.
pub(super) fn simulated(session: &Session) -> &'static str {
    match session.simulated {
        true => "Its squeezes are of a simulated forearm: they are no evidence about people.\n",
        false => "",
    }
}

/// The publication's figures of a source beside those here, where these are of its own data; what was simulated or
/// recorded elsewhere is not to be compared.
pub(super) fn beside(source: &str, session: &Session) -> Option<[f64; 3]> {
    let published = PUBLISHED
        .iter()
        .find(|(name, ..)| *name == source && session.is_published());
    published.map(|(_, rmse, mae, range)| [*rmse, *mae, *range])
}

/// The heading of a column for them, and its figures.
pub(super) fn column(beside: Option<[f64; 3]>) -> (&'static str, [String; 3]) {
    match beside {
        Some(figures) => (
            "   publication (its Table 3; which mean it does not say)",
            figures.map(|figure| format!("{figure:10.2}")),
        ),
        None => ("", Default::default()),
    }
}

pub(super) fn errors(source: &str, session: &Session, outcome: &Outcome, train_s: f64) -> String {
    let e = &outcome.errors;
    let least = e.macro_rmses.iter().copied().fold(f64::INFINITY, f64::min);
    let most = e.macro_rmses.iter().copied().fold(0.0, f64::max);
    let (heading, [rmse, mae, range]) = column(beside(source, session));
    let [seen, new] = e.coverage_seen_and_new;
    let refused = (outcome.refused.iter()).map(|(count, why)| format!("{count} refused: {why}\n"));
    format!(
        "\n{source}, % of the forearm        here{heading}\n\
         \x20 RMSE, mean over places   {:8.2}{rmse}\n\
         \x20 MAE, mean over places    {:8.2}{mae}\n\
         \x20 RMSE over squeezes       {:8.2}\n\
         \x20 MAE over squeezes        {:8.2}\n\
         \x20 range of estimates, mean {:8.2}{range}\n\
         Over the repetitions the first is {least:.2} to {most:.2}.\n\
         90 % intervals of +-{:.1} hold {:.1} % (mean over places): {} of squeezes at places that were trained on,\n\
         {} at others. Training took {train_s:.2} s for all repetitions, an estimate {:.1} us.\n{}",
        e.macro_rmse,
        e.macro_mae,
        e.pooled_rmse,
        e.pooled_mae,
        e.mean_range(),
        e.half_width_90,
        100.0 * e.coverage_90,
        share(seen),
        share(new),
        outcome.estimate_us,
        refused.collect::<String>(),
    )
}

/// A share as percent, or that there was nothing to judge.
fn share(of_one: f64) -> String {
    match of_one.is_nan() {
        true => "none was judged".to_owned(),
        false => format!("{:.1} %", 100.0 * of_one),
    }
}

pub(super) fn places(outcome: &Outcome) -> String {
    let mut text =
        "\n   place    RMSE     MAE     min      q1  median      q3     max   range  in interval\n"
            .to_owned();
    for place in &outcome.errors.places {
        let [low, first, median, third, high] = place.spread;
        let _ = writeln!(
            text,
            "{:6.1} %{:8.2}{:8.2}{low:8.1}{first:8.1}{median:8.1}{third:8.1}{high:8.1}{:8.1}{:11.1} %",
            place.percent,
            place.rmse,
            place.mae,
            place.range(),
            100.0 * place.covered,
        );
    }
    text
}

/// What is printed of the estimators that need touch.
pub(super) fn with_touch(session: &Session, touch: &WithTouch) -> String {
    let mut text = String::new();
    for (name, (judgement, train_s)) in
        (touch.parts().into_iter()).chain([(FUSED_UNSEEN, &touch.fused_unseen)])
    {
        match judgement {
            Ok(outcome) => {
                text += &errors(name, session, outcome, *train_s);
                if name == "fused" {
                    text += FUSED;
                }
                text += &places(outcome);
            }
            Err(none) => text += &format!("\n{name}: refused: all, because {none}\n"),
        }
    }
    text
}

/// What is printed of what is judged beside the protocol.
pub(super) fn more(session: &Session, more: &More, touch: Option<&WithTouch>) -> String {
    let mut text = table(
        "disturbed, from angles: each squeeze drawn anew in each repetition, without being told",
        more.disturbed.iter().map(|(name, outcome)| (name, outcome)),
    );
    if let Some(touch) = touch {
        text += &table(
            "an array of another gain (without an angle: without touch)",
            touch.gains.iter().map(|(name, outcome)| (name, outcome)),
        );
    }
    let name = |share: f64| format!("after {:.0} % of its time", 100.0 * share);
    text += &table(
        "before the squeeze is over, from angles",
        more.early.iter().map(|(share, outcome)| (name(*share), outcome)),
    );
    text += &places_left_out(session, &more.places_left_out);
    text + &table(
        "other procedures",
        more.procedures.iter().map(|(name, outcome)| (name, outcome)),
    )
}

fn table<'a, S: std::fmt::Display>(
    title: &str,
    rows: impl IntoIterator<Item = (S, &'a Judgement)>,
) -> String {
    let mut text = format!(
        "\n{title}\n{:50}    macro RMSE  MAE   pooled RMSE  MAE   in interval  without an angle\n",
        ""
    );
    for (name, judgement) in rows {
        let name = name.to_string();
        let outcome = match judgement {
            Ok(outcome) => outcome,
            Err(none) => {
                let _ = writeln!(text, "  {name:50}  refused: all, because {none}");
                continue;
            }
        };
        let e = &outcome.errors;
        let _ = write!(
            text,
            "  {name:50}{:10.2}{:6.2}{:12.2}{:6.2}{:11.1} %{:15.1} %",
            e.macro_rmse,
            e.macro_mae,
            e.pooled_rmse,
            e.pooled_mae,
            100.0 * e.coverage_90,
            100.0 * outcome.without_an_angle,
        );
        if let Some((count, why)) = &outcome.refused {
            let _ = write!(text, "  {count} refused: {why}");
        }
        text.push('\n');
    }
    text
}

/// Why the floor is where it is: places that their neighbours tell nothing of.
fn places_left_out(session: &Session, judgement: &Judgement) -> String {
    let errors = match judgement {
        Ok(outcome) => &outcome.errors,
        Err(none) => return format!("\ntrained on all other places: refused: all, because {none}\n"),
    };
    let mut text = format!(
        "\ntrained on all other places: RMSE {:.2} (mean over places), {:.2} (over squeezes)\n   place    RMSE  closed\n",
        errors.macro_rmse, errors.pooled_rmse
    );
    let closed: Vec<f64> = (errors.places.iter())
        .map(|place| closed_at_peak(session, place.percent))
        .collect();
    for (place, closed) in errors.places.iter().zip(&closed) {
        let _ = writeln!(text, "{:6.1} %{:8.2}{closed:8.1}", place.percent, place.rmse);
    }
    let is_between = |w: &[f64]| w[0].min(w[2]) <= w[1] && w[1] <= w[0].max(w[2]);
    let odd = closed
        .windows(3)
        .zip(&errors.places[1..])
        .filter(|(window, _)| !is_between(window));
    let odd: Vec<String> = odd.map(|(_, place)| format!("{:.1} %", place.percent)).collect();
    if !odd.is_empty() {
        let _ = writeln!(
            text,
            "Closed is the sum of both motors' angles at the peak, degrees. At {} it is not between that of the\n\
             neighbours: no curve that goes one way passes these places, whatever it is trained on.",
            odd.join(", ")
        );
    }
    text
}
