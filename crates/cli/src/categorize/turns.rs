//! Counts followed from frame to frame: round their turns, and past readings of chips that do not answer.

/// What each of three counts is that a chip gives which does not answer.
const ENDS: [u16; 2] = [0, u16::MAX];
/// Counts are sent modulo this.
const TURN: f64 = 65_536.0;
/// A step round the end of the counts that is no longer than this is one. Of a longer one nobody can say which way it went: it is
/// taken as the counts have it.
const SURE: i32 = 1 << 14;

/// One taxel of a hand or a recording, frame by frame.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Followed {
    /// As sent last.
    counts: Option<[u16; 3]>,
    /// The same with the turns that they have made since they were first followed.
    at: [f64; 3],
    /// Whether it has shown several axes: three zeros are no reading of it then, and counts turn over.
    has_axes: bool,
}

impl Followed {
    /// Looks at counts before they are followed, for what they tell of the taxel.
    pub(super) fn look(&mut self, counts: [u16; 3]) {
        self.has_axes |= counts[..2] != [0, 0] && !all_at_ends(counts);
    }

    /// Whether such counts are those of a chip that does not answer.
    pub(super) fn is_silent(&self, counts: [u16; 3]) -> bool {
        self.has_axes && all_at_ends(counts)
    }

    /// Takes the next counts, on the turn of the last or, where they went round the end, on the next; those again where the chip did not answer.
    pub(super) fn follow(&mut self, counts: [u16; 3]) {
        self.look(counts);
        if self.is_silent(counts) {
            return;
        }
        let last = self.counts.replace(counts).filter(|_| self.has_axes);
        let step = |now: u16, last: u16| match i32::from(now.wrapping_sub(last).cast_signed()) {
            step if step.abs() <= SURE => f64::from(step),
            _ => f64::from(now) - f64::from(last),
        };
        self.at = match last {
            None => counts.map(f64::from),
            Some(last) => std::array::from_fn(|axis| self.at[axis] + step(counts[axis], last[axis])),
        };
    }

    /// Takes the turn that is nearest to its baseline: it is at rest.
    pub(super) fn rest(&mut self, baseline: [f32; 3]) {
        if !self.has_axes {
            return;
        }
        for (at, rest) in self.at.iter_mut().zip(baseline) {
            let turns = ((*at - f64::from(rest)) / TURN).round();
            *at -= if turns.is_finite() { TURN * turns } else { 0.0 };
        }
    }

    /// Whether nothing was followed yet.
    pub(super) fn is_new(&self) -> bool {
        self.counts.is_none()
    }

    /// x, y, z.
    pub(super) fn at(&self) -> [f64; 3] {
        self.at
    }
}

fn all_at_ends(counts: [u16; 3]) -> bool {
    counts.iter().all(|count| ENDS.contains(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn followed(counts: &[[u16; 3]]) -> Vec<[f64; 3]> {
        let mut taxel = Followed::default();
        let follow = |counts: &[u16; 3]| {
            taxel.follow(*counts);
            taxel.at()
        };
        counts.iter().map(follow).collect()
    }

    #[test]
    fn counts_go_on_where_they_turn_over() {
        let z = [13_000, 53_000, 60_000, 4_000, 60_000, 13_000];
        let at: Vec<f64> = followed(&z.map(|z| [100, 200, z]))
            .iter()
            .map(|at| at[2])
            .collect();
        // The first and the last step are too long to be told from others the other way round.
        assert_eq!(at, [13e3, 53e3, 60e3, 69_536.0, 60e3, 13e3]);
        assert_eq!(followed(&[[10, 1, 1], [65_526, 1, 1]])[1], [-10.0, 1.0, 1.0]);
    }

    #[test]
    fn a_chip_that_does_not_answer_keeps_its_last_reading() {
        let reading = [100, 200, 300];
        for silent in [[0; 3], [u16::MAX; 3], [0, 0, u16::MAX]] {
            assert_eq!(
                followed(&[reading, silent, reading])[1],
                [100.0, 200.0, 300.0],
                "{silent:?}"
            );
        }
    }

    #[test]
    fn of_one_axis_nothing_is_a_reading_and_no_count_turns_over() {
        let at: Vec<f64> = followed(&[0, 50_000, 65_535, 0].map(|z| [0, 0, z]))
            .iter()
            .map(|at| at[2])
            .collect();
        assert_eq!(at, [0.0, 50e3, 65_535.0, 0.0]);
    }

    #[test]
    fn at_rest_a_taxel_is_on_the_turn_of_its_baseline() {
        let mut taxel = Followed::default();
        taxel.follow([65_500, 40_000, 13_000]);
        taxel.rest([10.0, 40_010.0, -52_000.0]);
        assert_eq!(taxel.at(), [-36.0, 40e3, -52_536.0]);
        // Where it is not known, nothing is.
        taxel.rest([f32::NAN; 3]);
        assert_eq!(taxel.at(), [-36.0, 40e3, -52_536.0]);
    }
}
