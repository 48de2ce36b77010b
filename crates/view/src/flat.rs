//! A hand laid flat: where its taxels are drawn.

use std::ops::Deref;
use taxel_hand::Geometry;

/// A hand and how it is laid flat.
#[derive(Debug, Clone, PartialEq)]
pub struct Hand {
    geometry: Geometry,
    pub(crate) flat: Flat,
}

impl Hand {
    pub(crate) fn new(geometry: Geometry) -> Self {
        Self {
            flat: Flat::of(&geometry),
            geometry,
        }
    }
}

impl Deref for Hand {
    type Target = Geometry;

    fn deref(&self) -> &Geometry {
        &self.geometry
    }
}

/// Gaps between patches of skin that a drawing may have, in distances of taxels, widest first. The hand's own
/// are wider: fingers are drawn side by side, and not as far apart as they are.
const GAPS: [f32; 3] = [1.0, 0.5, 0.0];
/// Places nearer than this, in distances of taxels, are one.
const SAME: f32 = 0.05;

/// Where taxels are along one axis, in distances of neighbouring taxels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Axis {
    /// By taxel, 0 or more.
    pub(crate) places: Vec<f32>,
    /// From the first taxel's edge to the last one's.
    pub(crate) length: f32,
    /// Between patches, at most.
    pub(crate) gap: f32,
}

/// A hand laid flat, with gaps of several widths.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Flat {
    /// With wide, narrow and no gaps between columns.
    pub(crate) across: [Axis; 3],
    /// For each of these, with wide, narrow and no gaps between rows.
    pub(crate) down: [[Axis; 3]; 3],
}

/// Taxels that keep their places to each other: a module, or modules that reach into each other.
struct Patch {
    part: String,
    taxels: Vec<usize>,
    /// Edges along each axis.
    from: [f32; 2],
    to: [f32; 2],
}

impl Flat {
    /// From the taxels' positions on the hand; from their pixels where the layout has none, or where positions seen
    /// from above would hide taxels behind each other.
    pub(crate) fn of(hand: &Geometry) -> Self {
        let places = positions(hand).unwrap_or_else(|| pixels(hand));
        let patches = patches(hand, &places);
        let across =
            GAPS.map(|gap| pushed_together(&patches, &places, 0, gap, |patch| (patch.from[1], patch.to[1])));
        let down = std::array::from_fn(|width| {
            let columns = |patch: &Patch| {
                let first = patch.taxels[0];
                let from = across[width].places[first] - (places[first][0] - patch.from[0]);
                (from, from + patch.to[0] - patch.from[0])
            };
            GAPS.map(|gap| pushed_together(&patches, &places, 1, gap, columns))
        });
        Self { across, down }
    }
}

/// The patches of a hand, those that reach into each other as one.
fn patches(hand: &Geometry, places: &[[f32; 2]]) -> Vec<Patch> {
    let mut patches: Vec<Patch> = Vec::new();
    for module in hand.modules.iter().filter(|module| module.taxels > 0) {
        let taxels: Vec<usize> = module
            .taxel_range()
            .filter(|taxel| *taxel < places.len())
            .collect();
        let edge = |axis: usize, of: fn(f32, f32) -> f32| {
            taxels
                .iter()
                .map(|taxel| places[*taxel][axis])
                .reduce(of)
                .unwrap_or(0.0)
        };
        let mut patch = Patch {
            part: module.part.clone(),
            from: [edge(0, f32::min), edge(1, f32::min)],
            to: [edge(0, f32::max) + 1.0, edge(1, f32::max) + 1.0],
            taxels,
        };
        while let Some(other) = patches
            .iter()
            .position(|other| (0..2).all(|axis| overlap(other, &patch, axis)))
        {
            let other = patches.swap_remove(other);
            for axis in 0..2 {
                patch.from[axis] = patch.from[axis].min(other.from[axis]);
                patch.to[axis] = patch.to[axis].max(other.to[axis]);
            }
            patch.taxels.extend(other.taxels);
        }
        patches.push(patch);
    }
    patches
}

fn overlap(a: &Patch, b: &Patch, axis: usize) -> bool {
    a.from[axis] + SAME < b.to[axis] && b.from[axis] + SAME < a.to[axis]
}

/// Moves patches along an axis towards 0, until those that are beside each other, by `beside`, are `gap` apart or as
/// far as they were. Patches of a part that begin at one place do so afterwards.
fn pushed_together(
    patches: &[Patch],
    places: &[[f32; 2]],
    axis: usize,
    gap: f32,
    beside: impl Fn(&Patch) -> (f32, f32),
) -> Axis {
    let mut order: Vec<&Patch> = patches.iter().collect();
    order.sort_by(|a, b| {
        a.from[axis]
            .total_cmp(&b.from[axis])
            .then_with(|| a.part.cmp(&b.part))
    });
    let spans: Vec<(f32, f32)> = order.iter().map(|patch| beside(patch)).collect();
    let mut begins = vec![0.0f32; order.len()];
    let mut first = 0;
    while first < order.len() {
        let is_level = |other: &&&Patch| {
            other.part == order[first].part && other.from[axis] - order[first].from[axis] < SAME
        };
        let level = order[first..].iter().take_while(is_level).count();
        let mut begin = 0.0f32;
        for patch in first..first + level {
            for other in 0..first {
                let apart = order[patch].from[axis] - order[other].to[axis];
                let meets = spans[other].0 + SAME < spans[patch].1 && spans[patch].0 + SAME < spans[other].1;
                if meets && apart > -SAME {
                    let length = order[other].to[axis] - order[other].from[axis];
                    begin = begin.max(begins[other] + length + apart.clamp(0.0, gap));
                }
            }
        }
        begins[first..first + level].fill(begin);
        first += level;
    }
    let mut axis_places = vec![0.0; places.len()];
    let mut length = 1.0f32;
    for (patch, begin) in order.iter().zip(&begins) {
        for taxel in &patch.taxels {
            axis_places[*taxel] = begin + places[*taxel][axis] - patch.from[axis];
        }
        length = length.max(begin + patch.to[axis] - patch.from[axis]);
    }
    Axis {
        places: axis_places,
        length,
        gap,
    }
}

