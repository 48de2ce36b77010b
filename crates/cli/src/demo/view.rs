//! The demo's picture on the terminal.

use super::colour::Palette;
use super::grid::{Grid, STATUS_LINES, parts};
use super::meter::{Cell, Picture};
use super::{joints, palpation};
use ratatui::Frame;
use ratatui::buffer::Buffer;
use ratatui::layout::{Alignment, Constraint, Layout as Split, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph, Widget};
use taxel_skin::Layout;

/// Columns that the map of touches needs.
const LEAST_MAP: u16 = 24;

/// Draws the picture into the whole terminal.
pub(super) fn draw(frame: &mut Frame<'_>, picture: &Picture, palette: &Palette) {
    let area = frame.area();
    let (hand, map) = beside_map(picture, area);
    let Some(grid) = Grid::fit(&picture.layout, hand) else {
        let text = format!(
            "The terminal has {}x{} characters; the demo needs {}x{}. Make it larger, or use --headless. q quits.",
            area.width,
            area.height,
            2 * (picture.layout.width + 2) + 1,
            picture.layout.height + 3 + STATUS_LINES,
        );
        frame.render_widget(
            Paragraph::new(text).wrap(ratatui::widgets::Wrap { trim: true }),
            area,
        );
        return;
    };
    let panels_height = map.map_or(grid.height + 3, |map| map.height);
    let [panels, status] =
        Split::vertical([Constraint::Length(panels_height), Constraint::Min(STATUS_LINES)]).areas(area);
    let across = grid.width + 2;
    let margin = (hand.width - 2 * across) / 3;
    let left = Rect {
        x: panels.x + margin,
        width: across,
        height: grid.height + 3,
        ..panels
    };
    let right = Rect {
        x: panels.x + hand.width - margin - across,
        width: across,
        height: grid.height + 3,
        ..panels
    };
    let buffer = frame.buffer_mut();

    let raw_title = format!(" raw: {} taxels ", picture.layout.len());
    let origin = panel(buffer, left, &raw_title, picture, &grid, palette);
    draw_raw(buffer, origin, picture, &grid, palette);
    for (part, first, last) in parts(&picture.layout) {
        let (first, last) = (grid.cell(origin, first, 0), grid.cell(origin, last, 0));
        let below = Rect {
            x: first.x,
            y: left.bottom() - 1,
            width: last.right() - first.x,
            height: 1,
        };
        joints::draw_bars(buffer, below, picture, part, palette);
    }

    let image_title = format!(" tactile image: {} actuators ", picture.max_actuators);
    let origin = panel(buffer, right, &image_title, picture, &grid, palette);
    draw_image(buffer, origin, picture, &grid, palette);

    if let (Some(map), Some(palpation)) = (map, &picture.palpation) {
        palpation::draw(buffer, map, palpation, palette);
    }
    draw_status(buffer, status, picture, palette);
    let names: Vec<&str> = parts(&picture.layout).iter().map(|(name, ..)| *name).collect();
    joints::draw_degrees(buffer, status, picture, &names, palette);
}

/// The columns of the panels, and where the map of touches is beside them: nowhere where nothing is palpated or the
/// panels would not fit.
fn beside_map(picture: &Picture, area: Rect) -> (Rect, Option<Rect>) {
    let [hand, map] = Split::horizontal([Constraint::Fill(3), Constraint::Fill(2)]).areas(area);
    let fits = map.width >= LEAST_MAP && Grid::fit(&picture.layout, hand).is_some();
    if picture.palpation.is_none() || !fits {
        return (area, None);
    }
    let map = Rect {
        height: area.height - STATUS_LINES,
        ..map
    };
    (hand, Some(map))
}

/// A frame with a title and the names of the hand's parts; returns where the pixels begin.
fn panel(
    buffer: &mut Buffer,
    area: Rect,
    title: &str,
    picture: &Picture,
    grid: &Grid,
    palette: &Palette,
) -> (u16, u16) {
    let border = Style::new().fg(palette.rgb(110, 110, 120));
    let block = Block::bordered()
        .border_style(border)
        .title(Span::styled(title, Modifier::BOLD));
    let inner = block.inner(area);
    block.render(area, buffer);
    for (name, first, last) in parts(&picture.layout) {
        let (first, last) = (
            grid.cell((inner.x, inner.y), first, 0),
            grid.cell((inner.x, inner.y), last, 0),
        );
        let place = Rect {
            width: last.right() - first.x,
            height: 1,
            ..first
        };
        Line::from(name)
            .alignment(Alignment::Center)
            .style(border)
            .render(place, buffer);
    }
    (inner.x, inner.y + 1)
}

