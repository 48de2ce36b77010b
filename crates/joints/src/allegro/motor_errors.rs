//! Errors that a hand of version 5 reports of its motors: `docs/protocols.md`, "Allegro 4 and 5".

use super::config::ALLEGRO_JOINTS;

/// A report counts for so long, nanoseconds. How often the hand repeats one is not public; one that it repeats every few seconds
/// stays, and one that it sends once is seen by whoever looks.
pub const MOTOR_ERROR_NS: u64 = 10_000_000_000;

/// What the hand has reported last of a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MotorError {
    /// Its number, as the hand says it: 0 to 15 are taken for those of the joints.
    pub motor: u8,
    /// What is wrong with it, as the hand says it; not 0.
    pub bits: u8,
    /// When, nanoseconds.
    pub heard_ns: u64,
}

/// What a hand has reported of its motors.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct MotorErrors {
    /// Messages.
    pub reports: u64,
    of: [Option<MotorError>; ALLEGRO_JOINTS],
    /// Of a motor with a number that no joint has.
    other: Option<MotorError>,
}

impl MotorErrors {
    /// Takes a message that came at `heard_ns`. One without a bit says that nothing is wrong any more.
    pub(super) fn push(&mut self, motor: u8, bits: u8, heard_ns: u64) {
        self.reports += 1;
        let error = MotorError {
            motor,
            bits,
            heard_ns,
        };
        let place = self.of.get_mut(usize::from(motor)).unwrap_or(&mut self.other);
        *place = (bits != 0).then_some(error);
    }

    /// Those that were reported of late.
    pub fn current(&self, now_ns: u64) -> impl Iterator<Item = MotorError> {
        let all = self.of.into_iter().chain([self.other]).flatten();
        all.filter(move |error| now_ns.saturating_sub(error.heard_ns) < MOTOR_ERROR_NS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_counts_until_the_hand_takes_it_back_or_is_silent_of_it_for_ten_seconds() {
        let mut errors = MotorErrors::default();
        let current = |errors: &MotorErrors, now_ns| {
            let current = errors.current(now_ns);
            current.map(|error| (error.motor, error.bits)).collect::<Vec<_>>()
        };
        errors.push(3, 0x04, 0);
        errors.push(15, 0x21, 1);
        errors.push(16, 0x01, 2);
        assert_eq!(current(&errors, 2), [(3, 0x04), (15, 0x21), (16, 0x01)]);
        errors.push(3, 0x20, 3);
        errors.push(15, 0, 3);
        assert_eq!(current(&errors, MOTOR_ERROR_NS + 1), [(3, 0x20), (16, 0x01)]);
        assert_eq!(current(&errors, MOTOR_ERROR_NS + 2), [(3, 0x20)]);
        assert_eq!(current(&errors, MOTOR_ERROR_NS + 3), []);
        assert_eq!(errors.reports, 5);
    }
}
