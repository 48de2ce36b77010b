//! Displays whose actuators cannot move: which of them stands for which contacts.
//!
//! A contact is felt at the actuator nearest to it. But two regions of contact that are apart on
//! the skin should not become one only because one actuator is nearest to both while another is
//! free nearby. So contacts are gathered into *pieces*: contacts that touch (pixels side by side or
//! corner to corner, on one part of the hand) and have the same nearest actuator. Pieces are
//! matched with actuators one to one at the least total cost, where a piece of `n` contacts with
//! its mean at distance `d` from an actuator costs `n d^2`. A piece may also share its nearest
//! actuator; it then counts as farther away by half the display's spacing. Any other actuator than
//! the one that stood for a piece in the last frame counts as farther by an eighth of it, so that a
//! piece half way between two does not go back and forth when others come and go.

use taxel_cluster::Matching;
use taxel_hand::Geometry;

use crate::contacts::Contacts;

/// The places of a display, and memory for a frame.
#[derive(Debug)]
pub(crate) struct Fixed {
    places: Vec<[f64; 2]>,
    /// Pixel by which each actuator is known in the image.
    pub(crate) pixel: Vec<[u16; 2]>,
    /// Median distance of actuators from the nearest other.
    spacing: f64,
    /// Nearest actuator of each taxel, by raster order.
    nearest: Vec<u16>,
    /// Contact at each pixel, from 1; 0 for none.
    at: Vec<u32>,
    width: usize,
    height: usize,
    /// A contact of the same piece, or the contact itself.
    parent: Vec<u32>,
    /// Piece of each contact that is the first of one.
    piece_of: Vec<u32>,
    pieces: Vec<Piece>,
    matching: Matching,
    /// Actuator of each taxel in the last frame, by raster order; [`NONE`] where it had none.
    held: Vec<u16>,
}

/// No actuator.
const NONE: u16 = u16::MAX;

/// Contacts that touch and have the same nearest actuator.
#[derive(Debug, Default, Clone, Copy)]
struct Piece {
    x: f64,
    y: f64,
    contacts: f64,
    nearest: u16,
    /// The actuator that stood for its first contact that had one, or [`NONE`].
    held: u16,
    actuator: u16,
}

impl Fixed {
    pub(crate) fn new(
        places: &[[f64; 2]],
        geometry: &Geometry,
        taxels: &[[f64; 2]],
        raster: &[usize],
    ) -> Self {
        let pixels = usize::from(geometry.width) * usize::from(geometry.height);
        let mut taken = vec![false; taxels.len()];
        let pixel = places
            .iter()
            .map(|place| {
                let free = raster.iter().copied().filter(|taxel| !taken[*taxel]);
                let taxel = nearest_of(*place, free.map(|t| (t, taxels[t])));
                let taxel = taxel.or_else(|| nearest_of(*place, raster.iter().map(|t| (*t, taxels[*t]))));
                let taxel = taxel.unwrap_or(0);
                taken[taxel] = true;
                [geometry.taxels[taxel].x, geometry.taxels[taxel].y]
            })
            .collect();
        let mut gaps: Vec<f64> = (0..places.len())
            .filter_map(|a| {
                let others = (0..places.len()).filter(|b| *b != a);
                others
                    .map(|b| squared(places[a], places[b]))
                    .min_by(f64::total_cmp)
            })
            .collect();
        gaps.sort_unstable_by(f64::total_cmp);
        let nearest = |taxel: &usize| {
            nearest_of(taxels[*taxel], places.iter().copied().enumerate()).map_or(0, |id| id as u16)
        };
        Self {
            pixel,
            spacing: gaps.get(gaps.len() / 2).copied().unwrap_or(0.0).sqrt(),
            nearest: raster.iter().map(nearest).collect(),
            at: vec![0; pixels],
            width: geometry.width.into(),
            height: geometry.height.into(),
            parent: Vec::with_capacity(taxels.len()),
            piece_of: Vec::with_capacity(taxels.len()),
            pieces: Vec::with_capacity(taxels.len()),
            matching: Matching::new(places.len(), 2 * places.len()),
            held: vec![NONE; taxels.len()],
            places: places.to_vec(),
        }
    }

    /// Writes the actuator of each contact.
    pub(crate) fn assign(&mut self, contacts: &Contacts, actuator: &mut Vec<u16>) {
        self.join(contacts);
        self.gather(contacts);
        self.choose();
        actuator.clear();
        actuator.extend(
            self.piece_of
                .iter()
                .map(|piece| self.pieces[*piece as usize].actuator),
        );
        self.held.fill(NONE);
        for (rank, actuator) in contacts.rank.iter().zip(actuator) {
            self.held[usize::from(*rank)] = *actuator;
        }
    }

