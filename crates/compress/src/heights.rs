//! Forces as a third coordinate of the contacts, in the unit of their places.

use taxel_hand::Geometry;

use crate::contacts::Contacts;

/// Contacts whose forces differ by so many times what those of neighbours differ by in the mean are as far apart in height as
/// neighbouring taxels in the plane.
const STEPS_A_PITCH: f64 = 4.75;

/// The heights of a frame, and what they are measured by.
#[derive(Debug)]
pub(crate) struct Heights {
    /// Of each taxel in raster order the next one of its module in its row, and in its column; itself where there is none.
    next: Vec<[u16; 2]>,
    /// Force of each contact, by its taxel's number in raster order. Of other taxels it is of an earlier frame.
    force_at: Vec<f64>,
    height: Vec<f64>,
}

impl Heights {
    /// Memory for every taxel of the geometry; `raster` are their numbers in raster order.
    pub(crate) fn new(geometry: &Geometry, raster: &[usize]) -> Self {
        Self {
            next: next(geometry, raster),
            force_at: vec![0.0; raster.len()],
            height: Vec::with_capacity(raster.len()),
        }
    }

    /// Of the contacts in the order of their list; empty where they have none.
    pub(crate) fn get(&self) -> &[f64] {
        &self.height
    }

    /// Raises each contact by how far its force is above the least: by `pitch` for [`STEPS_A_PITCH`] steps between
    /// neighbours. Where forces do not differ, or with a pitch of 0, there are no heights.
    pub(crate) fn raise(&mut self, contacts: &Contacts, pitch: f64) {
        self.height.clear();
        let forces = &contacts.force;
        let least = forces.iter().copied().fold(f64::INFINITY, f64::min);
        let most = forces.iter().copied().fold(0.0, f64::max);
        if pitch > 0.0 && most > least {
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
        for (rank, force) in contacts.rank.iter().zip(forces) {
            self.force_at[usize::from(*rank)] = *force;
        }
        let (mut steps, mut pairs) = ([0.0; 2], 0);
        for (rank, force) in contacts.rank.iter().zip(forces) {
            for (sum, next) in steps.iter_mut().zip(self.next[usize::from(*rank)]) {
                let touched = next != *rank && contacts.is_listed(next);
                let step = (self.force_at[usize::from(next)] - force).abs();
                *sum += if touched { step } else { 0.0 };
                pairs += usize::from(touched);
            }
        }
        let steps = steps[0] + steps[1];
        let fewest = forces.len() - 1;
        if pairs >= fewest {
            return steps / pairs as f64;
        }
        let mean = forces.iter().sum::<f64>() / forces.len() as f64;
        let spread = forces.iter().map(|force| (force - mean).abs()).sum::<f64>() / forces.len() as f64;
        (steps + (fewest - pairs) as f64 * spread) / fewest as f64
    }
}

/// Of each taxel in raster order the next one of its module in its row, and in its column; itself where there is none. Between
/// taxels of a hexagonal skin there are pixels without one.
fn next(geometry: &Geometry, raster: &[usize]) -> Vec<[u16; 2]> {
    let ranks = (0..=u16::MAX).take(raster.len());
    let mut next: Vec<[u16; 2]> = ranks.clone().map(|rank| [rank; 2]).collect();
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
                for to in to.iter().filter(|to| usize::from(**to) != rank) {
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
        assert_eq!(next, [[1, 3], [2, 4], [2, 5], [4, 3], [5, 4], [5, 5]]);
    }
}
