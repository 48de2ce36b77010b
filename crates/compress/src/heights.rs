//! Forces as a third coordinate of the contacts, in the unit of their places.

use taxel_hand::Geometry;

use crate::contacts::Contacts;

/// Contacts whose forces differ by so many times what those of neighbours differ by in the mean are as far apart in height as
/// neighbouring taxels in the plane.
const STEPS_A_PITCH: f64 = 4.75;
/// Forces that are looked at together.
const AT_ONCE: usize = 8;

/// The heights of a frame, and what they are measured by.
#[derive(Debug)]
pub(crate) struct Heights {
    /// Of each taxel in raster order the next one of its module in its row, and in its column; the number of taxels where
    /// there is none.
    next: Vec<[u16; 2]>,
    /// Force of each taxel in raster order that is a contact. NaN of any other, and behind the last.
    force_at: Vec<f64>,
    /// The contacts whose forces these are.
    known: Vec<u16>,
    height: Vec<f64>,
}

impl Heights {
    /// Memory for every taxel of the geometry; `raster` are their numbers in raster order.
    pub(crate) fn new(geometry: &Geometry, raster: &[usize]) -> Self {
        Self {
            next: next(geometry, raster),
            force_at: vec![f64::NAN; raster.len() + 1],
            known: Vec::with_capacity(raster.len()),
            height: Vec::with_capacity(raster.len()),
        }
    }

    /// Of the contacts in the order of their list, where they have any.
    pub(crate) fn get(&self) -> Option<&[f64]> {
        (!self.height.is_empty()).then_some(&self.height)
    }

    /// Leaves the contacts without heights.
    pub(crate) fn clear(&mut self) {
        self.height.clear();
    }

    /// Raises each contact by how far its force is above the least: by `pitch`, which is above 0, for [`STEPS_A_PITCH`] steps
    /// between neighbours. Where forces do not differ, there are no heights.
    pub(crate) fn raise(&mut self, contacts: &Contacts, pitch: f64) {
        self.clear();
        let forces = &contacts.force;
        let (least, most) = ends(forces);
        if most > least {
            // No less than a way from the least force to the greatest by all contacts would have. So heights are finite.
            let step = self.step(contacts).max((most - least) / forces.len() as f64);
            let scale = pitch / (STEPS_A_PITCH * step);
            self.height
                .extend(forces.iter().map(|force| scale * (force - least)));
        }
    }

    /// By how much forces of neighbours differ in the mean. A contact that hangs together has a pair of neighbours less than
    /// contacts, or more; where there are fewer, each that lacks counts as what forces differ by from their mean.
    fn step(&mut self, contacts: &Contacts) -> f64 {
        let forces = &contacts.force;
        for rank in self.known.drain(..) {
            self.force_at[usize::from(rank)] = f64::NAN;
        }
        self.known.extend_from_slice(&contacts.rank);
        for (rank, force) in contacts.rank.iter().zip(forces) {
            self.force_at[usize::from(*rank)] = *force;
        }
        let (mut steps, mut pairs) = ([0.0; 2], [0; 2]);
        for (rank, force) in contacts.rank.iter().zip(forces) {
            let next = self.next[usize::from(*rank)].map(|next| self.force_at[usize::from(next)]);
            for (axis, next) in next.into_iter().enumerate() {
                let step = (next - force).abs();
                steps[axis] += if step.is_nan() { 0.0 } else { step };
                pairs[axis] += usize::from(!step.is_nan());
            }
        }
        let (steps, pairs) = (steps[0] + steps[1], pairs[0] + pairs[1]);
        let fewest = forces.len() - 1;
        if pairs >= fewest {
            return steps / pairs as f64;
        }
        let mean = forces.iter().sum::<f64>() / forces.len() as f64;
        let spread = forces.iter().map(|force| (force - mean).abs()).sum::<f64>() / forces.len() as f64;
        (steps + (fewest - pairs) as f64 * spread) / fewest as f64
    }
}

/// The least and the greatest of some forces, looked at several at once.
fn ends(forces: &[f64]) -> (f64, f64) {
    let (several, left) = forces.as_chunks::<AT_ONCE>();
    let mut ends = [[f64::INFINITY; AT_ONCE], [0.0; AT_ONCE]];
    for forces in several {
        for (n, force) in forces.iter().enumerate() {
            ends[0][n] = if *force < ends[0][n] { *force } else { ends[0][n] };
            ends[1][n] = if *force > ends[1][n] { *force } else { ends[1][n] };
        }
    }
    let all = |ends: [f64; AT_ONCE]| ends.into_iter().chain(left.iter().copied());
    let least = all(ends[0]).fold(f64::INFINITY, f64::min);
    (least, all(ends[1]).fold(0.0, f64::max))
}

/// Of each taxel in raster order the next one of its module in its row, and in its column; the number of taxels where there is
/// none. Between taxels of a hexagonal skin there are pixels without one.
fn next(geometry: &Geometry, raster: &[usize]) -> Vec<[u16; 2]> {
    let ranks = 0..raster.len() as u16;
    let mut next = vec![[raster.len() as u16; 2]; raster.len()];
    for (axis, across) in [(0, 1), (1, 0)] {
        let place = |rank: &u16| {
            let taxel = &geometry.taxels[raster[usize::from(*rank)]];
            let pixel = [taxel.x, taxel.y];
            ((taxel.module, pixel[across]), pixel[axis])
        };
        let mut in_lines: Vec<u16> = ranks.clone().collect();
        in_lines.sort_unstable_by_key(place);
        for pair in in_lines.windows(2) {
            if place(&pair[0]).0 == place(&pair[1]).0 {
                next[usize::from(pair[0])][axis] = pair[1];
            }
        }
    }
    next
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::Layout;

    fn neighbours(layout: &Layout) -> Vec<[u16; 2]> {
        let places = vec![[0.0; 2]; layout.taxels.len()];
        next(layout, &Contacts::new(layout, &places).raster())
    }

    #[test]
    fn every_taxel_of_every_layout_has_a_neighbour() {
        for name in Layout::builtin_names() {
            let next = neighbours(&Layout::builtin(name).unwrap());
            let mut paired = vec![false; next.len()];
            for (rank, to) in next.iter().enumerate() {
                for to in to.iter().filter(|to| usize::from(**to) < next.len()) {
                    paired[rank] = true;
                    paired[usize::from(*to)] = true;
                }
            }
            assert!(paired.iter().all(|paired| *paired), "{name}");
        }
    }

    #[test]
    fn on_a_grid_the_next_taxels_are_to_the_right_and_below() {
        let next = neighbours(&Layout::grid(3, 2).unwrap());
        assert_eq!(next, [[1, 3], [2, 4], [6, 5], [4, 6], [5, 6], [6, 6]]);
    }
}