/// Positions in distances of neighbouring taxels.
fn positions(hand: &Geometry) -> Option<Vec<[f32; 2]>> {
    let places: Option<Vec<[f32; 2]>> = (hand.taxels.iter())
        .map(|taxel| taxel.position_mm.map(|[x, y, _]| [x, y]))
        .collect();
    let places = places?;
    let mut nearest: Vec<f32> = hand
        .modules
        .iter()
        .filter_map(|module| places.get(module.taxel_range()))
        .flat_map(|module| {
            module.iter().filter_map(move |a| {
                let others = module.iter().filter(move |b| !std::ptr::eq(a, *b));
                others
                    .map(|b| (a[0] - b[0]).hypot(a[1] - b[1]))
                    .min_by(f32::total_cmp)
            })
        })
        .collect();
    nearest.sort_by(f32::total_cmp);
    let pitch = *nearest.get(nearest.len() / 2)?;
    let hidden = nearest.first().is_some_and(|least| *least < 0.5 * pitch);
    (pitch.is_finite() && pitch > 0.0 && !hidden)
        .then(|| places.iter().map(|place| place.map(|mm| mm / pitch)).collect())
}

/// Columns and rows of the image, with a gap where a part of the hand begins.
fn pixels(hand: &Geometry) -> Vec<[f32; 2]> {
    let mut edges: Vec<u16> = parts(hand).iter().map(|part| part.columns.0).collect();
    edges.sort_unstable();
    edges.dedup();
    let before = |x: u16| edges.iter().skip(1).filter(|edge| **edge <= x).count();
    hand.taxels
        .iter()
        .map(|taxel| [f32::from(taxel.x) + before(taxel.x) as f32, f32::from(taxel.y)])
        .collect()
}

/// A part of the hand.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Part<'a> {
    pub(crate) name: &'a str,
    pub(crate) taxels: Vec<usize>,
    /// First and last column of the image.
    pub(crate) columns: (u16, u16),
}

/// The parts of the hand, in the order of their taxels.
pub(crate) fn parts(hand: &Geometry) -> Vec<Part<'_>> {
    let mut parts: Vec<Part<'_>> = Vec::new();
    for (number, taxel) in hand.taxels.iter().enumerate() {
        let name = hand.modules[usize::from(taxel.module)].part.as_str();
        match parts.iter_mut().find(|part| part.name == name) {
            Some(part) => {
                part.taxels.push(number);
                part.columns = (part.columns.0.min(taxel.x), part.columns.1.max(taxel.x));
            }
            None => parts.push(Part {
                name,
                taxels: vec![number],
                columns: (taxel.x, taxel.x),
            }),
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::Layout;

    #[test]
    fn fingers_are_side_by_side_and_never_wider_apart_than_a_taxel() {
        let hand = Layout::builtin("allegro-uskin-15").unwrap();
        let flat = Flat::of(&hand);
        for axis in [&flat.across, &flat.down[0], &flat.down[2]] {
            for wide in axis {
                let length = 16.0 + 3.0 * wide.gap;
                assert!((wide.length - length).abs() < 1e-3, "{} {length}", wide.length);
            }
        }
        let at = |x, y| hand.taxel_at(x, y).unwrap();
        let (left, right) = (at(3, 0), at(4, 0));
        let places = &flat.across[0].places;
        assert!((places[right] - places[left] - 2.0).abs() < 1e-3);
    }

    #[test]
    fn no_two_taxels_of_a_built_in_hand_are_in_one_place() {
        for name in Layout::builtin_names() {
            let hand = Layout::builtin(name).unwrap();
            let flat = Flat::of(&hand);
            for (across, down) in flat
                .across
                .iter()
                .zip(&flat.down)
                .flat_map(|(a, d)| d.iter().map(move |d| (a, d)))
            {
                for a in 0..hand.len() {
                    for b in 0..a {
                        let apart = |axis: &Axis| (axis.places[a] - axis.places[b]).abs();
                        let apart = apart(across).hypot(apart(down));
                        assert!(apart > 0.9, "{name}: {a} and {b} are {apart} apart");
                    }
                }
            }
        }
    }

    #[test]
    fn a_palm_is_below_the_fingers_in_one_row() {
        let hand = Layout::builtin("allegro-xela-18").unwrap();
        let flat = Flat::of(&hand);
        for down in flat.down.iter().flatten() {
            let row = |module: usize| down.places[hand.modules[module].taxel_range().start];
            let palm: Vec<usize> = (0..18)
                .filter(|module| hand.modules[*module].part == "palm")
                .collect();
            let lowest = (0..18)
                .filter(|module| !palm.contains(module))
                .map(row)
                .fold(0.0, f32::max);
            for module in &palm {
                assert_eq!(row(*module), row(palm[0]));
                assert!(row(*module) >= lowest + 4.0, "{} {lowest}", row(*module));
            }
        }
    }

    #[test]
    fn a_hand_without_positions_is_drawn_as_its_image() {
        let hand = Layout::resolve("grid:3x5").unwrap();
        let flat = Flat::of(&hand);
        assert_eq!((flat.across[0].length, flat.down[0][0].length), (5.0, 3.0));
    }
}
