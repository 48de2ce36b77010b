//! The joints: a bar each under its finger, and the degrees where there is room.

use crate::colour::Palette;
use crate::paint::text_width;
use crate::picture::{Joint, Picture};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Widget;
use std::f32::consts::FRAC_PI_2;

/// Bars from straight to bent by a right angle, either way.
const BARS: [&str; 8] = ["▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"];
/// Columns of one angle in degrees, with the blank before it.
const DEGREES_WIDTH: usize = 5;
/// Columns that the status lines may take at the left of the degrees.
const STATUS_WIDTH: u16 = 80;

fn bar(angle: f32) -> &'static str {
    let share = (angle.abs() / FRAC_PI_2).min(1.0);
    BARS[(share * (BARS.len() - 1) as f32).round() as usize]
}

/// The joints of a part of the hand: those whose names begin with its own.
fn of_part<'a>(joints: &'a [Joint], part: &str) -> Vec<&'a Joint> {
    let belongs = |joint: &&Joint| (joint.name.strip_prefix(part)).is_some_and(|rest| rest.starts_with(' '));
    joints.iter().filter(belongs).collect()
}

/// Draws the bars of a part's joints into `place`, one row, in its middle; nothing where they do not fit.
pub(crate) fn draw_bars(buffer: &mut Buffer, place: Rect, picture: &Picture, part: &str, palette: Palette) {
    let joints = of_part(&picture.joints, part);
    let width = joints.len() as u16;
    if width == 0 || width > place.width {
        return;
    }
    let known = Style::new().fg(palette.rgb(120, 170, 220));
    let bars = joints.iter().map(|joint| match joint.angle_rad {
        Some(angle) => Span::styled(bar(angle), known),
        None => Span::styled("?", unknown(palette)),
    });
    let place = Rect {
        x: place.x + (place.width - width) / 2,
        width,
        ..place
    };
    Line::from_iter(bars).render(place, buffer);
}

fn unknown(palette: Palette) -> Style {
    Style::new()
        .fg(palette.rgb(255, 175, 0))
        .add_modifier(Modifier::BOLD)
}

/// Draws the angles in degrees at the right of the status lines, a row for each part of the hand;
/// nothing where there is no room for all of them. Returns the columns at their left.
pub(crate) fn draw_degrees(
    buffer: &mut Buffer,
    status: Rect,
    picture: &Picture,
    parts: &[&str],
    palette: Palette,
) -> u16 {
    let rows: Vec<(&str, Vec<&Joint>)> = (parts.iter())
        .map(|part| (*part, of_part(&picture.joints, part)))
        .filter(|(_, joints)| !joints.is_empty())
        .collect();
    let name_width = rows.iter().map(|(name, _)| text_width(name)).max().unwrap_or(0);
    let most = rows.iter().map(|(_, joints)| joints.len()).max().unwrap_or(0);
    let columns = (name_width + DEGREES_WIDTH * most + 2) as u16;
    let fits = STATUS_WIDTH + columns <= status.width && rows.len() <= usize::from(status.height);
    if most == 0 || !fits {
        return status.width;
    }
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    for (row, (name, joints)) in (status.y..).zip(&rows) {
        let blanks = " ".repeat(name_width - text_width(name));
        let mut spans = vec![Span::styled(format!("{name}{blanks}"), dim)];
        spans.extend(joints.iter().map(|joint| match joint.angle_rad {
            // Adding zero turns -0 into 0.
            Some(angle) => Span::raw(format!(" {:>3}°", angle.to_degrees().round() + 0.0)),
            None => Span::styled("    ?", unknown(palette)),
        }));
        let place = Rect {
            x: status.right() - columns,
            y: row,
            width: columns,
            height: 1,
        };
        Line::from(spans).render(place, buffer);
    }
    status.width - columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_is_as_high_as_its_joint_is_bent() {
        for (degrees, glyph) in [
            (0.0, "▁"),
            (-3.0, "▁"),
            (45.0, "▅"),
            (-45.0, "▅"),
            (90.0, "█"),
            (500.0, "█"),
        ] {
            assert_eq!(bar(f32::to_radians(degrees)), glyph, "{degrees}");
        }
    }

    #[test]
    fn joints_belong_to_the_part_whose_name_they_begin_with() {
        let joint = |name: &str| Joint {
            name: name.into(),
            angle_rad: Some(0.0),
        };
        let joints = [joint("ring 0"), joint("ringer 0"), joint("ring 1"), joint("ring")];
        let names: Vec<&str> = of_part(&joints, "ring")
            .iter()
            .map(|joint| joint.name.as_str())
            .collect();
        assert_eq!(names, ["ring 0", "ring 1"]);
    }
}
