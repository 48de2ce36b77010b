//! A section through the forearm, and a finger that lies against it.

use std::f64::consts::PI;
use taxel_gripper::FiveBar;

/// Girth at wrist and elbow, mm: mean wrist and forearm girth of 252 men (Penrose, Nelson and Fisher, 1985).
const GIRTH_MM: [f64; 2] = [182.0, 287.0];
/// Width by height of the section, at wrist and elbow. An assumption.
const ASPECT: [f64; 2] = [1.45, 1.15];
/// Tissue that a finger presses together, at wrist and elbow, and its modulus. The thickness at the wrist is an
/// assumption: 5 mm to the bone on either side. The other two and [`PIVOT_MM`] are fitted to the mean angles of the
/// publication's squeezes at 13 places and six levels of PWM, and to nothing else; what muscle and skin are made of they do not
/// say.
const TISSUE_MM: [f64; 2] = [10.0, 53.4];
const TISSUE_KPA: f64 = 29.5;
/// From the middle of the third finger to the pivots of the two that close, mm.
const PIVOT_MM: f64 = 36.9;
/// What a motor gives at full PWM, N m: the stall torque of an XM430-W210 at 12 V, by its data sheet.
pub(crate) const STALL_NM: f64 = 3.0;
/// A finger presses at this distance from its pivot, on this area. Assumptions; only their product with the modulus
/// shows.
const LEVER_M: f64 = 0.06;
const AREA_M2: f64 = 900e-6;
/// Half the thickness of a finger, mm: `w / 2` of the publication's Table 2.
const HALF_FINGER_MM: f64 = 5.0;

/// Between the value at the wrist and that at the elbow. A little beyond both, since the sensor is.
pub(crate) fn along([wrist, elbow]: [f64; 2], location: f64) -> f64 {
    wrist + (elbow - wrist) * location
}

/// An ellipse that rests on the third finger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Section {
    location: f64,
    /// Half the width.
    pub(crate) wide_mm: f64,
    /// Half the height.
    pub(crate) high_mm: f64,
}

impl Section {
    /// At a location, 0 at the wrist and 1 at the elbow.
    pub(crate) fn at(location: f64) -> Self {
        let (girth, aspect) = (along(GIRTH_MM, location), along(ASPECT, location));
        // Ramanujan's girth of an ellipse (1914): pi (3 (A + B) - sqrt((3 A + B) (A + 3 B))), with A = aspect B.
        let root = ((3.0 * aspect + 1.0) * (aspect + 3.0)).sqrt();
        let high_mm = girth / (PI * (3.0 * (aspect + 1.0) - root));
        Self {
            location,
            wide_mm: aspect * high_mm,
            high_mm,
        }
    }

    /// The section under what the tissue holds against a finger, N m at the finger's pivot.
    ///
    /// The stress is `T / (lever area)`; tissue gives way in proportion to it at first, and stiffens until two thirds of
    /// it are gone: `t sigma / (E + 1.5 sigma)`.
    fn pressed(self, torque_nm: f64) -> Self {
        let stress_kpa = torque_nm / (LEVER_M * AREA_M2) / 1000.0;
        let less = along(TISSUE_MM, self.location) * stress_kpa / (TISSUE_KPA + 1.5 * stress_kpa);
        Self {
            wide_mm: self.wide_mm - less,
            high_mm: self.high_mm - less,
            ..self
        }
    }

    /// The angle of the proximal phalanx, rad, at which the distal one, bent by `passive_rad`, lies against the section.
    ///
    /// The ellipse's centre is above the third finger by its half height; the finger's joint is at
    /// `(W + a cos theta_u, a sin theta_u)`; the phalanx is a tangent where the centre is as far from its line as the
    /// ellipse's support in that direction, and half a finger more. The finger comes from outside, so that it is the
    /// first such angle.
    pub(crate) fn touched_rad(self, passive_rad: f64, torque_nm: f64) -> f64 {
        let Self { wide_mm, high_mm, .. } = self.pressed(torque_nm);
        let a_mm = FiveBar::FINGER.a_mm;
        let room = |proximal_rad: f64| {
            let (sin, cos) = (proximal_rad + passive_rad).sin_cos();
            let centre =
                cos * (high_mm - a_mm * proximal_rad.sin()) + sin * (PIVOT_MM + a_mm * proximal_rad.cos());
            centre - (wide_mm * sin).hypot(high_mm * cos) - HALF_FINGER_MM
        };
        // At 0 a finger is beside the forearm, at 170 degrees through it.
        let (mut outside, mut inside) = (0.0, 170_f64.to_radians());
        for _ in 0..48 {
            let middle = 0.5 * (outside + inside);
            *(if room(middle) > 0.0 {
                &mut outside
            } else {
                &mut inside
            }) = middle;
        }
        outside
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_girth_is_that_of_the_place() {
        for (location, girth) in [(0.0, 182.0), (0.5, 234.5), (1.0, 287.0)] {
            let section = Section::at(location);
            // The ellipse in ten thousand straight lines.
            let point = |n: i32| {
                let angle = 2.0 * PI * f64::from(n) / 10_000.0;
                [section.wide_mm * angle.cos(), section.high_mm * angle.sin()]
            };
            let around: f64 = (0..10_000)
                .map(|n| {
                    let ([ax, ay], [bx, by]) = (point(n), point(n + 1));
                    (ax - bx).hypot(ay - by)
                })
                .sum();
            assert!((around - girth).abs() < 0.01, "{around}");
        }
    }

    #[test]
    fn a_phalanx_touches_the_section_and_is_nowhere_in_it() {
        for location in [0.0, 0.3, 0.7, 1.0] {
            for torque_nm in [0.0, 0.3, 1.4] {
                let passive_rad = 42_f64.to_radians();
                let section = Section::at(location);
                let angle = section.touched_rad(passive_rad, torque_nm);
                let pressed = section.pressed(torque_nm);
                let (sin, cos) = (angle + passive_rad).sin_cos();
                let joint = [PIVOT_MM + 40.0 * angle.cos(), 40.0 * angle.sin()];
                let least = (0..3600)
                    .map(|n| {
                        let around = PI * f64::from(n) / 1800.0;
                        let x = pressed.wide_mm * around.cos() - joint[0];
                        let y = pressed.high_mm + pressed.high_mm * around.sin() - joint[1];
                        cos * y - sin * x
                    })
                    .fold(f64::INFINITY, f64::min);
                assert!(
                    (least - HALF_FINGER_MM).abs() < 0.01,
                    "{location} {torque_nm}: {least}"
                );
            }
        }
    }
}
