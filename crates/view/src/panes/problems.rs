//! What the daemon says is wrong.

use crate::colour::Palette;
use crate::picture::Picture;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Widget, Wrap};

pub(super) fn draw(buffer: &mut Buffer, area: Rect, picture: &Picture, palette: Palette) {
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let mut lines = vec![match picture.problems.len() {
        0 => Line::from(vec![Span::styled("problems", bold), Span::styled("  none", dim)]),
        count => Line::from(Span::styled(format!("problems: {count}"), bold)),
    }];
    lines.extend(picture.problems.iter().map(|problem| {
        let (mark, colour) = match problem.severe {
            true => ("error ", palette.rgb(255, 95, 95)),
            false => ("warning ", palette.rgb(255, 175, 0)),
        };
        Line::from(vec![
            Span::styled(mark, Style::new().fg(colour).add_modifier(Modifier::BOLD)),
            Span::raw(problem.sentence.clone()),
            Span::styled(format!("  ({:.0} s)", problem.since_s), dim),
        ])
    }));
    Paragraph::new(lines)
        .wrap(Wrap { trim: true })
        .render(area, buffer);
}
