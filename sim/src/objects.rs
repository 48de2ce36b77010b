//! Twenty simple objects of a public set, each grasped and let go: scenes made from a table.
//!
//! Only where an object touches and how hard is modelled. Shapes, sizes and masses: Calli et al., "Benchmarking in
//! Manipulation Research: Using the Yale-CMU-Berkeley Object and Model Set", IEEE Robotics & Automation Magazine 22(3),
//! 2015, table of objects.

use std::fmt::Write;

/// How an object lies in the hand, and the size that is gripped, millimetres.
#[derive(Debug, Clone, Copy)]
enum Shape {
    /// A diameter.
    Ball(f64),
    /// A diameter; it lies across the fingers.
    Cylinder(f64),
    /// A thickness; the fingertips are on a face, the phalanges on its edges.
    Box(f64),
    /// Held by its rim.
    Plate,
    /// A diameter; between thumb, index and middle finger.
    Pen(f64),
}

/// An object: name, what it is, shape, mass in grams.
type Object = (&'static str, &'static str, Shape, f64);

const OBJECTS: [Object; 20] = [
    ("football", "mini soccer ball, 140 mm", Shape::Ball(140.0), 123.0),
    ("softball", "softball, 96 mm", Shape::Ball(96.0), 191.0),
    ("apple", "plastic apple, 75 mm", Shape::Ball(75.0), 68.0),
    ("orange", "plastic orange, 73 mm", Shape::Ball(73.0), 47.0),
    ("tennis-ball", "tennis ball, 65 mm", Shape::Ball(65.0), 58.0),
    ("peach", "plastic peach, 59 mm", Shape::Ball(59.0), 33.0),
    ("lemon", "plastic lemon, 54 mm", Shape::Ball(54.0), 29.0),
    ("plum", "plastic plum, 52 mm", Shape::Ball(52.0), 25.0),
    ("strawberry", "plastic strawberry, 44 mm", Shape::Ball(44.0), 18.0),
    ("golf-ball", "golf ball, 43 mm", Shape::Ball(43.0), 46.0),
    ("tuna-can", "tuna can, 85 mm", Shape::Cylinder(85.0), 171.0),
    ("mug", "mug, 80 mm", Shape::Cylinder(80.0), 118.0),
    ("chips-can", "chips can, 75 mm", Shape::Cylinder(75.0), 205.0),
    ("soup-can", "tomato soup can, 66 mm", Shape::Cylinder(66.0), 349.0),
    ("banana", "plastic banana, 36 mm", Shape::Cylinder(36.0), 66.0),
    (
        "meat-can",
        "potted meat can, 50 mm thick",
        Shape::Box(50.0),
        370.0,
    ),
    ("pudding-box", "pudding box, 35 mm thick", Shape::Box(35.0), 187.0),
    ("gelatin-box", "gelatin box, 28 mm thick", Shape::Box(28.0), 97.0),
    ("plate", "plate, by its rim", Shape::Plate, 279.0),
    ("marker", "large marker, 18 mm", Shape::Pen(18.0), 16.0),
];

/// Friction of skin on these objects, assumed.
const FRICTION: f64 = 0.5;
/// How much harder than it must an object is held.
const MARGIN: f64 = 1.5;
/// What the thumb presses with whatever the mass, since the hand closes by a motion of its own, newtons: assumed,
/// about what the scene `ball-grasp` has.
const LEAST_N: f64 = 25.0;
/// Where the fingers touch one after the other and where they hold, seconds.
const FIRST_S: f64 = 2.2;
const APART_S: f64 = 0.2;
const TIGHT_S: [f64; 2] = [4.0, 5.0];
const LAST_S: f64 = 6.2;

/// One contact, of `[[contact]]`.
struct Contact {
    shape: &'static str,
    on: String,
    /// Pixels.
    at: [f64; 2],
    radius: f64,
    /// Of the whole footprint when it is held, newtons.
    held_n: f64,
    from_s: f64,
    along: Option<[f64; 2]>,
}

/// Names of the objects.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    OBJECTS.iter().map(|(name, ..)| *name)
}

/// The scene of an object as a scene file; none where there is no object of that name.
pub(crate) fn text(name: &str) -> Option<String> {
    let (name, about, shape, mass_g) = OBJECTS.iter().find(|(n, ..)| *n == name)?;
    let mut text = format!(
        "# Made from a table of objects; mass {mass_g} g, held with friction {FRICTION} and {MARGIN} times the least force.\n\
         name = \"{name}\"\nabout = \"Grasps and lets go: {about}, {mass_g} g.\"\nseconds = 7.0\n"
    );
    for contact in contacts(*shape, *mass_g) {
        let Contact {
            shape,
            on,
            at: [x, y],
            radius,
            ..
        } = &contact;
        let (from, [tight, loose]) = (contact.from_s, TIGHT_S);
        let peak = contact.on_a_taxel_n();
        let _ = write!(
            text,
            "\n[[contact]]\nshape = \"{shape}\"\non = [\"{on}\"]\nat = [{x:.2}, {y:.2}]\nradius = {radius:.2}\n\
             force_n = [[{from:.2}, 0.0], [{tight:.2}, {peak:.3}], [{loose:.2}, {peak:.3}], [{:.2}, 0.0]]\n",
            LAST_S - (from - FIRST_S) / 2.0
        );
        if let Some([x, y]) = contact.along {
            let _ = writeln!(text, "along = [{x}, {y}]");
        }
    }
    Some(text)
}

