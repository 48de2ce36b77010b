//! How far a squeeze has come, told by the PWM that was commanded, so that its speed and its gaps do not matter.

use crate::shape::Shape;

/// Phases that columns are looked at.
pub(crate) const PHASES: usize = 48;
/// From one phase to the next.
const STEP: f64 = 0.05;
/// The phase of the first sample: the rest before the squeeze lasts from here to 0.
const FIRST: f64 = -0.25;
/// The phase of the last sample: the rest after the release begins at 2.
const LAST: f64 = 2.1;
/// How long the rest after the release is looked at, as a share of the time from 0 to 2.
const REST_AFTER: f64 = 0.06;
/// The phase of step `step`: from -0.25 (the first sample) by 0 (PWM begins to rise), 1 (the peak) and 2 (PWM is back at
/// rest) to 2.1.
pub(crate) fn phase_of(step: usize) -> f64 {
    FIRST + STEP * step as f64
}

/// The phase of every sample of a squeeze.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Course {
    phases: Vec<f64>,
}

impl Course {
    /// From times, increasing, and the shape of the PWM. The phase never decreases. It is that of the whole squeeze as
    /// far as the squeeze has come: between 0 and 2 it is the share of the peak, up and down; before, the share of the
    /// rest that is over; after, time.
    pub(crate) fn of(time_ms: &[f64], shape: &Shape<'_>) -> Self {
        let mut phases = vec![FIRST; shape.len()];
        let Some(start) = shape.start else {
            return Self { phases };
        };
        let (down, end) = (shape.down, shape.end);
        let before = (time_ms[start] - time_ms[0]).max(f64::MIN_POSITIVE);
        let squeezed = time_ms.get(end).map_or(f64::INFINITY, |t| t - time_ms[start]);
        let mut highest = FIRST;
        for (row, phase) in phases.iter_mut().enumerate() {
            let now = if row < start {
                FIRST * (time_ms[start] - time_ms[row]) / before
            } else if row == start {
                0.0
            } else if row < down {
                shape.level(row)
            } else if row < end {
                2.0 - shape.level(row)
            } else {
                2.0 + (LAST - 2.0) * ((time_ms[row] - time_ms[end]) / (REST_AFTER * squeezed)).min(1.0)
            };
            highest = now.max(highest);
            *phase = highest;
        }
        Self { phases }
    }

    /// How far the squeeze has come, -0.25 to 2.1.
    pub(crate) fn reached(&self) -> f64 {
        self.phases.last().copied().unwrap_or(FIRST)
    }

