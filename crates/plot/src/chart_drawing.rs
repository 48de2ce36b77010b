//! How a chart is drawn.

use crate::axis::Scale;
use crate::chart::{Chart, Layer, Marks};
use crate::colour;
use crate::error::PlotError;
use crate::pen::{Pen, Place, Side, fit, text_width};
use crate::spread::{Quartiles, ellipse};

const TEXT: f64 = 11.0;

/// Where the axes are and what they span.
struct Plane {
    x: Scale,
    y: Scale,
    from: Place,
    to: Place,
}

impl Plane {
    fn at(&self, x: f64, y: f64) -> Option<Place> {
        Some((self.across(x)?, self.up(y)?))
    }

    fn across(&self, x: f64) -> Option<f64> {
        Some(self.from.0 + self.x.place(x)? * (self.to.0 - self.from.0))
    }

    fn up(&self, y: f64) -> Option<f64> {
        Some(self.to.1 - self.y.place(y)? * (self.to.1 - self.from.1))
    }
}

/// Draws into the panel between two corners; `names` are those of the whole sheet.
pub(crate) fn draw(
    chart: &Chart,
    pen: &Pen<'_>,
    (x0, y0): Place,
    (x1, y1): Place,
    names: &[&str],
) -> Result<(), PlotError> {
    let mut top = y0 + 4.0;
    if !chart.title.is_empty() {
        pen.fitted(
            &chart.title,
            ((x0 + x1) / 2.0, top + 6.0),
            x1 - x0,
            12.0,
            colour::INK,
        )?;
        top += 18.0;
    }
    top = draw_legend(chart, pen, (x0, x1), top, names)? + 6.0;

    let x = chart
        .x
        .scale(chart.layers.iter().flat_map(|layer| layer.marks.xs()));
    let y = chart
        .y
        .scale(chart.layers.iter().flat_map(|layer| layer.marks.ys()));
    let y_ticks = chart.y.marked(&y, ((y1 - top) / 45.0) as usize);
    let widest = y_ticks
        .iter()
        .map(|(_, text)| text_width(text, TEXT))
        .fold(0.0, f64::max);
    let left = x0 + widest + 10.0 + if chart.y.label.is_empty() { 0.0 } else { 18.0 };
    let right = x1 - 14.0;
    let longest = chart
        .x
        .names
        .iter()
        .map(|n| text_width(n, TEXT))
        .fold(0.0, f64::max);
    let upright = longest > (right - left) / chart.x.names.len().max(1) as f64 - 4.0;
    let x_ticks_height = if upright { longest + 8.0 } else { 18.0 };
    let bottom = y1 - x_ticks_height - if chart.x.label.is_empty() { 2.0 } else { 18.0 };
    let plane = Plane {
        x,
        y,
        from: (left, top),
        to: (right, bottom.max(top + 20.0)),
    };
    draw_axes(chart, pen, &plane, &y_ticks, upright, ((x0, y0), (x1, y1)))?;
    draw_layers(chart, pen, &plane, names)
}

fn series(names: &[&str], name: &str) -> Option<usize> {
    names.iter().position(|n| *n == name)
}

/// In rows from the left; gives where it ends. None for a single series: the title tells it.
fn draw_legend(
    chart: &Chart,
    pen: &Pen<'_>,
    (x0, x1): (f64, f64),
    mut y: f64,
    names: &[&str],
) -> Result<f64, PlotError> {
    let shown = chart.names();
    if shown.len() < 2 {
        return Ok(y);
    }
    let mut x = x0 + 8.0;
    for name in shown {
        let (words, size) = fit(name, x1 - x0 - 32.0, TEXT);
        let width = 24.0 + text_width(&words, size);
        if x + width > x1 && x > x0 + 8.0 {
            (x, y) = (x0 + 8.0, y + 16.0);
        }
        let number = series(names, name);
        let points =
            |layer: &&crate::chart::Layer| matches!(layer.marks, Marks::Points(_)) && layer.name == name;
        if chart.layers.iter().any(|layer| points(&layer)) {
            pen.marker((x + 6.0, y + 7.0), number)?;
        } else {
            pen.rect((x, y + 4.0), (x + 12.0, y + 10.0), colour::of_series(number))?;
        }
        pen.text(&words, (x + 17.0, y + 7.0), Side::Right, size, colour::INK)?;
        x += width + 10.0;
    }
    Ok(y + 16.0)
}

