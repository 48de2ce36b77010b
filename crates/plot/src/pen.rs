//! The pen: marks on paper, in pixels. The only file that draws with plotters.

use crate::colour::{self, Rgb};
use crate::error::PlotError;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{Circle, Drawable, PathElement, PointCollection, Polygon, Rectangle, Text};
use plotters::prelude::SVGBackend;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontTransform, IntoFont, RGBAColor, RGBColor, ShapeStyle};

/// A place on the paper, pixels from the top left.
pub(crate) type Place = (f64, f64);

/// Plotters draws on whole pixels: a figure is drawn this much larger than it is shown.
const FINE: f64 = 4.0;

/// Where a text is, seen from its place.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Side {
    Left,
    Right,
    Middle,
}

/// Draws on one sheet of paper.
pub(crate) struct Pen<'a> {
    area: DrawingArea<SVGBackend<'a>, Shift>,
}

fn fine((x, y): Place) -> (i32, i32) {
    ((x * FINE).round() as i32, (y * FINE).round() as i32)
}

fn rgba([red, green, blue]: Rgb, opacity: f64) -> RGBAColor {
    RGBColor(red, green, blue).mix(opacity)
}

fn stroke(colour: Rgb, width: f64) -> ShapeStyle {
    rgba(colour, 1.0).stroke_width((width * FINE).round() as u32)
}

