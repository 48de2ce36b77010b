//! The numbers of a figure.

use crate::axis::Axis;
use crate::chart::{Layer, Marks};
use crate::colour;
use crate::panel::Panel;
use crate::picture::Cell;

/// One row: kind, series, x, y, low, high, value.
type Row<'a> = [&'a str; 7];

pub(crate) fn csv(panels: &[Panel]) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut write = |panel: &str, row: Row<'_>| {
        let row = [panel].into_iter().chain(row);
        // Memory takes all that is written.
        let _ = writer.write_record(row);
    };
    write("panel", ["kind", "series", "x", "y", "low", "high", "value"]);
    for (number, panel) in panels.iter().enumerate() {
        let title = match panel {
            Panel::Chart(chart) => &chart.title,
            Panel::Picture(picture) => &picture.title,
        };
        let title = if title.is_empty() {
            (number + 1).to_string()
        } else {
            title.clone()
        };
        match panel {
            Panel::Chart(chart) => {
                for layer in &chart.layers {
                    of_layer(layer, &chart.x, &mut |row| write(&title, row));
                }
            }
            Panel::Picture(picture) => {
                let mut cell = |series: &str, n: usize, value: &str| {
                    let (x, y) = (n % picture.width.max(1), n / picture.width.max(1));
                    write(
                        &title,
                        ["cell", series, &x.to_string(), &y.to_string(), "", "", value],
                    );
                };
                for (series, values) in &picture.numbers {
                    for (n, value) in values.iter().enumerate() {
                        cell(series, n, &value.map_or(String::new(), number_text));
                    }
                }
                for (n, colour) in picture.cells.iter().enumerate() {
                    match colour {
                        _ if !picture.numbers.is_empty() => {}
                        Cell::None => cell("", n, ""),
                        Cell::Grey(grey) => cell("", n, &grey.to_string()),
                        Cell::Rgb(rgb) => cell("", n, &colour::hex(*rgb)),
                        Cell::Number(value) => cell("", n, &number_text(*value)),
                    }
                }
            }
        }
    }
    let bytes = writer.into_inner().unwrap_or_default();
    String::from_utf8(bytes).unwrap_or_default()
}

/// The shortest text that reads as the same number; nothing for what is none.
fn number_text(value: f64) -> String {
    if value.is_nan() {
        String::new()
    } else {
        value.to_string()
    }
}

fn of_layer(layer: &Layer, x_axis: &Axis, write: &mut dyn FnMut(Row<'_>)) {
    let series = layer.name.as_str();
    let at = |place: usize| {
        x_axis
            .names
            .get(place)
            .cloned()
            .unwrap_or_else(|| place.to_string())
    };
    let text = number_text;
    match &layer.marks {
        Marks::Line(points) | Marks::Steps(points) | Marks::Points(points) => {
            let kind = if matches!(layer.marks, Marks::Points(_)) {
                "point"
            } else {
                "line"
            };
            for (x, y) in points {
                write([kind, series, &text(*x), &text(*y), "", "", ""]);
            }
        }
        Marks::Ellipse(points) => {
            for (x, y) in crate::ellipse(points) {
                write(["ellipse", series, &text(x), &text(y), "", "", ""]);
            }
        }
        Marks::Band(band) => {
            for (x, low, high) in band {
                write(["band", series, &text(*x), "", &text(*low), &text(*high), ""]);
            }
        }
        Marks::Bars(bars) => {
            for (place, (height, low, high)) in bars.iter().enumerate() {
                write([
                    "bar",
                    series,
                    &at(place),
                    &text(*height),
                    &text(*low),
                    &text(*high),
                    "",
                ]);
            }
        }
        Marks::Boxes(boxes) => {
            for (place, samples) in boxes.iter().enumerate() {
                for sample in samples {
                    write(["sample", series, &at(place), &text(*sample), "", "", ""]);
                }
            }
        }
        Marks::AtY(y) => write(["threshold", series, "", &text(*y), "", "", ""]),
    }
}
