//! What cannot be drawn.

/// Why a figure cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// A picture whose cells fill no rectangle.
    #[error("picture \"{title}\": {cells} cells are no rows of {width}; give whole rows")]
    NoRectangle {
        /// The picture's title.
        title: String,
        /// How many cells were given.
        cells: usize,
        /// Cells of a row.
        width: usize,
    },
    /// A sheet without panels.
    #[error("figure \"{title}\" has no panel; there is nothing to draw")]
    Empty {
        /// The sheet's title.
        title: String,
    },
    /// What the drawing library says.
    #[error("the figure cannot be drawn: {0}")]
    Drawing(String),
}