fn draw_axes(
    chart: &Chart,
    pen: &Pen<'_>,
    plane: &Plane,
    y_ticks: &[(f64, String)],
    upright: bool,
    ((x0, y0), (x1, y1)): (Place, Place),
) -> Result<(), PlotError> {
    let ((left, top), (right, bottom)) = (plane.from, plane.to);
    for (value, text) in y_ticks {
        if let Some(y) = plane.up(*value) {
            pen.line(&[(left, y), (right, y)], colour::GRID, 0.75)?;
            pen.text(text, (left - 6.0, y), Side::Left, TEXT, colour::INK)?;
        }
    }
    if chart.x.names.is_empty() {
        let mut free = f64::NEG_INFINITY;
        for (value, text) in chart.x.marked(&plane.x, ((right - left) / 70.0) as usize) {
            if let Some(x) = plane.across(value) {
                pen.line(&[(x, top), (x, bottom)], colour::GRID, 0.75)?;
                let half = text_width(&text, TEXT) / 2.0;
                if x - half > free {
                    pen.text(&text, (x, bottom + 10.0), Side::Middle, TEXT, colour::INK)?;
                    free = x + half + 4.0;
                }
            }
        }
    }
    for (place, name) in chart.x.names.iter().enumerate() {
        let Some(x) = plane.across(place as f64) else {
            continue;
        };
        if upright {
            pen.text_upwards(name, (x, bottom + 6.0), Side::Left, colour::INK)?;
        } else {
            pen.text(name, (x, bottom + 10.0), Side::Middle, TEXT, colour::INK)?;
        }
    }
    pen.line(&[(left, top), (left, bottom), (right, bottom)], colour::PALE, 1.0)?;
    let middle = ((left + right) / 2.0, (top + bottom) / 2.0);
    // Around the middle of its axis, within the panel.
    let room = 2.0 * (x1 - middle.0);
    pen.fitted(&chart.x.label, (middle.0, y1 - 7.0), room, TEXT, colour::PALE)?;
    let room = 2.0 * (middle.1 - y0).min(y1 - middle.1);
    pen.fitted_upwards(&chart.y.label, (x0 + 8.0, middle.1), room, colour::PALE)
}

fn draw_layers(chart: &Chart, pen: &Pen<'_>, plane: &Plane, names: &[&str]) -> Result<(), PlotError> {
    let mut beside: Vec<&str> = Vec::new();
    for layer in chart.layers.iter().filter(|layer| layer.marks.is_side_by_side()) {
        if !beside.contains(&layer.name.as_str()) {
            beside.push(&layer.name);
        }
    }
    for layer in &chart.layers {
        draw_layer(layer, pen, plane, series(names, &layer.name), &beside)?;
    }
    Ok(())
}

/// Draws the layer of a series of this `number`, of those that stand `beside` each other.
fn draw_layer(
    layer: &Layer,
    pen: &Pen<'_>,
    plane: &Plane,
    number: Option<usize>,
    beside: &[&str],
) -> Result<(), PlotError> {
    let ink = colour::of_series(number);
    // The middle and the width of the mark of a name, where several series stand side by side.
    let slot = |place: usize| {
        let share = 0.8 / beside.len().max(1) as f64;
        let nth = beside.iter().position(|name| *name == layer.name).unwrap_or(0);
        let middle = place as f64 - 0.4 + (nth as f64 + 0.5) * share;
        let (from, to) = (
            plane.across(middle - 0.45 * share)?,
            plane.across(middle + 0.45 * share)?,
        );
        Some((from, plane.across(middle)?, to))
    };
    match &layer.marks {
        Marks::Line(points) | Marks::Steps(points) => {
            for mut part in parts(points, |(x, y)| plane.at(*x, *y)) {
                if matches!(layer.marks, Marks::Steps(_)) {
                    part = stairs(&part);
                }
                match thinned(&part).as_slice() {
                    [alone] => pen.marker(*alone, number)?,
                    line => pen.line(line, ink, 1.75)?,
                }
            }
        }
        Marks::Band(band) => {
            let both = |(x, low, high): &(f64, f64, f64)| Some((plane.at(*x, *low)?, plane.at(*x, *high)?));
            for part in parts(band, both) {
                let (low, high): (Vec<_>, Vec<_>) = part.into_iter().unzip();
                let mut outline = thinned(&high);
                outline.extend(thinned(&low).into_iter().rev());
                pen.shape(&outline, ink, 0.22)?;
            }
        }
        Marks::Points(points) => {
            for place in points.iter().filter_map(|(x, y)| plane.at(*x, *y)) {
                pen.marker(place, number)?;
            }
        }
        Marks::Ellipse(points) => {
            let outline = ellipse(points);
            let mut outline: Vec<_> = outline.iter().filter_map(|(x, y)| plane.at(*x, *y)).collect();
            if let Some(first) = outline.first().copied() {
                pen.shape(&outline, ink, 0.12)?;
                outline.push(first);
                pen.line(&outline, ink, 1.0)?;
            }
        }
        Marks::Bars(bars) => {
            let floor = plane.up(0.0).unwrap_or(plane.to.1);
            for (place, (height, low, high)) in bars.iter().enumerate() {
                let (Some((from, middle, to)), Some(y)) = (slot(place), plane.up(*height)) else {
                    continue;
                };
                pen.rect((from, y.min(floor)), (to, y.max(floor)), ink)?;
                if let (Some(low), Some(high)) = (plane.up(*low), plane.up(*high)) {
                    pen.line(&[(middle, low), (middle, high)], colour::INK, 1.25)?;
                }
            }
        }
        Marks::Boxes(boxes) => {
            for (place, samples) in boxes.iter().enumerate() {
                if let Some(slot) = slot(place) {
                    draw_box(pen, plane, samples, slot, number)?;
                }
            }
        }
        Marks::AtY(y) => {
            if let Some(y) = plane.up(*y) {
                pen.line(&[(plane.from.0, y), (plane.to.0, y)], colour::PALE, 1.0)?;
                let above = if y - 14.0 < plane.from.1 { -7.0 } else { 7.0 };
                let place = (plane.to.0 - 4.0, y - above);
                pen.text(&layer.name, place, Side::Left, 10.0, colour::PALE)?;
            }
        }
    }
    Ok(())
}

