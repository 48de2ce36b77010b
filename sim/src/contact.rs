//! What touches the skin: a footprint, a force over time, and what that does to each taxel under it.

use crate::clock::Keyframes;

/// Shear that a pressed taxel feels away from the middle of the contact, per unit of pressure, at
/// the rim of the footprint: the elastomer bulges outwards. About a tenth of z in the recordings.
const BULGE: f64 = 0.15;

/// One thing that touches the skin, its places still names.
#[derive(Debug, Clone)]
pub(crate) struct Contact {
    /// Line of the scene file.
    pub(crate) line: u32,
    /// Modules, parts, or `all`.
    pub(crate) on: Vec<String>,
    pub(crate) shape: Shape,
    pub(crate) footprint: Footprint,
    /// Radius of the footprint; half the width of an edge; in pixels or shares, as the footprint.
    pub(crate) radius: f64,
    /// Counts of z on a taxel of nominal gain under the middle of the contact.
    pub(crate) force: Keyframes<1>,
    /// Counts of x and y there.
    pub(crate) shear: Option<Keyframes<2>>,
}

/// How pressure falls off from the middle of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Shape {
    /// Hertz's pressure under a ball, `sqrt(1 - r^2)`, r in radii.
    Sphere,
    /// A ball felt through thick elastomer, `(1 - r^2)^2`: smooth at the rim.
    Bump,
    /// A flat punch: 1 inside the radius.
    Flat,
    /// A straight edge through the middle: falls off linearly to both sides.
    Edge {
        /// Unit vector along the edge.
        along: [f64; 2],
    },
}

/// Where the middle of a contact is.
#[derive(Debug, Clone)]
pub(crate) enum Footprint {
    /// In the middle of each place named, pixels.
    Middle,
    /// Pixels from the first column and row of each place named.
    Pixels(Keyframes<2>),
    /// Shares of the width and height of each place named, 0 to 1, so that it fits any hand.
    Shares(Keyframes<2>),
}

/// A contact as one taxel sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seat {
    /// Index of the contact in the scene.
    pub(crate) contact: u16,
    /// The taxel's place, pixels from the first column and row of the place named.
    pub(crate) place: [f64; 2],
    /// From the first to the last pixel of the place named, for [`Footprint::Middle`] and
    /// [`Footprint::Shares`].
    pub(crate) extent: [f64; 2],
}

impl Seat {
    /// Pixels that a radius of 1 is, where it is given as a share: the side of a square as large as
    /// the place.
    fn side(&self) -> f64 {
        let [w, h] = self.extent.map(|side| side.max(1.0));
        (w * h).sqrt()
    }
}

impl Contact {
    /// What the contact does to a taxel of nominal gain at a time of the scene: counts of x, y, z.
    /// Pressing raises z, since uSkin boards are tuned so that z idles low and has head-room
    /// (docs/protocols.md, "uSkin values").
    pub(crate) fn on_taxel(&self, seat: &Seat, scene_ns: u64) -> [f64; 3] {
        let [force] = self.force.at(scene_ns);
        let shear = self.shear.as_ref().map_or([0.0; 2], |s| s.at(scene_ns));
        if force <= 0.0 {
            return [0.0; 3];
        }
        let [w, h] = seat.extent;
        let (middle, radius) = match &self.footprint {
            Footprint::Middle => ([w / 2.0, h / 2.0], self.radius),
            Footprint::Pixels(path) => (path.at(scene_ns), self.radius),
            Footprint::Shares(path) => {
                let [x, y] = path.at(scene_ns);
                ([x * w, y * h], self.radius * seat.side())
            }
        };
        let away: [f64; 2] = std::array::from_fn(|i| (seat.place[i] - middle[i]) / radius);
        let share = self.shape.share(away);
        let bulge = match self.shape {
            Shape::Sphere | Shape::Bump => BULGE * force * share,
            Shape::Flat | Shape::Edge { .. } => 0.0,
        };
        [
            shear[0] * share + bulge * away[0],
            shear[1] * share + bulge * away[1],
            force * share,
        ]
    }
}

impl Shape {
    /// Pressure relative to the middle, 0 to 1, at a distance given in radii.
    fn share(self, [x, y]: [f64; 2]) -> f64 {
        let left = 1.0 - (x * x + y * y);
        match self {
            Shape::Sphere if left > 0.0 => left.sqrt(),
            Shape::Bump if left > 0.0 => left * left,
            Shape::Flat if left >= 0.0 => 1.0,
            Shape::Edge { along } => {
                let off = (x * along[1] - y * along[0]).abs();
                if off < 1.0 { 1.0 - off } else { 0.0 }
            }
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pressure_falls_off_as_each_shape_says() {
        let edge = Shape::Edge { along: [1.0, 0.0] };
        let cases = [
            (Shape::Sphere, [0.0, 0.0], 1.0),
            (Shape::Sphere, [0.6, 0.0], 0.8),
            (Shape::Sphere, [0.8, 0.8], 0.0),
            (Shape::Bump, [0.0, 0.0], 1.0),
            (Shape::Bump, [0.5, 0.5], 0.25),
            (Shape::Bump, [1.0, 0.0], 0.0),
            (Shape::Flat, [1.0, 0.0], 1.0),
            (Shape::Flat, [1.0, 0.1], 0.0),
            (edge, [5.0, 0.0], 1.0),
            (edge, [5.0, 0.25], 0.75),
            (edge, [0.0, -1.5], 0.0),
        ];
        for (shape, [x, y], share) in cases {
            let got = shape.share([x, y]);
            assert!((got - share).abs() < 1e-12, "{shape:?} at {x}, {y}: {got}");
        }
    }
}
