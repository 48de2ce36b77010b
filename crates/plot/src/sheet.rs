//! A sheet: panels in rows beneath a title.

use crate::chart::Chart;
use crate::chart_drawing;
use crate::colour;
use crate::error::PlotError;
use crate::numbers;
use crate::panel::Panel;
use crate::pen;
use crate::picture::Picture;

/// Panels in rows beneath a title: one figure.
#[derive(Debug, Clone)]
pub struct Sheet {
    title: String,
    columns: usize,
    panel: (f64, f64),
    pub(crate) panels: Vec<Panel>,
}

/// Around and between panels, pixels.
const GAP: f64 = 12.0;
/// Panels that have to be larger than was asked for make a sheet no wider, pixels.
const WIDEST: f64 = 1300.0;

impl Sheet {
    /// A sheet without panels, one in a row, 640 by 360 pixels each.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            columns: 1,
            panel: (640.0, 360.0),
            panels: Vec::new(),
        }
    }

    /// How many panels are in a row.
    pub fn columns(mut self, columns: usize) -> Self {
        self.columns = columns.max(1);
        self
    }

    /// The size of each panel, pixels. All become larger where the cells of a picture would be hard to see, then with
    /// fewer in a row; a row of pictures is no higher than they are.
    pub fn panel_size(mut self, width: u32, height: u32) -> Self {
        self.panel = (f64::from(width.max(120)), f64::from(height.max(80)));
        self
    }

    /// Adds a chart.
    pub fn chart(mut self, chart: Chart) -> Self {
        self.panels.push(Panel::Chart(chart));
        self
    }

    /// Adds a picture.
    pub fn picture(mut self, picture: Picture) -> Self {
        self.panels.push(Panel::Picture(picture));
        self
    }

    /// The figure as SVG.
    pub fn svg(&self) -> Result<String, PlotError> {
        if self.panels.is_empty() {
            let title = self.title.clone();
            return Err(PlotError::Empty { title });
        }
        for panel in &self.panels {
            if let Panel::Picture(picture) = panel {
                picture.check()?;
            }
        }
        let panel = self.panels.iter().fold(self.panel, |room, panel| match panel {
            Panel::Picture(picture) => picture.panel(room, WIDEST - 2.0 * GAP),
            Panel::Chart(_) => room,
        });
        let columns = self.columns_of(panel.0);
        let rows: Vec<_> = self.panels.chunks(columns).collect();
        let height_of = |row: &&[Panel]| {
            let heights = row.iter().map(|of| match of {
                Panel::Picture(picture) => picture.height(panel),
                Panel::Chart(_) => panel.1,
            });
            heights.fold(0.0, f64::max)
        };
        let heights: Vec<f64> = rows.iter().map(height_of).collect();
        let top = if self.title.is_empty() { 0.0 } else { 26.0 };
        let width = GAP + columns as f64 * (panel.0 + GAP);
        let height = top + GAP + heights.iter().map(|height| height + GAP).sum::<f64>();
        let names = self.names();
        pen::draw(width, height, |pen| {
            if !self.title.is_empty() {
                let place = (width / 2.0, GAP + 8.0);
                pen.fitted(&self.title, place, width - 2.0 * GAP, 15.0, colour::INK)?;
            }
            let mut y = top + GAP;
            for (row, height) in rows.iter().zip(&heights) {
                for (n, of) in row.iter().enumerate() {
                    let x = GAP + n as f64 * (panel.0 + GAP);
                    let to = (x + panel.0, y + panel.1);
                    match of {
                        Panel::Chart(chart) => chart_drawing::draw(chart, pen, (x, y), to, &names)?,
                        Panel::Picture(picture) => picture.draw(pen, (x, y), to)?,
                    }
                }
                y += height + GAP;
            }
            Ok(())
        })
    }

    /// How many panels are in a row: as many as were asked for, or a part of them that divides them evenly where the
    /// sheet would be too wide.
    fn columns_of(&self, width: f64) -> usize {
        let asked = self.columns.min(self.panels.len());
        let fits = |columns: &usize| GAP + *columns as f64 * (width + GAP) <= WIDEST.max(self.width());
        let mut parts = (1..=asked).rev().filter(|columns| asked.is_multiple_of(*columns));
        parts.find(fits).unwrap_or(1)
    }

    /// With panels as large as was asked for.
    fn width(&self) -> f64 {
        GAP + self.columns as f64 * (self.panel.0 + GAP)
    }

    /// Every number of the figure as it was given, as CSV: `panel,kind,series,x,y,low,high,value`. A place on an axis of
    /// names is its name; a cell of a picture has its column as `x`, its row as `y`, and its colour as `value` unless the
    /// picture has [numbers](crate::Picture::numbers).
    pub fn csv(&self) -> String {
        numbers::csv(&self.panels)
    }

    /// The names of all series: the place in this list is a series' colour and marker.
    fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for panel in &self.panels {
            if let Panel::Chart(chart) = panel {
                for name in chart.names() {
                    if !names.contains(&name) {
                        names.push(name);
                    }
                }
            }
        }
        names
    }
}
