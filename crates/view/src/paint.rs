//! Half blocks and letters on the terminal.

use crate::colour::Palette;
use crate::raster::Raster;
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::Span;

/// How a taxel is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ink {
    /// Share of the scale; what is strongest is seen where taxels share a place.
    pub(crate) share: f64,
    pub(crate) colour: Color,
    /// A letter on it where there is room, and its colour.
    pub(crate) letter: Option<(char, Color)>,
}

/// Draws every taxel of a hand, with `origin` as the upper left corner.
pub(crate) fn paint(
    buffer: &mut Buffer,
    origin: Position,
    raster: &Raster,
    palette: Palette,
    ink: &dyn Fn(usize) -> Ink,
) {
    let blocks = usize::from(raster.width) * usize::from(raster.height);
    let mut seen: Vec<Option<Ink>> = vec![None; blocks];
    let place = |x: u16, y: u16| usize::from(y) * usize::from(raster.width) + usize::from(x);
    let taxels = raster.taxels();
    let inks: Vec<Ink> = (0..taxels).map(ink).collect();
    for y in 0..raster.height {
        for x in 0..raster.width {
            seen[place(x, y)] = raster.taxel_at(x, y).map(|taxel| inks[taxel]);
        }
    }
    if raster.is_crowded() {
        for (taxel, ink) in inks.iter().enumerate() {
            let (x, y) = raster.middle(taxel);
            let block = &mut seen[place(x, y)];
            if block.is_none_or(|other| ink.share > other.share) {
                *block = Some(*ink);
            }
        }
    }
    for row in 0..raster.rows() {
        for x in 0..raster.width {
            let half = |y: u16| {
                if y < raster.height {
                    seen[place(x, y)]
                } else {
                    None
                }
            };
            let cell = &mut buffer[(origin.x + x, origin.y + row)];
            match (half(2 * row), half(2 * row + 1)) {
                (None, None) => {}
                (top, bottom) if palette == Palette::Shades => {
                    let share = |ink: Option<Ink>| ink.map_or(f64::NEG_INFINITY, |ink| ink.share);
                    cell.set_symbol(Palette::shade(share(top).max(share(bottom))));
                }
                (Some(top), Some(bottom)) if top.colour == bottom.colour => {
                    cell.set_symbol(" ").set_bg(top.colour);
                }
                (Some(top), Some(bottom)) => {
                    cell.set_symbol("▀").set_fg(top.colour).set_bg(bottom.colour);
                }
                (Some(top), None) => {
                    cell.set_symbol("▀").set_fg(top.colour);
                }
                (None, Some(bottom)) => {
                    cell.set_symbol("▄").set_fg(bottom.colour);
                }
            }
        }
    }
    for (taxel, ink) in inks.iter().enumerate() {
        let Some((letter, colour)) = ink.letter else {
            continue;
        };
        let at = match (raster.letter(taxel, origin), palette) {
            (Some(at), _) => at,
            (None, Palette::Shades) => {
                let (x, y) = raster.middle(taxel);
                Position::new(origin.x + x, origin.y + y / 2)
            }
            (None, _) => continue,
        };
        let mut style = Style::new().fg(colour).add_modifier(Modifier::BOLD);
        if palette != Palette::Shades {
            style = style.bg(ink.colour);
        }
        buffer[at].set_char(letter).set_style(style);
    }
}

/// Writes a line that ends where the place does.
pub(crate) fn text(buffer: &mut Buffer, place: Rect, text: &str, style: Style) {
    if place.height > 0 {
        buffer.set_stringn(place.x, place.y, text, usize::from(place.width), style);
    }
}

/// Columns that a text takes: two for the letters of Chinese, Japanese and Korean.
pub(crate) fn text_width(text: &str) -> usize {
    Span::raw(text).width()
}

/// As much of a sentence as so many columns have room for, with dots where it goes on.
pub fn shortened(text: &str, most: usize) -> String {
    if text_width(text) <= most {
        return text.into();
    }
    let mut start = text.to_owned();
    while text_width(&start) >= most.max(1) {
        start.pop();
    }
    start.trim_end().to_owned() + "…"
}
