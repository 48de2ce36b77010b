//! What is said of magnitudes that are read otherwise than they were meant.

use super::input::InputArgs;
use taxel_record::Recording;
use taxel_skin::Layout;

/// Frames from which on a recording tells what its taxels have at rest; so many are what `--idle 10` needs.
const ENOUGH: usize = 10;
/// Cells with sensors, from which on those that are always 0 are none.
const FEWEST_SENSORS: usize = 16;
/// Columns of a table with a line for each taxel: which one, and what it has.
const TIDY_COLUMNS: usize = 8;
/// No step of a clock is so many times as long as they are in the mean.
const MOST_STEPS: f64 = 4.0;

/// That a recording is of another size than the hand, and what it may be.
pub(crate) fn of_another_size(recording: &Recording, layout: &Layout, input: &InputArgs) -> anyhow::Error {
    let (name, taxels, wanted) = (recording.name(), recording.taxels(), layout.len());
    let columns = match recording.column_names() {
        [first, .., last] => format!(" ({first:?} to {last:?})"),
        _ => String::new(),
    };
    let has = format!("{name} has {taxels} taxels{columns}");
    let and_layout = match input.is_grid() {
        true => format!("{has}, and {} x {} are {wanted}", layout.height, layout.width),
        false => format!("{has} and layout {} has {wanted}", layout.name),
    };
    let and_layout = match input.layout.is_some() && recording.len() == wanted {
        true => format!(
            "{and_layout}, as many as there are frames; time is the first axis: where it is the last, give it turned, a.T"
        ),
        false => and_layout,
    };
    if let Some(other) = other_table(recording, wanted) {
        return anyhow::anyhow!("{and_layout}; {other}");
    }
    let place = match input.is_grid() {
        true => format!("--layout grid:HxW names rows and columns whose product is {taxels}"),
        false => "place them with --layout grid:HxW".into(),
    };
    let void = recording.cells();
    let columns = void.map_or(taxels, <[bool]>::len);
    match input.counts_of(columns, wanted) {
        Some(counts) => {
            let third = if taxels == 3 * wanted { ", a third" } else { "" };
            let leave = if void.is_some() {
                "leave --void out and "
            } else {
                ""
            };
            anyhow::anyhow!("{and_layout}{third}; {leave}{counts}, or {place}")
        }
        None if taxels.is_multiple_of(3) => {
            anyhow::anyhow!("{and_layout}; {place}, or say with --columns that they are x y z counts")
        }
        None => anyhow::anyhow!("{and_layout}; {place}"),
    }
}

/// What a table of the wrong number of taxels is, where its lines show it.
fn other_table(recording: &Recording, wanted: usize) -> Option<String> {
    let (lines, taxels) = (recording.len(), recording.taxels());
    if let Some(tidy) = a_line_for_each_taxel(recording) {
        return Some(tidy);
    }
    if recording.image_shape().is_none() && lines > 1 && lines * taxels == wanted {
        return Some(format!(
            "it may be one frame of {lines} lines: in numpy a[None], 1 x {lines} x {taxels}"
        ));
    }
    let clock = begins_with_clock(recording).filter(|_| taxels == wanted + 1)?;
    Some(clock.into())
}

/// That each time stands there many times, as in a table with a line for each taxel and time.
fn a_line_for_each_taxel(recording: &Recording) -> Option<String> {
    let may_be = recording.image_shape().is_none() && recording.taxels() <= TIDY_COLUMNS;
    let is_it = may_be && recording.has_times() && recording.len() > 1 && recording.period_ns() == 0;
    is_it.then(|| {
        "most times stand in several lines, as where there is a line for each taxel: in pandas \
         df.pivot(index=\"time\", columns=\"taxel\", values=\"value\").to_csv(..) makes a line for each time"
            .into()
    })
}