/// Draws with a pen on `width` by `height` pixels; gives the SVG.
pub(crate) fn draw(
    width: f64,
    height: f64,
    paint: impl FnOnce(&Pen<'_>) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    let mut svg = String::new();
    let (fine_width, fine_height) = fine((width, height));
    {
        let area = SVGBackend::with_string(&mut svg, (fine_width as u32, fine_height as u32));
        let pen = Pen {
            area: area.into_drawing_area(),
        };
        pen.rect((0.0, 0.0), (width, height), colour::PAPER)?;
        paint(&pen)?;
        pen.area
            .present()
            .map_err(|e| PlotError::Drawing(e.to_string()))?;
    }
    let size = format!("width=\"{fine_width}\" height=\"{fine_height}\"");
    let shown = format!("width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"sans-serif\"");
    let svg = svg.replacen(&size, &shown, 1);
    // What holds without being said.
    let svg = svg.replace(" opacity=\"1\"", "").replace(" stroke=\"none\"", "");
    let svg = svg
        .replace(" font-family=\"sans-serif\" font-size", " font-size")
        .replace(" \"/>", "\"/>");
    let end = svg.find('>').map_or(0, |end| end + 2);
    Ok(format!("{}{}{}", &svg[..end], colour::style_sheet(), &svg[end..]))
}

/// About how wide a text is, pixels. From the first letters of Korean on, letters are mostly as wide as they are high.
pub(crate) fn text_width(text: &str, size: f64) -> f64 {
    let width = |letter: char| if letter < '\u{1100}' { 0.56 } else { 1.0 };
    size * text.chars().map(width).sum::<f64>()
}

/// The size at which a text is no wider than `width`, as far as it stays legible; and the text, shorter where even
/// that is too wide. Pixels.
pub(crate) fn fit(text: &str, width: f64, size: f64) -> (String, f64) {
    const LEAST: f64 = 8.0;
    let size = (size * width / text_width(text, size).max(width)).max(LEAST.min(size));
    if text_width(text, size) <= width + 1e-9 {
        return (text.to_owned(), size);
    }
    let mut shorter = text.to_owned();
    while shorter.pop().is_some() && text_width(&shorter, size) + text_width("x", size) > width {}
    shorter.push('…');
    (shorter, size)
}

impl<'a> Pen<'a> {
    fn put<E>(&self, element: &E) -> Result<(), PlotError>
    where
        for<'b> &'b E: PointCollection<'b, (i32, i32)>,
        E: Drawable<SVGBackend<'a>>,
    {
        self.area
            .draw(element)
            .map_err(|e| PlotError::Drawing(e.to_string()))
    }

    /// A line through places.
    pub(crate) fn line(&self, places: &[Place], colour: Rgb, width: f64) -> Result<(), PlotError> {
        let places: Vec<_> = places.iter().copied().map(fine).collect();
        self.put(&PathElement::new(places, stroke(colour, width)))
    }

    /// A filled shape.
    pub(crate) fn shape(&self, corners: &[Place], colour: Rgb, opacity: f64) -> Result<(), PlotError> {
        let corners: Vec<_> = corners.iter().copied().map(fine).collect();
        self.put(&Polygon::new(corners, rgba(colour, opacity).filled()))
    }

    /// A filled rectangle between two corners.
    pub(crate) fn rect(&self, from: Place, to: Place, colour: Rgb) -> Result<(), PlotError> {
        self.put(&Rectangle::new(
            [fine(from), fine(to)],
            rgba(colour, 1.0).filled(),
        ))
    }

    /// The outline of a rectangle between two corners.
    pub(crate) fn frame(&self, (x0, y0): Place, (x1, y1): Place, colour: Rgb) -> Result<(), PlotError> {
        self.line(&[(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], colour, 1.0)
    }

    /// The marker of a class.
    pub(crate) fn marker(&self, (x, y): Place, class: Option<usize>) -> Result<(), PlotError> {
        const R: f64 = 3.0;
        let colour = colour::of_series(class);
        let shape = |corners: &[Place]| {
            let corners: Vec<_> = corners.iter().map(|(a, b)| (x + R * a, y + R * b)).collect();
            self.shape(&corners, colour, 0.85)
        };
        match class.unwrap_or(0) % 5 {
            0 => self.put(&Circle::new(
                fine((x, y)),
                (R * FINE) as i32,
                rgba(colour, 0.85).filled(),
            )),
            1 => shape(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
            2 => shape(&[(0.0, -1.2), (1.1, 0.9), (-1.1, 0.9)]),
            3 => shape(&[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)]),
            _ => shape(&[(0.0, 1.2), (1.1, -0.9), (-1.1, -0.9)]),
        }
    }

    /// A text on its middle line; `size` in pixels.
    pub(crate) fn text(
        &self,
        text: &str,
        place: Place,
        side: Side,
        size: f64,
        colour: Rgb,
    ) -> Result<(), PlotError> {
        self.write(text, place, side, size, colour, FontTransform::None)
    }

    /// A text around its middle, smaller than `size` where it would be wider than `width`.
    pub(crate) fn fitted(
        &self,
        text: &str,
        place: Place,
        width: f64,
        size: f64,
        colour: Rgb,
    ) -> Result<(), PlotError> {
        let (text, size) = fit(text, width, size);
        self.text(&text, place, Side::Middle, size, colour)
    }

    /// A text that reads upwards.
    pub(crate) fn text_upwards(
        &self,
        text: &str,
        place: Place,
        side: Side,
        colour: Rgb,
    ) -> Result<(), PlotError> {
        self.write(text, place, side, 11.0, colour, FontTransform::Rotate270)
    }

    /// A text that reads upwards, around its middle, smaller where it would be longer than `length`.
    pub(crate) fn fitted_upwards(
        &self,
        text: &str,
        place: Place,
        length: f64,
        colour: Rgb,
    ) -> Result<(), PlotError> {
        let (text, size) = fit(text, length, 11.0);
        self.write(&text, place, Side::Middle, size, colour, FontTransform::Rotate270)
    }

    fn write(
        &self,
        text: &str,
        place: Place,
        side: Side,
        size: f64,
        colour: Rgb,
        turn: FontTransform,
    ) -> Result<(), PlotError> {
        let side = match side {
            Side::Left => HPos::Right,
            Side::Right => HPos::Left,
            Side::Middle => HPos::Center,
        };
        // Plotters gives a font's size with its line's height.
        let font = ("sans-serif", size * FINE * 1.24).into_font().transform(turn);
        let style = font.color(&rgba(colour, 1.0)).pos(Pos::new(side, VPos::Center));
        self.put(&Text::new(text.to_owned(), fine(place), style))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_becomes_smaller_before_it_becomes_shorter() {
        assert_eq!(fit("tightest", 250.0, 12.0), ("tightest".into(), 12.0));
        let long = "optimal: middle proximal disengages (13.72 s)";
        for width in 220..290 {
            let width = f64::from(width);
            let (text, size) = fit(long, width, 12.0);
            assert!(text == long && (8.0..12.0).contains(&size), "{text} at {size}");
            assert!(text_width(&text, size) <= width + 1e-9);
        }
        let (text, size) = fit(&long.repeat(3), 250.0, 12.0);
        assert!(
            text.starts_with("optimal: middle") && text.ends_with('…') && size == 8.0,
            "{text}"
        );
        assert!(text_width(&text, size) <= 250.0);
        assert_eq!(fit("", 250.0, 12.0), (String::new(), 12.0));
    }
}
