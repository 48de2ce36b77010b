//! How far a hand's taxels are from each other.

use crate::{Geometry, Module};

/// Squares of distances are the same up to this times the least: places are rounded.
const SAME: f64 = 1.001;

impl Geometry {
    /// Distance of neighbouring taxels on the hand laid flat, millimetres: the median over the taxels of the distance to
    /// the nearest other ones of the same module. It is of the places' x and y, wherever taxels are in the image. `None`
    /// where no two taxels of a module have places apart.
    pub fn neighbour_distance_mm(&self) -> Option<f64> {
        let mut nearest: Vec<f64> = self
            .modules
            .iter()
            .flat_map(|module| self.nearest(module))
            .collect();
        nearest.sort_unstable_by(f64::total_cmp);
        nearest.get(nearest.len() / 2).map(|squared| squared.sqrt())
    }

    /// Squared distances of each taxel of a module to those nearest to it: on a grid, to all that are side by side with
    /// it. Those at its own place do not count.
    fn nearest(&self, module: &Module) -> Vec<f64> {
        let taxels = self.taxels.get(module.taxel_range()).unwrap_or_default();
        let mut places: Vec<[f64; 2]> = (taxels.iter())
            .filter_map(|taxel| taxel.position_mm.map(|[x, y, _]| [x, y].map(f64::from)))
            .collect();
        // Along the longer side, on which few are near.
        if extent(&places, 1) > extent(&places, 0) {
            places.iter_mut().for_each(|place| place.reverse());
        }
        places.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        places.dedup();
        let mut nearest = Vec::new();
        for n in 0..places.len() {
            let mut least = f64::INFINITY;
            each_near(&places, n, |squared| {
                least = least.min(squared);
                least
            });
            each_near(&places, n, |squared| {
                nearest.extend((squared <= SAME * least).then_some(squared));
                SAME * least
            });
        }
        nearest
    }
}

fn extent(places: &[[f64; 2]], axis: usize) -> f64 {
    let along = || places.iter().map(|place| place[axis]);
    along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
}

/// Squared distances from a place to others, in the order of x to either side, for as long as x alone is within what
/// `within` gives back, squared.
fn each_near(places: &[[f64; 2]], n: usize, mut within: impl FnMut(f64) -> f64) {
    let mut bound = f64::INFINITY;
    let mut is_near = |other: &[f64; 2]| {
        let [dx, dy] = [other[0] - places[n][0], other[1] - places[n][1]];
        let squared = dx * dx + dy * dy;
        if squared > 0.0 && dx * dx <= bound {
            bound = within(squared);
        }
        dx * dx <= bound
    };
    let _ = places[n + 1..].iter().all(&mut is_near);
    let _ = places[..n].iter().rev().all(&mut is_near);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Taxel;

    /// One module of taxels at these places, in the pixels of every `apart`-th column.
    fn skin(places: &[[f32; 2]], apart: u16) -> Geometry {
        let module = Module {
            name: "sole".into(),
            part: "foot".into(),
            first_taxel: 0,
            taxels: places.len() as u16,
            pose: None,
            joint: None,
        };
        let taxel = |(n, [x, y]): (usize, &[f32; 2])| Taxel {
            module: 0,
            x: n as u16 * apart,
            y: 0,
            position_mm: Some([*x, *y, 0.0]),
        };
        let size = [places.len() as u16 * apart, 1];
        let taxels = places.iter().enumerate().map(taxel).collect();
        Geometry::new("foot", size, vec![module], taxels).unwrap()
    }

    #[test]
    fn the_distance_of_neighbours_is_that_of_places_and_not_of_pixels() {
        let grid: Vec<[f32; 2]> = (0..196)
            .map(|n| [5.0 * (n % 14) as f32, 5.0 * (n / 14) as f32])
            .collect();
        for (name, places, wanted) in [
            ("a grid", &grid[..], Some(5.0)),
            (
                "of unlike ways",
                &[[0.0, 0.0], [9.0, 0.0], [0.0, 2.0], [9.0, 2.0]],
                Some(2.0),
            ),
            (
                "far from one of two",
                &[[0.0, 0.0], [3.0, 4.0], [103.0, 4.0], [108.0, 4.0]],
                Some(5.0),
            ),
            (
                "two at one place",
                &[[0.0, 0.0], [0.0, 0.0], [3.0, 4.0]],
                Some(5.0),
            ),
            ("all at one place", &[[1.0, 1.0]; 3], None),
            ("alone", &[[1.0, 1.0]], None),
        ] {
            let distances = [1, 2].map(|apart| skin(places, apart).neighbour_distance_mm());
            assert_eq!(distances, [wanted; 2], "{name}");
        }
        assert_eq!(Geometry::grid(4, 4).unwrap().neighbour_distance_mm(), None);
    }

    #[test]
    fn modules_are_not_neighbours() {
        let mut hand = skin(&[[0.0, 0.0], [7.0, 0.0], [7.0, 1.0], [7.0, 8.0]], 1);
        hand.modules.push(Module {
            first_taxel: 2,
            taxels: 2,
            ..hand.modules[0].clone()
        });
        hand.modules[0].taxels = 2;
        assert_eq!(hand.neighbour_distance_mm(), Some(7.0));
    }
}