/// That the first column, and no other, rises from line to line, by steps that are much alike.
fn begins_with_clock(recording: &Recording) -> Option<&'static str> {
    if recording.len() < ENOUGH || recording.image_shape().is_some() || recording.has_times() {
        return None;
    }
    let frames: Vec<&[f64]> = (0..recording.len())
        .map_while(|index| recording.magnitudes(index))
        .collect();
    let steps = |column: usize| {
        frames
            .windows(2)
            .map(move |pair| pair[1][column] - pair[0][column])
    };
    let rises = |column: usize| steps(column).all(|step| step > 0.0);
    let of_first = || steps(0);
    let mean = of_first().sum::<f64>() / (frames.len() - 1) as f64;
    let is_clock = frames.len() == recording.len()
        && recording.taxels() > 1
        && rises(0)
        && of_first().all(|step| step < MOST_STEPS * mean)
        && !(1..recording.taxels()).any(rises);
    is_clock.then_some(
        "its first column rises from line to line, as times do: of a .csv --time-column s says that it is seconds",
    )
}

/// Says what of its magnitudes is no contact, and what is contact all the time.
pub(crate) fn tell(recording: &Recording, threshold: f64, idles: bool) {
    let name = recording.name();
    let mut are_above = vec![true; recording.taxels()];
    let mut are_ever = vec![false; recording.taxels()];
    let [mut falls, mut rises] = [0u64; 2];
    let [mut least, mut greatest] = [f64::INFINITY, f64::NEG_INFINITY];
    for frame in (0..recording.len()).filter_map(|index| recording.magnitudes(index)) {
        for ((is_above, is_ever), value) in are_above.iter_mut().zip(&mut are_ever).zip(frame) {
            *is_above &= *value > threshold;
            *is_ever |= *value != 0.0;
            falls += u64::from(-*value > threshold);
            rises += u64::from(*value > threshold);
            least = least.min(*value);
            greatest = greatest.max(*value);
        }
    }
    if greatest < 0.0 {
        remark!(
            "taxel: {name}: every magnitude is below 0, the greatest is {greatest}; a force is from 0 on"
        );
    } else if !idles && -least > threshold.max(greatest / 2.0) {
        remark!(
            "taxel: {name}: values below 0, down to {least}, are no contact; where they are touch, give them without sign, \
             numpy.abs(a)"
        );
    }
    let mostly_fall = threshold > 0.0 && falls > rises && -least > greatest / 2.0;
    if idles && (-least > threshold.max(2.0 * greatest) || mostly_fall) {
        remark!(
            "taxel: {name}: values fall by up to {} below rest (--idle) and rise by up to {greatest}; where touch lowers \
             them, give them turned over, rest - value, and where it does both, numpy.abs(value - rest)",
            -least
        );
    }
    let count = |which: &[bool]| which.iter().filter(|is_so| **is_so).count();
    let (always, ever, cells) = (count(&are_above), count(&are_ever), recording.taxels());
    // Those that are always 0 may have no sensor, as in the image of a glove.
    let is_glove = ever >= FEWEST_SENSORS && 4 * ever >= cells && 10 * always > 9 * ever;
    let sensors = if is_glove { ever } else { cells };
    let rest_above = is_glove || 2 * always > cells;
    if let Some(other) = a_line_for_each_taxel(recording) {
        remark!("taxel: {name}: {other}");
    } else if let Some(clock) = begins_with_clock(recording) {
        remark!("taxel: {name}: {clock}");
    } else if !idles && rest_above && recording.len() >= ENOUGH {
        remark!(
            "taxel: {name}: {always} of {} taxels are above the threshold of {threshold} in every frame; where taxels at \
             rest are not 0, --idle {ENOUGH} takes off what each has in the first {ENOUGH} frames, and --threshold T is \
             above their noise",
            sensors
        );
    }
    if let Some((height, width)) = recording.image_shape()
        && height > 1
        && width > 255.max(4 * height.max(recording.len()))
    {
        remark!(
            "taxel: {name}: read as {} frames of {height} x {width}; time is the first axis: numpy.moveaxis(a, -1, 0) where it \
             is the last",
            recording.len()
        );
    }
}
