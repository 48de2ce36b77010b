//! A drawn screen as SVG.

use crate::paint::text_width;
use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};
use std::fmt::Write;

/// Width and height of a character, units of the picture.
const CELL: (usize, usize) = (8, 16);
/// Where letters stand in their character.
const BASE: usize = 12;
const GROUND: &str = "#101014";
const INK: &str = "#d8d8d8";

/// What was drawn into a buffer with [`Palette::True`](crate::Palette::True), on a dark ground.
pub fn svg(buffer: &Buffer) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_svg(buffer, &mut text);
    text
}

fn write_svg(buffer: &Buffer, out: &mut String) -> std::fmt::Result {
    let (columns, rows) = (usize::from(buffer.area.width), usize::from(buffer.area.height));
    let (width, height) = (columns * CELL.0, rows * CELL.1);
    // Blanks are kept as they are: what browsers go by is the style, others by the attribute.
    writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         font-family=\"monospace\" font-size=\"13\" xml:space=\"preserve\">\n\
         <style>text{{white-space:pre}}</style>\n<rect width=\"{width}\" height=\"{height}\" fill=\"{GROUND}\"/>"
    )?;
    for (row, cells) in buffer.content().chunks(columns).enumerate() {
        let mut column = 0;
        while column < columns {
            let cell = &cells[column];
            // The character behind a wide letter is a part of it.
            let mut end = column;
            while end < columns && is_alike(cell, &cells[end]) {
                end += text_width(cells[end].symbol()).max(1);
            }
            let alike = end.min(columns) - column;
            write_run(out, (column, row), &cells[column..column + alike])?;
            column += alike;
        }
    }
    writeln!(out, "</svg>")
}

/// Whether two characters go into one run: both of the same block, or both letters or blanks of the same colour.
fn is_alike(a: &Cell, b: &Cell) -> bool {
    let is_block = |cell: &Cell| matches!(cell.symbol(), "▀" | "▄");
    let style = |cell: &Cell| (cell.fg, cell.bg, cell.modifier);
    style(a) == style(b) && (a.symbol() == b.symbol() || (!is_block(a) && !is_block(b)))
}

fn write_run(out: &mut String, (column, row): (usize, usize), cells: &[Cell]) -> std::fmt::Result {
    let (x, y) = (column * CELL.0, row * CELL.1);
    let (width, half) = (cells.len() * CELL.0, CELL.1 / 2);
    let cell = &cells[0];
    if let Some(ground) = colour(cell.bg) {
        writeln!(
            out,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{}\" fill=\"{ground}\"/>",
            CELL.1
        )?;
    }
    let ink = colour(cell.fg).unwrap_or(INK.into());
    match cell.symbol() {
        _ if cells.iter().all(|cell| cell.symbol() == " ") => Ok(()),
        "▀" => writeln!(
            out,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{half}\" fill=\"{ink}\"/>"
        ),
        "▄" => {
            let y = y + half;
            writeln!(
                out,
                "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{half}\" fill=\"{ink}\"/>"
            )
        }
        _ => {
            let bold = if cell.modifier.contains(Modifier::BOLD) {
                " font-weight=\"bold\""
            } else {
                ""
            };
            let mut from = 0;
            let letters = cells.iter().enumerate().filter(|(n, cell)| {
                let is_letter = *n >= from;
                if is_letter {
                    from = n + text_width(cell.symbol()).max(1);
                }
                is_letter
            });
            let words: String = letters.map(|(_, cell)| cell.symbol()).collect();
            let words = words.replace('&', "&amp;").replace('<', "&lt;");
            writeln!(
                out,
                "<text x=\"{x}\" y=\"{}\" textLength=\"{width}\" fill=\"{ink}\"{bold}>{words}</text>",
                y + BASE
            )
        }
    }
}

fn colour(colour: Color) -> Option<String> {
    match colour {
        Color::Rgb(r, g, b) => Some(format!("#{r:02x}{g:02x}{b:02x}")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::layout::Rect;
    use ratatui::style::Style;

    #[test]
    fn blocks_are_rectangles_and_letters_are_text() {
        let mut buffer = Buffer::empty(Rect::new(0, 0, 10, 2));
        let red = Style::new().fg(Color::Rgb(255, 0, 0));
        buffer.set_string(0, 0, "▀▀ a<b", red);
        buffer.set_string(2, 1, " ", Style::new().bg(Color::Rgb(0, 0, 255)));
        let svg = svg(&buffer);
        for part in [
            "viewBox=\"0 0 80 32\"",
            "xml:space=\"preserve\">\n<style>text{white-space:pre}</style>\n",
            "<rect x=\"0\" y=\"0\" width=\"16\" height=\"8\" fill=\"#ff0000\"/>",
            "<text x=\"16\" y=\"12\" textLength=\"32\" fill=\"#ff0000\"> a&lt;b</text>",
            "<rect x=\"16\" y=\"16\" width=\"8\" height=\"16\" fill=\"#0000ff\"/>",
        ] {
            assert!(svg.contains(part), "{part}\n{svg}");
        }
        assert_eq!(svg.matches("<text").count(), 1, "{svg}");
    }

    #[test]
    fn wide_letters_are_text_without_the_blanks_behind_them() {
        let mut buffer = Buffer::empty(Rect::new(0, 0, 6, 1));
        buffer.set_string(0, 0, "親指 a", Style::new().fg(Color::Rgb(255, 0, 0)));
        let svg = svg(&buffer);
        assert!(
            svg.contains("textLength=\"48\" fill=\"#ff0000\">親指 a</text>"),
            "{svg}"
        );
    }
}