/// The grey of a taxel that feels nothing: modules differ from their neighbours.
fn idle(layout: &Layout, taxel: usize) -> u8 {
    let module = layout.module_of(taxel);
    let before = layout
        .modules
        .iter()
        .take_while(|m| m.first_taxel != module.first_taxel);
    match before.filter(|m| m.part == module.part).count() % 2 {
        0 => 30,
        _ => 46,
    }
}

fn fill(buffer: &mut Buffer, place: Rect, text: &str, style: Style) {
    buffer.set_style(place, style);
    let row = place.y + (place.height - 1) / 2;
    let column = place.x + place.width.saturating_sub(text.chars().count() as u16) / 2;
    buffer.set_stringn(column, row, text, usize::from(place.width), style);
}

fn draw_raw(buffer: &mut Buffer, origin: (u16, u16), picture: &Picture, grid: &Grid, palette: &Palette) {
    for (taxel, place) in picture.layout.taxels.iter().enumerate() {
        let place = grid.cell(origin, place.x, place.y);
        let idle = idle(&picture.layout, taxel);
        let (text, style) = match picture.cells.get(taxel) {
            Some(Cell::Force(force)) => ("", Style::new().bg(palette.force(force / picture.scale, idle))),
            Some(Cell::Faulty) => (
                "x",
                Style::new()
                    .fg(palette.rgb(255, 95, 95))
                    .bg(palette.rgb(95, 0, 0)),
            ),
            Some(Cell::Missing) => ("?", Style::new().fg(palette.rgb(138, 138, 138))),
            None => ("", Style::new().bg(palette.force(0.0, idle))),
        };
        fill(buffer, place, text, style);
    }
}

fn draw_image(buffer: &mut Buffer, origin: (u16, u16), picture: &Picture, grid: &Grid, palette: &Palette) {
    for (taxel, place) in picture.layout.taxels.iter().enumerate() {
        let colour = palette.force(0.0, idle(&picture.layout, taxel));
        fill(
            buffer,
            grid.cell(origin, place.x, place.y),
            "",
            Style::new().bg(colour),
        );
    }
    for actuator in &picture.actuators {
        // The image may have another size than the layout only if the daemon is not this one.
        let Some(taxel) = picture.layout.taxel_at(actuator.x, actuator.y) else {
            continue;
        };
        let share = f64::from(actuator.force) / picture.scale;
        let colour = palette.force(share, idle(&picture.layout, taxel));
        let style = Style::new()
            .fg(palette.ink(share))
            .bg(colour)
            .add_modifier(Modifier::BOLD);
        fill(
            buffer,
            grid.cell(origin, actuator.x, actuator.y),
            &actuator.level.to_string(),
            style,
        );
    }
}

