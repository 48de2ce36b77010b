//! Where the pixels of a hand are on the terminal.

use ratatui::layout::Rect;
use taxel_skin::Layout;

/// Lines below the panels.
pub(super) const STATUS_LINES: u16 = 5;
/// Where the pixels of an image are drawn: so many columns and rows for each, with gaps between the
/// hand's parts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Grid {
    cell_width: u16,
    cell_height: u16,
    /// Blank columns before each pixel column, all together.
    shift: Vec<u16>,
    pub(super) width: u16,
    pub(super) height: u16,
}

impl Grid {
    /// The largest that fits twice, side by side, into `area` above the status lines.
    pub(super) fn fit(layout: &Layout, area: Rect) -> Option<Self> {
        let (width, height) = (layout.width, layout.height);
        let edges = part_edges(layout);
        // As square as characters can be, as large as there is room; narrow ones where there is none.
        let square = (1..=4)
            .rev()
            .flat_map(|height| [(2 * height, 1), (2 * height, 0), (2 * height - 1, 1)].map(|w| (height, w)));
        let narrow = (1..=4).rev().map(|height| (height, (1, 0)));
        for (cell_height, (cell_width, gap)) in square.chain(narrow) {
            let shift: Vec<u16> = (0..width)
                .map(|x| gap * edges.iter().filter(|e| **e <= x).count() as u16)
                .collect();
            let inner = width * cell_width + shift.last().copied().unwrap_or(0);
            let fits_across = 2 * (inner + 2) < area.width;
            // A line of names, and two of border.
            let fits_down = height * cell_height + 3 + STATUS_LINES <= area.height;
            if fits_across && fits_down {
                let height = height * cell_height;
                return Some(Self {
                    cell_width,
                    cell_height,
                    shift,
                    width: inner,
                    height,
                });
            }
        }
        None
    }

    /// The place of a pixel in a panel whose pixels begin at `origin`.
    pub(super) fn cell(&self, origin: (u16, u16), x: u16, y: u16) -> Rect {
        Rect {
            x: origin.0 + x * self.cell_width + self.shift[usize::from(x)],
            y: origin.1 + y * self.cell_height,
            width: self.cell_width,
            height: self.cell_height,
        }
    }
}

/// Columns at which a part of the hand begins, without the first.
fn part_edges(layout: &Layout) -> Vec<u16> {
    let mut begins: Vec<u16> = parts(layout).iter().map(|(_, x, _)| *x).collect();
    begins.sort_unstable();
    begins.dedup();
    begins.into_iter().skip(1).collect()
}

/// The parts of the hand with their first and last column in the image.
pub(super) fn parts(layout: &Layout) -> Vec<(&str, u16, u16)> {
    let mut parts: Vec<(&str, u16, u16)> = Vec::new();
    for taxel in &layout.taxels {
        let part = layout.modules[usize::from(taxel.module)].part.as_str();
        match parts.iter_mut().find(|(name, _, _)| *name == part) {
            Some((_, first, last)) => {
                *first = taxel.x.min(*first);
                *last = taxel.x.max(*last);
            }
            None => parts.push((part, taxel.x, taxel.x)),
        }
    }
    parts
}
