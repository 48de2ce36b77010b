//! The motions of the publication.

use crate::{Alignment, SequenceError};

/// How a probe touches a place (Scimeca, Maiolino and Iida, section 3.3 and eq. 7): straight down, or turning below the
/// surface about a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// How deep it goes, mm below the surface; above 0, at most 40.
    pub depth_mm: f64,
    /// How far above the probe's face the point is about which it turns, mm; 0 is straight down. At most 100.
    pub radius_mm: f64,
}

/// From one step down to the next, mm.
const DOWN_MM: f64 = 0.5;
/// Angle at which turning begins, degrees; it ends at the same on the other side, a degree a step.
const TURN_DEG: i32 = 30;

impl Motion {
    /// Checks both numbers.
    ///
    /// # Errors
    /// Numbers outside their ranges, and a depth of less than a step.
    pub fn new(depth_mm: f64, radius_mm: f64) -> Result<Self, SequenceError> {
        if (DOWN_MM..=40.0).contains(&depth_mm) && (0.0..=100.0).contains(&radius_mm) {
            Ok(Self { depth_mm, radius_mm })
        } else {
            Err(SequenceError::Motion { depth_mm, radius_mm })
        }
    }

    /// Whether it turns.
    pub fn is_rotary(self) -> bool {
        self.radius_mm > 0.0
    }

    /// What its steps are counted along.
    pub fn along(self) -> Alignment {
        if self.is_rotary() {
            Alignment::Angle
        } else {
            Alignment::Depth
        }
    }

    /// From one step to the next: mm, or degrees.
    pub fn step(self) -> f64 {
        if self.is_rotary() { 1.0 } else { DOWN_MM }
    }

    /// How many steps it has, an image after each: `2 d` down to `d`, the surface not among them; 61 from 30 to -30
    /// degrees.
    pub fn steps(self) -> usize {
        if self.is_rotary() {
            2 * TURN_DEG as usize + 1
        } else {
            (self.depth_mm / DOWN_MM).round() as usize
        }
    }

    /// Where step `n`, from 0, is: mm below the surface, or degrees.
    pub fn at(self, n: usize) -> f64 {
        if self.is_rotary() {
            f64::from(TURN_DEG) - n as f64
        } else {
            (n + 1) as f64 * DOWN_MM
        }
    }
}

impl std::fmt::Display for Motion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "d = {} mm, r = {} mm", self.depth_mm, self.radius_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_those_of_the_publication() {
        let down = Motion::new(6.5, 0.0).unwrap();
        assert_eq!(
            (down.steps(), down.at(0), down.at(12), down.along()),
            (13, 0.5, 6.5, Alignment::Depth)
        );
        let turn = Motion::new(12.5, 16.0).unwrap();
        assert_eq!(
            (turn.steps(), turn.at(0), turn.at(60), turn.along()),
            (61, 30.0, -30.0, Alignment::Angle)
        );
        for (depth, radius) in [
            (0.0, 0.0),
            (f64::NAN, 0.0),
            (41.0, 0.0),
            (6.5, -1.0),
            (6.5, f64::INFINITY),
        ] {
            assert!(Motion::new(depth, radius).is_err(), "{depth}, {radius}");
        }
    }
}