    /// The sample that is nearest to a phase.
    pub(crate) fn row_at(&self, phase: f64) -> usize {
        let distance = |row: &usize| (self.phases[*row] - phase).abs();
        let nearest = (0..self.phases.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.unwrap_or(0)
    }

    /// The number of the phases that the squeeze has come to.
    pub(crate) fn steps(&self) -> usize {
        ((self.reached() - FIRST) / STEP + 1e-6) as usize + 1
    }

    /// A column at the phases, by straight lines between the samples that are numbers; beyond them it stays as it is. No
    /// values where there is no number.
    pub(crate) fn at_phases(&self, column: impl Fn(usize) -> f64, values: &mut Vec<f64>) -> bool {
        let mut known = (0..self.phases.len())
            .map(|row| (self.phases[row], column(row)))
            .filter(|(_, value)| value.is_finite());
        let Some(mut left) = known.next() else {
            return false;
        };
        let mut right = left;
        for step in 0..PHASES {
            let phase = phase_of(step);
            while right.0 < phase {
                let Some(next) = known.next() else {
                    break;
                };
                if next.0 > right.0 {
                    (left, right) = (right, next);
                }
            }
            let share = if right.0 > left.0 {
                (phase - left.0) / (right.0 - left.0)
            } else {
                0.0
            };
            values.push(left.1 + share.clamp(0.0, 1.0) * (right.1 - left.1));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along(time_ms: &[f64], pwm: &[f64], profile: [f64; 2]) -> Course {
        Course::of(time_ms, &Shape::of(pwm, profile))
    }

    /// Ten samples of rest, 41 up to 410, 40 down, five of rest.
    fn squeeze(step_ms: f64) -> (Vec<f64>, Vec<f64>) {
        let up = (1..=41).map(|n| 10.0 * f64::from(n));
        let down = (0..=40).rev().map(|n| 10.0 * f64::from(n));
        let pwm: Vec<f64> = [0.0; 10]
            .into_iter()
            .chain(up)
            .chain(down)
            .chain([0.0; 5])
            .collect();
        ((0..pwm.len()).map(|n| step_ms * n as f64).collect(), pwm)
    }

    #[test]
    fn the_phase_is_the_pwm_up_and_down_whatever_the_speed() {
        let (time, pwm) = squeeze(120.0);
        let course = along(&time, &pwm, [0.0, 400.0]);
        let close = |row: usize, phase: f64| {
            assert!(
                (course.phases[row] - phase).abs() < 1e-9,
                "{row}: {:?}",
                course.phases
            )
        };
        close(0, -0.25);
        close(9, 0.0);
        close(29, 0.5);
        close(49, 1.0);
        close(71, 1.5);
        close(91, 2.0);
        close(96, 2.1);
        assert_eq!(course.steps(), PHASES);
        let (slow, _) = squeeze(240.0);
        let other = along(&slow, &pwm, [0.0, 400.0]);
        assert!(
            course
                .phases
                .iter()
                .zip(&other.phases)
                .all(|(a, b)| (a - b).abs() < 1e-9)
        );
    }

    #[test]
    fn a_squeeze_has_the_phases_of_the_whole_as_far_as_it_has_come() {
        let (time, pwm) = squeeze(120.0);
        let whole = along(&time, &pwm, [0.0, 400.0]);
        for end in 1..=time.len() {
            let part = along(&time[..end], &pwm[..end], [0.0, 400.0]);
            // Until PWM rises nobody knows how long the rest is, and at the top whether it has turned.
            if end > 11 && !(51..56).contains(&end) {
                assert_eq!(part.phases[..], whole.phases[..end], "{end}");
            }
            assert!(part.steps() <= whole.steps());
        }
        assert_eq!(along(&time[..8], &pwm[..8], [0.0, 400.0]).steps(), 1);
    }

    #[test]
    fn a_profile_that_is_never_at_rest_has_phases_too() {
        // From 10 to 90 % and back in steps of half a second, four samples each.
        let pwm: Vec<f64> = (0..132)
            .map(|n| 88.5 + 44.25 * f64::from((n / 4).min(32 - n / 4)))
            .collect();
        let time: Vec<f64> = (0..pwm.len()).map(|n| 125.0 * n as f64).collect();
        let course = along(&time, &pwm, [88.5, 796.5]);
        assert!((course.phases[32] - 0.5).abs() < 1e-9 && (course.phases[96] - 1.5).abs() < 1e-9);
        assert!(course.reached() >= 2.0, "{}", course.reached());
    }

    #[test]
    fn columns_are_interpolated_over_what_is_missing() {
        let (time, pwm) = squeeze(120.0);
        let course = along(&time, &pwm, [0.0, 400.0]);
        let mut whole = Vec::new();
        assert!(course.at_phases(|row| 3.0 * course.phases[row], &mut whole));
        let mut holed = Vec::new();
        let hole = |row: usize| {
            if row % 3 == 1 {
                f64::NAN
            } else {
                3.0 * course.phases[row]
            }
        };
        assert!(course.at_phases(hole, &mut holed));
        for step in 0..PHASES {
            assert!((whole[step] - 3.0 * phase_of(step)).abs() < 1e-9);
            assert!((holed[step] - whole[step]).abs() < 1e-9);
        }
        assert!(!course.at_phases(|_| f64::NAN, &mut Vec::new()));
    }
}