impl Contact {
    /// Force on the taxel in the middle: the whole divided by the taxels that share it.
    fn on_a_taxel_n(&self) -> f64 {
        let r = self.radius;
        let taxels = match self.shape {
            // The integral of (1 - r^2)^2 over a disc; of a triangle over four taxels of an edge; a disc.
            "bump" => std::f64::consts::PI * r * r / 3.0,
            "edge" => 4.0 * r,
            _ => std::f64::consts::PI * r * r,
        };
        self.held_n / taxels.max(1.0)
    }
}

/// Where an object touches the hand. The thumb holds against all fingers together.
fn contacts(shape: Shape, mass_g: f64) -> Vec<Contact> {
    let thumb_n = LEAST_N + MARGIN * mass_g / 1000.0 * 9.81 / (2.0 * FRICTION);
    let fingers: &[&str] = match shape {
        Shape::Pen(_) | Shape::Plate => &["index", "middle"],
        Shape::Ball(size) if size < 50.0 => &["index", "middle"],
        _ => &["index", "middle", "ring"],
    };
    let mut contacts = Vec::new();
    for (number, finger) in ["thumb"].iter().chain(fingers).enumerate() {
        let held_n = if number == 0 {
            thumb_n
        } else {
            thumb_n / fingers.len() as f64
        };
        let from_s = FIRST_S + APART_S * number as f64;
        let mut touch = |shape, phalanx: &str, radius: f64, share: f64, along| {
            contacts.push(Contact {
                shape,
                on: format!("{finger} {phalanx}"),
                // Each finger lies a little differently.
                at: [1.5 + 0.1 * (number as f64 - 1.0), 1.6 - 0.1 * (number % 2) as f64],
                radius,
                held_n: share * held_n,
                // What lies nearer to the palm touches later.
                from_s: if phalanx == "tip" { from_s } else { from_s + 0.5 },
                along,
            });
        };
        let across = Some([1.0, 0.0]);
        match shape {
            Shape::Ball(size) => {
                let radius = footprint(size);
                touch("bump", "tip", radius, if size < 55.0 { 1.0 } else { 0.7 }, None);
                if size >= 55.0 {
                    touch("bump", "distal", radius, 0.3, None);
                }
            }
            Shape::Cylinder(size) => {
                touch("edge", "tip", 0.7 * footprint(size), 0.5, across);
                touch("edge", "distal", 0.7 * footprint(size), 0.3, across);
                if size < 80.0 && *finger != "thumb" {
                    touch("edge", "middle", 0.7 * footprint(size), 0.2, across);
                }
            }
            Shape::Box(size) => {
                touch("flat", "tip", 2.2, 0.8, None);
                if size > 30.0 {
                    touch("edge", "distal", 0.8, 0.2, across);
                }
            }
            Shape::Plate => touch("edge", "tip", 1.1, 1.0, across),
            Shape::Pen(size) => {
                touch("edge", "tip", 0.7 * footprint(size), 0.8, Some([1.0, 0.4]));
                if *finger == "index" {
                    touch("edge", "distal", 0.7 * footprint(size), 0.2, Some([1.0, 0.4]));
                }
            }
        }
    }
    contacts
}

/// Radius of the contact of a round body, pixels: it grows with the cube root of the body's radius (Hertz), and is that of
/// the scene `ball-grasp` for a football.
fn footprint(diameter_mm: f64) -> f64 {
    1.9 * (diameter_mm / 40.0).cbrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scene, Simulator};
    use taxel_skin::Layout;

    #[test]
    fn every_object_touches_the_hand_and_lets_go_and_none_as_another() {
        let mut felt = Vec::new();
        for name in names() {
            let scene = Scene::builtin(name).unwrap();
            let layout = Layout::resolve(scene.layout()).unwrap();
            let hand = Simulator::new(&scene, &layout, 1).unwrap();
            let mut force = vec![0.0; layout.len()];
            for free_s in [0.0, 2.0, 6.5] {
                assert_eq!(
                    hand.truth((free_s * 1e9) as u64, &mut force),
                    0,
                    "{name} at {free_s} s"
                );
            }
            let touched = hand.truth(4_500_000_000, &mut force);
            assert!((8..=200).contains(&touched), "{name}: {touched}");
            // Well above the noise, and below half a turn.
            let strongest = force.iter().copied().fold(0.0, f64::max);
            assert!((300.0..20_000.0).contains(&strongest), "{name}: {strongest}");
            assert!(!felt.contains(&force), "{name}");
            felt.push(force);
        }
        assert_eq!(felt.len(), 20);
    }

    #[test]
    fn what_is_heavier_is_held_harder() {
        let thumb = |name: &str| {
            let (.., shape, mass_g) = OBJECTS.iter().find(|(n, ..)| *n == name).unwrap();
            let all = contacts(*shape, *mass_g);
            all.iter()
                .filter(|c| c.on.starts_with("thumb"))
                .map(|c| c.held_n)
                .sum::<f64>()
        };
        assert!(thumb("soup-can") > thumb("chips-can") && thumb("softball") > thumb("apple"));
        // 349 g, friction 0.5, half as much again, and what the motion presses.
        assert!((thumb("soup-can") * 1.25 - (LEAST_N + 1.5 * 0.349 * 9.81)).abs() < 1e-9);
    }
}
