//! Pictures: tactile images, frames as colours, and matrices of numbers.

use crate::colour::{self, Rgb};
use crate::error::PlotError;
use crate::pen::{Pen, Place, Side, text_width};

/// A picture of square cells, row by row from the top left.
#[derive(Debug, Clone)]
pub struct Picture {
    pub(crate) title: String,
    pub(crate) width: usize,
    pub(crate) cells: Vec<Cell>,
    caption: String,
    row_names: Vec<String>,
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

impl Picture {
    fn new(title: impl Into<String>, width: usize, cells: Vec<Cell>) -> Self {
        Self {
            title: title.into(),
            width,
            cells,
            caption: String::new(),
            row_names: Vec::new(),
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

    /// Names beside the rows.
    pub fn row_names<S: Into<String>>(mut self, names: impl IntoIterator<Item = S>) -> Self {
        self.row_names = names.into_iter().map(Into::into).collect();
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

    /// Draws into the panel between two corners.
    pub(crate) fn draw(&self, pen: &Pen<'_>, (x0, y0): Place, (x1, y1): Place) -> Result<(), PlotError> {
        let rows = self.cells.len() / self.width;
        let names_width = |names: &[String]| names.iter().map(|n| text_width(n, 11.0)).fold(0.0, f64::max);
        let left = if self.row_names.is_empty() {
            4.0
        } else {
            names_width(&self.row_names) + 12.0
        };
        let right = if self.span.is_some() { 62.0 } else { 4.0 };
        let top = if self.title.is_empty() { 4.0 } else { 22.0 };
        let names_fit = |cell: f64| names_width(&self.column_names) < cell - 2.0;
        let (width, height) = (x1 - x0 - left - right, y1 - y0 - top);
        let caption = if self.caption.is_empty() { 4.0 } else { 20.0 };
        let cell_for = |bottom: f64| {
            (width / self.width as f64)
                .min((height - bottom) / rows as f64)
                .max(0.25)
        };
        let flat = if self.column_names.is_empty() {
            caption
        } else {
            caption + 16.0
        };
        let (cell, upright) = if self.column_names.is_empty() || names_fit(cell_for(flat)) {
            (cell_for(flat), false)
        } else {
            (cell_for(caption + names_width(&self.column_names) + 8.0), true)
        };
        // Whole quarters of a pixel, so that cells meet without seams.
        let cell = (cell * 4.0).floor().max(1.0) / 4.0;
        let (w, h) = (cell * self.width as f64, cell * rows as f64);
        let (ox, oy) = (x0 + left + ((width - w) / 2.0).max(0.0), y0 + top);
        // A text around a place stays within the panel on both sides.
        let room = |middle: f64| 2.0 * (middle - x0).min(x1 - middle);
        if !self.title.is_empty() {
            let place = (ox + w / 2.0, y0 + 10.0);
            pen.fitted(&self.title, place, room(place.0), 12.0, colour::INK)?;
        }
        self.draw_cells(pen, (ox, oy), cell)?;
        pen.frame((ox, oy), (ox + w, oy + h), colour::PALE)?;
        for (row, name) in self.row_names.iter().take(rows).enumerate() {
            let y = oy + (row as f64 + 0.5) * cell;
            pen.text(name, (ox - 6.0, y), Side::Left, 11.0, colour::INK)?;
        }
        for (column, name) in self.column_names.iter().take(self.width).enumerate() {
            let x = ox + (column as f64 + 0.5) * cell;
            if upright {
                pen.text_upwards(name, (x, oy + h + 6.0), Side::Left, colour::INK)?;
            } else {
                pen.text(name, (x, oy + h + 9.0), Side::Middle, 11.0, colour::INK)?;
            }
        }
        if let Some(span) = self.span {
            draw_span(pen, (ox + w + 10.0, oy), h.max(40.0), span)?;
        }
        if !self.caption.is_empty() {
            let below = if upright {
                names_width(&self.column_names) + 8.0
            } else {
                flat - caption
            };
            let place = (ox + w / 2.0, oy + h + below + 10.0);
            pen.fitted(&self.caption, place, room(place.0), 11.0, colour::PALE)?;
        }
        Ok(())
    }

    /// Neighbours of one colour in a row are one rectangle; the most frequent colour lies beneath all.
    fn draw_cells(&self, pen: &Pen<'_>, (ox, oy): Place, cell: f64) -> Result<(), PlotError> {
        let place = |column: usize, row: usize| (ox + column as f64 * cell, oy + row as f64 * cell);
        let rows = self.cells.len() / self.width;
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
                if let Some(colour) = run[0].filter(|_| !(is_dark && run[0] == black)) {
                    pen.rect(place(column, row), place(end, row + 1), colour)?;
                }
                column = end;
            }
        }
        Ok(())
    }
}

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
            &crate::axis::tick_text(value),
            (x + 12.0, y),
            Side::Right,
            10.0,
            colour::PALE,
        )
    };
    text(high, y + 5.0)?;
    text(low, y + height - 5.0)
}
