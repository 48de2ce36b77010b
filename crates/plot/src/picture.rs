//! Pictures: tactile images, frames as colours, and matrices of numbers.

use crate::colour::{self, Rgb};
use crate::error::PlotError;
use crate::pen::{Pen, Place, Side, text_width};

/// A cell is no smaller where there is room on the sheet, pixels.
const LEAST_CELL: f64 = 3.0;
/// Cells of a strip are stretched until it is so thick, pixels.
const LEAST_STRIP: f64 = 20.0;
/// Left of the cells, pixels.
const LEFT: f64 = 4.0;

/// A picture of square cells, row by row from the top left; those of a strip of few rows or columns are stretched across
/// it. A cell without a colour is sand-coloured and hatched.
#[derive(Debug, Clone)]
pub struct Picture {
    pub(crate) title: String,
    pub(crate) width: usize,
    pub(crate) cells: Vec<Cell>,
    caption: String,
    column_names: Vec<String>,
    /// What dark blue and yellow mean, where cells are numbers.
    span: Option<(f64, f64)>,
    /// What the cells stand for, by name.
    pub(crate) numbers: Vec<(String, Vec<Option<f64>>)>,
}

#[derive(Debug, Clone, Copy)]
pub(crate) enum Cell {
    None,
    Grey(u8),
    Rgb(Rgb),
    Number(f64),
}

/// Where the parts of a picture are in its panel, pixels.
struct Parts {
    /// Above the cells, for the title.
    top: f64,
    /// Width and height of a cell.
    cell: (f64, f64),
    /// Of all cells.
    size: (f64, f64),
    /// Whether the names of columns read upwards.
    upright: bool,
    /// How much of the panel's width the cells may take.
    width: f64,
    /// From the top of the cells to the middle of the caption.
    caption: f64,
    /// Of the whole.
    height: f64,
}

impl Picture {
    fn new(title: impl Into<String>, width: usize, cells: Vec<Cell>) -> Self {
        Self {
            title: title.into(),
            width,
            cells,
            caption: String::new(),
            column_names: Vec::new(),
            span: None,
            numbers: Vec::new(),
        }
    }

    /// A grey image such as a tactile image: 0 is black, 255 white; `width` pixels a row.
    pub fn grey(title: impl Into<String>, width: usize, pixels: impl IntoIterator<Item = u8>) -> Self {
        Self::new(title, width, pixels.into_iter().map(Cell::Grey).collect())
    }

    /// A colour image: red, green and blue of each pixel, none where there is no taxel.
    pub fn rgb(
        title: impl Into<String>,
        width: usize,
        pixels: impl IntoIterator<Item = Option<[u8; 3]>>,
    ) -> Self {
        let cells = pixels
            .into_iter()
            .map(|pixel| pixel.map_or(Cell::None, Cell::Rgb));
        Self::new(title, width, cells.collect())
    }

    /// Numbers as colours, from dark blue for the smallest to yellow for the largest; what is not finite has no cell.
    pub fn heat(title: impl Into<String>, width: usize, values: impl IntoIterator<Item = f64>) -> Self {
        let values: Vec<f64> = values.into_iter().collect();
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let span = (
            finite().fold(f64::INFINITY, f64::min),
            finite().fold(f64::NEG_INFINITY, f64::max),
        );
        let cells = values.iter().copied().map(Cell::Number).collect();
        Self {
            span: (span.0 <= span.1).then_some(span),
            ..Self::new(title, width, cells)
        }
    }

    /// What dark blue and yellow mean, in place of the smallest and the largest number.
    pub fn span(mut self, low: f64, high: f64) -> Self {
        self.span = Some((low, high));
        self
    }

    /// Another title.
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// What the cells stand for, one by one, none where there is nothing: the sheet's CSV has these numbers under the name
    /// `series` in place of the colours. May be said more than once, under names of their own.
    pub fn numbers(
        mut self,
        series: impl Into<String>,
        values: impl IntoIterator<Item = Option<f64>>,
    ) -> Self {
        let values = values.into_iter().collect();
        self.numbers.push((series.into(), values));
        self
    }

    /// A line beneath it.
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Names beneath the columns.
    pub fn column_names<S: Into<String>>(mut self, names: impl IntoIterator<Item = S>) -> Self {
        self.column_names = names.into_iter().map(Into::into).collect();
        self
    }

