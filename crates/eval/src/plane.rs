//! Where taxels are, in the coordinates in which a display's actuators are placed.

use taxel_hand::{Coordinates, ProfileError, Taxel};
use taxel_skin::Layout;

/// A move beyond this is a jump, in distances of neighbouring taxels: two on a hand of up to 256, an eighth of the side of
/// 16 x 16. On a skin of more and smaller taxels it is the same share of the side of a square of them: two taxels are no
/// distance there.
fn jump_taxels(taxels: usize) -> f64 {
    2.0 * ((taxels as f64).sqrt() / 16.0).max(1.0)
}

/// The image, or the hand laid flat.
#[derive(Debug, Clone)]
pub struct Plane {
    width: usize,
    /// Of the taxel of each pixel.
    places: Vec<[f64; 2]>,
    /// Where distances are in pixels, or else in millimetres.
    pub coordinates: Coordinates,
    /// A move beyond this is a jump: of two pixels, or of two [distances of neighbouring taxels], and of more on a hand of
    /// more than 256 taxels.
    ///
    /// [distances of neighbouring taxels]: taxel_hand::Geometry::neighbour_distance_mm
    pub jump: f64,
}

impl Plane {
    /// # Errors
    ///
    /// Where a taxel's place on the hand is wanted and not known.
    pub(crate) fn new(layout: &Layout, coordinates: Coordinates) -> Result<Self, ProfileError> {
        let place = |(taxel, t): (usize, &Taxel)| match (coordinates, t.position_mm) {
            (Coordinates::Pixels, _) => Ok([t.x, t.y].map(f64::from)),
            (Coordinates::Hand, Some([x, y, _])) => Ok([x, y].map(f64::from)),
            (Coordinates::Hand, None) => Err(ProfileError::NoPosition { taxel }),
        };
        let width = usize::from(layout.width);
        let mut places = vec![[0.0; 2]; width * usize::from(layout.height)];
        for (n, taxel) in layout.taxels.iter().enumerate() {
            places[usize::from(taxel.y) * width + usize::from(taxel.x)] = place((n, taxel))?;
        }
        let mut plane = Self {
            width,
            places,
            coordinates,
            jump: jump_taxels(layout.len()),
        };
        if coordinates == Coordinates::Hand {
            plane.jump *= layout.neighbour_distance_mm().unwrap_or(1.0);
        }
        Ok(plane)
    }

    /// What distances are in.
    pub fn unit(&self) -> &'static str {
        match self.coordinates {
            Coordinates::Pixels => "px",
            Coordinates::Hand => "mm",
        }
    }

    /// Where the taxel of a pixel is.
    pub(crate) fn at(&self, [x, y]: [u16; 2]) -> [f64; 2] {
        self.places[usize::from(y) * self.width + usize::from(x)]
    }
}

pub(crate) fn squared_distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    dx * dx + dy * dy
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_is_the_same_share_of_a_skin_of_more_taxels() {
        assert_eq!([1, 240, 256, 1024].map(jump_taxels), [2.0, 2.0, 2.0, 4.0]);
    }

    #[test]
    fn a_hand_laid_flat_is_in_millimetres() {
        let layout = Layout::builtin("uskin-module").unwrap();
        let image = Plane::new(&layout, Coordinates::Pixels).unwrap();
        let hand = Plane::new(&layout, Coordinates::Hand).unwrap();
        let pitch = hand.jump / image.jump;
        assert_eq!([image.unit(), hand.unit()], ["px", "mm"]);
        assert_eq!(image.at([2, 1]), [2.0, 1.0]);
        let apart = squared_distance(hand.at([0, 0]), hand.at([1, 0])).sqrt();
        assert!((apart - pitch).abs() < 1e-6 && pitch > 2.0, "{apart} and {pitch}");
        let triangle = Layout::builtin("cyskin-triangle").unwrap();
        let apart = Plane::new(&triangle, Coordinates::Hand).unwrap().jump / 2.0;
        assert!(
            (apart - 7.5).abs() < 0.1,
            "no two side by side in the image: {apart}"
        );
        let unplaced = Plane::new(&Layout::grid(2, 2).unwrap(), Coordinates::Hand);
        assert!(matches!(unplaced, Err(ProfileError::NoPosition { taxel: 0 })));
    }
}
