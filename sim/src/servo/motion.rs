//! Where a simulated servo is at any time: a function of time, so that a test knows the truth.

use std::f64::consts::TAU;
use std::sync::Arc;

/// How a servo moves while its motor is off: as if somebody moved the finger.
#[derive(Debug, Clone, PartialEq)]
pub enum Motion {
    /// Stays at this position, pulses.
    Still(i32),
    /// Swings around a centre.
    Sine {
        /// Centre, pulses.
        centre: f64,
        /// Largest distance from it, pulses.
        amplitude: f64,
        /// Swings per second.
        hz: f64,
        /// Phase at time 0, radians.
        phase: f64,
    },
    /// Goes a way given point by point, again and again.
    Track(Arc<Track>),
}

/// Positions at equal distances of time, joined by straight lines, the last with the first.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    start_ns: u64,
    step_ns: u64,
    positions: Vec<f64>,
}

impl Track {
    /// The way through `positions` (pulses, at least one), which begins at `start_ns` and takes
    /// `step_ns` from each to the next.
    pub fn new(start_ns: u64, step_ns: u64, positions: Vec<f64>) -> Self {
        debug_assert!(step_ns > 0 && !positions.is_empty());
        Self {
            start_ns,
            step_ns,
            positions,
        }
    }

    fn position(&self, t_ns: u64) -> f64 {
        let since = t_ns.saturating_sub(self.start_ns);
        let point = |step: u64| self.positions[(step % self.positions.len() as u64) as usize];
        let (step, rest) = (since / self.step_ns, since % self.step_ns);
        let (here, next) = (point(step), point(step + 1));
        here + (next - here) * rest as f64 / self.step_ns as f64
    }
}

impl Motion {
    /// Position in pulses, not rounded.
    pub fn position(&self, t_ns: u64) -> f64 {
        match *self {
            Motion::Still(position) => f64::from(position),
            Motion::Track(ref track) => track.position(t_ns),
            Motion::Sine {
                centre,
                amplitude,
                hz,
                phase,
            } => centre + amplitude * (TAU * hz * t_ns as f64 * 1e-9 + phase).sin(),
        }
    }
}

/// What the motor does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Drive {
    /// Off: the servo is moved.
    Off,
    /// On: from a place at a time towards a goal, pulses and pulses per second. Without goal it turns on.
    On {
        from: f64,
        since_ns: u64,
        goal: Option<f64>,
        speed: f64,
    },
}

impl Drive {
    /// Position in pulses, not rounded.
    pub(crate) fn position(&self, t_ns: u64, moved: &Motion) -> f64 {
        match *self {
            Drive::Off => moved.position(t_ns),
            Drive::On {
                from,
                since_ns,
                goal,
                speed,
            } => {
                let way = speed * t_ns.saturating_sub(since_ns) as f64 * 1e-9;
                match goal {
                    None => from + way,
                    Some(goal) if (goal - from).abs() <= way => goal,
                    Some(goal) => from + way.copysign(goal - from),
                }
            }
        }
    }

    /// Velocity in pulses per second, from the positions around an instant.
    pub(crate) fn velocity(&self, t_ns: u64, moved: &Motion) -> f64 {
        const STEP_NS: u64 = 500_000;
        let before = t_ns.saturating_sub(STEP_NS);
        let after = t_ns + STEP_NS;
        (self.position(after, moved) - self.position(before, moved)) / ((after - before) as f64 * 1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn a_sine_swings_around_its_centre() {
        let m = Motion::Sine {
            centre: 2048.0,
            amplitude: 100.0,
            hz: 1.0,
            phase: 0.0,
        };
        for (t, p) in [(0, 2048.0), (S / 4, 2148.0), (S / 2, 2048.0), (3 * S / 4, 1948.0)] {
            assert!((m.position(t) - p).abs() < 1e-6, "{t}");
        }
        assert!((Drive::Off.velocity(S, &m) - 100.0 * TAU).abs() < 0.1);
    }

    #[test]
    fn a_motor_goes_to_its_goal_and_stays() {
        let d = Drive::On {
            from: 1000.0,
            since_ns: S,
            goal: Some(500.0),
            speed: 1000.0,
        };
        let m = Motion::Still(7);
        for (t, p) in [
            (S, 1000.0),
            (S + S / 4, 750.0),
            (S + S / 2, 500.0),
            (9 * S, 500.0),
        ] {
            assert_eq!(d.position(t, &m), p, "{t}");
        }
        assert_eq!(Drive::Off.position(S, &m), 7.0);
    }
}
