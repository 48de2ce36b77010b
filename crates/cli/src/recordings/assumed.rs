//! What a recording does not say for sure and is taken for: sentences on its columns and times.

use std::collections::HashSet;
use taxel_record::{DEFAULT_RATE_HZ, ReadOptions, Recording};
use taxel_skin::ConditionConfig;

/// Characters of a comment that are quoted.
const COMMENT_CHARS: usize = 40;

/// Where the names of its columns were found, which of these are no taxels, and whether its first frame may be their names.
pub(crate) fn of_columns(recording: &Recording) -> impl Iterator<Item = String> + use<> {
    let left_out = recording.left_out_columns().iter();
    let left_out: Vec<String> = left_out.map(|column| format!("{column:?}")).collect();
    let left_out =
        (!left_out.is_empty()).then(|| format!("left out, since no taxels: column {}", left_out.join(", ")));
    let names = recording.names_line().map(|line| {
        let what = if line == 1 { "its first line" } else { "the first of its lines with numbers" };
        format!(
            "{what}, 0, 1, 2, .., is taken for a frame; where these are pandas' names of columns, cut it off (`tail -n +{}`)",
            line + 1
        )
    });
    let comment = recording.names_comment().map(|comment| {
        let names: String = match comment.char_indices().nth(COMMENT_CHARS) {
            Some((end, _)) => format!("{}..", &comment[..end]),
            None => comment.into(),
        };
        format!("the comment {names:?} is taken for the names of its columns")
    });
    let sorted = recording.column_order_before().map(|order| {
        let first = &recording.column_names()[..recording.taxels().min(3)];
        format!(
            "its columns stand {order}; they are taken by the numbers in their names, {}, ..",
            first.join(", ")
        )
    });
    let of_grid = recording.columns_of_grid().map(str::to_owned);
    let mut seen = HashSet::new();
    let twice = (recording.column_names().iter().filter(|name| !name.is_empty()))
        .find(|name| !seen.insert(name.as_str()))
        .map(|name| format!("two of its columns are called {name:?}; each is taken for a taxel"));
    let of_names = comment.into_iter().chain(left_out).chain(names);
    of_names.chain(sorted).chain(of_grid).chain(twice)
}

/// That a column is taken for seconds, or that a recording without times is taken to have come at a rate that nobody gave.
/// `units` is how another unit is said.
pub(crate) fn of_times(recording: &Recording, options: &ReadOptions, units: &str) -> Option<String> {
    if let Some(column) = recording.unitless_time() {
        return Some(format!("the column {column:?} is taken for seconds; {units}"));
    }
    let is_assumed = !recording.has_times() && recording.len() > 1 && options.rate_hz.is_none();
    is_assumed.then(|| {
        format!(
            "it has no times (of an .npz: nanoseconds, the array t_ns), and is taken for {DEFAULT_RATE_HZ} frames a \
             second; --rate HZ says otherwise"
        )
    })
}

/// That floats of 16 bits have left steps between counts, of which two are above the least threshold.
pub(crate) fn of_steps(recording: &Recording) -> Option<String> {
    let step = recording.counts_step()?;
    let enough = 2 * step;
    (f64::from(enough) > ConditionConfig::robust().threshold_min_counts).then(|| {
        format!(
            "its counts stand in floats of 16 bits, which go in steps of {step} there: save them as uint16; where there is no \
             more left of them, one step of noise is no contact with threshold_min_counts = {enough} ({} where forces are \
             squared) in [conditioning] of a file for --config",
            enough * enough
        )
    })
}