fn draw_status(buffer: &mut Buffer, area: Rect, picture: &Picture, palette: &Palette) {
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let warn = Style::new()
        .fg(palette.rgb(255, 175, 0))
        .add_modifier(Modifier::BOLD);
    let value = |text: String| Span::styled(text, bold);
    let label = |text: &'static str| Span::styled(text, dim);
    let count = |n: u64| Span::styled(n.to_string(), if n > 0 { warn } else { bold });

    let mut scene = vec![
        label(" scene "),
        value(picture.scene.clone()),
        value(format!(" {:4.1}", picture.scene_at_s)),
        label(" of "),
        Span::raw(format!("{:.1} s", picture.scene_seconds)),
    ];
    if picture.paused {
        scene.push(Span::styled(
            "   paused: every actuator has let go; p goes on",
            warn,
        ));
    } else if picture.calibrating {
        scene.push(Span::styled("   measuring the baseline: hands off", warn));
    } else if !picture.note.is_empty() {
        scene.push(Span::styled(format!("   {}", picture.note), warn));
    } else {
        let used: usize = scene.iter().map(Span::width).sum();
        let about = shortened(&picture.about, usize::from(area.width).saturating_sub(used + 4));
        scene.push(Span::styled(format!("   {about}"), dim));
    }
    let contacts = vec![
        label(" contact "),
        value(format!("{:3}", picture.contacts)),
        label(" taxels → "),
        value(format!("{:2}", picture.actuators.len())),
        label(" actuators"),
        label("   missing "),
        count(picture.missing.into()),
        label("   faulty "),
        count(picture.faulty.into()),
        label("   skipped "),
        count(picture.skipped),
    ];
    let rates = vec![
        label(" rate "),
        value(format!("{:5.1} Hz", picture.rate_hz)),
        label("   latency p50 "),
        value(format!("{:.2}", picture.latency_p50_ms)),
        label(" p99 "),
        value(format!("{:.2} ms", picture.latency_p99_ms)),
        label("   data "),
        value(format!("{:.0}", picture.raw_bits_per_s / 1e3)),
        label(" → "),
        value(format!("{:.1} kbit/s", picture.image_bits_per_s / 1e3)),
        value(match picture.image_bits_per_s {
            bits if bits > 0.0 => format!(" {:.0}:1", picture.raw_bits_per_s / bits),
            _ => String::new(),
        }),
    ];
    let mut legend = vec![label(" force 0 ")];
    const STEPS: usize = 20;
    // The colours are a square root of the force; so are the places of the legend.
    legend.extend((0..STEPS).map(|i| {
        let share = (i as f64 / (STEPS - 1) as f64).powi(2);
        Span::styled(" ", Style::new().bg(palette.force(share, 30)))
    }));
    legend.push(Span::raw(format!(" {:.0} ", picture.scale)));
    legend.push(Span::styled(picture.unit.clone(), dim));
    legend.push(label("   digits: level, 1 to "));
    legend.push(Span::raw(picture.levels.to_string()));
    if !picture.joints.is_empty() {
        legend.push(label("   bars: joints"));
    }
    let keys = vec![
        value(" q".into()),
        label(" quit   "),
        value("z".into()),
        label(" measure the baseline anew   "),
        value("p".into()),
        label(if picture.paused { " go on" } else { " pause" }),
        label("      method "),
        Span::styled(picture.method.clone(), dim),
    ];
    let lines = [scene, contacts, rates, legend, keys];
    for (row, line) in (area.top()..area.bottom()).zip(lines) {
        Line::from(line).render(
            Rect {
                y: row,
                height: 1,
                ..area
            },
            buffer,
        );
    }
}