    /// Joins contacts that touch and have the same nearest actuator.
    fn join(&mut self, contacts: &Contacts) {
        self.at.fill(0);
        self.parent.clear();
        for n in 0..contacts.len() {
            self.parent.push(n as u32);
            let [x, y] = contacts.pixel[n].map(usize::from);
            self.at[y * self.width + x] = n as u32 + 1;
            // Contacts come in raster order: those before are to the left and in the row above.
            let above = y
                .checked_sub(1)
                .map(|y| (x.saturating_sub(1)..=(x + 1).min(self.width - 1), y));
            let left = x.checked_sub(1).map(|x| (x..=x, y));
            for (columns, row) in above.into_iter().chain(left) {
                debug_assert!(row < self.height);
                for column in columns {
                    let Some(other) = (self.at[row * self.width + column] as usize).checked_sub(1) else {
                        continue;
                    };
                    let same = |of: &[u16]| of[n] == of[other];
                    let nearest = |n: usize| self.nearest[usize::from(contacts.rank[n])];
                    if same(&contacts.part) && nearest(n) == nearest(other) {
                        let (a, b) = (self.root(n), self.root(other));
                        self.parent[a.max(b)] = a.min(b) as u32;
                    }
                }
            }
        }
    }

    /// The first contact of the piece that a contact belongs to.
    fn root(&mut self, mut n: usize) -> usize {
        while self.parent[n] as usize != n {
            self.parent[n] = self.parent[self.parent[n] as usize];
            n = self.parent[n] as usize;
        }
        n
    }

    /// Adds up the contacts of each piece; pieces are numbered by their first contacts.
    fn gather(&mut self, contacts: &Contacts) {
        self.pieces.clear();
        self.piece_of.clear();
        for n in 0..contacts.len() {
            let root = self.root(n);
            if root == n {
                let nearest = self.nearest[usize::from(contacts.rank[n])];
                self.piece_of.push(self.pieces.len() as u32);
                self.pieces.push(Piece {
                    nearest,
                    held: NONE,
                    actuator: nearest,
                    ..Piece::default()
                });
            } else {
                self.piece_of.push(self.piece_of[root]);
            }
            let piece = &mut self.pieces[self.piece_of[n] as usize];
            piece.x += contacts.x[n];
            piece.y += contacts.y[n];
            piece.contacts += 1.0;
            if piece.held == NONE {
                piece.held = self.held[usize::from(contacts.rank[n])];
            }
        }
        for piece in &mut self.pieces {
            piece.x /= piece.contacts;
            piece.y /= piece.contacts;
        }
    }

    /// Matches pieces with actuators. Where there are more pieces than actuators, the largest (the
    /// first among equals) are matched, and the others share.
    fn choose(&mut self) {
        let actuators = self.places.len();
        let rows = self.pieces.len().min(actuators);
        if self.pieces.len() > actuators {
            // Sorting would renumber the pieces: the size that so many reach is enough.
            self.match_largest(rows);
            return;
        }
        let (pieces, places, spacing) = (&self.pieces, &self.places, self.spacing);
        let found = self.matching.solve(rows, actuators + rows, |row, column| {
            cost(&pieces[row], places, spacing, column)
        });
        for (row, column) in found.iter().enumerate() {
            if *column < actuators {
                self.pieces[row].actuator = *column as u16;
            }
        }
    }

    fn match_largest(&mut self, rows: usize) {
        // `parent` is done with: it takes the order.
        self.parent.clear();
        self.parent.extend(0..self.pieces.len() as u32);
        let pieces = &self.pieces;
        self.parent.sort_unstable_by(|a, b| {
            let size = |n: &u32| pieces[*n as usize].contacts;
            size(b).total_cmp(&size(a)).then(a.cmp(b))
        });
        let (largest, places, spacing) = (&self.parent[..rows], &self.places, self.spacing);
        let actuators = places.len();
        let found = self.matching.solve(rows, actuators + rows, |row, column| {
            cost(&pieces[largest[row] as usize], places, spacing, column)
        });
        for (row, column) in found.iter().enumerate() {
            if *column < actuators {
                self.pieces[self.parent[row] as usize].actuator = *column as u16;
            }
        }
    }
}

/// Cost of a piece at an actuator, or of sharing its nearest, which are the columns after all actuators.
fn cost(piece: &Piece, places: &[[f64; 2]], spacing: f64, column: usize) -> f64 {
    let to = |place: [f64; 2]| squared([piece.x, piece.y], place);
    let change = |id: usize| {
        if piece.held == NONE || usize::from(piece.held) == id {
            0.0
        } else {
            0.125 * spacing
        }
    };
    let farther = |square: f64, by: f64| {
        if by > 0.0 {
            let distance = square.sqrt() + by;
            distance * distance
        } else {
            square
        }
    };
    piece.contacts
        * match places.get(column) {
            Some(place) => farther(to(*place), change(column)),
            None => {
                let nearest = usize::from(piece.nearest);
                farther(to(places[nearest]), 0.5 * spacing + change(nearest))
            }
        }
}

fn squared(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    dx * dx + dy * dy
}

/// Which of some numbered places is nearest, the first among equals.
fn nearest_of(place: [f64; 2], places: impl Iterator<Item = (usize, [f64; 2])>) -> Option<usize> {
    let mut nearest: Option<(usize, f64)> = None;
    for (number, other) in places {
        let distance = squared(place, other);
        if nearest.is_none_or(|(_, least)| distance < least) {
            nearest = Some((number, distance));
        }
    }
    nearest.map(|(number, _)| number)
}
