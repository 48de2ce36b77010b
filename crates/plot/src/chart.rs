//! A chart: two axes and what is drawn between them.

use crate::axis::Axis;

/// A chart: lines with bands, points with ellipses, bars, boxes, on two axes.
///
/// Each series has a name, which is in the legend and chooses the colour; an empty name is drawn in the colour of the
/// text and is in no legend. A value that is not finite leaves a gap.
#[derive(Debug, Clone)]
pub struct Chart {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) layers: Vec<Layer>,
}

/// One series, as one kind of mark.
#[derive(Debug, Clone)]
pub(crate) struct Layer {
    pub(crate) name: String,
    pub(crate) marks: Marks,
}

#[derive(Debug, Clone)]
pub(crate) enum Marks {
    /// x and y.
    Line(Vec<(f64, f64)>),
    /// x and y, which holds until the next x.
    Steps(Vec<(f64, f64)>),
    /// x and y.
    Points(Vec<(f64, f64)>),
    /// x, low and high.
    Band(Vec<(f64, f64, f64)>),
    /// Of the points around which it lies.
    Ellipse(Vec<(f64, f64)>),
    /// Height, low and high, for each name of the axis.
    Bars(Vec<(f64, f64, f64)>),
    /// Samples, for each name of the axis.
    Boxes(Vec<Vec<f64>>),
    /// A place on the y axis.
    AtY(f64),
}

impl Chart {
    /// A chart without content.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        let (title, layers) = (title.into(), Vec::new());
        Self { title, x, y, layers }
    }

    fn with(mut self, name: impl Into<String>, marks: Marks) -> Self {
        let name = name.into();
        self.layers.push(Layer { name, marks });
        self
    }

    /// A line through points (x, y), in their order.
    pub fn line(self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.with(name, Marks::Line(points.into_iter().collect()))
    }

    /// A line through points (x, y), in their order, that holds each y until the next x.
    pub fn steps(self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.with(name, Marks::Steps(points.into_iter().collect()))
    }

    /// A band from low to high over (x, low, high); beneath the line of the same name if it comes first.
    pub fn band(self, name: impl Into<String>, band: impl IntoIterator<Item = (f64, f64, f64)>) -> Self {
        self.with(name, Marks::Band(band.into_iter().collect()))
    }

    /// Points (x, y) of one class, with a marker of its own.
    pub fn points(self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.with(name, Marks::Points(points.into_iter().collect()))
    }

    /// The two-sigma ellipse of points (x, y): mean and sample covariance. Nothing where there are fewer than three.
    pub fn ellipse(self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.with(name, Marks::Ellipse(points.into_iter().collect()))
    }

    /// A bar for each name of the x axis, in its order; bars of several series stand side by side.
    pub fn bars(self, name: impl Into<String>, heights: impl IntoIterator<Item = f64>) -> Self {
        self.bars_within(
            name,
            heights.into_iter().map(|height| (height, f64::NAN, f64::NAN)),
        )
    }

    /// Bars with whiskers: (height, low, high).
    pub fn bars_within(
        self,
        name: impl Into<String>,
        bars: impl IntoIterator<Item = (f64, f64, f64)>,
    ) -> Self {
        self.with(name, Marks::Bars(bars.into_iter().collect()))
    }

    /// A box plot for each name of the x axis: quartiles, whiskers to the last sample within one and a half times the
    /// distance of the quartiles, and the samples beyond.
    pub fn boxes(self, name: impl Into<String>, samples: impl IntoIterator<Item = Vec<f64>>) -> Self {
        self.with(name, Marks::Boxes(samples.into_iter().collect()))
    }

    /// A thin horizontal line with its name above it: a threshold.
    pub fn at_y(self, name: impl Into<String>, y: f64) -> Self {
        self.with(name, Marks::AtY(y))
    }

    /// The names in the legend, in their order.
    pub(crate) fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for layer in self.layers.iter().filter(|layer| !layer.marks.is_named_beside()) {
            if !layer.name.is_empty() && !names.contains(&layer.name.as_str()) {
                names.push(&layer.name);
            }
        }
        names
    }
}

impl Marks {
    fn is_named_beside(&self) -> bool {
        matches!(self, Self::AtY(_))
    }

    pub(crate) fn is_side_by_side(&self) -> bool {
        matches!(self, Self::Bars(_) | Self::Boxes(_))
    }

    pub(crate) fn xs(&self) -> Vec<f64> {
        match self {
            Self::Line(points) | Self::Steps(points) | Self::Points(points) => {
                points.iter().map(|p| p.0).collect()
            }
            Self::Ellipse(points) => crate::ellipse(points).iter().map(|p| p.0).collect(),
            Self::Band(band) => band.iter().map(|p| p.0).collect(),
            Self::Bars(_) | Self::Boxes(_) | Self::AtY(_) => Vec::new(),
        }
    }

    pub(crate) fn ys(&self) -> Vec<f64> {
        match self {
            Self::Line(points) | Self::Steps(points) | Self::Points(points) => {
                points.iter().map(|p| p.1).collect()
            }
            Self::Ellipse(points) => crate::ellipse(points).iter().map(|p| p.1).collect(),
            Self::Band(band) => band.iter().flat_map(|p| [p.1, p.2]).collect(),
            // A bar stands on zero.
            Self::Bars(bars) => bars.iter().flat_map(|b| [0.0, b.0, b.1, b.2]).collect(),
            Self::Boxes(boxes) => boxes.iter().flatten().copied().collect(),
            Self::AtY(y) => vec![*y],
        }
    }
}