/// At most so many characters of a sentence, with dots where it goes on.
fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.into();
    }
    let start: String = text.chars().take(most.saturating_sub(1)).collect();
    start.trim_end().to_owned() + "…"
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use taxel_wire::WireActuator;

    fn picture() -> Picture {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        let mut cells = vec![Cell::Force(0.0); layout.len()];
        let taxel = |x, y| layout.taxel_at(x, y).unwrap();
        cells[taxel(3, 2)] = Cell::Force(100.0);
        cells[taxel(8, 8)] = Cell::Faulty;
        cells[taxel(0, 15)] = Cell::Missing;
        Picture {
            layout,
            cells,
            actuators: vec![WireActuator {
                id: 0,
                x: 3,
                y: 2,
                level: 8,
                force: 100.0,
            }],
            joints: ["index", "middle", "ring", "thumb"]
                .iter()
                .flat_map(|finger| (0..4).map(move |j| (format!("{finger} {j}"), Some(0.5 * j as f32))))
                .collect(),
            scale: 100.0,
            unit: "counts".into(),
            levels: 8,
            max_actuators: 16,
            method: "paper".into(),
            scene: "ball-grasp".into(),
            about: "a ball".into(),
            scene_at_s: 1.5,
            scene_seconds: 10.0,
            rate_hz: 50.0,
            latency_p50_ms: 0.25,
            latency_p99_ms: 0.5,
            contacts: 1,
            missing: 1,
            faulty: 1,
            skipped: 0,
            raw_bits_per_s: 576e3,
            image_bits_per_s: 8.8e3,
            calibrating: false,
            paused: false,
            palpation: None,
            note: String::new(),
        }
    }

    fn drawn(width: u16, height: u16, picture: &Picture) -> Terminal<TestBackend> {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal
            .draw(|frame| draw(frame, picture, &Palette::True))
            .unwrap();
        terminal
    }

    fn text(terminal: &Terminal<TestBackend>) -> String {
        let buffer = terminal.backend().buffer();
        let rows = buffer.content().chunks(usize::from(buffer.area.width));
        rows.map(|row| row.iter().map(|c| c.symbol()).collect::<String>() + "\n")
            .collect()
    }

    #[test]
    fn everything_is_there_on_a_small_and_on_a_large_terminal() {
        for (width, height) in [(80, 24), (120, 40), (200, 60)] {
            let text = text(&drawn(width, height, &picture()));
            for part in [
                "raw: 240 taxels",
                "tactile image: 16 actuators",
                "index",
                "thumb",
                "ball-grasp",
                "50.0 Hz",
                "p50 0.25 p99 0.50 ms",
                "level, 1 to 8",
                "576 → 8.8 kbit/s 65:1",
                "missing 1",
                "faulty 1",
                "q quit",
            ] {
                assert!(text.contains(part), "{width}x{height} lacks {part:?}:\n{text}");
            }
        }
    }

    #[test]
    fn a_palpated_phantoms_touches_are_on_a_map_beside_the_hand() {
        let layout = Layout::builtin("cyskin-triangle").unwrap();
        let picture = Picture {
            cells: vec![Cell::Force(0.0); layout.len()],
            layout,
            actuators: Vec::new(),
            joints: Vec::new(),
            palpation: Some(palpation::Palpation::sample()),
            ..picture()
        };
        for (width, height) in [(80, 24), (120, 40), (200, 60)] {
            let text = text(&drawn(width, height, &picture));
            for part in [
                "raw: 7",
                "touches: first two",
                "NA",
                "◆ touch 3 BS is like BS 0.50",
                "1 of 1",
                "q quit",
            ] {
                assert!(text.contains(part), "{width}x{height} lacks {part:?}:\n{text}");
            }
            assert_eq!(text.matches('◆').count(), 2, "on the map and below it:\n{text}");
        }
        let small = text(&drawn(30, 24, &picture));
        assert!(small.contains("raw") && !small.contains("touches"), "{small}");
    }

    #[test]
    fn a_terminal_that_is_too_small_says_so_instead_of_breaking() {
        for (width, height) in [(30, 40), (80, 20), (1, 1)] {
            let text = text(&drawn(width, height, &picture()));
            assert!(width < 30 || text.contains("needs"), "{text}");
        }
    }

    #[test]
    fn force_has_the_same_colour_in_both_panels_and_the_actuator_its_level() {
        let terminal = drawn(80, 24, &picture());
        let buffer = terminal.backend().buffer();
        let brightest = Palette::True.force(1.0, 0);
        let lit: Vec<_> = (0..19u16)
            .flat_map(|y| (0..80u16).map(move |x| (x, y)))
            .filter(|(x, y)| buffer[(*x, *y)].bg == brightest)
            .collect();
        assert_eq!(lit.len(), 4, "two columns in each panel: {lit:?}");
        let symbols: String = lit.iter().map(|(x, y)| buffer[(*x, *y)].symbol()).collect();
        assert_eq!(symbols.trim(), "8");
    }

    #[test]
    fn broken_taxels_are_marked() {
        let text = text(&drawn(80, 24, &picture()));
        let panels: String = text.lines().take(18).skip(2).collect();
        assert_eq!(panels.matches('?').count(), 1, "{text}");
        assert_eq!(panels.matches('x').count(), 1, "{text}");
    }

    #[test]
    fn joints_are_bars_under_their_fingers_and_degrees_where_there_is_room() {
        let mut picture = picture();
        picture.joints[6].1 = None;
        for (width, height, degrees) in [(80, 24, false), (120, 40, true), (200, 60, true)] {
            let text = text(&drawn(width, height, &picture));
            assert_eq!(text.matches("▁▃▅█").count(), 3, "{width}x{height}:\n{text}");
            assert_eq!(text.matches("▁▃?█").count(), 1, "{width}x{height}:\n{text}");
            assert!(text.contains("bars: joints"), "{width}x{height}:\n{text}");
            let rows = text.matches("  0°  29°  57°  86°").count();
            assert_eq!(rows, if degrees { 3 } else { 0 }, "{width}x{height}:\n{text}");
            assert_eq!(
                text.contains("  0°  29°    ?  86°"),
                degrees,
                "{width}x{height}:\n{text}"
            );
        }
        picture.joints.clear();
        let text = text(&drawn(120, 40, &picture));
        assert!(
            !text.contains('°') && !text.contains('▁') && !text.contains("bars"),
            "{text}"
        );
    }

    #[test]
    fn what_the_user_must_know_replaces_the_scenes_sentence() {
        let calibrating = Picture {
            calibrating: true,
            ..picture()
        };
        assert!(text(&drawn(80, 24, &calibrating)).contains("hands off"));
        let paused = Picture {
            paused: true,
            ..picture()
        };
        assert!(text(&drawn(80, 24, &paused)).contains("let go"));
    }
}
