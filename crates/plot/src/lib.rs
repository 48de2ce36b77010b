//! Figures as SVG, one hand for all: charts and tactile images on a [`Sheet`], the numbers of a figure beside it as CSV.
//!
//! A name stands for one colour and one marker on the whole sheet, whichever panel it is in. A figure is light where its
//! reader is light and dark where the reader asks for dark (`prefers-color-scheme`); readers that know no style sheets
//! draw it light. The same sheet is the same bytes.
//!
//! ```
//! use taxel_plot::{Axis, Chart, Sheet};
//!
//! let time = (0..100).map(|n| f64::from(n) / 10.0);
//! let force = Chart::new("", Axis::new("time, s"), Axis::new("force, counts"))
//!     .line("felt", time.map(|t| (t, t.sin().abs())));
//! let sheet = Sheet::new("A finger").chart(force);
//! assert!(sheet.svg()?.starts_with("<svg"));
//! assert!(sheet.csv().starts_with("panel,kind,series,x,y,low,high,value\n"));
//! # Ok::<(), taxel_plot::PlotError>(())
//! ```

mod axis;
mod chart;
mod chart_drawing;
mod colour;
mod error;
mod numbers;
mod panel;
mod pen;
mod picture;
mod sheet;
mod spread;

pub use axis::Axis;
pub use chart::Chart;
pub use error::PlotError;
pub use picture::Picture;
pub use sheet::Sheet;
pub use spread::{Quartiles, ellipse};
