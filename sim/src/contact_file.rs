//! A contact as a scene file has it, and the checks it goes through.

use crate::clock::{Keyframes, ns_of_seconds};
use crate::contact::{Contact, Footprint, Shape};
use crate::levels::Levels;
use serde::Deserialize;
use taxel_hand::WholeList;

/// The keys of a `[[contact]]`. Which go together is checked afterwards, so that the message can say so.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ContactToml {
    shape: ShapeToml,
    on: Vec<String>,
    #[serde(default, deserialize_with = "WholeList::read")]
    at: Option<[f64; 2]>,
    #[serde(default, deserialize_with = "WholeList::read")]
    path: Option<Vec<[f64; 3]>>,
    #[serde(default, deserialize_with = "WholeList::read")]
    at_share: Option<[f64; 2]>,
    #[serde(default, deserialize_with = "WholeList::read")]
    path_share: Option<Vec<[f64; 3]>>,
    radius: Option<f64>,
    radius_share: Option<f64>,
    #[serde(default, deserialize_with = "WholeList::read")]
    along: Option<[f64; 2]>,
    #[serde(default, deserialize_with = "WholeList::read")]
    force_n: Option<Vec<[f64; 2]>>,
    #[serde(default, deserialize_with = "WholeList::read")]
    force_counts: Option<Vec<[f64; 2]>>,
    #[serde(default, deserialize_with = "WholeList::read")]
    shear_n: Option<Vec<[f64; 3]>>,
}

#[derive(Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum ShapeToml {
    Sphere,
    Bump,
    Flat,
    Edge,
}

impl ContactToml {
    pub(crate) fn check(self, line: u32, length_ns: u64, levels: Levels) -> Result<Contact, String> {
        if self.on.is_empty() {
            return Err("`on` names no place; name modules, parts of the hand, or \"all\"".into());
        }
        let shape = match (self.shape, self.along) {
            (ShapeToml::Sphere, None) => Shape::Sphere,
            (ShapeToml::Bump, None) => Shape::Bump,
            (ShapeToml::Flat, None) => Shape::Flat,
            (ShapeToml::Edge, along) => {
                let [x, y] = along.unwrap_or([1.0, 0.0]);
                let length = (x * x + y * y).sqrt();
                if !(length > 0.0 && length.is_finite()) {
                    return Err(format!("`along` is [{x}, {y}]; it must be a direction"));
                }
                Shape::Edge {
                    along: [x / length, y / length],
                }
            }
            (_, Some(_)) => return Err("only an edge has `along`".into()),
        };
        let in_shares = self.at_share.is_some() || self.path_share.is_some() || self.radius_share.is_some();
        let in_pixels = self.at.is_some() || self.path.is_some() || self.radius.is_some();
        if in_pixels && in_shares {
            return Err("a contact is given in pixels or in shares, not in both".into());
        }
        if self.at.is_some() && self.path.is_some() || self.at_share.is_some() && self.path_share.is_some() {
            return Err("a contact rests `at` a place or follows a `path`, not both".into());
        }
        let usual = if in_shares { 0.4 } else { 2.0 };
        let radius = self.radius.or(self.radius_share).unwrap_or(usual);
        if !(0.01..=1e6).contains(&radius) {
            return Err(format!("the radius is {radius}; it must be 0.01 to 1000000"));
        }
        let path = |name: &str, path: Vec<[f64; 3]>| {
            let frames = path.into_iter().map(|[t, x, y]| (t, [x, y]));
            keyframes(name, frames.collect(), length_ns)
        };
        let rest = |name: &str, at: [f64; 2]| keyframes(name, vec![(0.0, at)], length_ns);
        let footprint = match (self.at, self.path, self.at_share, self.path_share) {
            (Some(at), ..) => Footprint::Pixels(rest("at", at)?),
            (_, Some(way), ..) => Footprint::Pixels(path("path", way)?),
            (_, _, Some(at), _) => Footprint::Shares(rest("at_share", at)?),
            (.., Some(way)) => Footprint::Shares(path("path_share", way)?),
            _ if in_shares => Footprint::Shares(rest("at_share", [0.5, 0.5])?),
            _ => Footprint::Middle,
        };
        let scaled =
            |frames: Vec<[f64; 2]>, scale: f64| frames.into_iter().map(|[t, f]| (t, [f * scale])).collect();
        let force = match (self.force_n, self.force_counts) {
            (Some(f), None) => keyframes("force_n", scaled(f, levels.counts_per_newton()[2]), length_ns)?,
            (None, Some(f)) => keyframes("force_counts", scaled(f, 1.0), length_ns)?,
            _ => {
                return Err(
                    "a contact needs its force over time, `force_n` or `force_counts`: [[seconds, force], ...]".into(),
                );
            }
        };
        let shear = self.shear_n.map(|frames| {
            let [sx, sy, _] = levels.counts_per_newton();
            let counts = frames.into_iter().map(|[t, x, y]| (t, [x * sx, y * sy]));
            keyframes("shear_n", counts.collect(), length_ns)
        });
        let shear = shear.transpose()?;
        Ok(Contact {
            line,
            on: self.on,
            shape,
            footprint,
            radius,
            force,
            shear,
        })
    }
}

/// Checks keyframes given in seconds: in rising order, within the scene, finite.
fn keyframes<const N: usize>(
    name: &str,
    frames: Vec<(f64, [f64; N])>,
    length_ns: u64,
) -> Result<Keyframes<N>, String> {
    if frames.is_empty() {
        return Err(format!("`{name}` is empty; it needs at least one keyframe"));
    }
    let mut checked: Vec<(u64, [f64; N])> = Vec::with_capacity(frames.len());
    for (seconds, value) in frames {
        if !(seconds >= 0.0 && seconds <= length_ns as f64 / 1e9) {
            return Err(format!(
                "`{name}` has a keyframe at {seconds} s; the scene lasts {} s",
                length_ns as f64 / 1e9
            ));
        }
        if let Some(v) = value.iter().find(|v| v.is_nan() || v.abs() > 1e9) {
            return Err(format!(
                "`{name}` is {v} at {seconds} s; that is not a usable number"
            ));
        }
        let t_ns = ns_of_seconds(seconds);
        if checked.last().is_some_and(|(before, _)| *before >= t_ns) {
            return Err(format!(
                "`{name}`: the keyframe at {seconds} s is not after the one before it"
            ));
        }
        checked.push((t_ns, value));
    }
    Ok(Keyframes::new(checked))
}
