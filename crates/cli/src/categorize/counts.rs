//! Counts followed from frame to frame, round their turns and past readings of chips that do not answer, and taken from rest.

use taxel_hand::plural;
use taxel_record::{Frames as Recorded, Recording};

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

/// All values of a recording as signed numbers, and how many a frame has: magnitudes, or x y z of each taxel, round their turns.
/// Where a taxel has none, or its chip does not answer, its last one is taken, before its first that, and that is said; 0 where
/// it never has any.
pub(super) fn values(recording: &Recording) -> (usize, Vec<f64>) {
    let counts = match recording.frames() {
        Recorded::Magnitudes(values) => return (recording.taxels(), values.clone()),
        Recorded::Counts(counts) => counts,
    };
    if recording.missing() > 0 {
        remark!(
            "taxel: {}: {} values of taxels are not there; the last one of the same taxel is taken for each",
            recording.name(),
            recording.missing()
        );
    }
    let taxels = recording.taxels();
    let mut followed = vec![Followed::default(); taxels];
    for frame in counts.chunks_exact(taxels) {
        let given = followed.iter_mut().zip(frame);
        given.for_each(|(taxel, counts)| counts.iter().for_each(|counts| taxel.look(*counts)));
    }
    for (n, taxel) in followed.iter_mut().enumerate() {
        let mut given = counts.iter().skip(n).step_by(taxels).flatten();
        if let Some(first) = given.find(|counts| !taxel.is_silent(**counts)) {
            taxel.follow(*first);
        }
    }
    let mut values = Vec::with_capacity(3 * counts.len());
    let mut silent = 0;
    for frame in counts.chunks_exact(taxels) {
        for (taxel, counts) in followed.iter_mut().zip(frame) {
            if let Some(counts) = counts {
                silent += usize::from(taxel.is_silent(*counts));
                taxel.follow(*counts);
            }
            values.extend(taxel.at());
        }
    }
    if silent > 0 {
        remark!(
            "taxel: {}: {} of taxels are 0 or 65535 on every axis, as of a chip that does not answer; the last one of the same \
             taxel is taken for each",
            recording.name(),
            plural(silent, "reading")
        );
    }
    (3 * taxels, values)
}

/// Raw counts are taken from the mean of so many frames before a touch.
pub(super) const FRAMES_BEFORE: usize = 5;

/// Values less those of an untouched probe: raw counts are taken from the mean of the frames before the touch, up to
/// five of them, or from its first frame where there is none; other numbers are above baseline already.
pub(super) fn above_baseline(values: &[f64], taxels: usize, raw: bool, first: usize) -> Vec<f64> {
    if !raw {
        return values.to_vec();
    }
    let before = if first == 0 {
        0..1
    } else {
        first.saturating_sub(FRAMES_BEFORE)..first
    };
    let mut baseline = vec![0.0; taxels];
    for frame in values[before.start * taxels..before.end * taxels].chunks_exact(taxels) {
        baseline
            .iter_mut()
            .zip(frame)
            .for_each(|(sum, x)| *sum += x / before.len() as f64);
    }
    let less = |frame: &[f64]| {
        frame
            .iter()
            .zip(&baseline)
            .map(|(x, b)| x - b)
            .collect::<Vec<_>>()
    };
    values.chunks_exact(taxels).flat_map(less).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raw_counts_are_above_the_frames_before_the_touch() {
        let values = [10.0, 20.0, 12.0, 22.0, 15.0, 19.0];
        assert_eq!(above_baseline(&values, 2, true, 2)[4..], [4.0, -2.0]);
        assert_eq!(above_baseline(&values, 2, true, 0)[..4], [0.0, 0.0, 2.0, 2.0]);
        assert_eq!(above_baseline(&values, 2, false, 2), values);
    }

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