    pub(crate) fn check(&self) -> Result<(), PlotError> {
        let (width, cells) = (self.width, self.cells.len());
        if width == 0 || cells == 0 || cells % width != 0 {
            let title = self.title.clone();
            return Err(PlotError::NoRectangle { title, cells, width });
        }
        Ok(())
    }

    fn colour_of(&self, cell: Cell) -> Option<Rgb> {
        let colour = match cell {
            Cell::None => return None,
            Cell::Grey(grey) => [grey; 3],
            Cell::Rgb(rgb) => rgb,
            Cell::Number(value) => {
                let (low, high) = self.span.filter(|_| value.is_finite())?;
                let share = if high > low {
                    (value - low) / (high - low)
                } else {
                    1.0
                };
                colour::of_heat(share.clamp(0.0, 1.0))
            }
        };
        Some(colour::of_picture(colour))
    }

    fn rows(&self) -> usize {
        self.cells.len() / self.width
    }

    /// What is right of the cells.
    fn right(&self) -> f64 {
        if self.span.is_some() { 62.0 } else { LEFT }
    }

    /// What is above the cells, and beneath them where names of columns do not read upwards.
    fn above_and_beneath(&self) -> (f64, f64) {
        let top = if self.title.is_empty() { 4.0 } else { 22.0 };
        let caption = if self.caption.is_empty() { 4.0 } else { 20.0 };
        let names = if self.column_names.is_empty() { 0.0 } else { 16.0 };
        (top, caption + names)
    }

    /// The panel that has room for it: this one, or a larger one where cells would be hard to see, but no wider or higher
    /// than `most`.
    pub(crate) fn panel(&self, (width, height): (f64, f64), most: f64) -> (f64, f64) {
        let (right, (top, beneath)) = (self.right(), self.above_and_beneath());
        let enlarged = |side: f64, least: f64| side.max(least.min(most));
        (
            enlarged(width, LEFT + right + LEAST_CELL * self.width as f64),
            enlarged(height, top + beneath + LEAST_CELL * self.rows() as f64),
        )
    }

    /// How much of a panel's height it takes.
    pub(crate) fn height(&self, panel: (f64, f64)) -> f64 {
        self.parts(panel).height
    }

    fn parts(&self, (panel_width, panel_height): (f64, f64)) -> Parts {
        let (right, (top, flat)) = (self.right(), self.above_and_beneath());
        let (columns, rows) = (self.width as f64, self.rows() as f64);
        let (width, height) = (panel_width - LEFT - right, panel_height - top);
        let names = names_width(&self.column_names);
        let cell_for = |beneath: f64| (width / columns).min((height - beneath) / rows).max(0.25);
        let upright = !self.column_names.is_empty() && names >= cell_for(flat) - 2.0;
        let beneath = if upright { flat - 16.0 + names + 8.0 } else { flat };
        // Whole quarters of a pixel, so that cells meet without seams.
        let whole = |cell: f64| (cell * 4.0).floor().max(1.0) / 4.0;
        let cell = whole(cell_for(beneath));
        let cell = [columns, rows].map(|cells| cell.max((4.0 * LEAST_STRIP / cells).ceil() / 4.0));
        let size = (cell[0] * columns, cell[1] * rows);
        // The bar of colours has a height of its own.
        let body = if self.span.is_some() {
            size.1.max(LEAST_SPAN)
        } else {
            size.1
        };
        let caption = if self.caption.is_empty() { 4.0 } else { 20.0 };
        Parts {
            top,
            cell: (cell[0], cell[1]),
            size,
            upright,
            width,
            caption: body + beneath - caption + 10.0,
            height: top + body + beneath,
        }
    }

