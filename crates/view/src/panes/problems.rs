//! What the daemon says is wrong, and which taxels are out of use.

use crate::colour::Palette;
use crate::out_of_use::out_of_use;
use crate::picture::Picture;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Widget, Wrap};

pub(super) fn draw(buffer: &mut Buffer, area: Rect, picture: &Picture, palette: Palette) {
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let none = |words| {
        Line::from(vec![
            Span::styled("problems", bold),
            Span::styled(format!("  {words}"), dim),
        ])
    };
    let mut lines = vec![match picture.problems() {
        Err(unlooked) => none(unlooked),
        Ok([]) => none("none"),
        Ok(problems) => Line::from(Span::styled(format!("problems: {}", problems.len()), bold)),
    }];
    lines.extend(picture.problems().unwrap_or_default().iter().map(|problem| {
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
    let unused = out_of_use(&picture.hand, &picture.taxels);
    lines.extend(
        unused
            .into_iter()
            .map(|sentence| Line::from(vec![Span::styled("out of use ", dim), Span::raw(sentence)])),
    );
    Paragraph::new(lines)
        .wrap(Wrap { trim: true })
        .render(area, buffer);
}
