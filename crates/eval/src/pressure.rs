//! Where the force acts: the centre of pressure of each part of the hand, felt and displayed.

use crate::sequence::Felt;
use taxel_hand::TactileImage;
use taxel_skin::Layout;

/// Where every pixel is, and to which part of the hand it belongs.
#[derive(Debug)]
pub(crate) struct Places {
    width: usize,
    /// Per pixel: part and place; millimetres if `in_mm`, else pixels.
    places: Vec<(usize, [f64; 3])>,
    parts: usize,
    /// Whether every taxel's place on the hand is known.
    pub(crate) in_mm: bool,
}

/// A force at a place, added up.
#[derive(Debug, Default, Clone, Copy)]
struct Moment {
    force: f64,
    sum: [f64; 3],
}

impl Moment {
    fn add(&mut self, force: f64, place: [f64; 3]) {
        self.force += force;
        for (sum, at) in self.sum.iter_mut().zip(place) {
            *sum += force * at;
        }
    }

    fn centre(&self) -> [f64; 3] {
        self.sum.map(|s| s / self.force)
    }
}

impl Places {
    pub(crate) fn new(layout: &Layout) -> Self {
        let width = usize::from(layout.width);
        let in_mm = layout.taxels.iter().all(|t| t.position_mm.is_some());
        let mut names: Vec<&str> = layout.modules.iter().map(|m| m.part.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        let mut places = vec![(0, [0.0; 3]); width * usize::from(layout.height)];
        for (n, taxel) in layout.taxels.iter().enumerate() {
            let part = names
                .binary_search(&layout.module_of(n).part.as_str())
                .unwrap_or(0);
            let place = match taxel.position_mm {
                Some(at) if in_mm => at.map(f64::from),
                _ => [f64::from(taxel.x), f64::from(taxel.y), 0.0],
            };
            places[usize::from(taxel.y) * width + usize::from(taxel.x)] = (part, place);
        }
        Self {
            width,
            places,
            parts: names.len(),
            in_mm,
        }
    }

    fn at(&self, x: u16, y: u16) -> (usize, [f64; 3]) {
        self.places[usize::from(y) * self.width + usize::from(x)]
    }

    /// How far the centre of pressure that the actuators give is from that of the contacts, for
    /// each part that has both; appended to `errors`. Returns how many parts have contacts but no
    /// actuator.
    pub(crate) fn compare(
        &self,
        pixel: &[[u16; 2]],
        force: &[f64],
        image: &TactileImage,
        felt_as: Felt,
        errors: &mut Vec<f64>,
    ) -> u64 {
        let mut felt = vec![Moment::default(); self.parts];
        let mut shown = felt.clone();
        for (&[x, y], force) in pixel.iter().zip(force) {
            let (part, place) = self.at(x, y);
            felt[part].add(felt_as.of(*force), place);
        }
        for actuator in &image.actuators {
            let (part, place) = self.at(actuator.x, actuator.y);
            shown[part].add(felt_as.of(actuator.force), place);
        }
        let mut missed = 0;
        for (felt, shown) in felt.iter().zip(&shown) {
            if felt.force > 0.0 && shown.force > 0.0 {
                let (a, b) = (felt.centre(), shown.centre());
                errors.push((0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt());
            } else if felt.force > 0.0 {
                missed += 1;
            }
        }
        missed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::Actuator;

    fn image(actuators: &[(u16, u16, f64)]) -> TactileImage {
        TactileImage {
            actuators: actuators
                .iter()
                .map(|&(x, y, force)| Actuator {
                    x,
                    y,
                    force,
                    ..Actuator::default()
                })
                .collect(),
            ..TactileImage::default()
        }
    }

    #[test]
    fn the_error_is_the_distance_of_the_two_centres() {
        let places = Places::new(&Layout::grid(8, 8).unwrap());
        assert!(!places.in_mm);
        for (name, contacts, actuators, want) in [
            ("the same", vec![(1, 1, 3.0)], vec![(1, 1, 3.0)], 0.0),
            (
                "the scale of force does not matter",
                vec![(0, 0, 1.0), (2, 0, 1.0)],
                vec![(0, 0, 9.0), (2, 0, 9.0)],
                0.0,
            ),
            (
                "two contacts on one actuator",
                vec![(0, 0, 1.0), (4, 0, 3.0)],
                vec![(4, 0, 3.0)],
                1.0,
            ),
            ("diagonally", vec![(0, 0, 5.0)], vec![(3, 4, 5.0)], 5.0),
        ] {
            let pixel: Vec<[u16; 2]> = contacts.iter().map(|c| [c.0, c.1]).collect();
            let force: Vec<f64> = contacts.iter().map(|c| c.2).collect();
            let mut errors = Vec::new();
            assert_eq!(
                places.compare(&pixel, &force, &image(&actuators), Felt::Force, &mut errors),
                0,
                "{name}"
            );
            assert_eq!(errors, [want], "{name}");
        }
    }

    #[test]
    fn parts_are_compared_on_their_own_and_a_missed_part_is_counted() {
        let layout = Layout::builtin("allegro-uskin-15").unwrap();
        let places = Places::new(&layout);
        let of_part = |part: &str| {
            let n = (0..layout.len())
                .find(|n| layout.module_of(*n).part == part)
                .unwrap();
            (layout.taxels[n].x, layout.taxels[n].y)
        };
        let (index, thumb) = (of_part("index"), of_part("thumb"));
        let pixel = [[index.0, index.1], [thumb.0, thumb.1]];
        let mut errors = Vec::new();
        let missed = places.compare(
            &pixel,
            &[1.0, 1.0],
            &image(&[(index.0, index.1, 1.0)]),
            Felt::Force,
            &mut errors,
        );
        assert_eq!((missed, errors), (1, vec![0.0]));
    }
}
