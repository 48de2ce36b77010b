//! What changes from one image to the next.

use taxel_hand::TactileImage;

/// A move beyond this is a jump, pixels: two on a hand of up to 256 taxels, an eighth of the side of 16 x 16. On a skin
/// of more and smaller taxels it is the same share of the side of a square of them: two taxels are no distance there.
pub fn jump_px(taxels: usize) -> f64 {
    2.0 * ((taxels as f64).sqrt() / 16.0).max(1.0)
}

/// Counts how actuators move and levels change between consecutive images, both of which have contacts.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// A move beyond this is a jump, pixels.
    jump_px: f64,
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
    /// For images of a hand of so many taxels, [`jump_px`].
    pub(crate) fn new(taxels: usize) -> Self {
        Self {
            jump_px: jump_px(taxels),
            ..Self::default()
        }
    }

    /// The next image, and the pixel and level (from 0) of each of its contacts.
    pub(crate) fn add(&mut self, image: &TactileImage, pixel: &[[u16; 2]], level: &[u16]) {
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
                let (dx, dy) = (
                    f64::from(now.x) - f64::from(before.x),
                    f64::from(now.y) - f64::from(before.y),
                );
                let moved = (dx * dx + dy * dy).sqrt();
                self.kept += 1;
                self.jumps += u64::from(moved > self.jump_px);
                self.moved_px += moved;
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
    use taxel_hand::Actuator;

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

    #[test]
    fn a_jump_is_the_same_id_more_than_two_pixels_away() {
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
            let mut tally = Tally::new(256);
            tally.add(&image(before), &[], &[]);
            tally.add(&image(after), &[], &[]);
            assert_eq!((tally.kept, tally.jumps), (kept, jumps), "{name}");
        }
    }

    #[test]
    fn a_jump_is_farther_on_a_skin_of_more_taxels() {
        assert_eq!([1, 240, 256, 1024].map(jump_px), [2.0, 2.0, 2.0, 4.0]);
        let mut tally = Tally::new(1024);
        for x in [0, 4, 9] {
            tally.add(&image(&[(0, x, 3)]), &[], &[]);
        }
        assert_eq!((tally.kept, tally.jumps), (2, 1));
    }

    #[test]
    fn a_level_changes_where_a_taxel_stays_in_contact() {
        let mut tally = Tally::new(256);
        let image = image(&[(0, 0, 0)]);
        tally.add(&image, &[[0, 0], [1, 0], [2, 0]], &[0, 1, 1]);
        tally.add(&image, &[[1, 0], [2, 0], [3, 0]], &[1, 0, 4]);
        assert_eq!((tally.touched, tally.level_changes), (2, 1));
    }

    #[test]
    fn an_empty_image_in_between_breaks_the_comparison() {
        let mut tally = Tally::new(256);
        for actuators in [&[(0, 0, 0)][..], &[], &[(0, 9, 9)]] {
            tally.add(&image(actuators), &[], &[]);
        }
        assert_eq!(tally.kept, 0);
    }
}
