//! What every key does.

use crate::colour::Palette;
use crate::keys::KEYS;
use crate::paint::shortened;
use crate::screen::Screen;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph, Widget};

/// Columns of the keys' names.
const NAMES: usize = 8;

/// Lists the keys in as many rows as they take, or as there are, and says how many are left out.
pub(super) fn draw(buffer: &mut Buffer, most: Rect, screen: &Screen, palette: Palette) {
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let room = usize::from(most.width).saturating_sub(NAMES + 3);
    let row = |(key, what): &(&'static str, &'static str)| {
        Line::from(vec![
            Span::styled(format!(" {key:NAMES$}"), bold),
            Span::raw(shortened(what, room)),
        ])
    };
    let [daemon, recording, both] = KEYS;
    let own = if screen.recording { recording } else { daemon };
    let mut lines: Vec<Line<'_>> = both.iter().map(row).collect();
    lines.push(Line::default());
    lines.extend(own.iter().map(row));
    let wanted = lines.len() as u16 + 2;
    let area = Rect {
        height: wanted.min(most.height),
        ..most
    };
    let dim = Style::new().fg(palette.rgb(138, 138, 138));
    let mut block = Block::bordered()
        .border_style(dim)
        .title(Span::styled(" keys; any of them goes back ", bold));
    if let missing @ 1.. = wanted - area.height {
        let rows = most.y + wanted;
        let text = format!(" {missing} more on a terminal of {rows} rows ");
        block = block.title_bottom(Span::styled(text, bold));
    }
    Clear.render(area, buffer);
    Paragraph::new(lines).block(block).render(area, buffer);
}