    /// Draws into the panel between two corners.
    pub(crate) fn draw(&self, pen: &Pen<'_>, (x0, y0): Place, (x1, y1): Place) -> Result<(), PlotError> {
        let parts = self.parts((x1 - x0, y1 - y0));
        let (cell, (w, h), upright) = (parts.cell, parts.size, parts.upright);
        let ox = x0 + LEFT + ((parts.width - w) / 2.0).max(0.0);
        let oy = y0 + parts.top;
        // A text around a place stays within the panel on both sides.
        let room = |middle: f64| 2.0 * (middle - x0).min(x1 - middle);
        if !self.title.is_empty() {
            let place = (ox + w / 2.0, y0 + 10.0);
            pen.fitted(&self.title, place, room(place.0), 12.0, colour::INK)?;
        }
        self.draw_cells(pen, (ox, oy), cell)?;
        pen.frame((ox, oy), (ox + w, oy + h), colour::PALE)?;
        for (column, name) in self.column_names.iter().take(self.width).enumerate() {
            let x = ox + (column as f64 + 0.5) * cell.0;
            if upright {
                pen.text_upwards(name, (x, oy + h + 6.0), Side::Left, colour::INK)?;
            } else {
                pen.text(name, (x, oy + h + 9.0), Side::Middle, 11.0, colour::INK)?;
            }
        }
        if let Some(span) = self.span {
            draw_span(pen, (ox + w + 10.0, oy), h.max(LEAST_SPAN), span)?;
        }
        if !self.caption.is_empty() {
            let place = (ox + w / 2.0, oy + parts.caption);
            pen.fitted(&self.caption, place, room(place.0), 11.0, colour::PALE)?;
        }
        Ok(())
    }

    /// Neighbours of one colour in a row are one rectangle; the most frequent colour lies beneath all.
    fn draw_cells(&self, pen: &Pen<'_>, (ox, oy): Place, cell: (f64, f64)) -> Result<(), PlotError> {
        let place = |column: usize, row: usize| (ox + column as f64 * cell.0, oy + row as f64 * cell.1);
        let rows = self.rows();
        let black = Some([0; 3]);
        let is_dark = self.cells.iter().all(|cell| matches!(cell, Cell::Grey(_)));
        if is_dark {
            pen.rect(place(0, 0), place(self.width, rows), [0; 3])?;
        }
        for (row, cells) in self.cells.chunks(self.width).enumerate() {
            let colours: Vec<_> = cells.iter().map(|cell| self.colour_of(*cell)).collect();
            let mut column = 0;
            for run in colours.chunk_by(|a, b| a == b) {
                let end = column + run.len();
                if !(is_dark && run[0] == black) {
                    let colour = run[0].unwrap_or(colour::EMPTY);
                    pen.rect(place(column, row), place(end, row + 1), colour)?;
                }
                column = end;
            }
        }
        self.hatch(pen, place)
    }

    /// A line through each cell that has no colour, from the bottom left; one line where it goes on in the next.
    fn hatch(&self, pen: &Pen<'_>, place: impl Fn(usize, usize) -> Place) -> Result<(), PlotError> {
        let is_empty = |column: usize, row: usize| {
            column < self.width && matches!(self.cells.get(row * self.width + column), Some(Cell::None))
        };
        for n in 0..self.cells.len() {
            let (column, row) = (n % self.width, n / self.width);
            if !is_empty(column, row) || (column > 0 && is_empty(column - 1, row + 1)) {
                continue;
            }
            let more = (1..=row).take_while(|n| is_empty(column + n, row - n)).count();
            let (from, to) = (place(column, row + 1), place(column + more + 1, row - more));
            pen.line(&[from, to], colour::PALE, 1.0)?;
        }
        Ok(())
    }
}

fn names_width(names: &[String]) -> f64 {
    names
        .iter()
        .map(|name| text_width(name, 11.0))
        .fold(0.0, f64::max)
}

/// The bar of colours is no lower, pixels: the numbers of its ends stand apart.
const LEAST_SPAN: f64 = 40.0;

/// The bar of colours and what its ends mean.
fn draw_span(pen: &Pen<'_>, (x, y): Place, height: f64, (low, high): (f64, f64)) -> Result<(), PlotError> {
    const STEPS: usize = 32;
    for step in 0..STEPS {
        let (top, bottom) = (step as f64 / STEPS as f64, (step + 1) as f64 / STEPS as f64);
        let colour = colour::of_picture(colour::of_heat(1.0 - top));
        pen.rect((x, y + top * height), (x + 8.0, y + bottom * height), colour)?;
    }
    let text = |value: f64, y: f64| {
        pen.text(
            &crate::axis::tick_text(rounded(value)),
            (x + 12.0, y),
            Side::Right,
            10.0,
            colour::PALE,
        )
    };
    text(high, y + 5.0)?;
    text(low, y + height - 5.0)
}

/// To four digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_a_bar_of_colours_are_told_in_four_digits() {
        for (value, wanted) in [
            (8133.877, 8134.0),
            (0.0, 0.0),
            (-0.123456, -0.1235),
            (1e300, 1e300),
            (12.0, 12.0),
        ] {
            assert_eq!(rounded(value), wanted);
        }
    }
}
