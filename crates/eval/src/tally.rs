//! What changes from one image to the next.

use crate::plane::{Plane, squared_distance};
use taxel_hand::TactileImage;

/// Counts how actuators move and levels change between consecutive images, both of which have contacts.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    last: Option<TactileImage>,
    /// Level of the contact at each pixel of the last image; 0 for none.
    last_levels: Vec<u16>,
    levels: Vec<u16>,
    /// Actuators whose id presses in both images, over all pairs of images.
    pub(crate) kept: u64,
    /// Those that jumped.
    pub(crate) jumps: u64,
    /// Pixels that they moved in all.
    pub(crate) moved_px: f64,
    /// Taxels in contact in both images.
    pub(crate) touched: u64,
    /// Those whose level is another.
    pub(crate) level_changes: u64,
}

impl Tally {
    /// The next image of a hand, and the pixel and level (from 0) of each of its contacts.
    pub(crate) fn add(&mut self, image: &TactileImage, plane: &Plane, pixel: &[[u16; 2]], level: &[u16]) {
        let width = usize::from(image.width);
        self.levels.clear();
        self.levels.resize(width * usize::from(image.height), 0);
        for ([x, y], level) in pixel.iter().zip(level) {
            self.levels[usize::from(*y) * width + usize::from(*x)] = level + 1;
        }
        if let Some(last) = self
            .last
            .as_ref()
            .filter(|l| !l.actuators.is_empty() && !image.actuators.is_empty())
        {
            for now in &image.actuators {
                let Some(before) = last.actuators.iter().find(|a| a.id == now.id) else {
                    continue;
                };
                let (from, to) = ([before.x, before.y], [now.x, now.y]);
                self.kept += 1;
                self.jumps += u64::from(squared_distance(plane.at(from), plane.at(to)).sqrt() > plane.jump);
                self.moved_px += squared_distance(from.map(f64::from), to.map(f64::from)).sqrt();
            }
            for (now, before) in self.levels.iter().zip(&self.last_levels) {
                if *now > 0 && *before > 0 {
                    self.touched += 1;
                    self.level_changes += u64::from(now != before);
                }
            }
        }
        std::mem::swap(&mut self.levels, &mut self.last_levels);
        self.last = Some(image.clone());
    }
}

/// `part / whole`; 0 of nothing.
pub(crate) fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 {
        0.0
    } else {
        part as f64 / whole as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{Actuator, Coordinates};
    use taxel_skin::Layout;

    fn image(actuators: &[(u16, u16, u16)]) -> TactileImage {
        let actuators = actuators.iter().map(|&(id, x, y)| Actuator {
            id,
            x,
            y,
            level: 1,
            force: 1.0,
        });
        TactileImage {
            width: 16,
            height: 16,
            actuators: actuators.collect(),
            ..TactileImage::default()
        }
    }

    fn plane(side: u16) -> Plane {
        Plane::new(&Layout::grid(side, side).unwrap(), Coordinates::Pixels).unwrap()
    }

    #[test]
    fn a_jump_is_the_same_id_more_than_two_pixels_away() {
        let plane = plane(16);
        for (name, before, after, kept, jumps) in [
            ("still", &[(0, 3, 3)][..], &[(0, 3, 3)][..], 1, 0),
            ("two pixels are no jump", &[(0, 3, 3)], &[(0, 5, 3)], 1, 0),
            ("two and two diagonally are", &[(0, 3, 3)], &[(0, 5, 5)], 1, 1),
            (
                "places swapped",
                &[(0, 0, 0), (1, 9, 0)],
                &[(0, 9, 0), (1, 0, 0)],
                2,
                2,
            ),
            ("another id at the same place", &[(0, 3, 3)], &[(1, 3, 3)], 0, 0),
            (
                "one comes, one goes, one stays",
                &[(0, 0, 0), (1, 5, 5)],
                &[(1, 5, 5), (2, 9, 9)],
                1,
                0,
            ),
            ("no contact before", &[], &[(0, 3, 3)], 0, 0),
            ("no contact after", &[(0, 3, 3)], &[], 0, 0),
        ] {
            let mut tally = Tally::default();
            tally.add(&image(before), &plane, &[], &[]);
            tally.add(&image(after), &plane, &[], &[]);
            assert_eq!((tally.kept, tally.jumps), (kept, jumps), "{name}");
        }
    }

    #[test]
    fn a_jump_is_farther_on_a_skin_of_more_taxels() {
        let plane = plane(32);
        let mut tally = Tally::default();
        for x in [0, 4, 9] {
            tally.add(&image(&[(0, x, 3)]), &plane, &[], &[]);
        }
        assert_eq!((tally.kept, tally.jumps), (2, 1));
    }

    #[test]
    fn a_level_changes_where_a_taxel_stays_in_contact() {
        let (plane, mut tally) = (plane(16), Tally::default());
        let image = image(&[(0, 0, 0)]);
        tally.add(&image, &plane, &[[0, 0], [1, 0], [2, 0]], &[0, 1, 1]);
        tally.add(&image, &plane, &[[1, 0], [2, 0], [3, 0]], &[1, 0, 4]);
        assert_eq!((tally.touched, tally.level_changes), (2, 1));
    }

    #[test]
    fn an_empty_image_in_between_breaks_the_comparison() {
        let (plane, mut tally) = (plane(16), Tally::default());
        for actuators in [&[(0, 0, 0)][..], &[], &[(0, 9, 9)]] {
            tally.add(&image(actuators), &plane, &[], &[]);
        }
        assert_eq!(tally.kept, 0);
    }
}
