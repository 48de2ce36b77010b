//! What is said of magnitudes that are read otherwise than they were meant.

use super::input::InputArgs;
use taxel_record::Recording;
use taxel_skin::Layout;

/// Frames from which on a recording tells what its taxels have at rest; so many are what `--idle 10` needs.
const ENOUGH: usize = 10;

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

/// Says what of its magnitudes is no contact, and what is contact all the time.
pub(crate) fn tell(recording: &Recording, threshold: f64, idles: bool) {
    let name = recording.name();
    let mut are_above = vec![true; recording.taxels()];
    let [mut least, mut greatest] = [f64::INFINITY, f64::NEG_INFINITY];
    for frame in (0..recording.len()).filter_map(|index| recording.magnitudes(index)) {
        for (is_above, value) in are_above.iter_mut().zip(frame) {
            *is_above &= *value > threshold;
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
    if idles && -least > threshold.max(2.0 * greatest) {
        remark!(
            "taxel: {name}: values fall by up to {} below rest (--idle) and rise by up to {greatest}; where touch lowers \
             them, give them turned over, rest - value",
            -least
        );
    }
    let always = are_above.iter().filter(|is_above| **is_above).count();
    if !idles && 2 * always > recording.taxels() && recording.len() >= ENOUGH {
        remark!(
            "taxel: {name}: {always} of {} taxels are above the threshold of {threshold} in every frame; where taxels at \
             rest are not 0, --idle {ENOUGH} takes off what each has in the first {ENOUGH} frames, and --threshold T is \
             above their noise",
            recording.taxels()
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
