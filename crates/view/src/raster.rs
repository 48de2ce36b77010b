//! A hand in half blocks: which taxel each half of a character belongs to.

use crate::flat::{Axis, Flat};
use ratatui::layout::{Position, Rect};

/// Where no taxel is.
const NONE: u16 = u16::MAX;
/// The largest side of a taxel, half blocks.
const LARGEST: u16 = 20;

/// A hand drawn in half blocks, which are about as high as they are wide: a character is one wide and two high.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Raster {
    pub(crate) width: u16,
    pub(crate) height: u16,
    /// Taxel of each half block, row by row.
    owner: Vec<u16>,
    /// The half block at each taxel's middle.
    middle: Vec<(u16, u16)>,
    /// Rows of half blocks of each taxel; 0 where there are more taxels than half blocks.
    side: u16,
}

/// What a hand is drawn into: two panels of this size, half blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Room {
    pub(crate) width: u16,
    pub(crate) height: u16,
}

impl Raster {
    /// The hand as large as there is room, with gaps as wide as that allows; and how large its taxels are.
    pub(crate) fn fit(flat: &Flat, room: Room) -> (Self, Size) {
        // Of one and a half each other taxel is the larger one, and the hand keeps its shape. The least are drawn wide
        // where there is room: they are easier to see.
        let whole = (2..=LARGEST).rev().map(|side| [f32::from(side); 2]);
        for [wide, high] in whole.chain([[1.5, 1.5], [2.0, 1.0], [1.0, 1.0]]) {
            let fitting = flat
                .across
                .iter()
                .zip(&flat.down)
                .filter(|(across, _)| blocks(across.length, wide) <= room.width);
            for (across, rows) in fitting {
                let Some(down) = rows.iter().find(|down| blocks(down.length, high) <= room.height) else {
                    continue;
                };
                let size = Size {
                    side: high,
                    gaps: across.gap + down.gap,
                };
                return (Self::draw(across, down, [wide, high], high as u16), size);
            }
        }
        let (across, down) = (&flat.across[2], &flat.down[2][2]);
        let scale = [(room.width, across), (room.height, down)]
            .map(|(room, axis)| (f32::from(room.max(1)) / axis.length).min(1.0));
        let size = Size { side: 0.0, gaps: 0.0 };
        (Self::draw(across, down, scale, 0), size)
    }

    fn draw(across: &Axis, down: &Axis, scale: [f32; 2], side: u16) -> Self {
        let (width, height) = (blocks(across.length, scale[0]), blocks(down.length, scale[1]));
        let mut owner = vec![NONE; usize::from(width) * usize::from(height)];
        let mut nearest = vec![f32::INFINITY; owner.len()];
        let mut middle = Vec::with_capacity(across.places.len());
        for (taxel, (u, v)) in across.places.iter().zip(&down.places).enumerate() {
            let (left, top) = (u * scale[0], v * scale[1]);
            let span = |from: f32, scale: f32, most: u16| {
                let first = (from.round() as u16).min(most - 1);
                let last = ((from + scale).round() as u16).clamp(first + 1, most);
                first..last
            };
            let (columns, rows) = (span(left, scale[0], width), span(top, scale[1], height));
            let centre = [left + scale[0] / 2.0, top + scale[1] / 2.0];
            middle.push((
                (columns.start + columns.end - 1) / 2,
                (rows.start + rows.end - 1) / 2,
            ));
            for y in rows {
                for x in columns.clone() {
                    let place = usize::from(y) * usize::from(width) + usize::from(x);
                    let off = [f32::from(x) + 0.5 - centre[0], f32::from(y) + 0.5 - centre[1]];
                    // Patterns of triangles overlap a little.
                    let distance = (off[0] / scale[0]).powi(2) + (off[1] / scale[1]).powi(2);
                    if distance < nearest[place] {
                        nearest[place] = distance;
                        owner[place] = taxel as u16;
                    }
                }
            }
        }
        Self {
            width,
            height,
            owner,
            middle,
            side,
        }
    }

    /// Rows of characters.
    pub(crate) fn rows(&self) -> u16 {
        self.height.div_ceil(2)
    }

    /// The taxel of a half block.
    pub(crate) fn taxel_at(&self, x: u16, y: u16) -> Option<usize> {
        if x >= self.width || y >= self.height {
            return None;
        }
        let taxel = self.owner[usize::from(y) * usize::from(self.width) + usize::from(x)];
        (taxel != NONE).then_some(usize::from(taxel))
    }

    /// Whether a taxel is in any of these characters, of a drawing that begins at `origin`.
    pub(crate) fn covers(&self, place: Rect, origin: Position) -> bool {
        place.positions().any(|at| {
            let (Some(x), Some(y)) = (at.x.checked_sub(origin.x), at.y.checked_sub(origin.y)) else {
                return false;
            };
            [2 * y, 2 * y + 1].iter().any(|y| self.taxel_at(x, *y).is_some())
        })
    }

    /// Number of taxels.
    pub(crate) fn taxels(&self) -> usize {
        self.middle.len()
    }

    /// The half block at a taxel's middle.
    pub(crate) fn middle(&self, taxel: usize) -> (u16, u16) {
        self.middle[taxel]
    }

    /// Whether a character belongs to one taxel alone.
    pub(crate) fn has_letters(&self) -> bool {
        self.side >= 2
    }

    /// Whether taxels share half blocks.
    pub(crate) fn is_crowded(&self) -> bool {
        self.side == 0
    }

    /// The character in which a letter on this taxel stands, of a drawing that begins at `origin`; `None` where a
    /// character holds more than one taxel.
    pub(crate) fn letter(&self, taxel: usize, origin: Position) -> Option<Position> {
        let (x, y) = self.middle[taxel];
        let whole = |y: u16| {
            let halves = [y & !1, y | 1];
            (halves.iter()).all(|y| self.taxel_at(x, *y).is_none_or(|owner| owner == taxel))
        };
        let y = [y, y + 1]
            .into_iter()
            .find(|y| self.taxel_at(x, *y) == Some(taxel) && whole(*y))?;
        Some(Position::new(origin.x + x, origin.y + y / 2))
    }

    /// The characters that these taxels take, of a drawing that begins at `origin`.
    pub(crate) fn around(&self, taxels: &[usize], origin: Position) -> Rect {
        let middles = || taxels.iter().map(|taxel| self.middle[*taxel]);
        let half = self.side / 2;
        let left = middles().map(|(x, _)| x).min().unwrap_or(0).saturating_sub(half);
        let right = middles().map(|(x, _)| x).max().unwrap_or(0) + half;
        let top = middles().map(|(_, y)| y).min().unwrap_or(0).saturating_sub(half) / 2;
        let bottom = (middles().map(|(_, y)| y).max().unwrap_or(0) + half).min(self.height - 1) / 2;
        Rect {
            x: origin.x + left,
            y: origin.y + top,
            width: right.min(self.width - 1) - left + 1,
            height: bottom - top + 1,
        }
    }
}

/// How large a hand is drawn: first by its taxels, then by the gaps between its parts.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub(crate) struct Size {
    /// Rows of half blocks of a taxel; 0 where taxels share them.
    pub(crate) side: f32,
    /// Gaps across and down, in distances of taxels.
    pub(crate) gaps: f32,
}

fn blocks(length: f32, side: f32) -> u16 {
    (length * side - 0.01).ceil().max(1.0) as u16
}
