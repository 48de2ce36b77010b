//! What became of commands, kept until whoever gave them has looked.

use super::writes::{WriteError, Written};
use std::collections::VecDeque;

/// How many are kept: several times as many as commands can wait, so that nobody misses the own one who looks now and then.
const KEPT: usize = 1024;

/// What became of the commands that ended last, of all servos. Each keeps its own, whatever becomes of later ones to the same
/// servo.
#[derive(Debug)]
pub(crate) struct Outcomes {
    /// With the servo's index; the newest is the last.
    kept: VecDeque<(usize, Written)>,
}

impl Outcomes {
    pub(crate) fn new() -> Self {
        Self {
            kept: VecDeque::with_capacity(KEPT),
        }
    }

    /// What became of the command of this number to this servo; `None` where it is not done with, or long ago.
    pub(crate) fn of(&self, servo: usize, number: u64) -> Option<Result<(), WriteError>> {
        let mut newest = self.kept.iter().rev();
        let own = newest.find(|(of, written)| (*of, written.number) == (servo, number));
        own.map(|(_, written)| written.result)
    }

    /// One of several writes that fails is a command that failed; so the first that is said of a command stays.
    pub(crate) fn push(&mut self, servo: usize, written: Written) {
        if self.of(servo, written.number).is_some() {
            return;
        }
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back((servo, written));
    }

    /// Takes those of another over.
    pub(crate) fn append(&mut self, other: &mut Self) {
        for (servo, written) in other.kept.drain(..) {
            self.push(servo, written);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_that_is_said_of_a_command_stays_until_there_are_many_newer_ones() {
        let mut outcomes = Outcomes::new();
        let written = |number, result| Written { number, result };
        let failed = Err(WriteError::Silent);
        outcomes.push(2, written(1, failed));
        outcomes.push(2, written(1, Ok(())));
        outcomes.push(3, written(1, Ok(())));
        for number in 2..1024 {
            outcomes.push(2, written(number, Ok(())));
            assert_eq!(outcomes.of(2, number), Some(Ok(())));
        }
        let capacity = outcomes.kept.capacity();
        assert_eq!(
            (outcomes.of(2, 1), outcomes.of(3, 1)),
            (Some(failed), Some(Ok(())))
        );
        outcomes.push(2, written(1024, Ok(())));
        assert_eq!((outcomes.of(2, 1), outcomes.of(3, 1)), (None, Some(Ok(()))));
        assert_eq!(outcomes.kept.capacity(), capacity);
    }
}
