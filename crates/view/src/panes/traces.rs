//! Force over time of chosen taxels.

use super::lines::name;
use crate::colour::Palette;
use crate::history::KEPT_NS;
use crate::picture::Picture;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Widget};

/// Colours of the chosen taxels, in their order.
pub(super) const COLOURS: [[u8; 3]; 6] = [
    [120, 190, 255],
    [255, 175, 95],
    [95, 215, 135],
    [255, 135, 215],
    [215, 215, 95],
    [175, 135, 255],
];

pub(super) fn draw(buffer: &mut Buffer, area: Rect, picture: &Picture, palette: Palette) {
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let colour = |place: usize| {
        let [r, g, b] = COLOURS[place % COLOURS.len()];
        Style::new().fg(palette.rgb(r, g, b))
    };
    let mut title = vec![Span::styled(
        "force over time",
        Style::new().add_modifier(Modifier::BOLD),
    )];
    match picture.traces.is_empty() {
        true => title.push(Span::styled("  of the strongest taxel", dim)),
        false => title.extend(picture.traces.iter().enumerate().map(|(place, trace)| {
            let letter = char::from(b'a' + place as u8);
            Span::styled(
                format!("  {letter} {}", name(picture, trace.taxel)),
                colour(place),
            )
        })),
    }
    Line::from(title).render(Rect { height: 1, ..area }, buffer);
    let chart = Rect {
        y: area.y + 1,
        height: area.height.saturating_sub(1),
        ..area
    };
    if chart.height < 3 {
        return;
    }
    let forces = picture
        .traces
        .iter()
        .flat_map(|trace| trace.points.iter().map(|(_, force)| *force));
    let greatest = round_up(forces.fold(4.0 * picture.threshold, f64::max).max(1.0));
    let seconds = KEPT_NS as f64 / 1e9;
    let datasets = picture.traces.iter().enumerate().map(|(place, trace)| {
        Dataset::default()
            .marker(Marker::Braille)
            .graph_type(GraphType::Line)
            .style(colour(place))
            .data(&trace.points)
    });
    let across = Axis::default()
        .style(dim)
        .bounds([-seconds, 0.0])
        .labels([format!("-{seconds:.0} s"), "now".into()]);
    let up = Axis::default()
        .style(dim)
        .bounds([0.0, greatest])
        .labels(["0".into(), format!("{greatest:.0}")]);
    Chart::new(datasets.collect())
        .x_axis(across)
        .y_axis(up)
        .legend_position(None)
        .render(chart, buffer);
}

/// The next of 1, 2, 5, 10, 20 ...: an axis that stays for a while.
fn round_up(greatest: f64) -> f64 {
    let power = 10f64.powf(greatest.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    steps
        .into_iter()
        .find(|step| *step >= greatest)
        .unwrap_or(greatest)
}
