//! What every key does.

use crate::colour::Palette;
use crate::keys::KEYS;
use crate::screen::Screen;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph, Widget};

/// Columns of the keys' names.
const NAMES: usize = 8;

pub(super) fn draw(buffer: &mut Buffer, area: Rect, screen: &Screen, palette: Palette) {
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let row = |(key, what): &(&'static str, &'static str)| {
        Line::from(vec![
            Span::styled(format!(" {key:NAMES$}"), bold),
            Span::raw(*what),
        ])
    };
    let [daemon, recording, both] = KEYS;
    let own = if screen.recording { recording } else { daemon };
    let mut lines: Vec<Line<'_>> = both.iter().map(row).collect();
    lines.push(Line::default());
    lines.extend(own.iter().map(row));
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let block = Block::bordered()
        .border_style(dim)
        .title(Span::styled(" keys; any of them goes back ", bold));
    Paragraph::new(lines).block(block).render(area, buffer);
}
