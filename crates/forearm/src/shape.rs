//! Where the PWM of a squeeze rises, turns and comes to rest, and whether it is one squeeze.

use crate::error::ForearmError;

/// A PWM up to this share of the swing above the least is rest.
const REST_PWM: f64 = 0.02;
/// A squeeze has turned where PWM is below its highest by more than this share of the swing.
const TURNED: f64 = 0.08;
/// From rest to the peak PWM takes at least this many samples: the data's ramp has 40, and 10 at four times its speed.
const LEAST_RISE: usize = 5;
/// So high it has come in fewer: a gap of 2 s in a squeeze twice as fast hides 0.8 of the way with all that is missing.
const JUMPED: f64 = 0.9;
/// Above the training's first PWM by more than this share of the swing, the beginning is not there. Up to here errors on
/// squeezes whose beginning was cut off are those of whole ones, at places of the training and others.
const BEGUN: f64 = 0.1;
/// A squeeze that stays beyond this share for so many samples has another rest, and has not begun late.
pub(crate) const OTHER_REST: f64 = 0.04;
const RESTS: usize = 6;

/// The parts of a course of PWM, by rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shape<'a> {
    pwm: &'a [f64],
    least_pwm: f64,
    swing: f64,
    /// The last row at rest before PWM rises; none where it never rises.
    pub(crate) start: Option<usize>,
    /// The row of the highest PWM before it turns.
    pub(crate) top: usize,
    /// The first row after that, where PWM has turned; else their number.
    pub(crate) down: usize,
    /// The first row at rest after that; their number where there is none.
    pub(crate) end: usize,
}

impl<'a> Shape<'a> {
    /// Of a profile that goes from about `least_pwm` to about `peak_pwm` and back.
    pub(crate) fn of(pwm: &'a [f64], [least_pwm, peak_pwm]: [f64; 2]) -> Self {
        let rows = pwm.len();
        let mut shape = Self {
            pwm,
            least_pwm,
            swing: peak_pwm - least_pwm,
            start: None,
            top: 0,
            down: rows,
            end: rows,
        };
        let is_rest = |row: &usize| shape.at(*row) <= least_pwm + REST_PWM * shape.swing;
        let Some(start) = (0..rows)
            .find(|row| !is_rest(row))
            .map(|row| row.saturating_sub(1))
        else {
            return shape;
        };
        let mut top = start;
        let mut has_turned = false;
        for row in start..rows {
            if shape.at(row) > shape.at(top) {
                top = row;
            } else if shape.at(top) - shape.at(row) > TURNED * shape.swing {
                has_turned = true;
                break;
            }
        }
        let down = if has_turned { top + 1 } else { rows };
        let end = (down..rows).find(is_rest).unwrap_or(rows);
        (shape.start, shape.top, shape.down, shape.end) = (Some(start), top, down, end);
        shape
    }

    /// How many rows there are.
    pub(crate) fn len(&self) -> usize {
        self.pwm.len()
    }

    /// The PWM of a row. A single row that lies below both its neighbours, as no turn does, is a line that was lost: the
    /// lower of them counts.
    fn at(&self, row: usize) -> f64 {
        let value = self.pwm[row];
        match (row.checked_sub(1), self.pwm.get(row + 1)) {
            (Some(before), Some(after)) => {
                let lower = self.pwm[before].min(*after);
                if lower - value > TURNED * self.swing {
                    lower
                } else {
                    value
                }
            }
            _ => value,
        }
    }

    /// The PWM of a row as a share of the swing, 0 to 1.
    pub(crate) fn level(&self, row: usize) -> f64 {
        ((self.at(row) - self.least_pwm) / self.swing).clamp(0.0, 1.0)
    }

    /// Whether it is one squeeze from its beginning on, as far as it goes: one that begins at about `first_pwm`, rises in
    /// steps, and does not rise again.
    ///
    /// # Errors
    /// The row that tells that it is none.
    pub(crate) fn check(&self, first_pwm: f64) -> Result<(), ForearmError> {
        let Some(start) = self.start else {
            return Ok(());
        };
        let pwm = self.pwm[0];
        let beyond = (pwm - first_pwm) / self.swing;
        if beyond > BEGUN {
            return Err(ForearmError::Begun { pwm, first_pwm });
        }
        let mut first_rows = (0..self.len()).take(RESTS);
        let stays = |row: usize| self.at(row) <= pwm + REST_PWM * self.swing;
        if beyond > OTHER_REST && self.len() >= RESTS && first_rows.all(stays) {
            return Err(ForearmError::OtherRest { pwm, first_pwm });
        }
        let (row, samples) = (self.top, self.top - start);
        if samples < LEAST_RISE && self.level(row) > JUMPED {
            let pwm = self.at(row);
            return Err(ForearmError::Jump { row, samples, pwm });
        }
        let mut low = f64::INFINITY;
        for row in self.down..self.len() {
            let pwm = self.at(row);
            if pwm - low > TURNED * self.swing {
                return Err(ForearmError::Again { row, low, pwm });
            }
            low = pwm.min(low);
        }
        Ok(())
    }
}