fn draw_box(
    pen: &Pen<'_>,
    plane: &Plane,
    samples: &[f64],
    (from, middle, to): (f64, f64, f64),
    number: Option<usize>,
) -> Result<(), PlotError> {
    let Some(quartiles) = Quartiles::of(samples) else {
        return Ok(());
    };
    let Quartiles {
        low,
        first,
        median,
        third,
        high,
    } = quartiles;
    let ink = colour::of_series(number);
    let [Some(low_y), Some(first), Some(median), Some(third), Some(high_y)] =
        [low, first, median, third, high].map(|v| plane.up(v))
    else {
        return Ok(());
    };
    pen.line(&[(middle, low_y), (middle, first)], ink, 1.25)?;
    pen.line(&[(middle, third), (middle, high_y)], ink, 1.25)?;
    pen.shape(
        &[(from, third), (to, third), (to, first), (from, first)],
        ink,
        0.3,
    )?;
    pen.frame((from, third), (to, first), ink)?;
    pen.line(&[(from, median), (to, median)], colour::INK, 1.75)?;
    let beyond = samples.iter().filter(|v| **v < low || **v > high);
    for y in beyond.filter_map(|v| plane.up(*v)) {
        pen.marker((middle, y), number)?;
    }
    Ok(())
}

/// The runs of what has a place.
fn parts<T, P>(values: &[T], place: impl Fn(&T) -> Option<P>) -> Vec<Vec<P>> {
    let mut parts = vec![Vec::new()];
    for value in values {
        match (place(value), parts.last_mut()) {
            (Some(place), Some(part)) => part.push(place),
            _ => parts.push(Vec::new()),
        }
    }
    parts.retain(|part| !part.is_empty());
    parts
}

/// A line that goes from place to place along the axes: across, and then up or down.
fn stairs(places: &[Place]) -> Vec<Place> {
    let mut stairs: Vec<Place> = Vec::with_capacity(2 * places.len());
    for (x, y) in places {
        if let Some((_, before)) = stairs.last().copied().filter(|(_, before)| before != y) {
            stairs.push((*x, before));
        }
        stairs.push((*x, *y));
    }
    stairs
}

/// A line without what nobody could see: of the places within half a pixel from left to right the first, the lowest, the
/// highest and the last stay.
fn thinned(places: &[Place]) -> Vec<Place> {
    let column = |place: &Place| (place.0 * 2.0).floor();
    let mut kept = Vec::new();
    for run in places.chunk_by(|a, b| column(a) == column(b)) {
        let extreme = |sign: f64| {
            let by_height = |a: &usize, b: &usize| (sign * run[*a].1).total_cmp(&(sign * run[*b].1));
            (0..run.len()).min_by(by_height).unwrap_or(0)
        };
        let mut stay = [0, extreme(1.0), extreme(-1.0), run.len() - 1];
        stay.sort_unstable();
        for (n, index) in stay.into_iter().enumerate() {
            if n == 0 || index != stay[n - 1] {
                kept.push(run[index]);
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_keeps_its_ends_and_its_extremes() {
        let line: Vec<Place> = (0..100_000)
            .map(|n| {
                (
                    f64::from(n) / 1000.0,
                    if n == 50_250 { -9.0 } else { f64::from(n % 2) },
                )
            })
            .collect();
        let thin = thinned(&line);
        assert!(thin.len() <= 800, "{}", thin.len());
        assert_eq!((thin.first(), thin.last()), (line.first(), line.last()));
        assert!(thin.contains(&(50.25, -9.0)));
        assert_eq!(thinned(&[(1.0, 2.0)]), [(1.0, 2.0)]);
    }
}
