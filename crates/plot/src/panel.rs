//! What a sheet is made of.

use crate::chart::Chart;
use crate::picture::Picture;

#[derive(Debug, Clone)]
pub(crate) enum Panel {
    Chart(Chart),
    Picture(Picture),
}
