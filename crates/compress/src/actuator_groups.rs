//! Where taxels are for the placement of actuators, and which parts of the hand have how many.

use taxel_hand::{Coordinates, Geometry, Profile, ProfileError, check_range};

/// Place of each taxel in the coordinates of a profile.
pub(crate) fn places(geometry: &Geometry, coordinates: Coordinates) -> Result<Vec<[f64; 2]>, ProfileError> {
    let place = |(taxel, t): (usize, &taxel_hand::Taxel)| match (coordinates, t.position_mm) {
        (Coordinates::Pixels, _) => Ok([f64::from(t.x), f64::from(t.y)]),
        (Coordinates::Hand, Some([x, y, _])) => Ok([f64::from(x), f64::from(y)]),
        (Coordinates::Hand, None) => Err(ProfileError::NoPosition { taxel }),
    };
    geometry.taxels.iter().enumerate().map(place).collect()
}

/// Refuses a place of `fixed` where nothing is ever felt: more than a pixel outside the image, or
/// in millimetres beyond the taxels on every side by more than an actuator's reach (two distances of
/// neighbours). Between taxels, where a finger ends before another one, it may be as in the image.
pub(crate) fn check_fixed(
    geometry: &Geometry,
    profile: &Profile,
    places: &[[f64; 2]],
    reach: f64,
) -> Result<(), ProfileError> {
    let Geometry { width, height, .. } = *geometry;
    let (margin, [from, to]) = match profile.coordinates {
        Coordinates::Pixels => (0.0, [[-1.0; 2], [width, height].map(f64::from)]),
        Coordinates::Hand => (reach, extent(places)),
    };
    let outside = |place: &[f64; 2]| {
        (0..2).any(|axis| !(from[axis] - margin..=to[axis] + margin).contains(&place[axis]))
    };
    let Some(index) = profile.fixed.iter().position(outside) else {
        return Ok(());
    };
    let [x, y] = profile.fixed[index];
    Err(match profile.coordinates {
        Coordinates::Pixels => ProfileError::PlaceOutsideImage {
            index,
            x,
            y,
            width,
            height,
        },
        Coordinates::Hand => ProfileError::PlaceOffHand {
            index,
            x,
            y,
            distance_mm: (places.iter())
                .map(|at| (at[0] - x).hypot(at[1] - y))
                .fold(f64::INFINITY, f64::min),
            from,
            to,
        },
    })
}

/// The least and the greatest coordinates of places.
fn extent(places: &[[f64; 2]]) -> [[f64; 2]; 2] {
    let all = |axis: usize| places.iter().map(move |place| place[axis]);
    [
        [0, 1].map(|axis| all(axis).fold(f64::INFINITY, f64::min)),
        [0, 1].map(|axis| all(axis).fold(f64::NEG_INFINITY, f64::max)),
    ]
}

/// How far an actuator may go between two images without jumping: 2 pixels, or twice the distance of neighbouring taxels.
pub(crate) fn reach(geometry: &Geometry, coordinates: Coordinates) -> f64 {
    match coordinates {
        Coordinates::Pixels => 2.0,
        Coordinates::Hand => 2.0 * geometry.neighbour_distance_mm().unwrap_or(1.0),
    }
}

/// Names of the hand's parts, sorted; a part's number is its place here.
pub(crate) fn parts(geometry: &Geometry) -> Vec<&str> {
    let mut parts: Vec<&str> = geometry.modules.iter().map(|m| m.part.as_str()).collect();
    parts.sort_unstable();
    parts.dedup();
    parts
}

/// Number of actuators of each group of parts, and the group of each part: a part with a budget is
/// a group of its own, in the order of names; the others are one group, the last.
pub(crate) fn groups(geometry: &Geometry, profile: &Profile) -> Result<(Vec<u16>, Vec<usize>), ProfileError> {
    let parts = parts(geometry);
    for (part, &value) in &profile.budgets {
        if !parts.contains(&part.as_str()) {
            return Err(ProfileError::UnknownPart {
                part: part.clone(),
                parts: parts.join(", "),
            });
        }
        check_range("profile: ", "budgets", value, 1.0..=profile.actuators.into(), "")?;
    }
    let others = parts.len() - profile.budgets.len();
    let sum: u32 = profile.budgets.values().map(|budget| u32::from(*budget)).sum();
    let left = u32::from(profile.actuators).checked_sub(sum);
    let Some(left) = left.filter(|left| *left as usize >= others.min(1)) else {
        return Err(ProfileError::BudgetsTooLarge {
            sum,
            actuators: profile.actuators,
            others,
        });
    };
    let mut sizes = Vec::new();
    let mut group_of = Vec::new();
    for part in &parts {
        group_of.push(match profile.budgets.get(*part) {
            Some(budget) => {
                sizes.push(*budget);
                sizes.len() - 1
            }
            None => profile.budgets.len(),
        });
    }
    if others > 0 {
        sizes.push(left as u16);
    }
    Ok((sizes, group_of))
}
